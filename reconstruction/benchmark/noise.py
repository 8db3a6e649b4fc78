"""Smooth random fields: periodic lattice noise in two or three dimensions, and crack lines."""

from __future__ import annotations

import numba
import numpy as np

_LATTICE = 32


def value_noise(points, size: float, seed: int, octaves: int = 3) -> np.ndarray:
    """Fractal lattice noise.

    Parameters
    ----------
    points : (..., d) array
        Positions, d = 2 or 3.
    size : float
        Size of the largest features, same unit as the points; the field repeats after 32 of them.
    seed : int
    octaves : int
        Each has half the size and half the strength of the one before.

    Returns
    -------
    (...) array
        Mean about 0.5, almost all between 0 and 1.
    """
    points = np.asarray(points, dtype=float)
    d = points.shape[-1]
    flat = np.ascontiguousarray(points.reshape(-1, d) / size)
    rng = np.random.default_rng([seed, 41])
    lattice = rng.random((octaves, *(_LATTICE,) * d), dtype=np.float32)
    total = (_sum2 if d == 2 else _sum3)(flat, lattice)
    return (0.5 + (total / (2 - 0.5 ** (octaves - 1)) - 0.5) * 1.6).reshape(points.shape[:-1])


def pixel_grid(width: int, height: int) -> np.ndarray:
    """(height, width, 2) row and column of every pixel."""
    rows, columns = np.meshgrid(np.arange(float(height)), np.arange(float(width)), indexing="ij")
    return np.stack([rows, columns], axis=-1)


@numba.njit(cache=True)
def _sum2(points, lattice):
    out = np.zeros(len(points))
    for o in range(lattice.shape[0]):
        grid, strength = lattice[o], 0.5**o
        for i in range(len(points)):
            x, y = points[i, 0] * 2**o + 7.3 * o, points[i, 1] * 2**o + 7.3 * o
            fx, fy = np.floor(x), np.floor(y)
            a, b = int(fx) % _LATTICE, int(fy) % _LATTICE
            c, d = (a + 1) % _LATTICE, (b + 1) % _LATTICE
            s, t = x - fx, y - fy
            out[i] += strength * ((1 - s) * ((1 - t) * grid[a, b] + t * grid[a, d]) + s * ((1 - t) * grid[c, b] + t * grid[c, d]))
    return out


@numba.njit(cache=True)
def _sum3(points, lattice):
    out = np.zeros(len(points))
    for o in range(lattice.shape[0]):
        grid, strength = lattice[o], 0.5**o
        for i in range(len(points)):
            x, y, z = points[i, 0] * 2**o + 7.3 * o, points[i, 1] * 2**o + 7.3 * o, points[i, 2] * 2**o + 7.3 * o
            fx, fy, fz = np.floor(x), np.floor(y), np.floor(z)
            a, b, e = int(fx) % _LATTICE, int(fy) % _LATTICE, int(fz) % _LATTICE
            c, d, f = (a + 1) % _LATTICE, (b + 1) % _LATTICE, (e + 1) % _LATTICE
            s, t, r = x - fx, y - fy, z - fz
            low = (1 - s) * ((1 - t) * grid[a, b, e] + t * grid[a, d, e]) + s * ((1 - t) * grid[c, b, e] + t * grid[c, d, e])
            high = (1 - s) * ((1 - t) * grid[a, b, f] + t * grid[a, d, f]) + s * ((1 - t) * grid[c, b, f] + t * grid[c, d, f])
            out[i] += strength * ((1 - r) * low + r * high)
    return out


def cracks(width: int, height: int, count: int, rng: np.random.Generator, thickness: float = 1.0) -> np.ndarray:
    """Branching crack lines.

    Parameters
    ----------
    width, height : int
        Pixels.
    count : int
        Number of cracks.
    rng : numpy.random.Generator
    thickness : float
        Pixels.

    Returns
    -------
    (height, width) array
        0 where sound, up to 1 in a crack.
    """
    from PIL import Image, ImageDraw

    picture = Image.new("L", (width, height), 0)
    pen = ImageDraw.Draw(picture)
    for _ in range(count):
        at = rng.random(2) * (width, height)
        heading = rng.uniform(0, 2 * np.pi)
        line = [tuple(at)]
        for _ in range(int(rng.integers(15, 60))):
            heading += rng.normal(0, 0.35)
            at = at + rng.uniform(3, 9) * np.array([np.cos(heading), np.sin(heading)])
            line.append(tuple(at))
            if rng.random() < 0.06:
                side = heading + rng.choice([-1, 1]) * rng.uniform(0.5, 1.2)
                far = at + rng.uniform(8, 30) * np.array([np.cos(side), np.sin(side)])
                pen.line([tuple(at), tuple(far)], fill=160, width=max(1, int(thickness)))
        pen.line(line, fill=255, width=max(1, round(thickness * rng.uniform(0.7, 1.6))))
    return np.asarray(picture, dtype=float) / 255
