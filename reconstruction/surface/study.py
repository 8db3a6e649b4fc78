"""What the surface stage is worth, on surfaces that are known exactly."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from reconstruction.surface.analytic import SURFACES, analytic, curve_distances, mesh_distance, sample_mesh
from reconstruction.surface.connectivity import boundary_loops
from reconstruction.surface.pipeline import SurfaceResult, SurfaceSettings, build_surface
from reconstruction.surface.quality import quality, quality_picture
from reconstruction.surface.study_curvature import calibration
from reconstruction.surface.study_refinement import refinement
from reconstruction.surface.triangles import TriangleMesh

SAMPLES = 20_000
"""Points on each surface for the distances; those are exact from point to surface, so there is no floor of sampling but the
maximum is that of the sample."""
ARMS = {
    "whole": SurfaceSettings(),
    "paper": SurfaceSettings(even=False),
    "no subdivision": SurfaceSettings(adaptive=False),
    "no arap": SurfaceSettings(arap=False),
}
"""Settings compared; ``paper`` goes from Poisson straight to subdivision."""


def errors(mesh: TriangleMesh, surface, rng: np.random.Generator) -> dict[str, float]:
    """Distances in mm: of the mesh from the exact surface (``off``) and of the surface from the mesh (``missing``), mean, 95
    %, largest; rims both ways."""
    out: dict[str, float] = {}
    there, _ = sample_mesh(mesh, SAMPLES, rng)
    exact, _ = surface.sample(SAMPLES, rng)
    for name, d in (("off", surface.distance(there)), ("missing", mesh_distance(exact, mesh))):
        out |= {
            f"{name}_mean": 1e3 * float(d.mean()),
            f"{name}_95": 1e3 * float(np.percentile(d, 95)),
            f"{name}_max": 1e3 * float(d.max()),
        }
    loops = [mesh.vertices[c] for c in boundary_loops(mesh.faces)]
    if loops and surface.openings:
        rim = curve_distances(loops, surface.openings)
        out |= {"rim_mean": 1e3 * float(rim.mean()), "rim_max": 1e3 * float(rim.max())}
    return out


def one(name: str, noise: float, trimming: str, arm: str, points: int, seed: int) -> tuple[list[dict[str, Any]], SurfaceResult]:
    """Rows of one reconstruction: a row each for the trimmed Poisson surface and the final mesh."""
    surface, rng = analytic(name), np.random.default_rng(seed)
    p, n = surface.sample(points, rng)
    p = p + noise * rng.normal(size=(len(p), 1)) * n
    openings = {"closed": None, "curves": surface.openings, "distance": len(surface.openings)}[trimming]
    made = build_surface(p, n, noise or None, openings, ARMS[arm], closed=trimming == "closed")
    known = {"surface": name, "noise_mm": 1e3 * noise, "trimming": trimming, "arm": arm, "seed": seed}
    rows = []
    for stage, mesh in (("trimmed", made.trimmed), ("final", made.mesh)):
        q = quality(mesh)
        rows.append(known | {"stage": stage, "faces": q.faces, "loops": q.loops} | errors(mesh, surface, rng) | {
            "least_angle": q.least_angle, "angle_1": q.angle_1, "below_20": q.below_20, "largest_aspect": q.largest_aspect,
            "degenerate": q.degenerate, "spacing_mm": 1e3 * made.spacing, "seconds": sum(made.timings.values()),
        })  # fmt: skip
    return rows, made


def study(
    out: Path, points: int = 6000, noises: Sequence[float] = (0.0, 0.003), names: Sequence[str] = tuple(SURFACES), seeds: int = 1,
    progress: Callable[[], None] | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Reconstruct every surface with every noise and trimming, the arms on the pleats, the tables of curvature and
    refinement, a picture.

    Parameters
    ----------
    out : Path
        Folder that exists.
    points : int
        On every surface.
    noises : sequence of float
        Standard deviation along the normal, m.
    names : sequence of str
        Of :data:`reconstruction.surface.analytic.SURFACES`.
    seeds : int
    progress : callable, optional
        Called after every reconstruction and table, :func:`steps` times.

    Returns
    -------
    dict
        ``rows``, ``arms``, ``calibration``, ``refinement``, ``quality`` (of the picture), ``files``.
    """
    done = progress or (lambda: None)
    rows: list[dict[str, Any]] = []
    arms: list[dict[str, Any]] = []
    for name in names:
        for noise in noises:
            for trimming in trimmings(name):
                for seed in range(seeds):
                    rows += one(name, noise, trimming, "whole", points, seed)[0]
                    done()
    shown: SurfaceResult | None = None
    for arm in ARMS:
        new, made = one("pleats", max(noises), "curves", arm, points, 0)
        arms += new[1:]
        shown = made if arm == "whole" else shown
        done()
    table = calibration()
    done()
    fine = refinement()
    done()
    assert shown is not None
    stages = [
        ("Poisson, trimmed", shown.trimmed),
        ("even triangles", shown.even),
        ("subdivided", shown.subdivided),
        ("final", shown.mesh),
    ]
    files = {"picture": quality_picture(out / "before_after.png", stages)}
    for label, part in (("rows", rows), ("arms", arms), ("calibration", table), ("refinement", fine)):
        files[label] = out / f"{label}.csv"
        keys = list(dict.fromkeys(k for row in part for k in row))
        with files[label].open("w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, keys, restval="")
            writer.writeheader()
            writer.writerows(part)
    files["final"] = shown.mesh.write(out / "pleats.ply")
    return {"rows": rows, "arms": arms, "calibration": table, "refinement": fine, "quality": [q.to_dict() for q in shown.quality],
            "actions": list(shown.actions), "files": {k: str(v) for k, v in files.items()}}  # fmt: skip


def trimmings(name: str) -> tuple[str, ...]:
    """How a surface is opened in the study."""
    return ("curves", "distance") if analytic(name).openings else ("closed",)


def steps(noises: Sequence[float], names: Sequence[str], seeds: int) -> int:
    """Calls of ``progress``."""
    return len(noises) * seeds * sum(len(trimmings(n)) for n in names) + len(ARMS) + 2
