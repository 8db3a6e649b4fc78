"""What one linear system costs: direct solvers and multigrid against unknowns, time step and order, and where they cross.

A square of silk charmeuse, 0.3 m, hangs from two corners and has fallen for 50 ms; its tangent for a given time step is solved for
the residual of that step. ``first`` is the time of a new pattern (elimination order or symbolic factorisation included), ``again``
that of the next matrix of the same pattern; multigrid once to 1e-8 with a new hierarchy and once to 1e-2, as a Newton iteration
with adaptive tolerances asks for, with the hierarchy at hand.
"""

from __future__ import annotations

import csv
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.loads import gravity
from mfar_fem.materials.fabric import Fabric
from mfar_fem.solve.dynamics import Dynamics, DynamicsOptions
from mfar_fem.solve.integrators import step_rule
from mfar_fem.solve.linear import LinearSolver, SingularMatrixError, _pardiso, rigid_body_modes
from mfar_fem.solve.solver_choice import RULE, layout, wave_travel
from mfar_fem.supports import Support
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import strip

SIDE = 0.3
CELLS = {1: (18, 41, 71, 129, 224), 2: (10, 24, 41, 75, 129)}
"""Cells along a side for about 2k, 10k, 30k, 100k and 300k unknowns."""
STEPS = (0.5e-3, 2e-3, 20e-3, None)
"""Time steps, s; None is statics (safe tangent)."""


def hanging_square(order: int, cells: int, dt: float = 2e-3, linear_solver: str = "direct") -> Dynamics:
    """A square of silk charmeuse, flat and at rest, held by two corners under gravity."""
    surface = Surface.from_pattern(strip(SIDE, SIDE, cells, cells), order)
    x, y, _ = surface.nodes.T
    corners = np.flatnonzero((y > SIDE - 1e-9) & ((x < 1e-9) | (x > SIDE - 1e-9)))
    fabric = Fabric.load("silk-charmeuse")
    return Dynamics(surface, fabric, [Support(corners, by_node=True)], [gravity(fabric.areal_density)],
                    options=DynamicsOptions(dt=dt, linear_solver=linear_solver))


def system(dynamics: Dynamics, dt: float | None):
    """Matrix, right-hand side and rigid modes of the free unknowns for a step of ``dt`` from the present motion; None: statics."""
    problem, state = dynamics.problem, dynamics.motion.state
    if dt is None:
        dynamics.inertia.factor = 0.0
    else:
        dynamics.inertia.begin_step(step_rule("implicit-euler", dynamics.motion.kinematics, dt, 1.0), dynamics.motion.kinematics)
    g, data = problem.tangent(state, 1.0, dt is not None)
    modes = rigid_body_modes(problem.shell, state)[problem.free]
    return problem.system(data), -g[problem.free], modes


def _timed(solver: LinearSolver, A, b) -> tuple[float, float, np.ndarray]:
    clock = time.perf_counter()
    solve = solver.factor(A)
    middle = time.perf_counter()
    x = solve(b)
    return middle - clock, time.perf_counter() - middle, x


def measure(method: str, problem, A, b, modes, repeats: int = 3) -> dict:
    """Seconds of one solver for one matrix, best of ``repeats`` where the pattern is known, with iterations, residual, memory."""
    cache: dict = {}

    def solver(rtol=1e-8):
        return LinearSolver(method, modes, rtol=rtol, max_iterations=400, cache=cache, layout=layout(problem))

    first_solver = solver()
    first = sum(_timed(first_solver, A, b)[:2])
    row = {"method": method, "first_s": first, "iterations": first_solver.iterations, "iterations_loose": 0}
    later = solver(1e-2) if method == "amg" else first_solver
    if method == "amg" and first_solver.notes:
        return row | {"again_s": None, "residual": None, "memory_mb": None, "note": "; ".join(first_solver.notes)}
    times = []
    for _ in range(repeats):
        later.iterations = 0
        setup, solution, x = _timed(later, A, b)
        times.append(setup + solution)
    row["iterations_loose"] = later.iterations
    return row | {"again_s": min(times), "residual": float(np.linalg.norm(A @ x - b) / np.linalg.norm(b)),
                  "memory_mb": first_solver.memory / 1e6, "note": ""}


def run_linear_solvers(full: bool = False, cells: dict[int, Sequence[int]] | None = None, repeats: int = 3, progress=None) -> dict:
    """Measure all solvers on all sizes and time steps.

    Parameters
    ----------
    full : bool
        Also the sizes of 100k and 300k unknowns (minutes, some GB).
    cells : dict, optional
        Cells along a side by order instead of :data:`CELLS`.
    progress : callable, optional
        Called with a text after every matrix.

    Returns
    -------
    dict
        ``rows`` (order, unknowns, dt_s, travel, method, first_s, again_s, iterations to 1e-8, iterations_loose to 1e-2, residual,
        memory_mb, note) and ``crossover``: for each order, time step and direct solver the least size measured at which AMG was
        faster ``again`` (None: at none), with all time ratios; ``rule``: what ``auto`` does. The rule is
        stricter than the crossover of single systems:
        whole steps meet indefinite tangents, on which AMG falls back, and the loose solutions cost iterations.
    """
    methods = ["superlu"] + (["pardiso"] if _pardiso() is not None else []) + ["amg"]
    rows = []
    for order, sizes in (cells or {order: sizes if full else sizes[:3] for order, sizes in CELLS.items()}).items():
        for n in sizes:
            dynamics = hanging_square(order, n, dt=10e-3)
            started = dynamics.run(50e-3).converged
            for dt in STEPS:
                A, b, modes = system(dynamics, dt)
                common = {"order": order, "unknowns": A.shape[0], "dt_s": dt, "started": started,
                          "travel": wave_travel(dynamics.problem) if dt else None}
                for method in methods:
                    try:
                        rows.append(common | measure(method, dynamics.problem, A, b, modes, repeats))
                    except SingularMatrixError as error:
                        rows.append(common | {"method": method, "first_s": None, "again_s": None, "note": str(error)})
                if progress is not None:
                    progress(f"order {order}, {A.shape[0]} unknowns, " + ("statics" if dt is None else f"{1e3 * dt:g} ms"))
    return {"fabric": "silk-charmeuse", "side_m": SIDE, "rows": rows, "crossover": crossovers(rows),
            "rule": RULE}


def crossovers(rows: Sequence[dict]) -> list[dict]:
    """Where AMG overtakes each direct solver, by order and time step."""
    out = []
    times = {(r["order"], r["dt_s"], r["method"], r["unknowns"]): r["again_s"] for r in rows}
    for order, dt, direct in dict.fromkeys((r["order"], r["dt_s"], r["method"]) for r in rows if r["method"] != "amg"):
        again = {n: times.get((order, dt, "amg", n)) for (o, d, m, n) in times if (o, d, m) == (order, dt, direct)}
        ratio = {n: amg / times[order, dt, direct, n] for n, amg in sorted(again.items()) if amg and times[order, dt, direct, n]}
        slower = [n for n, r in ratio.items() if r >= 1.0]
        faster = [n for n in ratio if not slower or n > max(slower)]
        out.append({"order": order, "dt_s": dt, "direct": direct, "amg_faster_from": min(faster, default=None),
                    "amg_over_direct": ratio})
    return out


def render_linear_solvers(payload: Mapping[str, Any]) -> list:
    """Tables for the terminal."""
    from rich.table import Table

    table = Table(title="one linear system of hanging silk charmeuse, seconds", title_justify="left")
    for heading in ("order", "unknowns", "Δt ms", "solver", "first", "again", "iterations 1e-8 | 1e-2", "MB"):
        table.add_column(heading, justify="left" if heading == "solver" else "right")
    for r in payload["rows"]:
        step = "statics" if r["dt_s"] is None else f"{1e3 * r['dt_s']:g}"
        again, memory = (f"{r[key]:.3g}" if r.get(key) is not None else "fails" for key in ("again_s", "memory_mb"))
        first = "fails" if r["first_s"] is None else f"{r['first_s']:.3g}"
        iterations = f"{r['iterations']} | {r['iterations_loose']}" if r["method"] == "amg" else ""
        table.add_row(str(r["order"]), str(r["unknowns"]), step, r["method"], first, again, iterations, memory)
    lines = [payload["rule"]]
    for c in payload["crossover"]:
        step = "statics" if c["dt_s"] is None else f"{1e3 * c['dt_s']:g} ms"
        where = f"from {c['amg_faster_from']} unknowns" if c["amg_faster_from"] else "at no size measured"
        lines.append(f"order {c['order']}, {step}: AMG faster than {c['direct']} {where}")
    return [table, *lines]


def save_linear_solvers(folder: Path, payload: dict) -> list[str]:
    """Write ``linear_solvers.csv`` and the picture; returns the paths."""
    from matplotlib.figure import Figure

    table = folder / "linear_solvers.csv"
    keys = list(dict.fromkeys(key for row in payload["rows"] for key in row))
    with table.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, keys)
        writer.writeheader()
        writer.writerows(payload["rows"])
    figure = Figure(figsize=(12, 6.5), layout="constrained")
    axes = figure.subplots(2, len(STEPS), sharex=True, sharey=True)
    for i, order in enumerate((1, 2)):
        for j, dt in enumerate(STEPS):
            for method, colour in (("superlu", "C0"), ("pardiso", "C1"), ("amg", "C2")):
                rows = [r for r in payload["rows"] if (r["order"], r["dt_s"], r["method"]) == (order, dt, method) and r["again_s"]]
                axes[i, j].loglog([r["unknowns"] for r in rows], [r["again_s"] for r in rows], "o-", color=colour, label=method)
            axes[i, j].set_title(f"order {order}, " + ("statics" if dt is None else f"Δt {1e3 * dt:g} ms"), fontsize=10)
            axes[i, j].grid(True, which="both", alpha=0.3)
    for axis in axes[-1]:
        axis.set_xlabel("unknowns")
    for axis in axes[:, 0]:
        axis.set_ylabel("s, pattern known (AMG: to 1e-2)")
    axes[0, 0].legend(fontsize=8)
    picture = folder / "linear_solvers.png"
    figure.savefig(picture, dpi=130)
    return [str(table), str(picture)]
