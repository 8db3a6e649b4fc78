"""What all benchmarks share: a case, its run, its references, and the isotropic sheet they are made of."""

from __future__ import annotations

import csv
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.resources import files

import numpy as np

from mfar_fem.benchmarks.downhill import solve_downhill
from mfar_fem.benchmarks.linear import solve_linear
from mfar_fem.errors import InputError
from mfar_fem.materials.bending import Bending
from mfar_fem.materials.fabric import Fabric
from mfar_fem.materials.st_venant_kirchhoff import StVenantKirchhoff
from mfar_fem.shell import Shell, State
from mfar_fem.solve import NewtonOptions, Problem, solve_static
from mfar_fem.solve.newton import DEFAULT_OPTIONS

Measure = Callable[[Shell, State], dict[str, float]]


@dataclass(frozen=True)
class Case:
    """A benchmark on one mesh.

    Attributes
    ----------
    problem : Problem
    measure : callable
        ``measure(shell, state) -> {quantity: value}``.
    references : callable
        ``references() -> (reference, others)``: the reference of every quantity at the last load factor, and
        ``{source: {quantity: value}}`` of further ones. Called after the solution, outside its time.
    source : str
        Where the reference comes from.
    scale : dict
        What the error of a quantity is divided by, where that is not the reference itself (a reference of zero).
    levels, initial_step, quick
        Of :func:`mfar_fem.solve.solve_static`.
    note : str
        What a reader must know of the model.
    linear : bool
        Small displacements: one linear step from the reference state.
    downhill : bool
        Levels by descent of the energy, see :mod:`mfar_fem.benchmarks.downhill`.
    """

    problem: Problem
    measure: Measure
    references: Callable[[], tuple[dict[str, float], dict[str, dict[str, float]]]]
    source: str
    scale: dict[str, float] = field(default_factory=dict)
    levels: tuple[float, ...] = (1.0,)
    initial_step: float | None = None
    quick: int = 8
    options: NewtonOptions = DEFAULT_OPTIONS
    note: str = ""
    linear: bool = False
    downhill: bool = False


def sheet(E: float, nu: float, h: float) -> Fabric:
    """Isotropic sheet: St. Venant–Kirchhoff membrane and Kirchhoff bending of Young's modulus E (Pa) and thickness h (m)."""
    return Fabric("isotropic sheet", StVenantKirchhoff.isotropic(E, nu), h, 1.0, Bending.isotropic(E, nu, h))


def table(benchmark: str, source: str) -> dict[str, np.ndarray]:
    """Columns of ``references.csv``: ``{quantity: (m, 2) array of load factor and value}`` of one source."""
    text = files(__package__).joinpath("references.csv").read_text(encoding="utf-8")
    rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    found: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        if row["benchmark"] == benchmark and row["source"] == source:
            found.setdefault(row["quantity"], []).append((float(row["load_factor"]), float(row["value"])))
    if not found:
        raise InputError(f"references.csv has nothing on '{benchmark}' from '{source}'")
    return {name: np.array(values) for name, values in found.items()}


def final(benchmark: str, source: str) -> dict[str, float]:
    """Reference values at the highest load factor of :func:`table`."""
    return {name: float(values[values[:, 0].argmax(), 1]) for name, values in table(benchmark, source).items()}


def warm_up(order: int) -> None:
    """Load (or compile) kernels of one order and the direct solver, so that a clock started afterwards measures the work."""
    from scipy.sparse import eye_array

    from mfar_fem.solve.linear import LinearSolver
    from mfar_fem.surface import Surface
    from mfar_fem.surface.patterns import strip

    problem = Problem(Surface.from_pattern(strip(1.0, 1.0, 1, 1), order), sheet(1.0, 0.0, 0.1))
    problem.tangent(problem.start(), 0.0, True)
    problem.energy(problem.start(), 0.0)
    LinearSolver().factor(eye_array(4, format="csr"))(np.ones(4))


def run_case(name: str, order: int, mesh: tuple[int, int], build: Callable[[], Case], progress=None) -> dict:
    """Build and solve a case.

    Returns
    -------
    dict
        ``values``, ``reference``, ``error_percent`` (by quantity, signed), ``newton_iterations`` (of accepted steps),
        ``wasted_iterations`` (of steps that were cut), ``load_steps``, ``assembly_ms_per_iteration``,
        ``solve_ms_per_iteration``, ``wall_s`` (mesh, assembly, solution; kernels loaded before), ``elements``,
        ``unknowns``, ``residual`` (N), ``residual_relative``, ``converged``, ``status``, ``load_factor`` (reached),
        ``path`` (quantities at every accepted step), and the sources. A run that did not converge has the values at the
        load factor reached and no error.
    """
    warm_up(order)
    clock = time.perf_counter()
    case = build()
    if case.linear:
        result = solve_linear(case.problem)
    elif case.downhill:
        result = solve_downhill(case.problem, case.levels, progress=progress)
    else:
        result = solve_static(case.problem, case.levels, case.options, initial_step=case.initial_step, quick=case.quick,
                              progress=progress)
    wall = time.perf_counter() - clock
    reference, others = case.references()
    values = case.measure(case.problem.shell, result.state)
    iterations = result.newton_iterations + result.wasted_iterations
    last = result.steps[-1]
    path = [{"load_factor": step.lam, "iterations": step.iterations, **case.measure(case.problem.shell, step.state)}
            for step in result.steps]
    return {
        "benchmark": name, "order": order, "mesh": f"{mesh[0]}x{mesh[1]}",
        "values": values, "reference": reference,
        "error_percent": _errors(values, reference, case.scale) if result.converged else None,
        "newton_iterations": result.newton_iterations, "wasted_iterations": result.wasted_iterations,
        "load_steps": sum(step.iterations > 0 for step in result.steps),
        "assembly_ms_per_iteration": 1e3 * result.timings["assembly"] / max(result.assemblies, 1),
        "solve_ms_per_iteration": 1e3 * result.timings["solve"] / max(iterations, 1),
        "wall_s": wall, "elements": len(case.problem.surface.elements), "unknowns": len(case.problem.free),
        "residual": last.residual, "residual_relative": last.residual_relative,
        "converged": result.converged, "status": result.status, "message": result.message,
        "load_factor": last.lam, "notes": list(result.notes),
        "source": case.source, "other_references": others, "model": case.note, "path": path,
    }


def _errors(values, reference, scale) -> dict[str, float]:
    return {k: 100.0 * (values[k] - r) / scale.get(k, abs(r) or 1.0) for k, r in reference.items()}
