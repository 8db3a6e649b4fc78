"""Exact sensitivities against central differences, and that they do not depend on the load steps that led to the state.

Strips between grips (force by every parameter of the law, in warp, weft and on the bias) and a drooping cantilever on the bias
(deflection of the tip by every rigidity). The differences are central ones at two steps, extrapolated (Richardson), of states
converged to rounding.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from calibration.experiments import DIRECTIONS
from mfar_fem.errors import NotConvergedError, ParameterError

if TYPE_CHECKING:
    from mfar_fem.materials.fabric import Fabric
    from mfar_fem.solve import Problem

TOLERANCE = 1e-5
STEPS = (1, 5, 20)
STRAIN = {"eight-chain-silk": (0.2, 0.2, 0.2), "yarn-network": (0.03, 0.03, 0.12)}
"""Laws of the strips and their strains along warp, weft and bias."""

FABRICS = {"eight-chain-silk": "paper-silk", "yarn-network": "cupro-su1098"}
SMALL = 1e-4
"""Derivatives (times parameter) below this fraction of the value are compared with that fraction instead of with themselves."""


@dataclass(frozen=True)
class Case:
    """A boundary-value problem, the load factor to reach and the number read from it.

    ``read(problem, state, lam)`` is the value; ``slope(problem, sensitivity)`` its derivatives (p,).
    """

    name: str
    fabric: Fabric
    problem: Problem
    load: float
    names: tuple[str, ...]
    read: Callable
    slope: Callable


def strip_case(law_name: str, direction: str, strain: float, fidelity: str = "draft") -> Case:
    """Force over width of a clamped strip, N/m."""
    from material_tests.strip.fe import StripTest
    from mfar_fem.materials import get_law
    from mfar_fem.materials.fabric import Fabric

    fabric = Fabric.load(FABRICS[law_name])
    if fabric.law.name != law_name:
        fabric = fabric.replace(law=get_law(law_name))
    test = StripTest(0.08, 0.05, DIRECTIONS[direction], fidelity)
    problem = test.problem(fabric)
    grip = 3 * problem.surface.nodes_of("right")
    scale = (2.0 if test.quarter(fabric.law) else 1.0) / test.width
    return Case(f"strip, {law_name}, {direction}", fabric, problem, strain, tuple(f"law.{p.name}" for p in fabric.law.parameters),
                lambda problem, state, lam: scale * problem.gradient(state, lam)[grip].sum(),
                lambda problem, s: scale * s.reaction[grip].sum(axis=0))


def cantilever_case(length: float = 0.06, width: float = 0.025) -> Case:
    """Deflection (m) of the tip of a strip cut on the bias under its own weight."""
    from mfar_fem.loads import gravity
    from mfar_fem.materials.fabric import Fabric
    from mfar_fem.solve import Problem
    from mfar_fem.supports import Clamp
    from mfar_fem.surface import Surface, patterns
    from mfar_fem.units import STANDARD_GRAVITY

    fabric = Fabric.load("cupro-su1098")
    warp = np.array([math.sqrt(0.5), -math.sqrt(0.5), 0.0])
    surface = Surface.from_pattern(patterns.strip(length, width, 8, 2, "union"), 2, warp)
    problem = Problem(surface, fabric, [Clamp("left")], [gravity(fabric.areal_density, (0.0, 0.0, -STANDARD_GRAVITY))])
    tip = 3 * int(surface.boundary["right"][0]) + 2
    names = tuple(f"bending.{k}" for k in ("warp", "weft", "twist", "coupling"))
    return Case("cantilever on the bias", fabric, problem, 1.0, names,
                lambda problem, state, lam: state.u[tip], lambda problem, s: s.state[tip])


def cases() -> list[Case]:
    """All cases of the study."""
    strips = [strip_case(law, d, e) for law, strains in STRAIN.items() for d, e in zip(DIRECTIONS, strains, strict=True)]
    return [*strips, cantilever_case()]


def changed(fabric, name: str, change: float):
    """The fabric with one parameter moved by `change` (SI)."""
    kind, _, key = name.partition(".")
    if kind == "law":
        return fabric.replace(law=fabric.law.replace(**{key: fabric.law.values[key] + change}))
    return fabric.replace(bending=replace(fabric.bending, **{key: getattr(fabric.bending, key) + change}))


def size_of(fabric, name: str) -> float:
    """Size of a parameter, by which it is moved (a coupling of zero: the mean rigidity)."""
    kind, _, key = name.partition(".")
    value = abs(fabric.law.values[key] if kind == "law" else getattr(fabric.bending, key))
    return value or math.sqrt(fabric.bending.warp * fabric.bending.weft) if kind == "bending" else value or 1.0


def _solved(case: Case, steps: int):
    from mfar_fem.solve import NewtonOptions, solve_static

    options = NewtonOptions(rtol=1e-11, atol=1e-14)
    levels = case.load * np.arange(1, steps + 1) / steps
    result = solve_static(case.problem, levels, options)
    if not result.converged:
        raise NotConvergedError(f"{case.name} in {steps} load steps: {result.message}")
    return result


def _value_at(case: Case, fabric, state) -> float:
    """The value for another fabric, from the state of the first."""
    from mfar_fem.solve import NewtonOptions, solve_static

    problem = case.problem.with_fabric(fabric)
    near = case.load * (1.0 - 1e-12)
    result = solve_static(problem, [case.load], NewtonOptions(rtol=1e-12, atol=1e-15), state, near)
    if not result.converged:
        result = solve_static(problem, [case.load], NewtonOptions(rtol=1e-10, atol=1e-13), state, near)
    if not result.converged:
        raise NotConvergedError(f"{case.name} with a parameter moved: {result.message}")
    return case.read(problem, result.state, case.load)


def central(case: Case, name: str, state, step: float) -> tuple[float | None, str]:
    """Derivative by central differences at `step` and half of it, extrapolated; None where a bound is in the way."""
    h = step * size_of(case.fabric, name)

    def difference(h):
        up, down = (_value_at(case, changed(case.fabric, name, sign * h), state) for sign in (1, -1))
        return (up - down) / (2 * h)

    try:
        coarse, fine = difference(h), difference(0.5 * h)
    except ParameterError as error:
        return None, str(error)
    return (4 * fine - coarse) / 3, ""


def run_case(case: Case, step: float = 2e-3, load_steps=STEPS) -> dict:
    """Compare one case."""
    from mfar_fem.solve.sensitivity import sensitivity

    exact = []
    for n in load_steps:
        result = _solved(case, n)
        exact.append(case.slope(case.problem, sensitivity(case.problem, result.state, case.load, case.names)))
    state = result.state
    value = case.read(case.problem, state, case.load)
    rows = []
    for k, name in enumerate(case.names):
        size = size_of(case.fabric, name)
        found, note = central(case, name, state, step)
        floor = SMALL * abs(value) / size
        here = exact[-1][k]
        row = {"parameter": name, "exact": here, "central_difference": found, "relative_deviation": None, "note": note,
               "share_of_value": here * size / value,
               "load_step_deviation": float(max(abs(e[k] - here) for e in exact) / max(abs(here), floor))}
        if found is not None:
            row["relative_deviation"] = float(abs(here - found) / max(abs(found), floor))
        rows.append(row)
    compared = [r["relative_deviation"] for r in rows if r["relative_deviation"] is not None]
    return {"case": case.name, "load": case.load, "value": value, "parameters": rows,
            "max_relative_deviation": max(compared), "max_load_step_deviation": max(r["load_step_deviation"] for r in rows)}


def run(*, only=None, load_steps=STEPS, progress=None) -> dict:
    """The whole study: ``max_relative_deviation`` and ``max_load_step_deviation`` over all cases, and every row.

    Parameters
    ----------
    only : sequence of Case, optional
        Instead of all cases.
    progress : callable, optional
        ``progress(case, done, total)``.
    """
    clock = time.perf_counter()
    chosen, rows = list(only or cases()), []
    for k, case in enumerate(chosen):
        if progress is not None:
            progress(case.name, k, len(chosen))
        rows.append(run_case(case, load_steps=load_steps))
    worst, steps = (max(r[key] for r in rows) for key in ("max_relative_deviation", "max_load_step_deviation"))
    words = [f"Exact sensitivities differ from central differences by {worst:.1e} at most (tolerance {TOLERANCE:g}) over "
             f"{sum(len(r['parameters']) for r in rows)} derivatives; those under {SMALL:g} of the value (per relative change of "
             "the parameter) are compared with that.",
             f"They do not depend on the load steps: {', '.join(map(str, load_steps))} steps agree to {steps:.1e}."]
    return {"max_relative_deviation": worst, "max_load_step_deviation": steps, "tolerance": TOLERANCE,
            "load_steps": list(load_steps), "passed": bool(worst <= TOLERANCE and steps <= TOLERANCE), "cases": rows,
            "words": words, "wall_s": time.perf_counter() - clock}
