"""The style ``textile``: the garment laid flat and photographed from above, with its repeat and warp, holes, stains and creases."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

from . import pattern as patterns
from .camera import Camera
from .noise import pixel_grid, value_noise
from .pattern import Pattern
from .scene import Scene, look, shrink

RIB = 0.011
"""Period of the drawn warp ribs, m: threads of 0.2 mm cannot be seen at this size, so bundles of about fifty are drawn."""
LOSS = (0.0, 0.02, 0.08, 0.2)
"""Share of the cloth that is holes, by damage level."""


def draw_camera(points, seed: int, width: int, height: int) -> Camera:
    """A camera straight above the cloth, turned within 8 degrees, in parallel projection (a copy stand with a long lens)."""
    rng = np.random.default_rng([seed, 89])
    turn = np.radians(rng.uniform(-8, 8))
    c, s = np.cos(turn), np.sin(turn)
    linear = np.array([[c, s, 0.0], [s, -c, 0.0]])
    flat = np.asarray(points, dtype=float) @ linear.T
    low, high = flat.min(axis=0), flat.max(axis=0)
    scale = float((0.93 * np.array([width, height]) / (high - low)).min())
    offset = (np.array([width, height]) - 1) / 2 - scale * (low + high) / 2
    matrix = np.vstack([np.column_stack([scale * linear, offset]), [0, 0, 0, 1.0]])
    return Camera(matrix, np.array([0.0, 0.0, -1.0, 2.0]), width, height)


def paint(
    scene: Scene, camera: Camera, pattern: Pattern, texture_seed: int, damage: int, view_seed: int, scale: int = 2
) -> tuple[np.ndarray, np.ndarray]:
    """Draw the laid-out garment.

    Parameters
    ----------
    scene : Scene
        Laid flat, without a figure.
    camera, pattern, texture_seed, damage, view_seed, scale
        As for a mural; holes and stains belong to the cloth (`texture_seed`), creases and light to the picture.

    Returns
    -------
    image : (h, w, 3) uint8 array
    intact : (h, w) bool array
        Where there is no hole.
    """
    rng = np.random.default_rng([view_seed, 97])
    view = look(scene, camera, scale)
    h, w = view.face.shape
    at = view.hit
    uv, trim = view.uv[at], view.trim[at]
    dye = patterns.colour(pattern, uv, trim)
    rib = 1 + 0.10 * np.sin(2 * np.pi * uv[:, 0] / RIB)  # stripes along v: the warp
    slub = 0.88 + 0.24 * value_noise(uv * [1.0, 0.08], 0.012, texture_seed + 20, 2)
    weft = 0.96 + 0.08 * value_noise(uv * [0.06, 1.0], 0.010, texture_seed + 21, 2)
    cloth = dye * (rib * slub * weft)[:, None]
    age = (0.1, 0.22, 0.36, 0.5)[damage]
    cloth = cloth * (1 - age) + age * np.array([0.58, 0.47, 0.33]) * (slub * weft)[:, None]
    stain = np.clip(value_noise(uv, 0.22, texture_seed + 22, 4) - 0.6, 0, 1) * (0.4, 1.0, 1.8, 2.6)[damage]
    cloth *= (1 - np.clip(stain, 0, 0.65))[:, None]
    hole = np.zeros((h, w), dtype=bool)
    if damage:
        field = value_noise(uv, 0.13, texture_seed + 23, 5) + 0.25 * np.exp(-trim / 0.02)  # edges fray first
        hole[at] = field > np.quantile(field, 1 - LOSS[damage])
    there = at & ~hole
    colours = np.zeros((h, w, 3))
    colours[at] = cloth
    cover = shrink(there.astype(float), scale)
    grid = pixel_grid(camera.width, camera.height)
    board = (
        np.array([0.30, 0.31, 0.33]) * rng.uniform(0.6, 1.9) * (0.95 + 0.1 * value_noise(grid, 4.0, view_seed + 24, 2))[..., None]
    )
    shadow = gaussian_filter(cover, 3.0)[..., None]
    slope = np.gradient(gaussian_filter(value_noise(grid, 60.0, view_seed + 25, 4), 2.0), axis=1)
    image = shrink(colours * there[..., None], scale) * (1 + np.clip(14 * slope, -0.35, 0.35))[..., None]
    image = image + (1 - cover[..., None]) * board * (1 - 0.45 * shadow)
    image = image * (1 + 0.1 * rng.normal() * (np.linspace(-1, 1, camera.width))[None, :, None])
    image = image + rng.normal(0, 0.01, image.shape)
    intact = shrink(hole.astype(float), scale) < 0.5
    return (np.clip(image, 0, 1) * 255).round().astype(np.uint8), intact
