r"""To rest: relaxation with growing pseudo time steps, ending in an equilibrium whose stability is known.

Every step minimises the potential plus the inertia of a sheet that starts at rest, :math:`W(x) + |x - x_k|_M^2 / 2\Delta t^2`,
linearised once: a Levenberg–Marquardt step in the metric of the mass. Full steps that lower the energy let :math:`\Delta t` grow;
soon the step is Newton's. Its tangent is the positive semi-definite one with a share of the exact one: the first is never wrong but
too stiff where compression softens the sheet (a step then gains up to twice what it predicts), the second is indefinite far from
rest. The share grows with full steps and is halved by short ones. The energy falls monotonically, so the run cannot cycle, and
it ends only where the *static* residual is below tolerance. The number of negative eigenvalues of the tangent there says whether
the rest state is stable; an unstable one is left along its softest mode.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mfar_fem.materials.softened import Softened
from mfar_fem.shell import State
from mfar_fem.solve.inertia import Inertia
from mfar_fem.solve.integrators import Kinematics, step_rule
from mfar_fem.solve.linear import LinearSolver, SingularMatrixError, negative_eigenvalues
from mfar_fem.solve.newton import NewtonOptions, energy_rounding, newton
from mfar_fem.solve.problem import InadmissibleStateError, Problem

CONTACT_DT, STIFFENINGS = 0.05, 8
"""Time (s) in which a barrier must stop the sheet, for its first stiffness, and how often it may be made stiffer."""
ROUGH = 3e-5
"""Share of the energy still to be gained by the next step at which a softened stage ends."""
NEAR = 1e-2
"""Relative residual from which Newton's method is tried without inertia."""
GROWTH = 4.0
"""Factor of the pseudo time step after a full step."""


@dataclass(frozen=True)
class RestOptions:
    """Settings of the relaxation.

    Attributes
    ----------
    dt : float
        First pseudo time step, s.
    max_dt : float
        Largest one; beyond some seconds a step is a Newton step.
    rtol, atol : float
        Static residual below ``max(atol, rtol · reference)``, N; the reference is the larger of loads and reactions.
    max_iterations : int
    renew : float
        Rotation of the edges (rad) after which directors are renewed.
    check_stability : bool
        Count the negative eigenvalues of the tangent at rest.
    escapes : int
        How often an unstable equilibrium is left (0: it is returned and called unstable).
    softening : tuple of float
        Shares of the tensile stiffness (:class:`mfar_fem.materials.softened.Softened`) at which the sheet is first relaxed roughly.
        A sheet of stiff yarns turns by a few hundredths of a radian a step; a tenth of the stiffness makes the way short, and the
        last stage is the fabric itself.
    linear_solver : str
    """

    dt: float = 0.1
    max_dt: float = 1e3
    rtol: float = 1e-7
    atol: float = 1e-13
    max_iterations: int = 1500
    renew: float = 0.2
    check_stability: bool = True
    escapes: int = 3
    softening: tuple[float, ...] = ()
    linear_solver: str = "direct"


@dataclass(frozen=True)
class RestResult:
    """A rest state, or what was reached (:attr:`status` names the failure).

    Attributes
    ----------
    converged : bool
    status : str
        ``converged``, ``Diverged`` (iteration limit), ``Stalled`` (no step lowers the energy), ``SingularTangent`` or
        ``LockingReached``.
    message : str
    state : State
    energy : float
        Potential, J; ``membrane``, ``bending`` its elastic parts.
    residual, residual_relative : float
        Static, N, over all free unknowns.
    stable : bool or None
        Whether the tangent is positive definite (None: not asked).
    negative : int
        Its negative eigenvalues.
    escapes : int
        Unstable equilibria left on the way.
    iterations, factorisations : int
    timings : dict
        Seconds: ``assembly``, ``solve``, ``total``.
    history : (k, 4) array
        Iteration, pseudo time step (s), potential (J), static residual (N).
    """

    converged: bool
    status: str
    message: str
    state: State
    energy: float
    membrane: float
    bending: float
    residual: float
    residual_relative: float
    stable: bool | None
    negative: int
    escapes: int
    iterations: int
    timings: dict[str, float]
    history: np.ndarray


def resting_problem(surface, fabric, supports=(), loads=(), bending: bool = True) -> Problem:
    """The problem that :func:`relax` needs: the given one with the inertia of the pseudo time steps."""
    return Problem(surface, fabric, supports, [*loads, Inertia(fabric.areal_density, "lumped")], bending=bending)


def relax(problem: Problem, start: State | None = None, options: RestOptions | None = None,
          progress: Callable[[int, float, float, State], None] | None = None) -> RestResult:
    """Let a supported, loaded sheet come to rest.

    Parameters
    ----------
    problem : Problem
        From :func:`resting_problem`.
    start : State, optional
        Where it is let go; default the reference state with displaced supports.
    progress : callable, optional
        ``progress(iteration, energy, residual_relative, state)``.

    Returns
    -------
    RestResult
        Never raises for a failure to converge.
    """
    options = options or RestOptions()
    run = _Relaxation(problem, start, options, progress)
    for share in options.softening:
        run.soften(share)
    status, escapes, negative = run.settle(), 0, 0
    while status == "converged" and options.check_stability:
        negative = run.negative_eigenvalues()
        if negative == 0 or escapes >= options.escapes or not run.leave():
            break
        escapes += 1
        status = run.settle()
    return run.result(status, negative, escapes)


def _less(blend: float) -> float:
    """The share of the exact tangent after a step that did not go far."""
    return 0.5 * blend if blend > 0.1 else 0.0


class _Relaxation:
    def __init__(self, problem, start, options, progress):
        self.problem, self.options, self.progress = problem, options, progress
        self.inertia = next(load for load in problem.loads if isinstance(load, Inertia))
        state = start or problem.start()
        u = state.u.copy()
        u[problem.fixed] = problem.prescribed(1.0)
        self.state = state.with_u(u)
        self.contact = next((load for load in problem.loads if hasattr(load, "max_step")), None)
        if self.contact is not None:
            self.contact.check_start(problem.shell, self.state)
            self.contact.begin_step(problem.shell, self.state, None, 0.0, 0.0, CONTACT_DT)
        self.dt, self.iterations, self.rough = options.dt, 0, False
        self.timings = {"assembly": 0.0, "solve": 0.0}
        self.history: list[tuple[float, ...]] = []
        self.clock = time.perf_counter()
        self.residual = self.relative = np.inf

    def soften(self, share: float) -> None:
        """Relax roughly with a share of the tensile stiffness; what does not end well is only a worse start of the next stage."""
        fabric = self.problem.shell.fabric
        problem, options = self.problem, self.options
        self.problem = problem.with_fabric(fabric.replace(law=Softened(fabric.law, share)))
        self.options, self.rough = replace(options, max_iterations=options.max_iterations // 2), True
        self.descend()
        self.problem, self.options, self.dt, self.rough = problem, options, options.dt, False

    def settle(self) -> str:
        """Descend; where contacts came too near, with a stiffer barrier again."""
        status = self.descend()
        for _ in range(STIFFENINGS if self.contact is not None else 0):
            before = self.contact.stiffness
            self.contact.end_step(self.problem.shell, self.state)
            if status != "converged" or self.contact.stiffness == before:
                break
            self.contact.begin_step(self.problem.shell, self.state, None, 0.0, 0.0, CONTACT_DT)
            status = self.descend()
        return status

    # -- descent ---------------------------------------------------------------------------------------------------------
    def descend(self) -> str:
        """Lower the energy until the static residual is below tolerance; the status."""
        problem, options = self.problem, self.options
        self._anchor()
        energy = problem.energy(self.state, 1.0)
        if not np.isfinite(energy):
            return "LockingReached"
        limit, blend, near = self.iterations + options.max_iterations, 0.0, NEAR
        while self.iterations < limit:
            clock = time.perf_counter()
            try:
                g, data = self._tangent(blend)
            except InadmissibleStateError:
                return "LockingReached"
            self.timings["assembly"] += time.perf_counter() - clock
            self._measure(g)
            self.history.append((self.iterations, self.dt, energy, self.residual))
            if self.progress is not None:
                self.progress(self.iterations, energy, self.relative, self.state)
            if self.relative < near:
                if self._finish(energy):
                    return "converged"
                near = 0.3 * self.relative
            clock = time.perf_counter()
            step = self._solve(data, g)
            self.timings["solve"] += time.perf_counter() - clock
            self.iterations += 1
            slope = 0.0 if step is None else float(g @ step)
            if self.rough and -slope < ROUGH * abs(energy) and slope < 0:
                return "converged"
            turn = np.inf if step is None else np.abs(step[problem.shell.alpha_offset:]).max(initial=0.0)
            t, new = 0.0, energy
            if step is not None and slope < 0 and not (blend > 0.0 and turn > 0.5):
                t, new = self._move(energy, slope, step, turn)
            if t > 0.0:
                energy = new
                self.dt = min(GROWTH * self.dt, self.options.max_dt) if t >= 1.0 else self.dt
                self._anchor()
                blend = min(0.95, 0.12 + 0.9 * blend) if t >= 1.0 else blend if t > 0.3 else _less(blend)
            elif blend > 0.0:
                blend = _less(blend)
            else:
                self.dt *= 0.1
                self._anchor()
                if self.dt < 1e-9 or (step is not None and -slope < 1e-12 * abs(energy)):
                    return "converged" if self._finish(energy) else "SingularTangent" if step is None else "Stalled"
        return "Diverged"

    def _tangent(self, blend: float) -> tuple[np.ndarray, np.ndarray]:
        """Gradient, and the safe tangent with a share of the exact one."""
        g, data = self.problem.tangent(self.state, 1.0, False, definite=True)
        if blend > 0.0:
            data = (1.0 - blend) * data + blend * self.problem.tangent(self.state, 1.0, True)[1]
        return g, data

    def _anchor(self) -> None:
        """Inertia of a sheet at rest in the present state."""
        x = self.state.u[: self.problem.shell.alpha_offset]
        k = Kinematics(x, np.zeros_like(x), np.zeros_like(x))
        self.inertia.begin_step(step_rule("implicit-euler", k, self.dt), k)

    def _measure(self, g: np.ndarray) -> None:
        problem = self.problem
        r = g.copy()
        r[problem.fixed] = 0.0
        self.residual = problem.norm(r)
        reference = max(problem.norm(problem.external_force(self.state, 1.0)), problem.norm(g - r), 1e-300)
        self.relative = self.residual / reference

    def _solve(self, data: np.ndarray, g: np.ndarray) -> np.ndarray | None:
        problem = self.problem
        step = np.zeros(problem.n)
        solver = LinearSolver(self.options.linear_solver, cache=problem.linear_cache)
        try:
            step[problem.free] = solver.factor(problem.system(data))(-g[problem.free])
        except SingularMatrixError:
            return None
        return step if np.all(np.isfinite(step)) else None

    def _move(self, energy: float, slope: float, step: np.ndarray, turn: float) -> tuple[float, float]:
        """Go along the step while energy and inertia fall together: how far (0: not at all) and the new energy."""
        problem, old = self.problem, self.state
        t = min(1.0, 1.0 / max(turn, 1e-300))
        t *= problem.max_step(old, t * step)

        def at(t):
            trial = old.with_u(old.u + t * step)
            return problem.energy(trial, 1.0), trial  # inertia included, zero at the present state

        new, trial = at(t)
        if not new <= energy + 1e-4 * t * slope and self._within_rounding(energy, t * slope, new, trial, step):
            new = energy + 1e-4 * t * slope
        if new <= energy + 1e-4 * t * slope:
            while t >= 1.0 and new < energy + 0.6 * t * slope and 2.0 * t * turn < 1.0:  # the safe tangent is too stiff
                further, beyond = at(2.0 * t)
                if not further < new or problem.max_step(old, 2.0 * t * step) < 1.0:
                    break
                t, new, trial = 2.0 * t, further, beyond
        while not new <= energy + 1e-4 * t * slope:
            excess = new - energy - t * slope
            t *= min(max(-0.5 * slope * t / excess, 0.1), 0.5) if np.isfinite(excess) else 0.25
            if t < 1e-4:
                return 0.0, energy
            new, trial = at(t)
        moved = np.abs(trial.u[problem.shell.alpha_offset:]).max(initial=0.0)
        self.state = problem.shell.accept(trial) if moved > self.options.renew else trial
        self._anchor()
        return t, problem.energy(self.state, 1.0)

    def _within_rounding(self, energy: float, expected: float, new: float, trial: State, step: np.ndarray) -> bool:
        """Whether the energy cannot tell, but its slope fell along the step."""
        problem = self.problem
        rounding = energy_rounding(problem, self.state, 1.0)
        if not (new <= energy + rounding and -expected < 1e2 * rounding):
            return False
        slope = float(problem.gradient(trial, 1.0)[problem.free] @ step[problem.free])
        return abs(slope) <= 0.9 * abs(float(problem.gradient(self.state, 1.0)[problem.free] @ step[problem.free]))

    def _finish(self, energy: float) -> bool:
        """Newton's method without inertia; kept only if it converges to an energy that is not above the present one."""
        problem, options = self.problem, self.options
        if self.relative <= options.rtol or self.residual <= options.atol:
            self.state = problem.shell.accept(self.state)
            return True
        factor, self.inertia.factor = self.inertia.factor, 0.0
        settings = NewtonOptions(rtol=options.rtol, atol=options.atol, plain_iterations=8, linear_solver=options.linear_solver)
        clock = time.perf_counter()
        result = newton(problem, problem.shell.accept(self.state), 1.0, settings, descend=False)
        self.timings["assembly"] += result.assembly_s
        self.timings["solve"] += time.perf_counter() - clock - result.assembly_s
        self.iterations += result.iterations
        good = result.converged and problem.energy(result.state, 1.0) <= energy + 1e-9 * abs(energy)
        if good:
            self.state = problem.shell.accept(result.state)
            self.residual, self.relative = result.residual, result.residual_relative
        self.inertia.factor = factor
        return good

    # -- stability -------------------------------------------------------------------------------------------------------
    def _static_tangent(self):
        factor, self.inertia.factor = self.inertia.factor, 0.0
        _, data = self.problem.tangent(self.state, 1.0, True)
        self.inertia.factor = factor
        return self.problem.system(data)

    def negative_eigenvalues(self) -> int:
        """Of the static tangent at the present state."""
        return negative_eigenvalues(self._static_tangent())

    def leave(self) -> bool:
        """Push the sheet along its softest mode, to the side of lower energy; False if no direction lowers it."""
        from scipy.sparse.linalg import ArpackError, eigsh

        problem, n_x = self.problem, self.problem.shell.alpha_offset
        matrix = self._static_tangent()
        try:
            values, modes = eigsh(matrix, k=min(6, matrix.shape[0] - 2), sigma=0.0, which="LM")
        except (ArpackError, RuntimeError):
            return False
        mode = np.zeros(problem.n)
        mode[problem.free] = modes[:, np.argmin(values)]
        size = np.abs(mode[:n_x]).max()
        if values.min() >= 0 or not size > 0:
            return False
        self._anchor()
        self.inertia.factor = 0.0
        energy, best = problem.energy(self.state, 1.0), None
        for amplitude in (1e-3, 1e-4, 1e-5):
            for sign in (1.0, -1.0):
                trial = self.state.with_u(self.state.u + sign * amplitude / size * mode)
                new = problem.energy(trial, 1.0)
                if new < energy:
                    energy, best = new, trial
            if best is not None:
                break
        if best is None:
            return False
        self.state, self.dt = problem.shell.accept(best), self.options.dt
        return True

    def result(self, status: str, negative: int, escapes: int) -> RestResult:
        self.inertia.factor = 0.0
        membrane, bending = self.problem.shell.energies(self.state)
        energy = self.problem.energy(self.state, 1.0)
        stable = None if status != "converged" or not self.options.check_stability else negative == 0
        text = "at rest" if status == "converged" else (
            f"{status}: static residual {self.relative:.1e} of the load after {self.iterations} iterations; the state of lowest "
            "energy is kept")
        if stable is False:
            text += f", but unstable ({negative} negative eigenvalues)"
        self.timings["total"] = time.perf_counter() - self.clock
        return RestResult(status == "converged", status, text, self.state, energy, membrane, bending, self.residual, self.relative,
                          stable, negative, escapes, self.iterations, self.timings, np.array(self.history).reshape(-1, 4))

