"""Drawn scenes for the study of style: the same garment as figurine, mural and textile, seen through a known homography.

They are for training and testing of style alone, where the truth must be known to the pixel; they are not the benchmark.
A scene is a function of the plane: every pixel of a view is traced back through the homography and drawn there, so that two views
of one scene correspond exactly. Its outlines, folds and medallions are the scene's; colours, light, cracks, flakes, weave and noise
are the rendering's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reconstruction.landmarks import KINDS
from reconstruction.style.drawing import render

GARMENTS = ("robe", "half_sleeve", "shawl", "veil_hat")
PARTS = ("ground", "skin", "main", "trim", "second", "motif")
"""Colour areas of a scene, in the order of labels."""


@dataclass(frozen=True)
class Scene:
    """Shapes of one clothed figure, in the unit square (x right, y down).

    Attributes
    ----------
    garment : str
        One of :data:`GARMENTS`.
    length, flare, sleeve, cuff, drop : float
        Hem and its half width, reach, half height and slope of the sleeves.
    belt, medallions : bool
        Whether it has them.
    motif : (3,) float array
        Petals, radius and spacing of the medallions.
    folds : (k, 3) float array
        Place, depth and sharpness of the vertical folds.
    """

    garment: str
    length: float
    flare: float
    sleeve: float
    cuff: float
    drop: float
    belt: bool
    medallions: bool
    motif: np.ndarray
    folds: np.ndarray


@dataclass(frozen=True)
class Areas:
    """What a scene is at points (h, w): label of the part, distance to its nearest outline, height of the relief."""

    label: np.ndarray
    outline: np.ndarray
    height: np.ndarray


def draw_scene(rng: np.random.Generator) -> Scene:
    """A scene at random."""
    return Scene(
        garment=GARMENTS[rng.integers(len(GARMENTS))], length=rng.uniform(0.78, 0.92), flare=rng.uniform(0.17, 0.30),
        sleeve=rng.uniform(0.30, 0.42), cuff=rng.uniform(0.045, 0.10), drop=rng.uniform(0.0, 0.5), belt=bool(rng.random() < 0.5),
        medallions=bool(rng.random() < 0.6),
        motif=np.array([rng.integers(4, 9), rng.uniform(0.028, 0.045), rng.uniform(0.12, 0.16)]),
        folds=np.column_stack([rng.uniform(0.32, 0.68, 6), rng.uniform(0.3, 1.0, 6), rng.uniform(0.008, 0.02, 6)]),
    )


def areas(scene: Scene, x: np.ndarray, y: np.ndarray) -> Areas:
    """Parts, outlines and relief of a scene at points of the unit square."""
    u, v = x - 0.5, y
    body = _body(scene, u, v)
    sleeves = np.maximum(np.abs(v - 0.27 - scene.drop * np.maximum(np.abs(u) - 0.08, 0)) - scene.cuff, np.abs(u) - scene.sleeve)
    reach = 0.5 * scene.sleeve if scene.garment == "half_sleeve" else scene.sleeve
    cloth = np.minimum(body, np.maximum(sleeves, np.abs(u) - reach))
    head = np.hypot(u / 0.075, (v - 0.12) / 0.085) - 1.0
    layers = [("skin", np.minimum(head * 0.08, sleeves + 0.02)), ("main", cloth)]
    if scene.garment == "shawl":
        band = np.abs(u * 0.9 + 0.35 * np.sin(4.0 * v) * 0.4 - 0.02) - 0.028
        layers.append(("second", np.maximum(np.maximum(band, v - 0.8), 0.22 - v)))
    if scene.garment == "veil_hat":
        layers.append(("second", np.maximum(np.hypot(u / 0.17, (v - 0.075) / 0.032) - 1.0, v - 0.11) * 0.04))
        layers.append(("second", np.maximum(np.abs(u) - 0.02, np.abs(v - 0.04) - 0.03)))
    layers.append(("trim", np.abs(np.hypot(u, (v - 0.205) / 1.2) - 0.05) - 0.012))
    edge = np.maximum(cloth, np.minimum(reach - 0.03 - np.abs(u), scene.length - 0.03 - v))
    layers.append(("trim", edge))
    if scene.belt:
        layers.append(("trim", np.maximum(body, np.abs(v - 0.48) - 0.016)))
    if scene.medallions:
        layers.append(("motif", np.maximum(_medallions(scene, u, v), cloth + 0.015)))
    label = np.zeros(x.shape, dtype=np.int64)
    outline = np.full(x.shape, np.inf)
    for name, distance in layers:
        inside = distance < 0
        label[inside] = PARTS.index(name)
        outline = np.where(inside, -distance, np.minimum(outline, distance))
    return Areas(label, outline, _relief(scene, u, v, cloth, head))


def view(scene: Scene, kind: str, rng: np.random.Generator, size: int = 256, homography: np.ndarray | None = None) -> np.ndarray:
    """One rendering of a scene.

    Parameters
    ----------
    scene : Scene
    kind : str
        One of :data:`reconstruction.landmarks.KINDS`.
    rng : numpy.random.Generator
        Of the rendering: colours, light, damage.
    size : int
        Height and width, px.
    homography : (3, 3) array, optional
        From pixels of the frontal view to pixels of this one; the identity by default.

    Returns
    -------
    (size, size, 3) uint8 array
        sRGB.
    """
    if kind not in KINDS:
        raise ValueError(f"kind '{kind}' is not one of {KINDS}")
    column, row = np.meshgrid(np.arange(size, dtype=float), np.arange(size, dtype=float))
    back = np.eye(3) if homography is None else np.linalg.inv(homography)
    traced = np.stack([column, row, np.ones_like(column)], axis=-1) @ back.T
    x, y = traced[..., 0] / traced[..., 2] / (size - 1), traced[..., 1] / traced[..., 2] / (size - 1)
    return render(areas(scene, x, y), kind, rng, x, y)


def random_homography(rng: np.random.Generator, size: int = 256, strength: float = 1.0) -> np.ndarray:
    """A mild change of view: rotation within ±10°, scale 0.85 to 1.05, shift within 4 %, perspective within 12 %."""
    angle, scale = np.radians(rng.uniform(-10, 10) * strength), 1.0 + strength * rng.uniform(-0.15, 0.05)
    centre = (size - 1) / 2
    c, s = scale * np.cos(angle), scale * np.sin(angle)
    shift = strength * rng.uniform(-0.04, 0.04, 2) * size
    tilt = strength * rng.uniform(-0.12, 0.12, 2) / size
    to_centre = np.array([[1, 0, -centre], [0, 1, -centre], [0, 0, 1.0]])
    middle = np.array([[c, -s, 0], [s, c, 0], [tilt[0], tilt[1], 1.0]])
    return np.array([[1, 0, centre + shift[0]], [0, 1, centre + shift[1]], [0, 0, 1.0]]) @ middle @ to_centre


def _body(scene: Scene, u, v):
    half = 0.085 + (scene.flare - 0.085) * np.clip((v - 0.2) / (scene.length - 0.2), 0, 1) ** 1.5
    return np.maximum(np.maximum(np.abs(u) - half, 0.2 - v), v - scene.length)


def _medallions(scene: Scene, u, v):
    petals, radius, spacing = scene.motif
    row = np.floor(v / spacing)
    a = (u + 0.5 * spacing * (row % 2)) / spacing
    du, dv = (a - np.round(a)) * spacing, (v / spacing - row - 0.5) * spacing
    r, angle = np.hypot(du, dv), np.arctan2(dv, du)
    flower = r - radius * (0.75 + 0.25 * np.cos(petals * angle))
    ring = np.abs(r - 0.35 * radius) - 0.1 * radius
    return np.maximum(flower, -ring)


def _relief(scene: Scene, u, v, cloth, head):
    """Height above the ground, in units of the square: rounded cloth with folds, a round head."""
    inside = np.clip(-cloth, 0, 0.08)
    rounded = np.sqrt(np.maximum(0.08**2 - (0.08 - inside) ** 2, 0))
    folds = np.zeros_like(u)
    for place, depth, width in scene.folds:
        centre = (place - 0.5) * (0.5 + 1.2 * v)
        folds += 0.012 * depth * np.exp(-0.5 * ((u - centre) / width) ** 2) * np.clip((v - 0.3) * 3, 0, 1)
    ball = 0.07 * np.sqrt(np.clip(1.0 - (head + 1.0) ** 2, 0, 1)) * (head < 0)
    return np.where(cloth < 0, rounded + folds, ball)
