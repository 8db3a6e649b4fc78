"""How near restored shapes come to the truth of synthetic garments: the method, its controls, oracles, and multi-view stereo."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import MfarError, MissingDependencyError
from reconstruction.baselines.mvs import mvs
from reconstruction.keypoints_file import read_keypoints
from reconstruction.metrics.distance import distances
from reconstruction.restore.pipeline import calibrated_views, stature
from reconstruction.shape.evidence import Caster
from reconstruction.shape.fit import FitSettings, fit_shape
from reconstruction.shape.landmarks3d import SpacePoints, triangulate
from reconstruction.shape.simulation_mesh import simulation_mesh
from reconstruction.sources import read
from reconstruction.style.bootstrap import mean_interval
from reconstruction.surface.pipeline import SurfaceSettings
from reconstruction.surface.triangles import TriangleMesh
from reconstruction.template.pipeline import make_template

METHODS = {
    "restored": "template, landmarks, outlines and stereo",
    "template only": "template hung on the landmarks; no outline, no depth",
    "outlines only": "the same with outlines, without depths",
    "true points": "as restored, with the true landmarks, in the pictures (for the template) and in space (oracle)",
    "true depth": "as restored, with the true depths of the same pictures (oracle)",
    "poisson": "as restored, then (9) through its points, trimmed, remeshed, ARAP",
    "poisson without ARAP": "the same without the improvement of triangles",
    "poisson adaptive": "the same, remeshed half as coarse again, adaptive Loop subdivision, ARAP",
    "poisson uniform": "the same, remeshed half as coarse again, every triangle split once, ARAP",
    "MVS": "plane sweep, consistency, fusion, Poisson; no template",
    "Pix2Vex": "smooth differentiable renderer, from a sphere; no template",
    "Pix2Vex from template": "the same from the template hung on the landmarks (edges of 60 mm)",
}
"""What is compared."""
COARSE = 0.06
"""Edges of the template that Pix2Vex starts from, m: what it can draw in the time."""
ORACLE_SIGMA = 1e-3
"""Standard deviation given to oracles, m."""


def compare(
    folder: Path, detected: Path, garment: str, edge: float, methods: Sequence[str] = tuple(METHODS), meshes: Path | None = None
) -> list[dict[str, Any]]:
    """Rows of one case of ``mfar benchmark-case``: ``method``, distances in mm, ``seconds``; ``why`` where a method failed.

    What each method made is written to `meshes` as ``<method>.ply``.
    """
    sources, points = read(folder), read_keypoints(detected)
    views, pixels, sigma = calibrated_views(sources, points)
    with np.load(folder / "truth" / "geometry.npz") as stored:
        truth = TriangleMesh(stored["vertices"], stored["faces"])
        true_points = SpacePoints(stored["keypoints"], np.full(12, ORACLE_SIGMA), np.full(12, len(views)))
    dimensions = make_template(points, garment, weighting="precision").dimensions
    drawn = read_keypoints(folder / "truth" / "keypoints.json")
    found = triangulate([v.camera for v in views], pixels, sigma)
    exact, caster = {}, Caster(truth)
    for view in views:
        _, depth, _ = caster.cast(view, 1)
        exact[view.name] = (np.where(np.isfinite(depth), depth, np.nan), np.full(view.size, ORACLE_SIGMA))
    settings = {
        "template only": FitSettings(edge=edge, outlines=False, depths=False),
        "outlines only": FitSettings(edge=edge, depths=False),
    }

    def fit(method: str):
        oracle = method == "true points"
        cut = make_template(drawn, garment, weighting="precision").dimensions if oracle else dimensions
        return fit_shape(garment, cut, true_points if oracle else found, views, stature(sources),
                         settings.get(method, FitSettings(edge=edge)), given=exact if method == "true depth" else None)  # fmt: skip

    rows, fitted, surfaces = [], None, _surfaces(edge)
    for method in methods:
        begin = time.perf_counter()
        row: dict[str, Any] = {"garment": garment, "method": method}
        try:
            if method == "MVS":
                mesh = mvs(views).mesh
            elif method == "Pix2Vex":
                from reconstruction.baselines.pix2vex import pix2vex  # asks for torch

                mesh = pix2vex(views).mesh
            elif method == "Pix2Vex from template":
                from reconstruction.baselines.pix2vex import pix2vex

                hung = fit_shape(garment, dimensions, found, views, stature(sources),
                                 FitSettings(edge=COARSE, outlines=False, depths=False))  # fmt: skip
                mesh = pix2vex(views, hung.sewn.mesh(hung.vertices)).mesh
            elif method in surfaces:
                fitted = fitted or fit("restored")
                begin = time.perf_counter()  # of what it adds
                mesh = _poisson(fitted, edge, surfaces[method])
            else:
                shape = fit(method)
                mesh = shape.sewn.mesh(shape.vertices)
                if method == "restored":
                    fitted = shape
            seconds = time.perf_counter() - begin
            if meshes is not None:
                meshes.mkdir(parents=True, exist_ok=True)
                mesh.write(meshes / f"{method.replace(' ', '-')}.ply")
            rows.append(row | distances(mesh, truth) | {"seconds": seconds, "why": ""})
        except MissingDependencyError:
            raise  # says nothing of the method, and is not to be kept
        except MfarError as error:
            rows.append(row | {"seconds": time.perf_counter() - begin, "why": str(error)})
    return rows


def _surfaces(edge: float) -> dict[str, SurfaceSettings]:
    """How the Poisson surface and its controls are made."""
    coarse = 1.5 * edge
    return {
        "poisson": SurfaceSettings(edge=edge, adaptive=False),
        "poisson without ARAP": SurfaceSettings(edge=edge, adaptive=False, arap=False),
        "poisson adaptive": SurfaceSettings(edge=coarse),
        "poisson uniform": SurfaceSettings(edge=coarse, adaptive=False, uniform=1),
    }


def _poisson(shape, edge: float, settings: SurfaceSettings) -> TriangleMesh:
    known = {
        "vertices": shape.vertices,
        "faces": shape.sewn.faces,
        "warp": shape.sewn.warp_in_space(shape.vertices),
        "sigma": shape.sigma,
    }
    return simulation_mesh(known, "poisson", edge, settings).mesh


def study(out: Path, garments: Sequence[str], seeds: Sequence[int], edge: float = 0.03, methods: Sequence[str] = tuple(METHODS),
          progress: Callable[[], None] | None = None, around: int = 0) -> dict[str, Any]:  # fmt: skip
    """Cases of several garments and seeds, kept in ``out`` and gone on with, and what came of them; `around` as in
    :func:`reconstruction.benchmark.case.make_case`.

    Returns
    -------
    dict
        ``rows`` (:func:`compare`, with ``seed``), ``summary`` (by garment and method: mean distance with its 95 % interval over the
        seeds, and the difference to ``restored`` with its paired interval).
    """
    from reconstruction.benchmark.case import make_case
    from reconstruction.keypoints.locate import FILE, locate

    rows: list[dict[str, Any]] = []
    for seed in seeds:
        for garment in garments:
            folder = out / "cases" / case_name(garment, seed, around)
            if not (folder / "sources.toml").exists():
                make_case(folder, garment, seed, around=around)
            points = out / "keypoints" / folder.name
            if not (points / FILE).exists():
                locate([folder], points, garment=garment)
            kept = out / "rows" / f"{folder.name}-{1e3 * edge:g}mm.json"
            known = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else []
            missing = [m for m in methods if m not in {row["method"] for row in known}]
            if missing:
                more = compare(folder, points / FILE, garment, edge, missing, out / "meshes" / kept.stem)
                known += [{"seed": seed, "edge_mm": 1e3 * edge} | row for row in more]
                kept.parent.mkdir(parents=True, exist_ok=True)
                kept.write_text(json.dumps(known, indent=1), encoding="utf-8")
            rows += [row for row in known if row["method"] in methods]
            if progress is not None:
                progress()
    return {"rows": rows, "summary": summary(rows)}


def case_name(garment: str, seed: int, around: int = 0) -> str:
    """Name of a case's folders: cases of other pictures are other cases."""
    return f"{garment}-{seed}" + (f"-around{around}" if around else "")


def summary(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """By garment and method: means over the seeds with 95 % intervals, and paired differences to ``restored``, mm."""
    out = []
    for garment in dict.fromkeys(row["garment"] for row in rows):
        base = {
            row["seed"]: row["mean"] for row in rows if row["garment"] == garment and row["method"] == "restored" and not row["why"]
        }
        for method in dict.fromkeys(row["method"] for row in rows if row["garment"] == garment):
            mine = [row for row in rows if row["garment"] == garment and row["method"] == method]
            good = [row for row in mine if not row["why"]]
            entry: dict[str, Any] = {"garment": garment, "method": method, "cases": len(mine), "failed": len(mine) - len(good)}
            if good:
                seeds = np.array([row["seed"] for row in good])
                entry |= _interval("mean", [row["mean"] for row in good], seeds)
                for name in ("off_mean", "off_median", "missing_mean", "missing_95", "largest", "rim_mean", "floor", "seconds"):
                    values = [row[name] for row in good if name in row]
                    entry[name] = float(np.mean(values)) if values else None
                paired = [row for row in good if row["seed"] in base]
                if method != "restored" and paired:
                    entry |= _interval(
                        "worse_by", [row["mean"] - base[row["seed"]] for row in paired], np.array([r["seed"] for r in paired])
                    )
            out.append(entry)
    return out


def _interval(name: str, values: Sequence[float], groups: np.ndarray) -> dict[str, float]:
    found = mean_interval(np.asarray(values), groups)
    return {name: found.value, f"{name}_low": found.low, f"{name}_high": found.high}
