"""Depth maps that agree, and the points they make together.

A depth is believed where another view's depth map has nearly the same point (geometric consistency, Y. Furukawa & C. Hernandez,
Multi-View Stereo: A Tutorial, 2015, doi:10.1561/0600000052, section 3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mfar_fem.errors import InputError
from reconstruction.stereo.sweep import DepthMap

TOLERANCE = 1.0
"""Distance up to which two depth maps say the same, px of parallax."""
RELATIVE = 0.01
"""And part of the depth: from nearly the same place a pixel of parallax is any distance."""


def consistent(maps: Sequence[DepthMap], tolerance: float = TOLERANCE, least: int = 1) -> list[DepthMap]:
    """Depths that `least` other maps confirm; the others become NaN.

    Parameters
    ----------
    maps : sequence of DepthMap
    tolerance : float
        In pixels that the point would move in the confirming view if the depths differed by as much.
    least : int

    Raises
    ------
    InputError
        Fewer maps than would have to agree.
    """
    if len(maps) <= least:
        raise InputError(
            f"{least + 1} depth maps at least are needed for each depth to be confirmed {least} times; there are {len(maps)}"
        )
    out = []
    for one in maps:
        there = np.isfinite(one.depth)
        points = one.view.points(one.depth)[there]
        votes = np.zeros(len(points), dtype=int)
        for other in maps:
            if other is one or not len(points):
                continue
            pixels, depth = other.view.project(points)
            h, w = other.depth.shape
            x, y = np.rint(pixels).astype(int).T
            inside = (x >= 0) & (y >= 0) & (x < w) & (y < h) & (depth > 0)
            theirs = np.full(len(points), np.nan)
            theirs[inside] = other.depth[y[inside], x[inside]]
            pixel = 1.0 / max(one.view.parallax(other.view, float(np.median(one.depth[there]))), 1e-9)
            votes += np.abs(theirs - depth) < np.minimum(tolerance * pixel, RELATIVE * depth)
        kept = one.depth.copy()
        kept[there] = np.where(votes >= least, kept[there], np.nan)
        out.append(replace(one, depth=kept))
    return out


def fuse(maps: Sequence[DepthMap], voxel: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points, unit normals and standard deviations of all depths, averaged in cells of a grid.

    Parameters
    ----------
    voxel : float
        Edge of the cells, m.

    Returns
    -------
    points, normals : (n, 3) arrays
        m; towards the cameras.
    sigma : (n,) array
        Of single depths (averaging does not make neighbours independent), m.

    Raises
    ------
    InputError
        No depth is left.
    """
    points, normals, sigmas = [], [], []
    for one in maps:
        space = one.view.points(one.depth)
        across, down = (space[:, 2:] - space[:, :-2])[1:-1], (space[2:] - space[:-2])[:, 1:-1]
        normal = np.cross(down, across)
        size = np.linalg.norm(normal, axis=2)
        middle, sigma = space[1:-1, 1:-1], one.sigma[1:-1, 1:-1]
        good = np.isfinite(size) & (size > 0) & np.isfinite(middle).all(axis=2) & np.isfinite(sigma)
        n, p = normal[good] / size[good][:, None], middle[good]
        way = one.view.centre - p
        points.append(p)
        normals.append(n * np.sign(np.einsum("ni,ni->n", n, way))[:, None])
        sigmas.append(sigma[good])
    p, n, s = np.concatenate(points), np.concatenate(normals), np.concatenate(sigmas)
    if not len(p):
        raise InputError("no depth is left to fuse: the views confirm nothing of each other")
    cell = np.unique(np.floor(p / voxel).astype(np.int64), axis=0, return_inverse=True)[1].ravel()
    count = np.bincount(cell)
    mean = lambda a: np.stack([np.bincount(cell, a[:, i]) for i in range(3)], axis=1) / count[:, None]  # noqa: E731
    normal = mean(n)
    length = np.linalg.norm(normal, axis=1)
    clear = length > 0.3  # cells with both sides of a sheet in them have no normal
    return mean(p)[clear], normal[clear] / length[clear][:, None], (np.bincount(cell, s) / count)[clear]
