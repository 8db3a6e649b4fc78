"""Pictures of sheets and bodies: shaded triangles with a depth buffer, frames of a run, and their animation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

FRONT, BACK, BODY = (0.76, 0.13, 0.20), (0.93, 0.74, 0.60), (0.74, 0.76, 0.80)
LIGHT = np.array([-0.45, -0.55, 0.70]) / np.linalg.norm([-0.45, -0.55, 0.70])


class Camera:
    """A perspective view that stays the same through a run.

    Parameters
    ----------
    points : sequence of (n, 3) arrays
        What must be in the picture.
    view : (elevation, azimuth)
        Degrees.
    """

    def __init__(self, points: Sequence[np.ndarray], view: tuple[float, float] = (20.0, -60.0)):
        cloud = np.concatenate(list(points))
        low, high = cloud.min(axis=0), cloud.max(axis=0)
        centre = 0.5 * (low + high)
        e, a = np.radians(view)
        self.towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        self.axes = np.stack([right, np.cross(self.towards, right), self.towards])
        radius = float(np.linalg.norm(high - low)) * 0.5
        self.distance = 5.0 * max(radius, 1e-12)
        local = (cloud - centre) @ self.axes.T
        local[:, :2] /= (1.0 - local[:, 2] / self.distance)[:, None]
        middle = 0.5 * (local[:, :2].min(axis=0) + local[:, :2].max(axis=0))
        self.half = 0.53 * float(np.ptp(local[:, :2], axis=0).max())
        self.centre = centre + middle @ self.axes[:2]

    def project(self, points: np.ndarray, size: int) -> np.ndarray:
        """Pixel coordinates and depth (n, 3) on a square of ``size`` pixels."""
        local = (points - self.centre) @ self.axes.T
        scale = 0.5 * size / self.half / np.maximum(1.0 - local[:, 2] / self.distance, 1e-3)
        return np.column_stack([0.5 * size + scale * local[:, 0], 0.5 * size - scale * local[:, 1], -local[:, 2]])


def vertex_normals(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Unit normals (n, 3), means weighted by area."""
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    n = np.cross(b - a, c - a)
    out = np.zeros_like(vertices)
    for i in range(3):
        np.add.at(out, triangles[:, i], n)
    return out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-300)


def shade(vertices: np.ndarray, triangles: np.ndarray, towards: np.ndarray, front, back=None, shine: float = 0.35) -> np.ndarray:
    """Colours (nt, 3, 3) of the corners: two-sided diffuse light with a highlight; the far side in ``back``."""
    n = vertex_normals(vertices, triangles)[triangles]
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    away = np.cross(b - a, c - a) @ towards < 0
    colour = np.broadcast_to(np.asarray(front, dtype=float), n.shape).copy()
    if back is not None:
        colour[away] = back
    n = np.where(away[:, None, None], -n, n)
    lit = np.clip(n @ LIGHT, 0.0, 1.0)
    half = LIGHT + towards
    gloss = np.clip(n @ (half / np.linalg.norm(half)), 0.0, 1.0) ** 30
    return np.clip(colour * (0.32 + 0.68 * lit)[..., None] + shine * gloss[..., None], 0.0, 1.0)


def render(
    camera: Camera, sheet: tuple[np.ndarray, np.ndarray], bodies: Sequence[tuple[np.ndarray, np.ndarray]] = (), size: int = 560
) -> np.ndarray:
    """Picture (size, size, 3), 0 to 255, of a sheet (points, flat triangles) and bodies."""
    from mfar_fem.simulation.raster import rasterise

    fine = 2 * size
    depth, image = np.full((fine, fine), np.inf), np.ones((fine, fine, 3))
    image *= np.linspace(1.0, 0.93, fine)[:, None, None]
    for (vertices, triangles), front, back, shine in [(sheet, FRONT, BACK, 0.35), *(((v, t), BODY, None, 0.1) for v, t in bodies)]:
        colours = shade(vertices, triangles, camera.towards, front, back, shine)
        rasterise(camera.project(vertices, fine), np.ascontiguousarray(triangles), colours, depth, image)
    return (255 * image.reshape(size, 2, size, 2, 3).mean(axis=(1, 3))).astype(np.uint8)


def draw(
    path: Path,
    camera: Camera,
    sheet: tuple[np.ndarray, np.ndarray],
    bodies: Sequence[tuple[np.ndarray, np.ndarray]] = (),
    title: str = "",
    size: int = 560,
) -> Path:
    """Render to a PNG with a title.

    Returns
    -------
    Path
        The file written.
    """
    from PIL import Image, ImageDraw

    picture = Image.fromarray(render(camera, sheet, bodies, size))
    if title:
        ImageDraw.Draw(picture).text((12, 10), title, fill=(30, 30, 30), font_size=15)
    picture.save(path)
    return path


def animate(pictures: Sequence[Path], path: Path, interval: float) -> Path | None:
    """Join pictures into an animated GIF; ``interval`` s between them; None without pictures."""
    from PIL import Image

    if not pictures:
        return None
    frames = [Image.open(p).convert("P", palette=Image.Palette.ADAPTIVE, colors=128) for p in pictures]
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=max(20, int(1000 * interval)), loop=0)
    return path
