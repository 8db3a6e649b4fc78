"""How time and memory grow with the mesh: one implicit step of 2 ms at order 1, each size in a fresh process."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import InputError

TRIANGLES = (1_000, 3_000, 10_000, 30_000, 100_000)


def one_step(cells: int, linear_solver: str = "direct", steps: int = 2) -> dict:
    """Steps of 2 ms of the square of :mod:`mfar_fem.benchmarks.linear_solvers` and the peak memory of this process so far.

    Returns
    -------
    dict
        ``setup_s``, ``first_step_s`` (elimination order included), ``step_s`` (the fastest of the later ones), ``assembly_s`` and
        ``solve_s`` within all steps, ``iterations`` of the last, ``peak_rss_gb``.
    """
    from mfar_fem.benchmarks.linear_solvers import hanging_square

    hanging_square(1, 4, linear_solver=linear_solver).run(2e-3)  # compile
    clock = time.perf_counter()
    dynamics = hanging_square(1, cells, linear_solver=linear_solver)
    setup, times, results = time.perf_counter() - clock, [], []
    for i in range(1, steps + 2):
        clock = time.perf_counter()
        results.append(dynamics.run(2e-3 * i))
        times.append(time.perf_counter() - clock)
    return {"triangles": len(dynamics.problem.surface.elements), "unknowns": len(dynamics.problem.free), "setup_s": setup,
            "first_step_s": times[0], "step_s": min(times[1:]), "iterations": results[-1].newton_iterations,
            "assembly_s": sum(r.timings["assembly"] for r in results), "solve_s": sum(r.timings["solve"] for r in results),
            "converged": all(r.converged for r in results), "peak_rss_gb": peak_memory() / 1e9}


def peak_memory() -> int:
    """Largest resident memory of this process so far, bytes."""
    try:
        import resource
    except ImportError:  # Windows
        import psutil

        return psutil.Process().memory_info().peak_wset
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def run_scaling(triangles: Sequence[int] = TRIANGLES, linear_solver: str = "direct", progress=None) -> dict:
    """One row of :func:`one_step` a size, and the slopes of the log–log fits of time and memory over triangles.

    Raises
    ------
    InputError
        For fewer than two sizes, or a process that failed (with the end of what it said).
    """
    if len(triangles) < 2:
        raise InputError("a slope needs at least two sizes")
    rows = []
    for size in triangles:
        cells = max(2, int(np.ceil(np.sqrt(size / 2))))
        code = ("import json; from mfar_fem.benchmarks.scaling import one_step; "
                f"print(json.dumps(one_step({cells}, {linear_solver!r})))")
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
        if done.returncode:
            raise InputError(f"the run with {size} triangles failed: {done.stderr.strip()[-300:]}")
        rows.append(json.loads(done.stdout.splitlines()[-1]))
        if progress is not None:
            progress(f"{rows[-1]['triangles']} triangles")
    x = np.log([row["triangles"] for row in rows])
    slopes = {f"slope_{key}": float(np.polyfit(x, np.log([row[f"{key}_s"] for row in rows]), 1)[0])
              for key in ("setup", "first_step", "step")}
    return {"linear_solver": linear_solver, "dt_s": 2e-3, "order": 1, "rows": rows, **slopes,
            "peak_rss_gb": max(row["peak_rss_gb"] for row in rows), "converged": all(row["converged"] for row in rows)}


def render_scaling(payload: Mapping[str, Any]) -> list:
    """Table for the terminal."""
    from rich.table import Table

    table = Table(title=f"one implicit step of 2 ms at order 1, linear solver {payload['linear_solver']}", title_justify="left")
    for heading in ("triangles", "unknowns", "set-up s", "first step s", "step s", "iterations", "peak memory GB"):
        table.add_column(heading, justify="right")
    for r in payload["rows"]:
        table.add_row(str(r["triangles"]), str(r["unknowns"]), *(f"{r[key]:.3g}" for key in ("setup_s", "first_step_s", "step_s")),
                      str(r["iterations"]), f"{r['peak_rss_gb']:.2f}")
    return [table, f"time of a step grows like triangles to the {payload['slope_step']:.2f} (first step "
            f"{payload['slope_first_step']:.2f}, set-up {payload['slope_setup']:.2f})"]


def save_scaling(folder: Path, payload: dict) -> list[str]:
    """Write ``scaling.csv`` and the picture; returns the paths."""
    from matplotlib.figure import Figure

    table = folder / "scaling.csv"
    with table.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, payload["rows"][0].keys())
        writer.writeheader()
        writer.writerows(payload["rows"])
    figure = Figure(figsize=(9, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    x = [r["triangles"] for r in payload["rows"]]
    for key, text in (("setup", "set-up"), ("first_step", "first step"), ("step", "step")):
        left.loglog(x, [r[f"{key}_s"] for r in payload["rows"]], "o-", label=f"{text}, slope {payload[f'slope_{key}']:.2f}")
    left.set_ylabel("wall time, s")
    left.legend(fontsize=8)
    right.semilogx(x, [r["peak_rss_gb"] for r in payload["rows"]], "o-")
    right.set_ylabel("peak resident memory, GB")
    for axes in (left, right):
        axes.set_xlabel("triangles")
        axes.grid(True, which="both", alpha=0.3)
    figure.suptitle("one implicit step of 2 ms, order 1")
    picture = folder / "scaling.png"
    figure.savefig(picture, dpi=130)
    return [str(table), str(picture)]
