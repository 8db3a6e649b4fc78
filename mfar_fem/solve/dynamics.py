r"""Implicit dynamics: every time step is the minimum of an incremental potential, found by the Newton method of the statics.

Formula (14) of the silk paper with the internal force as the derivative of the energy: implicit Euler, Δt = 2 ms and a relative
residual of 1e-6 are the defaults; BDF2 and generalised-α are of second order (:mod:`mfar_fem.solve.integrators`). Steps that do not
converge are halved; with ``tolerance`` the step adapts to the local error and to Newton's effort too.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from mfar_fem.errors import InputError
from mfar_fem.shell import State
from mfar_fem.shell.shell import Viscosity
from mfar_fem.solve.inertia import Inertia
from mfar_fem.solve.integrators import METHODS, Kinematics, StepRule, step_rule
from mfar_fem.solve.newton import NewtonOptions, newton
from mfar_fem.solve.problem import Problem
from mfar_fem.solve.statics import failure_name

MAX_MOVES = 100
"""Collision-free moves of a body within one time step, at most."""


@dataclass(frozen=True)
class DynamicsOptions:
    """Settings of the time integration.

    Attributes
    ----------
    method : {'implicit-euler', 'bdf2', 'generalized-alpha'}
    dt : float
        Time step, s (the largest one where it adapts).
    rho : float
        Spectral radius of generalised-α at infinite frequency.
    rtol, atol : float
        Residual of a step: below ``max(atol, rtol · reference)``, N; the reference is the largest of loads, reactions and inertia.
    mass : {'consistent', 'lumped'}
    mass_damping : float
        1/s: force ``-c M v``.
    stiffness_damping : float
        s: viscous stress ``c D dE/dt`` with the stiffness at rest (Kelvin–Voigt), in membrane and bending; a vibration of angular
        frequency ω has the damping ratio c ω / 2. A backward difference, of first order within generalised-α.
    tolerance : float or None
        Largest local error of a step, m (root mean square over the nodes): the step adapts to it. None: fixed steps.
    min_dt : float
        Below this the run ends with the named failure, s.
    max_halvings : int
        Steps that may fail while the time advances by ``dt``, before the run ends with the named failure (fixed steps only: with
        ``tolerance`` dt is only the largest).
    max_iterations : int
        Newton iterations of a step before it is halved.
    iteration_error : float
        A step is accepted, whatever its residual, when the error left by Newton's method is below this share of the local error
        of the time step (the κ of Hairer and Wanner, Solving Ordinary Differential Equations II, IV.8); 0: only the residual
        counts. The error left is at most ``sqrt(decrement / (mass / Δt²))`` where the energy is convex, since inertia alone makes
        the tangent that stiff. Such a step lowers the energy and intersects nothing all the same; its residual is in the record,
        and the result counts them (``inexact_steps``).
    linear_solver : str
        See :class:`mfar_fem.solve.linear.LinearSolver`.
    """

    method: str = "implicit-euler"
    dt: float = 2e-3
    rho: float = 0.8
    rtol: float = 1e-6
    atol: float = 1e-12
    mass: str = "consistent"
    mass_damping: float = 0.0
    stiffness_damping: float = 0.0
    tolerance: float | None = None
    min_dt: float = 1e-7
    max_halvings: int = 40
    max_iterations: int = 300
    iteration_error: float = 0.0
    linear_solver: str = "direct"

    def __post_init__(self):
        if self.method not in METHODS:
            raise InputError(f"unknown time integrator '{self.method}'; choose one of {', '.join(METHODS)}")
        for name in ("dt", "min_dt", "rtol"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise InputError(f"{name} must be positive and finite, got {getattr(self, name)}")
        for name in ("mass_damping", "stiffness_damping", "atol", "iteration_error"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) >= 0):
                raise InputError(f"{name} must be >= 0 and finite, got {getattr(self, name)}")
        if self.tolerance is not None and not self.tolerance > 0:
            raise InputError(f"the tolerance of the local error must be positive, got {self.tolerance} m")

    @property
    def newton(self) -> NewtonOptions:
        """Options of Newton's method within a step."""
        return NewtonOptions(rtol=self.rtol, atol=self.atol, max_iterations=self.max_iterations, linear_solver=self.linear_solver)


@dataclass(frozen=True)
class StepRecord:
    """One accepted time step: times in s, energies and works in J, speeds in m/s, residual in N.

    ``dissipated`` is the work that drag and damping have taken since the start, ``defect`` what the total energy has lost beyond
    it and beyond the work of moved supports: the integrator's own dissipation.
    """

    time: float
    dt: float
    iterations: int
    residual: float
    residual_relative: float
    kinetic: float
    membrane: float
    bending: float
    potential: float
    contact: float
    dissipated: float
    defect: float
    speed: float
    error: float
    contacts: int = 0
    distance: float | None = None

    @property
    def total(self) -> float:
        """Kinetic, elastic, potential and contact energy together, J."""
        return self.kinetic + self.membrane + self.bending + self.potential + self.contact


@dataclass(frozen=True)
class Motion:
    """All that the next step needs: a run continued from it is the run itself.

    Attributes
    ----------
    time : float
        s.
    state : State
    kinematics : Kinematics
    dt : float
        Step to try next, s.
    step : int
        Steps taken.
    strain : tuple of arrays
        Strain and curvature samples (Green strain, interior, edge) of this step and of the one before; empty without viscosity.
    dissipated, work, first_energy : float
        Bookkeeping of :class:`StepRecord`, J.
    to_come : float
        Newton steps still to come after the last one, in sum and as a share of it, as the last time step found it.
    """

    time: float
    state: State
    kinematics: Kinematics
    dt: float
    step: int = 0
    strain: tuple[np.ndarray, ...] = ()
    dissipated: float = 0.0
    work: float = 0.0
    first_energy: float = 0.0
    to_come: float = np.inf


@dataclass(frozen=True)
class DynamicResult:
    """Result of :meth:`Dynamics.run`; never raises for a failure to converge: see ``status``.

    Attributes
    ----------
    converged : bool
    status : str
        ``converged`` or the named failure (``LockingReached``, ``Diverged``, ``StepTooSmall``, ``SingularTangent``,
        ``BodyBlocked``: a body cannot push the sheet out of its way).
    message : str
    motion : Motion
        The last accepted one.
    records : tuple of StepRecord
    newton_iterations, wasted_iterations, halvings, inexact_steps : int
    timings : dict
        Seconds: ``assembly``, ``solve``, ``total``.
    notes : tuple of str
    """

    converged: bool
    status: str
    message: str
    motion: Motion
    records: tuple[StepRecord, ...]
    newton_iterations: int
    wasted_iterations: int
    halvings: int
    inexact_steps: int
    timings: dict[str, float]
    notes: tuple[str, ...]

    @property
    def state(self) -> State:
        """Last accepted state."""
        return self.motion.state


@dataclass
class _Tally:
    iterations: int = 0
    wasted: int = 0
    halvings: int = 0
    inexact: int = 0
    assembly: float = 0.0
    solve: float = 0.0
    notes: list[str] = field(default_factory=list)


class Dynamics:
    """A sheet in motion.

    Parameters
    ----------
    surface : Surface
    fabric : Fabric
        Its areal density gives the mass.
    supports, loads : sequences
        As for :class:`mfar_fem.solve.Problem`.
    drag : sequence
        Of :class:`mfar_fem.drag.AirDrag` or :class:`mfar_fem.drag.VertexDrag`.
    contact : mfar_fem.contact.barrier.Barrier, optional
        Bodies and self-contact; without it nothing is searched.
    options : DynamicsOptions
    bending : bool
    schedule : callable, optional
        Load factor of loads and support displacements over time, ``schedule(t) -> lam``; default 1 throughout.
    start : State, optional
        Default: the reference with the displacement of the supports at ``schedule(0)``.
    velocity : (nn, 3) array, optional
        Initial velocity of the nodes, m/s (held ones are set by their supports).
    """

    def __init__(self, surface, fabric, supports: Sequence = (), loads: Sequence = (), drag: Sequence = (), contact=None,
                 options: DynamicsOptions | None = None, bending: bool = True, schedule: Callable[[float], float] | None = None,
                 start: State | None = None, velocity: np.ndarray | None = None):
        self.options = options or DynamicsOptions()
        if contact is not None and self.options.method == "generalized-alpha":
            raise InputError("generalized-alpha weights forces of the step before, which a barrier does not keep: with contact use "
                             "'implicit-euler' or 'bdf2'")
        self.inertia = Inertia(fabric.areal_density, self.options.mass, self.options.mass_damping)
        self.drag, self.contact = tuple(drag), contact
        extra = [self.inertia, *self.drag] + ([contact] if contact is not None else [])
        self.problem = Problem(surface, fabric, supports, [*loads, *extra], bending=bending)
        self.schedule = schedule or (lambda t: 1.0)
        self.external = [load for load in self.problem.loads if not getattr(load, "internal", False)]
        self._dissipative = self.options.stiffness_damping > 0
        self.motion = self._start(start, velocity)
        if contact is not None:
            contact.check_start(self.problem.shell, self.motion.state)

    # -- start -----------------------------------------------------------------------------------------------------------
    def _start(self, start: State | None, velocity) -> Motion:
        problem, k = self.problem, self.problem.shell.alpha_offset
        state = start or problem.start()
        lam = self.schedule(0.0)
        u = state.u.copy()
        u[problem.fixed] = problem.prescribed(lam)
        state = state.with_u(u)
        v = np.zeros(k) if velocity is None else np.ascontiguousarray(velocity, dtype=float).ravel().copy()
        if v.shape != (k,) or not np.all(np.isfinite(v)):
            raise InputError(f"the initial velocity must be a finite array of shape ({k // 3}, 3) in m/s")
        held = problem.fixed[problem.fixed < k]
        v[held] = 0.0
        kinematics = Kinematics(state.u[:k].copy(), v, np.zeros(k))
        motion = Motion(0.0, state, kinematics, self.options.dt)
        if not np.isfinite(problem.shell.energy(state)):
            raise InputError("the motion starts from an inadmissible state (past locking, or a collapsed element)")
        a = self.inertia.mass.solve(-self._static_gradient(motion)[:k], problem.free[problem.free < k])
        motion = replace(motion, kinematics=replace(kinematics, a=a), strain=self._samples(state) if self._dissipative else ())
        return replace(motion, first_energy=self._energy(motion)["total"])

    def _static_gradient(self, motion: Motion) -> np.ndarray:
        """Gradient (n,) of everything but inertia at a motion, drag at its velocity included."""
        shell, state, lam = self.problem.shell, motion.state, self.schedule(motion.time)
        x = shell.positions(state)
        g = np.zeros(self.problem.n)
        shell.gradient(state, g)
        for load in self.external:
            load.gradient(shell, state, lam, g)
        for drag in self.drag:
            rule = StepRule(1.0, 1.0, motion.kinematics.x - motion.kinematics.v, 1.0, motion.kinematics.x)
            drag.begin_step(shell, rule, x, motion.time)
            g[: shell.alpha_offset] += drag.force(shell, x)
        if self.options.mass_damping:
            v = motion.kinematics.v.reshape(-1, 3)
            g[: shell.alpha_offset] += self.options.mass_damping * self.inertia.mass(v).ravel()
        return g

    def _samples(self, state: State) -> tuple[np.ndarray, ...]:
        shell = self.problem.shell
        return (shell.green_strain(state), *shell.curvature_samples(state))

    def resume(self, motion: Motion) -> None:
        """Go on from a motion of the same sheet (its supports may be others)."""
        shell = self.problem.shell
        if motion.state.u.shape != (shell.n,) or motion.state.directors.shape != (shell.n_alpha, 3):
            raise InputError(f"the motion has {len(motion.state.u)} unknowns, the sheet {shell.n}: another mesh or level")
        self.motion = motion

    # -- one step --------------------------------------------------------------------------------------------------------
    def step(self, dt: float, tally: _Tally | None = None) -> StepRecord | str:
        """Try one step of ``dt`` seconds: the record, and :attr:`motion` has moved on; or the name of the failure."""
        tally = tally or _Tally()
        problem, shell, motion, options = self.problem, self.problem.shell, self.motion, self.options
        k, n_x, t = motion.kinematics, shell.alpha_offset, motion.time + dt
        lam = self.schedule(t)
        rule = step_rule(options.method, k, dt, options.rho)
        held = problem.prescribed(lam)
        old = None
        if rule.old_force:
            shell.viscosity = self._last_viscosity()  # that of a rejected step may still be there
            old = self._static_gradient(motion)
            old[n_x:] = 0.0
        self.inertia.begin_step(rule, k, old)
        predicted = (k.x + dt * k.v).reshape(-1, 3)
        for drag in self.drag:
            drag.begin_step(shell, rule, predicted, t)
        shell.viscosity = self._viscosity(rule)
        problem.force_scale = float(np.linalg.norm(self.inertia.mass(k.a.reshape(-1, 3))))
        done, base = 1.0, motion.state
        if self.contact is not None:
            done = self.contact.begin_step(shell, base, None, motion.time, t, dt)
            if done < 1.0:
                done, base = self.contact.advance(shell, base, problem.fixed)
        guess, energy = self._guess(rule, base, held, lam)
        if guess is None:
            return "LockingReached"
        touching = self.contact is not None and self.contact.touches(shell, guess)
        settings = options.newton
        if touching:  # full steps bounce off barriers
            settings = replace(settings, plain_iterations=0)
        self._to_come = np.inf
        enough = self._enough(rule) if options.iteration_error > 0 else None
        result, moves = newton(problem, guess, lam, settings, enough=enough, energy=energy), 0
        self._count(tally, result)
        while result.converged and done < 1.0 and moves < MAX_MOVES:  # a body on its way pushes the sheet in collision-free moves
            (done, base), moves = self.contact.advance(shell, result.state, problem.fixed), moves + 1
            result = newton(problem, base, lam, settings, enough=enough)
            self._count(tally, result)
        if not result.converged or done < 1.0:
            tally.wasted += result.iterations
            return "BodyBlocked" if result.converged else failure_name(result)
        tally.iterations += result.iterations
        tally.inexact += result.by_error
        state = shell.accept(result.state)
        return self._accept(rule, state, result, t, dt)

    def _enough(self, rule: StepRule) -> Callable[[State, float, bool], bool]:
        """Whether what Newton's method leaves is small beside the local error of the time step.

        What is left after an iteration is at most the iteration itself. One of θ times the one before is followed by others of
        θ/(1 - θ) of it in sum; for the first one that of the last time step is taken (Hairer and Wanner), a little more each time
        so that it is found anew.
        """
        before, n_x, mass = self.motion.kinematics, self.problem.shell.alpha_offset, self.inertia.mass.total
        last, self._to_come = np.inf, self.motion.to_come

        def enough(state: State, decrement: float, full: bool) -> bool:
            nonlocal last
            if not full or decrement < 0:
                last, self._to_come = np.inf, np.inf
                return False
            size = float(np.sqrt(decrement / (rule.ca * mass)))
            ratio = size / last if last > 0 else 0.0
            if np.isfinite(last):
                self._to_come = ratio / (1.0 - ratio) if ratio < 1.0 else np.inf
            else:
                self._to_come = max(self._to_come, 1e-16) ** 0.8
            last = size
            error = self._local_error(rule, before, rule.advance(before, state.u[:n_x]))
            return min(1.0, self._to_come) * size <= self.options.iteration_error * error

        return enough

    def _guess(self, rule: StepRule, base: State, held: np.ndarray, lam: float) -> tuple[State | None, float]:
        """Start of Newton's method and its potential, J: the last acceleration again (not with contact) or none, else no motion.

        ``base`` is the state at the start of the step, pushed along by bodies that have moved meanwhile.
        """
        problem, k = self.problem, self.motion.kinematics
        pushed, kept = base is not self.motion.state, base.u[: len(k.x)]
        places = [(rule.xa + k.a / rule.ca, True), (rule.xa, True), (kept, False)]
        if self.contact is not None:  # accelerations of a sheet that is being stopped tell nothing of the next
            places = places[1:]
        best, lowest = None, np.inf
        for x, moves in places:
            if best is not None and not moves:
                break
            u = base.u.copy()
            u[: len(x)] = x
            u[problem.fixed] = held
            trial = base.with_u(u)
            if self.contact is not None:
                if moves:
                    lifted = self.contact.lifted(u[: len(x)].reshape(-1, 3), kept.reshape(-1, 3))
                    u[: len(x)] = lifted.ravel()
                    u[problem.fixed] = held
                trial = self.contact.limit(problem.shell, base, trial)
                if pushed or not np.array_equal(trial.u[problem.fixed], held):
                    trial.u[problem.fixed] = held
            energy = problem.energy(trial, lam)
            if energy < lowest:
                best, lowest = trial, energy
        return best, lowest

    def _viscosity(self, rule: StepRule) -> Viscosity | None:
        """Viscous energy of the step: rates by the backward difference of the integrator."""
        if not self._dissipative:
            return None
        motion = self.motion
        if rule.order == 2 and self.options.method == "bdf2" and len(motion.strain) == 6:
            w = rule.dt / motion.kinematics.dt_old
            c1, c2 = -(1 + w) / rule.dt, w * w / (1 + w) / rule.dt
            star = [-(c1 * new + c2 * old) / rule.cv for new, old in zip(motion.strain[:3], motion.strain[3:], strict=True)]
            return Viscosity(self.options.stiffness_damping * rule.cv, *star)
        return Viscosity(self.options.stiffness_damping / rule.dt, *motion.strain[:3])

    def _last_viscosity(self) -> Viscosity | None:
        """Viscosity of the last accepted step of generalised-α, whose stress belongs to the old forces of the next."""
        motion = self.motion
        if len(motion.strain) < 6:
            return None
        return Viscosity(self.options.stiffness_damping / motion.kinematics.dt_old, *motion.strain[3:])

    def _count(self, tally: _Tally, result) -> None:
        tally.assembly += result.assembly_s
        tally.solve += result.solve_s
        tally.notes += result.notes

    def _accept(self, rule: StepRule, state: State, result, t: float, dt: float) -> StepRecord | str:
        problem, shell, motion = self.problem, self.problem.shell, self.motion
        before, n_x = motion.kinematics, shell.alpha_offset
        kinematics = rule.advance(before, state.u[:n_x].copy())
        error = self._local_error(rule, before, kinematics)
        if self.options.tolerance is not None and error > 4.0 * self.options.tolerance and dt > 2.0 * self.options.min_dt:
            return "ToleranceMissed"
        moved = kinematics.x - before.x
        gradient = problem.gradient(state, self.schedule(t))
        reaction = rule.force_weight * gradient[problem.fixed]
        residual, relative = result.residual, result.residual_relative
        if result.by_error:  # that before the last iteration
            gradient[problem.fixed] = 0.0
            now = problem.norm(gradient)
            residual, relative = now, relative * now / residual if residual > 0 else relative
        dissipated = self._drag_work(rule, before.x, kinematics.x, t)
        dissipated += self.options.mass_damping * float(self.inertia.mass(moved.reshape(-1, 3)).ravel() @ moved) / dt
        if shell.viscosity is not None:
            dissipated += self._viscous_work(state, motion.strain[:3], dt)
        work = float(reaction @ (state.u - motion.state.u)[problem.fixed]) if len(problem.fixed) else 0.0
        work += self._schedule_work(rule, motion.time, t, motion.state, state)
        samples = (*self._samples(state), *motion.strain[:3]) if self._dissipative else ()
        if self.contact is not None:
            self.contact.end_step(shell, state)
        self.motion = Motion(t, state, kinematics, motion.dt, motion.step + 1, samples, motion.dissipated + dissipated,
                             motion.work + work, motion.first_energy, self._to_come)
        energy = self._energy(self.motion)
        total = energy.pop("total")
        defect = motion.first_energy - total - self.motion.dissipated + self.motion.work
        speed = float(np.sqrt(np.sum(kinematics.v.reshape(-1, 3) ** 2, axis=1).max(initial=0.0)))
        contacts, distance = 0, None
        if self.contact is not None:
            contacts, distance = self.contact.summary()
        return StepRecord(t, dt, result.iterations, residual, relative, **energy,
                          dissipated=self.motion.dissipated, defect=defect, speed=speed, error=error, contacts=contacts,
                          distance=distance)

    def _drag_work(self, rule: StepRule, old: np.ndarray, new: np.ndarray, t: float) -> float:
        """Work that the drag has taken over the last step, J: by its force at the end (order 1) or in the middle (order 2)."""
        shell, total = self.problem.shell, 0.0
        x = new
        if rule.order == 2 and self.drag:
            x = 0.5 * (old + new)
            middle = StepRule(rule.dt, 1.0, x - (new - old) / rule.dt, 1.0, x)
            for drag in self.drag:
                drag.begin_step(shell, middle, x.reshape(-1, 3), t - 0.5 * rule.dt)
        for drag in self.drag:
            total += float(drag.force(shell, x.reshape(-1, 3)) @ (new - old))
        return total

    def _schedule_work(self, rule: StepRule, t_old: float, t: float, old: State, new: State) -> float:
        """Change of the potential of the loads because their factor changes, J."""
        before, after = self.schedule(t_old), self.schedule(t)
        if before == after:
            return 0.0
        shell, states = self.problem.shell, (old,) if rule.order == 1 else (old, new)
        changes = [load.energy(shell, s, after) - load.energy(shell, s, before) for load in self.external for s in states]
        return float(sum(changes)) / len(states)

    def _viscous_work(self, state: State, before: tuple[np.ndarray, ...], dt: float) -> float:
        """Work of the viscous stresses over the last step at its mean rates, J."""
        shell, g = self.problem.shell, self.problem.shell.geometry
        strain, interior, edge = (new - old for new, old in zip(self._samples(state), before, strict=True))
        stiffness = shell.fabric.membrane_scale * shell.fabric.law.tangent_at_rest()
        work = float(np.sum(g.area_weights * np.sum((strain @ stiffness) * strain, axis=-1)))
        if shell.with_bending:
            moment = np.einsum("ek,eqrk->eqr", edge, g.R_edge, optimize=True)
            if g.tables.order == 2:
                moment += np.einsum("eqa,eqra->eqr", interior, g.R_interior, optimize=True)
            work += float(np.sum(moment**2))
        return self.options.stiffness_damping / dt * work

    def _local_error(self, rule: StepRule, old: Kinematics, new: Kinematics) -> float:
        """Estimate of the local error of the positions, m (root mean square over the nodes)."""
        change = new.a - old.a
        if rule.order == 1:
            e = 0.5 * rule.dt * (new.v - old.v)
        elif self.options.method == "bdf2":
            e = (2.0 / 9.0) * rule.dt**2 * change
        else:
            e = rule.dt**2 * abs(1 / (rule.ca * rule.dt**2) - 1 / 6) * change
        return float(np.sqrt(3.0 * np.mean(e**2)))

    def _energy(self, motion: Motion) -> dict[str, float]:
        """Energies at a motion, J."""
        shell, state, v = self.problem.shell, motion.state, motion.kinematics.v.reshape(-1, 3)
        membrane, bending = shell.energies(state)
        lam = self.schedule(motion.time)
        parts = {"kinetic": 0.5 * float(np.sum(v * self.inertia.mass(v))), "membrane": membrane, "bending": bending,
                 "potential": float(sum(load.energy(shell, state, lam) for load in self.external)),
                 "contact": 0.0 if self.contact is None else float(self.contact.energy(shell, state, lam))}
        return parts | {"total": sum(parts.values())}

    # -- many steps ------------------------------------------------------------------------------------------------------
    def run(self, until: float, on_step: Callable[[StepRecord], None] | None = None, stops: Sequence[float] = ()) -> DynamicResult:
        """Advance to the time ``until`` (s), which is hit exactly, as are the times ``stops``.

        Parameters
        ----------
        on_step : callable, optional
            Called with the record of every accepted step (then :attr:`motion` is that step's).
        """
        begin, options = clock.perf_counter(), self.options
        tally, records, status = _Tally(), [], "converged"
        mark, failed = self.motion.time, 0
        targets = sorted({t for t in stops if self.motion.time < t < until} | {until})
        for target in targets:
            while target - self.motion.time > 1e-9 * options.dt:
                left = target - self.motion.time
                dt = left / max(1, int(np.ceil(left / self.motion.dt - 1e-9)))
                outcome = self.step(dt, tally)
                if isinstance(outcome, StepRecord):
                    self._adapt(outcome, dt)
                    records.append(outcome)
                    if on_step is not None:
                        on_step(outcome)
                    continue
                tally.halvings += 1
                self.motion = replace(self.motion, dt=0.5 * dt)
                if self.motion.time - mark >= options.dt:
                    mark, failed = self.motion.time, 0
                failed += 1
                if 0.5 * dt < options.min_dt or (failed > options.max_halvings and options.tolerance is None):
                    status = outcome
                    break
            if status != "converged":
                break
        message = f"{self.motion.time:.6g} s reached" if status == "converged" else (
            f"{status}: {self.motion.time:.6g} s of {until:.6g} s reached; steps of {2 * self.motion.dt:.1e} s do not converge "
            f"({failed} failed since {mark:.6g} s); the last accepted state is kept")
        timings = {"assembly": tally.assembly, "solve": tally.solve, "total": clock.perf_counter() - begin}
        return DynamicResult(status == "converged", status, message, self.motion, tuple(records), tally.iterations, tally.wasted,
                             tally.halvings, tally.inexact, timings, tuple(dict.fromkeys(tally.notes)))

    def _adapt(self, record: StepRecord, dt: float) -> None:
        """Step to try next: back to the nominal one after halvings; with a tolerance by the local error and Newton's effort."""
        options = self.options
        proposal = min(options.dt, 2.0 * dt)
        if options.tolerance is not None:
            order = 1 if options.method == "implicit-euler" else 2
            factor = 0.9 * (options.tolerance / max(record.error, 1e-300)) ** (1.0 / (order + 1))
            proposal = min(options.dt, dt * float(np.clip(factor, 0.3, 2.0)))
            if record.iterations > 20:
                proposal = min(proposal, 0.7 * dt)
        if dt < self.motion.dt * (1 - 1e-9) and options.tolerance is None and record.iterations < 30:
            proposal = max(proposal, self.motion.dt)  # shortened only to hit a stop
        self.motion = replace(self.motion, dt=max(proposal, options.min_dt))
