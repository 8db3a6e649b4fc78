"""Pictures of garments of known dimensions: filled outlines with points, drawn without anything of the code under test.

The outline is written down here from the dimensions (not from the panels), filled by PIL on a four times finer grid and
averaged. A textile lies flat. A figure is a paper doll: its arms hang at an angle, widths round the trunk are seen as the width of
an elliptic section of the right perimeter (computed by quadrature).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw
from scipy.integrate import quad
from scipy.ndimage import distance_transform_edt, gaussian_filter

from reconstruction.keypoints_file import ImageKeypoints
from reconstruction.landmarks import INDEX

FINE = 4


@dataclass(frozen=True)
class Flat:
    """Dimensions of the garment that is drawn, m."""

    length: float = 1.38
    cross: float = 2.48
    body: float = 0.62
    armhole: float = 0.34
    cuff: float = 0.22
    hem: float = 0.80
    neck: float = 0.18
    neck_depth: float = 0.10
    shoulder: float = 0.42
    waist_level: float = 0.55

    def half_width(self, level: float) -> float:
        """Flat half width of the trunk below the armpit."""
        t = (level - self.armhole) / (self.length - self.armhole)
        return ((1 - t) * self.body + t * self.hem) / 2

    def expected(self) -> dict[str, float]:
        """The measurements that should come out."""
        return {
            "garment_length": self.length, "cross_sleeve_width": self.cross, "body_width": self.body, "armhole_depth": self.armhole,
            "cuff_width": self.cuff, "hem_width": self.hem, "neck_width": self.neck, "shoulder_width": self.shoulder,
            "waist_width": 2 * self.half_width(self.waist_level), "sleeve_length": (self.cross - self.shoulder) / 2,
        }


def flat_half(g: Flat) -> tuple[np.ndarray, dict[str, tuple[float, float]]]:
    """Outline of the left half (x to the wearer's left, y down from the shoulder line), collar's bottom to hem's middle."""
    angle = np.linspace(np.pi / 2, 0, 40)
    neck = np.stack([g.neck / 2 * np.cos(angle), g.neck_depth * np.sin(angle)], axis=1)
    rest = [(g.cross / 2, 0), (g.cross / 2, g.cuff), (g.body / 2, g.armhole), (g.hem / 2, g.length), (0, g.length)]
    x = g.half_width(g.waist_level)
    points = {"shoulder": (g.shoulder / 2, 0.0), "elbow": ((g.shoulder + g.cross) / 4, 0.0), "wrist": (g.cross / 2, 0.0),
              "neckline": (g.neck / 2, 0.0), "waist": (x, g.waist_level), "ankle": (g.hem / 2, g.length)}
    return np.vstack([neck, rest]), points


def seen_width(flat: float, depth_ratio: float) -> float:
    """Width of an ellipse whose perimeter is twice the flat width."""
    perimeter = 2 * quad(lambda t: np.hypot(np.sin(t), depth_ratio * np.cos(t)), 0, np.pi)[0]  # of half axes 1 and the ratio
    return 2 * 2 * flat / perimeter


def doll_half(g: Flat, depth_ratio: float, arm_angle: float) -> tuple[list[np.ndarray], dict[str, tuple[float, float]]]:
    """Polygons (trunk, sleeve) of the left half of a worn garment, and its points."""
    body, hem = seen_width(g.body, depth_ratio) / 2, seen_width(g.hem, depth_ratio) / 2
    waist = seen_width(2 * g.half_width(g.waist_level), depth_ratio) / 2
    tip = g.shoulder / 2
    trunk = np.array([(0, 0), (tip, 0), (body, g.armhole * 0.4), (body, g.armhole), (hem, g.length), (0, g.length)])
    along = np.array([np.cos(arm_angle), np.sin(arm_angle)])
    across = np.array([-along[1], along[0]])
    arm = (g.cross - g.shoulder) / 2
    start = np.array([tip, 0.0])
    sleeve = np.array([start, start + arm * along, start + arm * along + g.cuff * across, start + g.armhole * 0.8 * across])
    points = {"shoulder": (tip, 0.0), "elbow": tuple(start + arm / 2 * along), "wrist": tuple(start + arm * along),
              "neckline": (g.neck / 2, 0.0), "waist": (waist, g.waist_level), "ankle": (hem, g.length)}
    return [trunk, sleeve], points


def draw(folder, name, kind, g: Flat, pixels_per_metre: float, *, noise=0.0, seed=0, tilt=0.0, depth_ratio=0.7, arm_angle=0.7,
         figure=None, scale=None, sigma=None, margin=0.12, rough=0.0) -> ImageKeypoints:
    """Draw image and mask into a folder.

    `noise` is that of the points (px), `tilt` that of the camera (rad), `rough` that of the mask's border (px, correlated over
    6 px).
    """
    if kind == "textile":
        half, points = flat_half(g)
        polygons = [np.vstack([half, half[::-1] * (-1, 1)])]
    else:
        halves, points = doll_half(g, depth_ratio, arm_angle)
        polygons = [p * (s, 1) for p in halves for s in (1, -1)]
    rotation = np.array([[np.cos(tilt), np.sin(tilt)], [-np.sin(tilt), np.cos(tilt)]])
    everything = np.vstack(polygons) @ rotation
    low = everything.min(axis=0) - margin
    size = np.ceil((np.ptp(everything, axis=0) + 2 * margin) * pixels_per_metre).astype(int)

    def pixel(p):
        return (np.asarray(p) @ rotation - low) * pixels_per_metre - 0.5

    fine = Image.new("L", tuple(int(n) for n in size * FINE))
    pen = ImageDraw.Draw(fine)
    for polygon in polygons:
        pen.polygon([tuple(v) for v in (pixel(polygon) + 0.5) * FINE], fill=255)
    grey = np.asarray(fine, dtype=float).reshape(size[1], FINE, size[0], FINE).mean(axis=(1, 3))
    rng = np.random.default_rng(seed)
    colour = np.array({"textile": (170, 60, 50), "mural": (90, 110, 80), "figurine": (150, 110, 60)}[kind])
    picture = 235 - grey[..., None] / 255 * (235 - colour) + rng.normal(0, 6, (*grey.shape, 1))
    Image.fromarray(np.clip(picture, 0, 255).astype(np.uint8)).save(folder / f"{name}.png")
    mask = grey > 127
    if rough:
        field = gaussian_filter(rng.normal(size=grey.shape), 6)
        mask = distance_transform_edt(mask) - distance_transform_edt(~mask) + rough * field / field.std() > 0
    Image.fromarray((mask * 255).astype(np.uint8)).save(folder / f"{name}_mask.png")
    keypoints = np.zeros((12, 2))
    for part, (x, y) in points.items():
        keypoints[INDEX[f"left_{part}"]], keypoints[INDEX[f"right_{part}"]] = pixel((x, y)), pixel((-x, y))
    keypoints += rng.normal(0, noise, keypoints.shape) if noise else 0
    return ImageKeypoints.of(
        folder / f"{name}.png", kind, keypoints, sigma=sigma or max(noise, 0.3), figure=figure, mask=folder / f"{name}_mask.png",
        scale=scale or {"metres_per_pixel": 1 / pixels_per_metre, "relative_sigma": 0.005}, size=(int(size[0]), int(size[1])),
    )
