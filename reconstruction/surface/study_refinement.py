"""Adaptive against uniform subdivision of the same mesh at the same number of triangles."""

from __future__ import annotations

from typing import Any

import numpy as np

from reconstruction.surface.analytic import Pleats, mesh_distance, sample_mesh
from reconstruction.surface.remesh import remesh
from reconstruction.surface.subdivision import Subdivided, adaptive_loop, uniform_loop
from reconstruction.surface.triangles import TriangleMesh


def base_mesh(edge: float, surface: Pleats | None = None) -> TriangleMesh:
    """Even triangles on the pleats, m."""
    surface = surface or Pleats()
    return remesh(surface.mesh(200, 60), edge)[0]


def at_count(mesh: TriangleMesh, faces: int, levels: int = 2, interpolate: bool = True) -> tuple[Subdivided, float]:
    """Adaptive mesh of about so many triangles (2 % more at most), and its angle θ, by bisection."""
    low, high = 0.01, 2.0
    best: tuple[Subdivided, float] | None = None
    for _ in range(9):
        angle = float(np.sqrt(low * high))
        made = adaptive_loop(mesh, levels=levels, angle=angle, interpolate=interpolate)
        if len(made.mesh.faces) <= 1.02 * faces:
            best, high = (made, angle), angle
        else:
            low = angle
    return best if best is not None else (adaptive_loop(mesh, levels=0), high)


def refinement(edges: tuple[float, ...] = (0.03, 0.02, 0.014), samples: int = 20_000) -> list[dict[str, Any]]:
    """Distances of the surface from the meshes.

    Returns
    -------
    list of dict
        ``edge_mm`` of the base mesh, ``mesh`` (base, uniform, adaptive, and with Loop's rule as it is), ``faces``, ``angle``
        (rad), ``mean``, ``p95``, ``largest`` in mm, over all and (``fold_mean``) over the outer tenth where the folds are
        deepest; ``limit_…``: the same from the limit surface of the base mesh (of three uniform steps), which is all that
        refinement can come nearer to; the rest is what the base mesh never knew.
    """
    surface, rows = Pleats(), []
    points, _ = sample_mesh(surface.dense, samples, np.random.default_rng(0))
    deep = points[:, 2] > 0.9 * surface.height
    for edge in edges:
        base = base_mesh(edge, surface)
        limit = sample_mesh(uniform_loop(base, 3), samples, np.random.default_rng(1))[0]
        count = 4 * len(base.faces)
        found, angle = at_count(base, count)
        plain, plain_angle = at_count(base, count, interpolate=False)
        meshes = (
            ("base", base, None),
            ("uniform", uniform_loop(base), None),
            ("adaptive", found.mesh, angle),
            ("uniform, approximating", uniform_loop(base, interpolate=False), None),
            ("adaptive, approximating", plain.mesh, plain_angle),
        )
        for name, mesh, theta in meshes:
            d = 1e3 * mesh_distance(points, mesh)
            row = {"edge_mm": 1e3 * edge, "mesh": name, "faces": len(mesh.faces), "angle": theta, "mean": float(d.mean())}
            rows.append(row | {"p95": float(np.percentile(d, 95)), "largest": float(d.max()), "fold_mean": float(d[deep].mean())})
            if "approximating" not in name:
                e = 1e3 * mesh_distance(limit, mesh)
                rows[-1] |= {
                    "limit_mean": float(e.mean()),
                    "limit_p95": float(np.percentile(e, 95)),
                    "limit_largest": float(e.max()),
                }
    return rows
