"""Static equilibrium by load steps that adapt: cut back on failure, grow when Newton is quick, hit every level asked for."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from mfar_fem.errors import InputError
from mfar_fem.result import LoadStep, StaticResult
from mfar_fem.shell import State
from mfar_fem.solve.linear import SingularMatrixError, rigid_body_modes
from mfar_fem.solve.newton import DEFAULT_OPTIONS, NewtonOptions, NewtonResult, _solver, newton
from mfar_fem.solve.problem import Problem


def solve_static(problem: Problem, levels: int | Sequence[float] | np.ndarray = 1, options: NewtonOptions = DEFAULT_OPTIONS,
                 start: State | None = None, start_lam: float = 0.0, initial_step: float | None = None,
                 min_step: float = 1e-7, quick: int = 8,
                 progress: Callable[[float], None] | None = None) -> StaticResult:
    """Follow the equilibrium from ``start`` through the load factors ``levels``.

    Parameters
    ----------
    problem : Problem
    levels : int or sequence of float
        Load factors to reach exactly, in order, or a number of equal steps to 1. Between them steps adapt.
    options : NewtonOptions
    start : State, optional
        Default: the reference state.
    initial_step : float, optional
        First step of the load factor; default: the first level.
    min_step : float
        Below this step the run ends with the named failure and the last converged state.
    quick : int
        Steps that took at most this many iterations grow by a half.
    progress : callable, optional
        Called with the load factor of every accepted step.

    Returns
    -------
    StaticResult
        Never raises for a failure to converge: see ``status``.
    """
    targets = np.arange(1, levels + 1) / levels if isinstance(levels, int) else np.asarray(levels, dtype=float)
    if len(targets) == 0 or not np.all(np.isfinite(targets)):
        raise InputError("levels must be a positive number of steps or a sequence of finite load factors")
    clock = time.perf_counter()
    state, lam = start or problem.start(), float(start_lam)
    step = abs(initial_step) if initial_step else None
    steps: list[LoadStep] = [_record(problem, state, lam, None, False)]
    notes: list[str] = []
    iterations = wasted = assemblies = cuts = 0
    timings = {"assembly": 0.0, "solve": 0.0}
    status = "converged"
    previous: tuple[State, float] | None = None
    for level in targets:
        while lam != level and status == "converged":
            direction = np.sign(level - lam)
            if step is None:
                step = abs(level - lam)
            target = level if abs(level - lam) <= step * (1 + 1e-9) else lam + direction * step
            if target != level and abs(level - target) < 0.1 * step:
                target = 0.5 * (lam + level)
            guess = _predict(problem, state, lam, target, previous, options)
            descend = cuts >= options.plain_cuts or options.plain_iterations == 0 or options.tangent == "safe"
            result = newton(problem, guess, target, options, descend) if guess is not None else None
            if result is not None:
                assemblies += result.assemblies
                timings["assembly"] += result.assembly_s
                timings["solve"] += result.solve_s
                notes += result.notes
            if result is not None and result.converged:
                previous, cuts = (state, lam), 0
                taken = abs(target - lam)
                state, lam = problem.shell.accept(result.state), float(target)
                iterations += result.iterations
                steps.append(_record(problem, state, lam, result, lam == level))
                if result.iterations <= quick:
                    step = max(step, 1.5 * taken)
                elif result.iterations > 3 * quick:
                    step = 0.7 * taken
                if progress is not None:
                    progress(lam)
                continue
            wasted += 0 if result is None else result.iterations
            cuts += 1
            step = 0.5 * abs(target - lam)
            if step < min_step * max(1.0, abs(level)):
                status = failure_name(result)
        if status != "converged":
            break
    timings["total"] = time.perf_counter() - clock
    message = "equilibrium reached at every level" if status == "converged" else (
        f"{status}: load factor {lam:.6g} of {targets[-1]:.6g} reached; the last converged state is kept")
    loose = 0 if status == "converged" else free_rigid_motions(problem)
    if loose:
        message += f"; the supports leave {loose} rigid motion{'s' if loose > 1 else ''} of the sheet free: is it held?"
    return StaticResult(status == "converged", status, message, tuple(steps), iterations, wasted,
                        assemblies, timings, tuple(dict.fromkeys(notes)))


def free_rigid_motions(problem: Problem) -> int:
    """How many of the six rigid motions the supports leave free (a sheet hung from two points may well swing about them)."""
    modes = rigid_body_modes(problem.shell, problem.start())[problem.fixed]
    if len(modes) == 0:
        return 6
    size = np.ptp(problem.surface.nodes, axis=0).max()
    modes[:, 3:] /= size
    return 6 - int(np.linalg.matrix_rank(modes, tol=1e-9))


def failure_name(result: NewtonResult | None) -> str:
    """Name of the failure that a step which did not converge is reported under."""
    if result is None or result.status == "inadmissible start":
        return "LockingReached"
    return {"singular tangent": "SingularTangent", "iteration limit": "Diverged"}.get(result.status, "StepTooSmall")


def _predict(problem: Problem, state: State, lam: float, target: float, previous, options: NewtonOptions) -> State | None:
    """Start of the next step with its held values: extrapolated from the last step or by the tangent; None if inadmissible."""
    held = problem.prescribed(target)
    change = held - state.u[problem.fixed]
    candidates: list[State | None] = []
    if np.any(change != 0.0):
        if previous is not None and previous[1] != lam:
            u = state.u.copy()
            k = problem.shell.alpha_offset
            u[:k] += (target - lam) / (lam - previous[1]) * (state.u - previous[0].u)[:k]
            u[problem.fixed] = held
            candidates.append(state.with_u(u))
        candidates.append(_affine(problem, state, lam, held, change, options))
    else:
        candidates.append(state)
    best, best_energy = None, np.inf
    for candidate in candidates:
        if candidate is None:
            continue
        energy = problem.energy(candidate, target)
        if energy < best_energy:
            best, best_energy = candidate, energy
    return best


def _affine(problem, state, lam, held, change, options) -> State | None:
    """Tangent predictor: the linear response to the change of the held unknowns."""
    for exact in (True, False):
        _, data = problem.tangent(state, lam, exact)
        try:
            factor = _solver(problem, state, replace(options, linear_solver="direct")).factor(problem.free_block.matrix(data))
        except SingularMatrixError:
            continue
        du = factor(-(problem.coupling_block.matrix(data) @ change))
        if not np.all(np.isfinite(du)):
            continue
        u = state.u.copy()
        u[problem.free] += du
        u[problem.fixed] = held
        if np.isfinite(problem.energy(state.with_u(u), lam)):
            return state.with_u(u)
    return None


def _record(problem: Problem, state: State, lam: float, result: NewtonResult | None, requested: bool) -> LoadStep:
    membrane, bending = problem.shell.energies(state)
    g = problem.gradient(state, lam)
    reaction = np.zeros_like(g)
    reaction[problem.fixed] = g[problem.fixed]
    if result is None:
        return LoadStep(lam, state, 0, 0.0, 0.0, membrane, bending, reaction, requested)
    return LoadStep(lam, state, result.iterations, result.residual, result.residual_relative, membrane, bending, reaction,
                    requested)
