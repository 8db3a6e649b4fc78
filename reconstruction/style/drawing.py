"""The three looks of a drawn scene: glazed figurine, wall painting, woven silk."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

_PALETTES = {  # sRGB in [0, 1]; ground, skin, then three or more colours to choose from
    "mural": ((0.80, 0.72, 0.58), (0.87, 0.72, 0.60),
              ((0.20, 0.42, 0.36), (0.17, 0.30, 0.50), (0.66, 0.22, 0.15), (0.75, 0.52, 0.20), (0.90, 0.86, 0.76),
               (0.35, 0.25, 0.20))),
    "figurine": ((0.16, 0.16, 0.18), (0.80, 0.72, 0.60),
                 ((0.72, 0.42, 0.10), (0.20, 0.42, 0.16), (0.86, 0.78, 0.58), (0.46, 0.22, 0.08), (0.18, 0.24, 0.42))),
    "textile": ((0.86, 0.83, 0.76), (0.74, 0.62, 0.46),
                ((0.55, 0.20, 0.20), (0.70, 0.55, 0.30), (0.33, 0.38, 0.28), (0.30, 0.32, 0.45), (0.80, 0.70, 0.52))),
}


def render(areas, kind: str, rng: np.random.Generator, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Paint areas (see :class:`reconstruction.style.scenes.Areas`) at points x, y of the scene as a picture, (h, w, 3) uint8."""
    colours = _colours(kind, rng)
    flat = colours[areas.label]
    rgb = {"mural": _mural, "figurine": _figurine, "textile": _textile}[kind](flat, areas, rng, x, y)
    return np.rint(255.0 * np.clip(rgb, 0.0, 1.0)).astype(np.uint8)


def smooth_noise(rng: np.random.Generator, shape: tuple[int, int], scale: float) -> np.ndarray:
    """Gaussian noise smoothed over `scale` px, of mean 0 and deviation 1."""
    noise = ndimage.gaussian_filter(rng.standard_normal(shape), scale, mode="wrap")
    return (noise - noise.mean()) / noise.std()


def _colours(kind: str, rng: np.random.Generator) -> np.ndarray:
    """Colours of the six labels, (6, 3)."""
    ground, skin, choice = _PALETTES[kind]
    picked = [choice[k] for k in rng.permutation(len(choice))[:4]]
    colours = np.array([ground, skin, *picked])
    return np.clip(colours * rng.uniform(0.85, 1.15, (len(colours), 1)) + rng.normal(0, 0.02, colours.shape), 0.02, 0.98)


def _mural(flat, areas, rng, x, y):
    """Flat pigments, dark contours of uneven width, patchy paint, cracks, flakes down to the plaster, uneven light."""
    shape = areas.label.shape
    width = 0.0045 * (1.0 + 0.3 * smooth_noise(rng, shape, 12))
    line = np.clip(1.5 - areas.outline / width, 0, 1)[..., None]
    rgb = flat * (1.0 + 0.06 * smooth_noise(rng, shape, 5))[..., None]
    rgb = rgb * (1 - 0.85 * line) + np.array([0.16, 0.11, 0.09]) * 0.85 * line
    plaster = np.array([0.86, 0.80, 0.68]) * (1.0 + 0.05 * smooth_noise(rng, shape, 2))[..., None]
    flakes = np.clip((smooth_noise(rng, shape, 6) - rng.uniform(1.5, 2.1)) * 6, 0, 1)[..., None]
    rgb = rgb * (1 - flakes) + plaster * flakes
    field = smooth_noise(rng, shape, 18)
    cracks = np.clip(1.3 - np.abs(field) / (0.8 * np.hypot(*np.gradient(field)) + 1e-9), 0, 1)
    cracks *= smooth_noise(rng, shape, 25) > 0.3
    light = 1.0 + rng.uniform(0.05, 0.2) * ((x - 0.5) * rng.uniform(-1, 1) + (y - 0.5) * rng.uniform(-1, 1)) * 2
    return rgb * (1 - 0.6 * cracks[..., None]) * light[..., None] + rng.normal(0, 0.012, (*shape, 1))


def _figurine(flat, areas, rng, x, y):
    """Glaze that runs, lit from one side, with a highlight, dark ground, grain of the photograph."""
    shape = areas.label.shape
    size = max(shape)
    height = ndimage.gaussian_filter(areas.height, 1.0) * size
    gy, gx = np.gradient(height)
    normal = np.stack([-gx, -gy, np.ones(shape)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    angle = rng.uniform(0, 2 * np.pi)
    light = np.array([0.55 * np.cos(angle), -0.45 - 0.2 * np.sin(angle), 0.75])
    light /= np.linalg.norm(light)
    shade = 0.28 + 0.85 * np.clip(normal @ light, 0, 1)
    half = light + np.array([0, 0, 1.0])
    gloss = 0.35 * np.clip(normal @ (half / np.linalg.norm(half)), 0, 1) ** 40
    runs = ndimage.gaussian_filter(rng.standard_normal(shape), (14, 2))
    rgb = flat * (1.0 + 0.10 * runs / runs.std())[..., None]
    rgb = ndimage.gaussian_filter(rgb, (1.2, 0.7, 0))  # glazes melt into each other
    solid = (areas.label > 0)[..., None]
    lit = np.where(solid, rgb * shade[..., None] + gloss[..., None], flat * (1.0 + 0.15 * (0.5 - y))[..., None])
    return ndimage.gaussian_filter(lit, (0.6, 0.6, 0)) + rng.normal(0, 0.012, (*shape, 1))


def _textile(flat, areas, rng, x, y):
    """Faded colours in a weave of two thread directions, stains and holes."""
    shape = areas.label.shape
    period = 1.0 / rng.uniform(70, 90)
    warp, weft = np.cos(2 * np.pi * x / period), np.cos(2 * np.pi * y / period)
    weave = 0.5 * (np.maximum(warp, 0) - np.maximum(weft, 0)) + 0.15 * np.sign(warp * weft)
    fade = rng.uniform(0.65, 0.85)
    rgb = fade * flat + (1 - fade) * np.array([0.70, 0.60, 0.45])
    rgb = rgb * (1.0 + 0.10 * weave * (areas.label > 0))[..., None]
    stains = 1.0 - 0.12 * np.clip(smooth_noise(rng, shape, 14), 0, 2)
    holes = (np.clip((smooth_noise(rng, shape, 5) - rng.uniform(2.2, 2.8)) * 6, 0, 1) * (areas.label > 0))[..., None]
    rgb = rgb * stains[..., None]
    return rgb * (1 - holes) + np.array([0.86, 0.83, 0.76]) * holes + rng.normal(0, 0.012, (*shape, 1))
