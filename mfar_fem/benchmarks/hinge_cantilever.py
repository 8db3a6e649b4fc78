"""What accuracy costs: error of the heavy elastica's chord angle against wall time, orders 1 and 2 beside the hinge model."""

from __future__ import annotations

import csv
import time
from pathlib import Path

import numpy as np

from mfar_fem.benchmarks.case import warm_up
from mfar_fem.benchmarks.heavy_elastica import LENGTH, THICKNESS, WEIGHT, WIDTH, fabric
from mfar_fem.benchmarks.hinge import HingeBending
from mfar_fem.loads import area_load
from mfar_fem.solve import Problem, solve_static
from mfar_fem.supports import Clamp, Support
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import rectangle

REFERENCE = 41.5
MESHES = {"order 2": ((4, 1), (8, 2), (16, 4)), "order 1": ((8, 2), (16, 4), (32, 8), (64, 16)),
          "hinge": ((8, 2), (16, 4), (32, 8), (48, 12))}
PATTERNS = ("right", "jitter")
NOTE = ("the hinge model is written in numpy, its time is not that of an optimised code; what the picture shows is that its error "
        "falls only slowly and, on a regular mesh, to a few degrees instead of zero")


def build(model: str, nx: int, ny: int, pattern: str) -> tuple[Problem, np.ndarray]:
    """The strip of the heavy elastica and the vertices of its free end; the hinge model's strip has one more row, held."""
    dx = LENGTH / nx
    ahead = 1 if model == "hinge" else 0
    jitter = 0.3 if pattern == "jitter" else None
    mesh = rectangle(nx + ahead, ny, (-ahead * dx, LENGTH), (0.0, WIDTH), pattern=pattern, jitter=jitter)
    if ahead:  # jittered vertices near the clamp are put on it
        row = np.abs(mesh.vertices[:, 0]) < 0.5 * dx
        mesh.vertices[row, 0] = mesh.uv[row, 0] = 0.0
    surface = Surface.from_pattern(mesh, 2 if model == "order 2" else 1)
    loads: list = [area_load((0.0, 0.0, -WEIGHT))]
    sheet = fabric()
    if model == "hinge":
        held = np.flatnonzero(surface.nodes[:, 0] < 1e-9 * LENGTH)
        loads.append(HingeBending(sheet.bending.warp))
        return Problem(surface, sheet, [Support(held, by_node=True)], loads, bending=False), surface.boundary["right"]
    return Problem(surface, sheet, [Clamp("left")], loads), surface.boundary["right"]


def run_one(model: str, nx: int, ny: int, pattern: str) -> dict:
    """Chord angle (°), error, iterations and wall time of one model on one mesh."""
    clock = time.perf_counter()
    problem, tip = build(model, nx, ny, pattern)
    result = solve_static(problem, [1.0], initial_step=0.25)
    wall = time.perf_counter() - clock
    x = problem.shell.positions(result.state)[tip].mean(axis=0)
    chord = float(np.degrees(np.arctan2(-x[2], x[0])))
    return {"model": model, "pattern": pattern, "mesh": f"{nx}x{ny} {pattern}", "elements": len(problem.surface.elements),
            "unknowns": len(problem.free), "chord": chord, "error": chord - REFERENCE, "wall_s": wall,
            "iterations": result.newton_iterations + result.wasted_iterations,
            "converged": result.converged, "status": result.status}


def run_comparison(progress=None, meshes=MESHES, patterns=PATTERNS) -> dict:
    """All models on all meshes: ``rows`` of :func:`run_one`, ``reference`` (°), ``converged`` (all of them), ``note``."""
    for order in (1, 2):
        warm_up(order)
    rows = []
    for model, sizes in meshes.items():
        for pattern in patterns:
            for nx, ny in sizes:
                rows.append(run_one(model, nx, ny, pattern))
                if progress is not None:
                    progress(f"{model} {rows[-1]['mesh']}")
    return {"reference": REFERENCE, "thickness_over_length": THICKNESS / LENGTH, "rows": rows,
            "converged": all(row["converged"] for row in rows), "note": NOTE}


def save_comparison(folder: Path, payload: dict) -> list[str]:
    """Write ``hinge_cantilever.csv`` and the picture; returns the paths."""
    from matplotlib.figure import Figure

    table = folder / "hinge_cantilever.csv"
    with table.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, payload["rows"][0].keys())
        writer.writeheader()
        writer.writerows(payload["rows"])
    figure = Figure(figsize=(7, 5), layout="constrained")
    axes = figure.add_subplot()
    colours = {"order 2": "C0", "order 1": "C1", "hinge": "C3"}
    for model, colour in colours.items():
        for pattern, style in zip(PATTERNS, ("-", "--"), strict=True):
            rows = [r for r in payload["rows"] if r["model"] == model and r["pattern"] == pattern and r["converged"]]
            if rows:
                wall, error = [r["wall_s"] for r in rows], [abs(r["error"]) for r in rows]
                axes.loglog(wall, error, style, marker="o", color=colour, label=f"{model}, {pattern} mesh")
                for r in rows:
                    axes.annotate(r["mesh"].split()[0], (r["wall_s"], abs(r["error"])), fontsize=7, xytext=(4, 4),
                                  textcoords="offset points")
    axes.set_xlabel("wall time, s")
    axes.set_ylabel("error of the chord angle (exact 41.5°), °")
    axes.set_title("heavy elastica: what accuracy costs")
    axes.grid(True, which="both", alpha=0.3)
    axes.legend(fontsize=8, loc="center right", bbox_to_anchor=(1.0, 0.66))
    picture = folder / "hinge_cantilever.png"
    figure.savefig(picture, dpi=130)
    return [str(table), str(picture)]
