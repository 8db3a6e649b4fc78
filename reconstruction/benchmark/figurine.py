"""The style ``figurine``: glazed ceramic, seen by a few known perspective cameras."""

from __future__ import annotations

import numpy as np

from . import pattern as patterns
from . import skin
from .camera import Camera
from .noise import value_noise
from .pattern import Pattern
from .scene import Scene, View, look, shrink

AZIMUTHS = (0.0, 28.0, -28.0, 180.0)
"""Nominal azimuths of the cameras, degrees; each is moved by up to 6."""
_GLAZES = ((0.70, 0.42, 0.12), (0.26, 0.45, 0.24), (0.88, 0.80, 0.62), (0.20, 0.26, 0.48), (0.50, 0.26, 0.14))
_CLAY = np.array([0.80, 0.70, 0.60])


def paint(
    scene: Scene, camera: Camera, pattern: Pattern, texture_seed: int, damage: int, view_seed: int, scale: int = 2
) -> np.ndarray:
    """Draw one picture.

    Parameters
    ----------
    scene : Scene
    camera : Camera
    pattern : Pattern
        Showing through the glaze.
    texture_seed : int
        Of glaze, dirt and losses: the same object in every view.
    damage : {0, 1, 2, 3}
        0: as new; 1: dirt and dull glaze; 2: chips and cracks; 3: large losses of glaze, heavy dirt.
    view_seed : int
        Of the light's small changes and the camera's noise.
    scale : int
        Samples a pixel in each direction.

    Returns
    -------
    image : (h, w, 3) uint8 array
    """
    rng = np.random.default_rng([view_seed, 61])
    view = look(scene, camera, scale)
    albedo, gloss = _material(scene, view, pattern, texture_seed, damage)
    colours = np.zeros((*view.face.shape, 3))
    colours[view.hit] = _light(scene, view, albedo, gloss, rng)
    y, x = np.mgrid[0 : 1 : camera.height * 1j, -0.5 : 0.5 : camera.width * 1j]
    wall = (rng.uniform(0.35, 0.6) * (1.15 - 0.5 * y - 0.25 * x**2))[..., None] * np.array([1.0, 0.99, 0.96])
    image = shrink(colours, scale) + (1 - shrink(view.hit.astype(float), scale))[..., None] * wall
    image = np.clip(image, 0, 1) ** (1 / 1.15) + rng.normal(0, 0.008, image.shape)
    return (np.clip(image, 0, 1) * 255).round().astype(np.uint8)


def _material(scene: Scene, view: View, pattern: Pattern, seed: int, damage: int):
    """Albedo (n, 3) and gloss (n,) of the pixels that are hit."""
    rng = np.random.default_rng([seed, 67])
    at = view.hit
    p = view.position[at]
    cloth = view.cloth[at]
    first, second = (np.array(_GLAZES[int(i)]) for i in rng.permutation(len(_GLAZES))[:2])
    dress = np.array(_GLAZES[int(rng.integers(len(_GLAZES)))]) * 0.9
    streak = value_noise(p * [1, 1, 0.16], 0.09, seed, 3)  # glaze runs down
    glaze = np.where((streak > 0.66)[:, None], second, first) * (0.85 + 0.35 * streak[:, None])
    albedo = np.empty((len(p), 3))
    albedo[~cloth] = skin.colour(p[~cloth], scene.head, scene.stature, _CLAY * [1.05, 1.0, 0.96], dress, scene.skirt)
    dye = patterns.colour(pattern, view.uv[at][cloth], view.trim[at][cloth])
    albedo[cloth] = 0.45 * glaze[cloth] + 0.55 * dye
    albedo *= (0.93 + 0.14 * value_noise(p, 0.012, seed + 1, 2))[:, None]
    gloss = np.where(cloth | (p[:, 2] < scene.head[2] - 0.1 * scene.stature), 1.0, 0.25)
    if damage >= 1:
        dirt = np.clip(value_noise(p, 0.12, seed + 2, 4) - 0.55 + 0.07 * damage, 0, 1) * 2.2 * (1.2 - view.sky[at])
        albedo = albedo * (1 - np.clip(dirt, 0, 0.7))[:, None] + np.array([0.33, 0.27, 0.2]) * np.clip(dirt, 0, 0.7)[:, None]
        gloss = gloss * (0.75, 0.5, 0.25)[damage - 1]
    if damage >= 2:
        lost = value_noise(p, 0.16, seed + 3, 5) > (0.76 if damage == 2 else 0.58)
        albedo[lost] = _CLAY * (0.8 + 0.25 * value_noise(p[lost], 0.01, seed + 4, 2))[:, None]
        gloss[lost] = 0.03
        crack = np.abs(value_noise(p, 0.3, seed + 5, 4) - 0.5) < 0.0022 * (damage - 1)
        albedo[crack] *= 0.25
    return albedo, gloss


def _light(scene: Scene, view: View, albedo, gloss, rng) -> np.ndarray:
    at = view.hit
    n, p, eye, sky = view.normal[at], view.position[at], view.toward[at], view.sky[at]
    key = np.array([rng.uniform(-0.7, 0.7), -0.8, rng.uniform(0.6, 1.1)])
    if eye.mean(axis=0)[1] > 0:  # a view from behind is lit from behind
        key[1] = 0.8
    key /= np.linalg.norm(key)
    facing = n @ key
    lit = facing > 0
    origins = p[lit] + 0.006 * n[lit]
    lit[lit] = ~scene.caster.blocked(origins, np.broadcast_to(key, origins.shape))
    ambient = (0.34 + 0.16 * n[:, 2]) * sky
    shade = 0.72 * np.where(lit, np.clip(facing, 0, 1), 0.0) + ambient + 0.12 * np.clip(np.einsum("ij,ij->i", n, eye), 0, 1) * sky
    half = key + eye
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    shine = np.where(lit, np.clip(np.einsum("ij,ij->i", n, half), 0, 1) ** 60, 0.0)
    rim = (1 - np.clip(np.einsum("ij,ij->i", n, eye), 0, 1)) ** 4
    return albedo * shade[:, None] + (gloss * (0.38 * shine + 0.10 * rim * sky))[:, None]
