"""The style ``mural``: flat colour and brush lines on plaster, in a wrong foreshortening, with cracks, flakes and uneven light."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import binary_dilation, gaussian_filter, maximum_filter, minimum_filter

from . import pattern as patterns
from . import skin
from .camera import Camera, oblique
from .noise import cracks, pixel_grid, value_noise
from .pattern import Pattern
from .scene import Scene, View, look, shrink

LOSS = (0.0, 0.03, 0.09, 0.24)
"""Share of the plaster's surface flaked off, by damage level (of the noise field, about)."""


def draw_camera(points, seed: int, width: int, height: int) -> Camera:
    """A mural's projection: view from the front or three-quarter, receding lines k within 0.3, heights squeezed to 0.86 to 1.1,
    shear within 0.12, tilted within 4 degrees (assumptions: as far as a person can be drawn wrongly and still be read)."""
    rng = np.random.default_rng([seed, 71])
    return oblique(
        points,
        float(rng.uniform(-38, 38)),
        float(rng.uniform(-4, 10)),
        width,
        height,
        recede=rng.uniform(-0.3, 0.3, 2),
        squeeze=float(rng.uniform(0.86, 1.1)),
        shear=float(rng.uniform(-0.12, 0.12)),
        roll=float(rng.uniform(-4, 4)),
    )


def paint(
    scene: Scene, camera: Camera, pattern: Pattern, texture_seed: int, damage: int, view_seed: int, scale: int = 2
) -> tuple[np.ndarray, np.ndarray]:
    """Draw one mural.

    Parameters
    ----------
    scene, camera, pattern, scale
        As for a figurine.
    texture_seed : int
        Of the plaster and pigments.
    damage : {0, 1, 2, 3}
        Cracks, flakes (:data:`LOSS`), stains, fading and uneven light grow with it.
    view_seed : int
        Of brush and damage.

    Returns
    -------
    image : (h, w, 3) uint8 array
    intact : (h, w) bool array
        Where the paint is left.
    """
    rng = np.random.default_rng([view_seed, 73])
    view = look(scene, camera, scale)
    grid = pixel_grid(camera.width, camera.height)
    plaster = _plaster(grid, texture_seed)
    figure = np.zeros((*view.face.shape, 3))
    figure[view.hit] = _flat_colour(scene, view, pattern, texture_seed)
    cover = shrink(view.hit.astype(float), scale)[..., None]
    wash = value_noise(grid, 60.0, view_seed, 4)[..., None]
    image = shrink(figure, scale) * (0.9 + 0.2 * wash) + (1 - cover) * plaster
    ink = shrink(_lines(view, grid, scale, view_seed), scale)[..., None]
    image = image * (1 - ink) + np.array([0.14, 0.11, 0.10]) * ink
    return _age(image, plaster, damage, rng, view_seed)


def _plaster(grid, seed: int) -> np.ndarray:
    rng = np.random.default_rng([seed, 79])
    base = np.array([0.78, 0.68, 0.52]) * rng.uniform(0.8, 1.1) + rng.normal(0, 0.025, 3)
    tone = 0.86 + 0.28 * value_noise(grid, 90.0, seed + 6, 5)
    grain = 0.96 + 0.08 * value_noise(grid, 3.0, seed + 7, 2)
    return np.clip(base * (tone * grain)[..., None], 0, 1)


def _flat_colour(scene: Scene, view: View, pattern: Pattern, seed: int) -> np.ndarray:
    rng = np.random.default_rng([seed, 83])
    at = view.hit
    cloth = view.cloth[at]
    flesh = np.array([0.86, 0.68, 0.55]) * rng.uniform(0.85, 1.08)
    dress = np.array([(0.62, 0.28, 0.2), (0.36, 0.46, 0.4), (0.72, 0.62, 0.42), (0.3, 0.34, 0.5)][int(rng.integers(4))])
    out = np.empty((len(cloth), 3))
    out[~cloth] = skin.colour(view.position[at][~cloth], scene.head, scene.stature, flesh, dress, scene.skirt)
    out[cloth] = patterns.colour(pattern, view.uv[at][cloth], view.trim[at][cloth])
    shade = gaussian_filter(np.where(at, view.sky, 1.0), 3.0)[at]
    return out * (0.74 + 0.3 * shade)[:, None]


def _lines(view: View, grid, scale: int, seed: int) -> np.ndarray:
    """Ink (h, w) in 0 to 1: outlines, occlusions inside the figure and sharp folds, with a brush of varying width."""
    depth = np.where(view.hit, view.depth, 50.0)
    jump = (maximum_filter(depth, 3) - minimum_filter(depth, 3)) > 0.03
    kind = np.where(view.hit, 1 + view.cloth, 0)
    border = maximum_filter(kind, 3) != minimum_filter(kind, 3)
    n = np.where(view.hit[..., None], view.normal, 0.0)
    away = gaussian_filter(np.einsum("ijk,ijk->ij", n, view.toward), 1.0)
    near = gaussian_filter(np.einsum("ijk,ijk->ij", n, view.toward), 5.0 * scale)
    fold = view.hit & view.cloth & (away - near < -0.17)
    enlarge = lambda a: np.repeat(np.repeat(a, scale, axis=0), scale, axis=1)  # noqa: E731
    width = enlarge(value_noise(grid, 25.0, seed + 8, 2))
    strong = jump | border
    thin, thick = binary_dilation(strong, iterations=1), binary_dilation(strong, iterations=scale)
    ink = np.where(width > 0.55, thick, thin).astype(float)
    ink = np.maximum(ink, 0.7 * np.where(width > 0.3, fold, False))
    return gaussian_filter(ink, 0.6) * (0.75 + 0.25 * enlarge(value_noise(grid, 8.0, seed + 9, 2)))


def _age(image, plaster, damage: int, rng, seed: int):
    h, w = image.shape[:2]
    grid = pixel_grid(w, h)
    image = image + (0.04, 0.1, 0.2, 0.38)[damage] * (plaster - image)  # fading
    flake = value_noise(grid, 70.0, seed + 10, 5)
    level = np.quantile(flake, 1 - LOSS[damage]) if damage else np.inf
    lost = flake > level
    raw = plaster * (0.82 + 0.2 * value_noise(grid, 6.0, seed + 11, 3))[..., None] + 0.06
    image = np.where(lost[..., None], raw, image)
    rim = binary_dilation(lost) & ~lost
    image[rim] *= 0.72
    line = cracks(w, h, (0, 5, 12, 26)[damage], rng)[..., None]
    image = image * (1 - 0.75 * line)
    stain = np.clip(value_noise(grid, 110.0, seed + 12, 4) - 0.62, 0, 1)[..., None] * (0.3, 0.7, 1.2, 1.8)[damage]
    image = image * (1 - np.clip(stain, 0, 0.6) * np.array([0.7, 0.85, 1.0]))
    y, x = np.mgrid[-1 : 1 : h * 1j, -1 : 1 : w * 1j]
    a, b, c = rng.normal(0, 1, 3)
    field = (a * x + b * y + 0.6 * c * (x * x - y * y)) / (np.hypot(a, b) + 0.6 * abs(c))
    image = image * (1 + (0.05, 0.13, 0.22, 0.34)[damage] * field)[..., None]
    image = image + rng.normal(0, 0.012, image.shape)
    return (np.clip(image, 0, 1) * 255).round().astype(np.uint8), ~lost
