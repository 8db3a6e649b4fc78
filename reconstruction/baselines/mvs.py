"""Multi-view stereo: known poses, plane sweep, consistency, fusion, Poisson surface."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mfar_fem.errors import InputError
from reconstruction.stereo.consistency import TOLERANCE, consistent, fuse
from reconstruction.stereo.sweep import DepthMap, planes, sweep
from reconstruction.stereo.view import View
from reconstruction.surface.poisson import poisson_surface
from reconstruction.surface.triangles import TriangleMesh
from reconstruction.surface.trimming import trim_by_distance

ANGLE = np.radians(60.0)
"""Views whose axes differ by more are not compared."""


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


def around(views: Sequence[View]) -> np.ndarray:
    """Corners (8, 3), m, of a box about what the masks show: the point their middles see, as wide as they are there.

    Raises
    ------
    InputError
        An empty mask, or fewer than two views.
    """
    if len(views) < 2:
        raise InputError(f"stereo needs two views with cameras at least; there are {len(views)}")
    rows, sides = [], []
    for view in views:
        pixels = np.argwhere(view.mask)[:, ::-1]
        if not len(pixels):
            raise InputError(f"the mask of '{view.name}' is empty")
        ray = view.rays(pixels.mean(axis=0))
        ray = ray / np.linalg.norm(ray)
        across = np.eye(3) - np.outer(ray, ray)
        rows.append((across, across @ view.centre))
        sides.append((view, np.ptp(pixels, axis=0)))
    middle = np.linalg.solve(sum(a for a, _ in rows), sum(b for _, b in rows))
    reach = []
    for view, size in sides:
        pixel, depth = view.project(middle)
        corner = view.rays(pixel + 0.5 * size) - view.rays(pixel)
        reach.append(depth * np.abs(np.linalg.norm(corner)))
    half = 0.5 * max(reach)  # of the diagonal: a garment is not as deep as it is wide and high together
    return middle + half * np.array([(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])


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
    box = around(views)
    maps: list[DepthMap] = []
    for view in views:
        others = [o for o in views if o is not view and np.arccos(np.clip(o.axis @ view.axis, -1, 1)) < ANGLE]
        if others:
            base, offsets = planes(view, box, others, margin=0.0, pixels=s.step)
            maps.append(sweep(view, others, base, offsets, s.window, s.least))
        if progress is not None:
            progress(1)
    if len(maps) < 2:
        raise InputError("no two views look from less than 60 degrees apart: there is nothing to compare")
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
