"""A patterned ball, or slanted plane, seen by cameras about it; depths known exactly."""

import numpy as np

from reconstruction.stereo.view import View

SIZE = (96, 112)
RADIUS = 0.3


def camera(azimuth, distance=2.0, focal=220.0):
    a = np.radians(azimuth)
    forward, right = np.array([np.sin(a), np.cos(a), 0.0]), np.array([np.cos(a), -np.sin(a), 0.0])
    r = np.stack([right, [0.0, 0.0, -1.0], forward])
    k = np.array([[focal, 0, SIZE[1] / 2], [0, focal, SIZE[0] / 2], [0, 0, 1.0]])
    return k @ np.column_stack([r, distance * r @ forward])


def pattern(p):
    rng = np.random.default_rng(0)
    waves = [np.sin(p @ (70 * rng.normal(size=3)) + k) for k in range(9)]
    return (0.5 + 0.16 * np.stack([waves[c] + waves[c + 3] + waves[c + 6] for c in range(3)], axis=-1)).astype(np.float32)


def ball(azimuth):
    """View and its depths; NaN beside the ball."""
    blank = View.of(f"ball {azimuth}", np.zeros((*SIZE, 3), dtype=np.float32), camera(azimuth))
    rays, c = blank.grid_rays(), blank.centre
    a, b, q = (rays**2).sum(-1), rays @ c, c @ c - RADIUS**2
    root = b**2 - a * q
    depth = np.where(root > 0, (-b - np.sqrt(np.maximum(root, 0))) / a, np.nan)
    seen = np.isfinite(depth)
    image = np.where(seen[..., None], pattern(blank.points(np.nan_to_num(depth))), 0.0).astype(np.float32)
    return View(blank.name, image, blank.camera, seen), depth


def plane(azimuth, slope=0.5):
    """y = slope x."""
    blank = View.of(f"plane {azimuth}", np.zeros((*SIZE, 3), dtype=np.float32), camera(azimuth))
    n = np.array([slope, -1.0, 0.0])
    depth = -(blank.centre @ n) / (blank.grid_rays() @ n)
    return View(blank.name, pattern(blank.points(depth)), blank.camera, np.ones(SIZE, dtype=bool)), depth
