"""Multi-view stereo: known poses, plane sweep, consistency, fusion, Poisson surface."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import distance_transform_edt

from mfar_fem.errors import InputError
from reconstruction.stereo.consistency import TOLERANCE, consistent, fuse
from reconstruction.stereo.sweep import DepthMap, planes, sweep
from reconstruction.stereo.view import View
from reconstruction.surface.poisson import poisson_surface
from reconstruction.surface.triangles import TriangleMesh
from reconstruction.surface.trimming import trim_by_distance


@dataclass(frozen=True)
class MvsSettings:
    """Window of the correlation and step of the planes (px), least correlation, tolerance of the consistency (px), grid of the
    fusion (m)."""

    window: int = 9
    step: float = 0.5
    least: float = 0.5
    tolerance: float = TOLERANCE
    voxel: float = 5e-3


@dataclass(frozen=True, eq=False)
class MvsResult:
    """Surface, fused points (n, 3) with normals and standard deviations, m, and plain facts."""

    mesh: TriangleMesh
    points: np.ndarray
    normals: np.ndarray
    sigma: np.ndarray
    facts: dict[str, Any]


def around(views: Sequence[View], cells: int = 48) -> np.ndarray:
    """Corners (8, 3), m, of a box about what all masks together leave room for, found on a coarse grid.

    Raises
    ------
    InputError
        An empty mask, fewer than two views, or masks that leave no room.
    """
    if len(views) < 2:
        raise InputError(f"stereo needs two views with cameras at least; there are {len(views)}")
    rows, sizes = [], []
    for view in views:
        pixels = np.argwhere(view.mask)[:, ::-1]
        if not len(pixels):
            raise InputError(f"the mask of '{view.name}' is empty")
        ray = view.rays(0.5 * (pixels.min(axis=0) + pixels.max(axis=0)))
        ray = ray / np.linalg.norm(ray)
        across = np.eye(3) - np.outer(ray, ray)
        rows.append((across, across @ view.centre))
        sizes.append(np.ptp(pixels, axis=0) + 1)
    matrix = sum(a for a, _ in rows)
    if np.linalg.cond(matrix) > 1e8:
        raise InputError("all views look along one line: their masks bound nothing along it")
    middle = np.linalg.solve(matrix, sum(b for _, b in rows))  # nearest to the rays through the masks' middles
    half = 0.0
    for view, size in zip(views, sizes, strict=True):
        pixel, depth = view.project(middle)
        ways = [view.rays(pixel + 0.5 * size * axis) - view.rays(pixel) for axis in np.eye(2)]
        half = max(half, *(float(depth * np.linalg.norm(way)) for way in ways))
    line = 1.1 * half * np.linspace(-1, 1, cells)
    grid = middle + np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).reshape(-1, 3)
    room = np.ones(len(grid), dtype=bool)
    for view in views:
        pixels, depth = view.project(grid)
        cell = (line[1] - line[0]) * np.sqrt(abs(np.linalg.det(view.camera[:, :3]))) / np.median(depth)
        near = distance_transform_edt(~view.mask) <= cell
        x, y = (np.rint(pixels[:, i]).astype(int) for i in (0, 1))
        inside = (depth > 0) & (x >= 0) & (y >= 0) & (x < view.size[1]) & (y < view.size[0])
        room[inside] &= near[y[inside], x[inside]]
        room &= inside
    if not room.any():
        raise InputError("the masks leave no room in common: do cameras and masks belong together?")
    low, high = grid[room].min(axis=0), grid[room].max(axis=0)
    return np.array([[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def mvs(views: Sequence[View], settings: MvsSettings | None = None, progress: Callable[[int], None] | None = None) -> MvsResult:
    """Reconstruct a surface from calibrated pictures alone.

    Parameters
    ----------
    views : sequence of View
    settings : MvsSettings, optional
    progress : callable, optional
        ``progress(1)`` after each view.

    Raises
    ------
    InputError
        Too few views that see the same side, or nothing that they confirm.
    SurfaceError
        The points make no surface.
    """
    s = settings or MvsSettings()
    clock = time.perf_counter()
    seen = [view.neighbours(views) for view in views]
    if len(views) > 1 and not any(seen):
        raise InputError("no two views look from less than 60 degrees apart: there is nothing to compare")
    box = around(views)
    maps: list[DepthMap] = []
    for view, others in zip(views, seen, strict=True):
        if others:
            base, offsets = planes(view, box, others, margin=0.0, pixels=s.step)
            maps.append(sweep(view, others, base, offsets, s.window, s.least))
        if progress is not None:
            progress(1)
    agreed = consistent(maps, s.tolerance)
    points, normals, sigma = fuse(agreed, s.voxel)
    base_surface = poisson_surface(points, normals, sigma)
    cut = trim_by_distance(base_surface.mesh, base_surface.points, base_surface.spacing)
    before, after = (sum(int(np.isfinite(m.depth).sum()) for m in some) for some in (maps, agreed))
    facts = {
        "views": len(maps),
        "depths": before,
        "consistent": after,
        "points": len(points),
        "seconds": time.perf_counter() - clock,
    }
    return MvsResult(cut.mesh, points, normals, sigma, facts)
