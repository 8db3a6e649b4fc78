"""What accuracy costs: a scene at several levels, meshes and time steps, each in its own process, against the finest."""

from __future__ import annotations

import multiprocessing
import resource
import time as clock
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import InputError
from mfar_fem.fidelity import LEVELS, Fidelity
from mfar_fem.scene import Output, Scene
from mfar_fem.surface.mesh import Surface

SILENT = Output(vtu=False, pictures=False, animation=False)
INSTANTS = 4
"""Equally spaced times of a run at which shapes are compared (the start excluded)."""


def ladder(scene: Scene) -> list[Fidelity]:
    """Levels to compare: every one on two meshes, the standard one with twice the step, the finest last."""
    cells, dt = scene.level.cells, scene.level.dt
    half = max(2, cells // 2)
    steps = [LEVELS["draft"].override(cells=half, dt=dt), LEVELS["draft"].override(cells=cells, dt=dt)]
    steps += [LEVELS["standard"].override(cells=half, dt=dt), LEVELS["standard"].override(cells=cells, dt=dt)]
    if not scene.to_rest:
        steps.append(LEVELS["standard"].override(cells=cells, dt=2 * dt))
    steps.append(LEVELS["reference"].override(cells=half, dt=dt))
    if not scene.to_rest:
        steps.append(LEVELS["reference"].override(cells=half, dt=0.5 * dt))
    return [*steps, LEVELS["reference"].override(cells=cells, dt=dt if scene.to_rest else 0.5 * dt)]


def tradeoff(
    scene: Scene,
    tolerance: float | None = None,
    levels: Sequence[Fidelity] | None = None,
    progress: Callable[[str], None] | None = None,
    cache: Path | None = None,
) -> dict[str, Any]:
    """Run the ladder and measure.

    Parameters
    ----------
    scene : Scene
    tolerance : float, optional
        Largest acceptable root-mean-square distance of material points from the finest run, m: a level is recommended for it.
    levels : sequence of Fidelity, optional
        Default: :func:`ladder`. The last one is the reference of the others.
    progress : callable, optional
        Called with a line of text before each run.
    cache : path, optional
        Folder in which finished runs are kept: a killed comparison goes on there.

    Returns
    -------
    dict
        ``rows`` (level, order, cells, dt, wall_s, memory_MB, error_m: root mean square, worst_m, height_error_m, status) and
        ``recommended``.

    Raises
    ------
    InputError
        Fewer than two levels, or the finest run did not converge.
    """
    levels = list(levels or ladder(scene))
    if len(levels) < 2:
        raise InputError("a comparison needs at least two levels")
    runs = []
    for level in levels:
        if progress is not None:
            progress(label(level))
        runs.append(_cached(replace(scene.with_level(level), output=SILENT), cache))
    finest = runs[-1]
    if finest["status"] != "converged":
        raise InputError(
            f"the finest run ({label(levels[-1])}) did not converge, so there is nothing to compare with: {finest['message']}"
        )
    points = sample_points(scene, levels)
    truth = [follow(scene, levels[-1], shape, points) for shape in finest["shapes"]]
    rows = []
    for level, run in zip(levels, runs, strict=True):
        row: dict[str, Any] = {
            "level": level.name,
            "order": level.order,
            "cells": level.cells,
            "dt": level.dt,
            "method": level.method,
            "label": label(level),
            "wall_s": run["wall_s"],
            "memory_MB": run["memory_MB"],
            "status": run["status"],
            "unknowns": run["unknowns"],
        }
        if run["status"] == "converged":
            gaps = [np.linalg.norm(follow(scene, level, s, points) - t, axis=1) for s, t in zip(run["shapes"], truth, strict=True)]
            heights = [
                float(abs(np.mean(follow(scene, level, s, points)[:, 2] - t[:, 2])))
                for s, t in zip(run["shapes"], truth, strict=True)
            ]
            row |= {
                "error_m": float(np.sqrt(np.mean(np.square(gaps)))),
                "worst_m": float(np.max(gaps)),
                "height_error_m": max(heights),
            }
        rows.append(row)
    return {
        "scene": scene.name,
        "fabric": scene.fabric.name,
        "reference": label(levels[-1]),
        "tolerance_m": tolerance,
        "rows": rows,
        "recommended": recommend(rows, tolerance),
    }


def recommend(rows: Sequence[dict[str, Any]], tolerance: float | None) -> dict[str, Any] | None:
    """The quickest row within the tolerance; the reference itself if no other is."""
    if tolerance is None:
        return None
    good = [r for r in rows if r.get("error_m") is not None and r["error_m"] <= tolerance]
    return min(good, key=lambda r: r["wall_s"])


def label(level: Fidelity) -> str:
    """Short name of a level with its mesh and step."""
    return f"{level.name}, {level.cells} cells, {1e3 * level.dt:g} ms"


def _cached(scene: Scene, cache: Path | None) -> dict[str, Any]:
    from mfar_fem.files import replace_file
    from mfar_fem.simulation.run import identity

    path = None if cache is None else cache / f"run-{identity(scene)}.npz"
    if path is not None and path.exists():
        with np.load(path, allow_pickle=True) as data:
            return data["run"].item()
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        run = pool.submit(run_alone, scene).result()
    if path is not None:
        replace_file(path, lambda partial: np.savez(partial, run=np.array(run, dtype=object)))
    return run


def run_alone(scene: Scene) -> dict[str, Any]:
    """Run a scene in this process: shapes (nn, 3) at the compared times, wall time without start-up, peak memory."""
    from mfar_fem.simulation.run import simulate

    before = _memory()
    if scene.to_rest:
        begin = clock.perf_counter()
        result = simulate(scene)
        return _outcome(
            [result.nodes], result.status, result.message, clock.perf_counter() - begin, before, result.payload["unknowns"]
        )
    from mfar_fem.simulation.engines import Advance, engine

    e = engine(scene)
    warm = engine(scene)
    warm.advance(scene.level.dt, lambda row: None)  # compiled kernels are loaded outside the measurement
    del warm
    begin, shapes, outcome = clock.perf_counter(), [], Advance("converged", "", 0.0)
    assert scene.duration is not None
    for i in range(INSTANTS):
        outcome = e.advance(scene.duration * (i + 1) / INSTANTS, lambda row: None)
        if outcome.status != "converged":
            break
        shapes.append(e.nodes())
    return _outcome(shapes, outcome.status, outcome.message, clock.perf_counter() - begin, before, e.summary()["unknowns"])


def _outcome(shapes, status, message, wall, before, unknowns) -> dict[str, Any]:
    return {
        "shapes": shapes,
        "status": status,
        "message": message,
        "wall_s": wall,
        "memory_MB": _memory(),
        "start_MB": before,
        "unknowns": unknowns,
    }


def _memory() -> float:
    """Peak resident memory of this process, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def sample_points(scene: Scene, levels: Sequence[Fidelity]) -> np.ndarray:
    """Material points (k, 3) that are compared: the vertices of the coarsest mesh."""
    coarsest = min(levels, key=lambda level: level.cells)
    return scene.with_level(coarsest).surface(1).vertices


def follow(scene: Scene, level: Fidelity, nodes: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Where material points (k, 3) of the reference sheet are in a run's shape (linear between nodes)."""
    surface = scene.with_level(level).surface()
    return _interpolate(surface, nodes, points)


def _interpolate(surface: Surface, nodes: np.ndarray, points: np.ndarray) -> np.ndarray:
    from trimesh import Trimesh
    from trimesh.triangles import closest_point, points_to_barycentric

    from mfar_fem.simulation.files import flat

    _, triangles, _ = flat(surface, nodes)
    reference = surface.nodes[: len(nodes)]
    mesh = Trimesh(reference, triangles, process=False)
    tree = mesh.triangles_center
    from scipy.spatial import cKDTree

    _, near = cKDTree(tree).query(points, k=min(12, len(tree)))
    near = np.atleast_2d(near)
    best, gap = np.zeros((len(points), 3)), np.full(len(points), np.inf)
    for column in near.T:
        corners = mesh.triangles[column]
        at = closest_point(corners, points)
        d = np.linalg.norm(at - points, axis=1)
        better = d < gap - 1e-12
        weights = points_to_barycentric(corners[better], at[better])
        best[better] = np.einsum("pi,pic->pc", weights, nodes[triangles[column[better]]])
        gap[better] = d[better]
    return best


def plot(payload: dict[str, Any], path: Path) -> Path:
    """Work–precision plot: error against wall time, one mark a run, the recommendation circled."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 5), dpi=120, layout="constrained")
    ax = figure.add_subplot()
    colours = {"draft": "tab:orange", "standard": "tab:blue", "reference": "tab:green"}
    seen = set()
    for row in payload["rows"]:
        if not row.get("error_m"):
            continue
        name = row["level"]
        ax.loglog(row["wall_s"], 1e3 * row["error_m"], "o", color=colours.get(name, "k"), label=None if name in seen else name)
        ax.annotate(
            f"{row['cells']} cells, {1e3 * row['dt']:g} ms\n{row['memory_MB']:.0f} MB",
            (row["wall_s"], 1e3 * row["error_m"]),
            xytext=(7, 3),
            textcoords="offset points",
            fontsize=8,
        )
        seen.add(name)
    if payload["tolerance_m"]:
        ax.axhline(1e3 * payload["tolerance_m"], color="k", lw=0.8, ls="--")
        ax.text(0.01, 1e3 * payload["tolerance_m"], " tolerance", va="bottom", fontsize=8, transform=ax.get_yaxis_transform())
    chosen = payload["recommended"]
    if chosen and chosen.get("error_m"):
        ax.loglog(chosen["wall_s"], 1e3 * chosen["error_m"], "o", ms=15, mfc="none", mec="k")
    finest = payload["rows"][-1]
    ax.axvline(finest["wall_s"], color="tab:green", lw=0.8, ls=":")
    ax.set(
        xlabel="wall time, s",
        ylabel=f"distance from the finest run, mm (root mean square)\n[{payload['reference']}: dotted]",
        title=f"{payload['scene']}: what accuracy costs",
    )
    ax.margins(0.18)
    ax.grid(True, which="both", alpha=0.25)
    ax.legend(loc="lower left")
    figure.savefig(path)
    return path
