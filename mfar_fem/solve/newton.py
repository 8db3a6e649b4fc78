"""Newton's method on the potential: line search, two tangents, and a named reason whenever it stops.

Two ways to the solution, tried in this order. *Plain*: full steps with the exact tangent. A thin shell that rotates is stretched
by every linearised step and relaxes in the next one, so its energy rises on the way to the minimum, and a line search on the
energy would crawl; plain steps take 4–8 iterations there. The result counts only if its energy is below that of the start.
*Descent*: energy line search with the safe (positive semi-definite) tangent, and the exact one where it gives descent and full
steps. This is what remains when the sheet falls, wrinkles or locks on its way.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from mfar_fem.shell import State
from mfar_fem.solve.inertia import Inertia
from mfar_fem.solve.linear import LinearSolver, SingularMatrixError, rigid_body_modes
from mfar_fem.solve.problem import InadmissibleStateError, Problem
from mfar_fem.solve.solver_choice import choose, layout, wave_travel


@dataclass(frozen=True)
class NewtonOptions:
    """Settings of the iteration.

    Attributes
    ----------
    rtol, atol : float
        Converged when the residual is below ``max(atol, rtol · reference)``; ``atol`` in N, the reference is the largest of the
        external forces, the smallest reactions met on the way, and a thousandth of the first residual (in motion the present
        inertia instead: a bad first guess must not loosen a step). What rounding of the
        unknowns can cause in a component, ``ε |K| |u|``, does not count, and a full Newton step at the rounding of the unknowns
        ends the iteration too: thin sheets under tiny loads get there. The residual reached is always reported.
    max_iterations : int
        Of the descent; ``plain_iterations`` those of the plain steps tried before it (0: none).
    plain_cuts : int
        How often a load step is halved after plain steps failed before the descent is tried.
    tangent : {'auto', 'safe', 'exact'}
        ``auto`` switches as described; the others keep one (``exact`` still falls back to ``safe`` on ascent).
    max_rotation : float
        Longest step of an edge rotation, rad.
    max_backtracks : int
        Halvings of a step before the search gives up.
    linear_solver : str
        See :class:`mfar_fem.solve.linear.LinearSolver`.
    """

    rtol: float = 1e-8
    atol: float = 1e-13
    max_iterations: int = 300
    plain_iterations: int = 12
    plain_cuts: int = 2
    tangent: str = "auto"
    max_rotation: float = 1.0
    max_backtracks: int = 30
    linear_solver: str = "direct"


DEFAULT_OPTIONS = NewtonOptions()
RENEWAL = 20
"""Iterations of the descent after which the directors are renewed."""
LARGEST_TURN = 1.5
"""Rotation of an edge, rad, at which they are renewed in any case: at π its angle has no unique value and the energy jumps."""


@dataclass
class NewtonResult:
    """Outcome of one Newton solve: ``status`` is ``converged`` or the name of the failure.

    ``by_error`` tells that the caller's ``enough`` ended it; the residual is then that before the last step.
    """

    state: State
    status: str
    iterations: int
    residual: float
    residual_relative: float
    residuals: list[float] = field(default_factory=list)
    safe_iterations: int = 0
    notes: list[str] = field(default_factory=list)
    assembly_s: float = 0.0
    solve_s: float = 0.0
    assemblies: int = 0
    reaction: float = np.inf
    first_residual: float = 0.0
    by_error: bool = False

    @property
    def converged(self) -> bool:
        """Whether the residual is below tolerance, or the step before was ``enough``."""
        return self.status == "converged"

    def stop_here(self, state: State, iterations: int) -> None:
        """Converged at ``state`` by the error left in it."""
        self.state, self.status, self.iterations, self.by_error = state, "converged", iterations, True


def newton(problem: Problem, state: State, lam: float, options: NewtonOptions = DEFAULT_OPTIONS,
           descend: bool = True, enough: Callable[[State, float, bool], bool] | None = None,
           energy: float | None = None) -> NewtonResult:
    """Solve for equilibrium at load factor ``lam``; the held unknowns of ``state`` must have their values.

    Parameters
    ----------
    enough : callable, optional
        ``enough(state, decrement, full)`` after every step with the state reached, the square of the Newton step in the norm of
        the tangent, J, and whether it was taken in full: true ends the iteration there, whatever the residual.
    energy : float, optional
        Potential of ``state``, J, where it is known.

    Returns
    -------
    NewtonResult
        With ``status`` ``converged``, ``iteration limit``, ``line search failed``, ``singular tangent``, ``plain steps failed``
        (with ``descend=False``) or ``inadmissible start`` (locking or a collapsed element); ``state`` is the best admissible state
        and never contains NaN.
    """
    energy = problem.energy(state, lam) if energy is None else energy
    out = NewtonResult(state, "inadmissible start", 0, np.inf, np.inf)
    if not np.isfinite(energy):
        return out
    solver = _solver(problem, state, options)
    if options.plain_iterations > 0 and options.tangent != "safe":
        _plain(problem, state, lam, energy, solver, options, out, enough)
    if not out.converged and not descend:
        out.status = "plain steps failed"
    elif not out.converged:
        plain, out.residuals = out.iterations, []
        _descent(problem, state, lam, energy, solver, options, out, enough)
        out.iterations += plain
    out.notes += solver.notes
    assert np.all(np.isfinite(out.state.u))
    return out


def _evaluate(problem: Problem, state: State, lam: float, exact: bool, options: NewtonOptions, out: NewtonResult,
              step: np.ndarray | None = None, definite: bool = False):
    """Gradient and tangent data at ``state``; records the residual and whether it is below tolerance."""
    clock = time.perf_counter()
    g, data = problem.tangent(state, lam, exact, step, definite)
    out.assembly_s += time.perf_counter() - clock
    r = g.copy()
    r[problem.fixed] = 0.0
    residual = problem.norm(r)
    out.reaction = min(out.reaction, problem.norm(g - r))
    out.first_residual = residual if out.assemblies == 0 else out.first_residual
    other = _inertia(problem, state) if problem.force_scale > 0 else 1e-3 * out.first_residual
    reference = max(problem.norm(problem.external_force(state, lam)), out.reaction, other, problem.force_scale)
    out.assemblies += 1
    out.residual = residual
    out.residual_relative = 0.0 if residual == 0 else residual / reference if 0 < reference and np.isfinite(residual) else np.inf
    out.residuals.append(residual)
    tolerance = max(options.atol, options.rtol * reference)
    if tolerance < residual < 0.1 * reference:
        residual = problem.norm(_beyond_rounding(problem, state, data, r))
    return g, data, reference, np.isfinite(residual) and residual <= tolerance  # forces may be too large to be squared


def _inertia(problem: Problem, state: State) -> float:
    """Norm of the inertial force, N."""
    x = problem.shell.positions(state)
    return max((float(np.linalg.norm(load.force(x))) for load in problem.loads if isinstance(load, Inertia)), default=0.0)


def _plain(problem, start, lam, energy, solver, options, out, enough) -> None:
    """Full exact steps from ``start``; ``out`` is converged only if the energy ended below its start."""
    state, best, step = start, np.inf, None
    for iteration in range(options.plain_iterations + 1):
        try:
            g, data, reference, done = _evaluate(problem, state, lam, True, options, out, step)
        except InadmissibleStateError:
            return
        out.iterations = iteration
        if done or _no_further(problem, state, lam, step, g, out.residual, reference):
            end = problem.energy(state, lam)
            size = np.abs(state.u)  # laws that subtract numbers of order one round their energy by about ε |u|·|K||u|
            noise = 1e-9 * abs(energy) + np.finfo(float).eps * float(size @ (problem.pattern.matrix(np.abs(data)) @ size))
            if not problem.conservative or end <= energy + noise or iteration == 0:
                out.state, out.status = state, "converged"
            return
        if not np.isfinite(out.residual) or (iteration > 6 and out.residual > 10 * best):
            return
        best = min(best, out.residual)
        clock = time.perf_counter()
        step = np.zeros(problem.n)
        try:
            step[problem.free] = solver.factor(problem.system(data))(-g[problem.free])
        except SingularMatrixError:
            return
        out.solve_s += time.perf_counter() - clock
        rotation = np.abs(step[problem.shell.alpha_offset:]).max(initial=0.0)
        if not np.all(np.isfinite(step)) or rotation > 3.0:
            return
        free = problem.max_step(state, step)
        state = state.with_u(state.u + free * step)
        decrement = -float(g @ step)
        if enough is not None and enough(state, decrement, free == 1.0) and problem.energy(state, lam) <= energy:
            out.stop_here(state, iteration + 1)
            return
        step *= free


def _descent(problem, state, lam, energy, solver, options, out, enough) -> None:
    """Line search on the energy with the safe tangent, and the exact one near the solution."""
    exact, previous, definite = options.tangent == "exact", np.inf, False
    for iteration in range(options.max_iterations + 1):
        g, data, reference, done = _evaluate(problem, state, lam, exact, options, out, definite=definite and not exact)
        out.state, out.iterations = state, iteration
        if done:
            out.status = "converged"
            return
        if iteration == options.max_iterations:
            out.status = "iteration limit"
            return
        clock = time.perf_counter()
        step, used_exact = _direction(problem, state, lam, g, data, exact, definite, solver, options)
        out.solve_s += time.perf_counter() - clock
        out.safe_iterations += not used_exact
        if step is None:
            out.status = "singular tangent"
            return
        t, state_new, energy_new = _line_search(problem, state, lam, energy, g, step, options)
        definite = definite or (t < 1.0 and not used_exact)  # far from the solution: contacts by their stiff part alone
        if t == 0.0:
            if used_exact and options.tangent != "exact":
                exact = False
                continue
            renewed = problem.shell.accept(state)  # an edge may stand where its angle to the director jumps by a turn
            if np.abs(renewed.u - state.u).max() > 0.1:
                state, energy = renewed, problem.energy(renewed, lam)
                continue
            rounding = _at_rounding(energy, g, step, out.residual, reference, options)
            out.status = "converged" if rounding else "line search failed"
            return
        if options.tangent == "auto":
            moved = np.abs(step[problem.shell.alpha_offset:]).max(initial=0.0)
            exact = t == 1.0 and (used_exact or (moved < 0.3 and out.residual < previous))
        state, energy, previous = state_new, energy_new, out.residual
        if enough is not None and enough(state, -float(g @ step), t == 1.0):
            out.stop_here(state, iteration + 1)
            return
        if iteration % RENEWAL == RENEWAL - 1 or _turned(problem, state) > LARGEST_TURN:  # too far from the directors
            state = problem.shell.accept(state)
            energy = problem.energy(state, lam)


def _turned(problem: Problem, state: State) -> float:
    """Largest rotation of an edge since the directors were renewed, rad."""
    return float(np.abs(state.u[problem.shell.alpha_offset:]).max(initial=0.0))


def _solver(problem: Problem, state: State, options: NewtonOptions) -> LinearSolver:
    method, notes = options.linear_solver, []
    if method == "auto":
        method = choose(len(problem.free), wave_travel(problem), problem.surface.order)
        notes.append(f"linear solver 'auto': {method} for {len(problem.free)} unknowns")
    modes = None
    if method == "amg":
        modes = rigid_body_modes(problem.shell, state)[problem.free]
        modes = modes[:, np.linalg.norm(modes, axis=0) > 0]
    solver = LinearSolver(method, modes, max_iterations=200, cache=problem.linear_cache, layout=layout(problem), adaptive=True)
    solver.notes += notes
    return solver


def _direction(problem, state, lam, g, data, exact, definite, solver, options):
    """Newton step (n,) with zeros on held unknowns, and whether it is the exact one; None if the tangent is singular."""
    touching = any(hasattr(load, "sparse_hessian") for load in problem.loads)
    attempts = [(True, False)] * bool(exact) + [(False, definite)] + [(False, True)] * (touching and not definite)
    for i, (attempt, whole) in enumerate(attempts):
        if i > 0:
            _, data = problem.tangent(state, lam, False, definite=whole)
        step = np.zeros(problem.n)
        try:
            step[problem.free] = solver.factor(problem.system(data))(-g[problem.free])
        except SingularMatrixError:
            if i < len(attempts) - 1:
                continue
            shift = data.copy()
            diagonal = problem.pattern.diagonal
            shift[diagonal] += 1e-8 * np.abs(data[diagonal]).max()
            solver.notes.append("safe tangent singular: shifted by 1e-8 of its largest diagonal entry")
            try:
                step[problem.free] = solver.factor(problem.system(shift))(-g[problem.free])
            except SingularMatrixError:
                return None, False
        slope = float(g @ step)
        if np.all(np.isfinite(step)) and slope < 0:
            return step, attempt
        if not problem.conservative and np.all(np.isfinite(step)):
            return step, attempt
    return (step, False) if np.all(np.isfinite(step)) else (None, False)


def _line_search(problem, state, lam, energy, g, step, options):
    """Largest of 1, ½, ¼ … that lowers the energy (or, within rounding, the slope): ``(t, state, energy)``, t = 0 if none."""
    rotation = np.abs(step[problem.shell.alpha_offset:]).max(initial=0.0)
    t = min(1.0, options.max_rotation / rotation) if rotation > 0 else 1.0
    t *= problem.max_step(state, t * step)
    slope = float(g @ step)
    rounding = None
    for _ in range(options.max_backtracks):
        trial = state.with_u(state.u + t * step)
        new = problem.energy(trial, lam)
        if np.isfinite(new):
            if problem.conservative and new <= energy + 1e-4 * t * slope:
                return t, trial, new
            if rounding is None:
                rounding = max(1e-11 * max(abs(energy), abs(slope)), energy_rounding(problem, trial, lam))
            if not problem.conservative or (new <= energy + rounding and -t * slope < 1e3 * rounding):
                slope_new = float(problem.gradient(trial, lam)[problem.free] @ step[problem.free])
                if abs(slope_new) <= 0.9 * abs(slope):
                    return t, trial, new
        t *= 0.5
    return 0.0, state, energy


def energy_rounding(problem: Problem, state: State, lam: float) -> float:
    """What rounding can do to the potential, J: its terms may cancel, and laws subtract numbers of the size of their stiffness."""
    shell = problem.shell
    size = shell.energy(state) + sum(abs(load.energy(shell, state, lam)) for load in problem.loads)
    if shell.with_membrane:
        stiffness = shell.fabric.membrane_scale * np.abs(shell.fabric.law.tangent_at_rest()).max()
        size += stiffness * float(shell.geometry.area_weights.sum())
    return 8.0 * np.finfo(float).eps * size


def _beyond_rounding(problem: Problem, state: State, data: np.ndarray, r: np.ndarray) -> np.ndarray:
    """The residual less what rounding of the unknowns alone can cause in each component, ``ε |K| |u|``."""
    floor = np.finfo(float).eps * (problem.pattern.matrix(np.abs(data)) @ np.abs(state.u))
    return np.maximum(np.abs(r) - floor, 0.0)


def _no_further(problem: Problem, state: State, lam: float, step: np.ndarray | None, g: np.ndarray, residual: float,
                reference: float) -> bool:
    """Whether the last full Newton step was at the rounding of the unknowns: thin sheets leave a residual that no step removes.

    The step must be small, and the residual what a few random digits in the last place of the unknowns change: on slivers strains
    round much more than the unknowns, and far from rest a tangent may be so stiff that a small step means nothing.
    """
    if step is None or residual > 0.1 * reference:
        return False
    k = problem.shell.alpha_offset
    size, moved, turned = (np.abs(part).max(initial=0.0) for part in (state.u[:k], step[:k], step[k:]))
    if moved > 1e-10 * size or turned > 1e-9:
        return False
    digits = 1e3 if moved <= 1e-13 * size and turned <= 1e-12 else 8.0
    signs = np.random.default_rng(0).choice((-1.0, 1.0), problem.n)
    change = problem.gradient(state.with_u(state.u * (1.0 + np.finfo(float).eps * signs)), lam) - g
    change[problem.fixed] = 0.0
    return residual <= digits * problem.norm(change)


def _at_rounding(energy, g, step, residual, reference, options) -> bool:
    """Whether no step helps because the residual is at rounding level of the element forces (and already small)."""
    return residual <= 10.0 * options.rtol * reference and abs(float(g @ step)) <= 1e-10 * max(abs(energy), 1e-300)
