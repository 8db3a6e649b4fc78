"""One case of the stress test: solve it, look for what is not finite, and verify what claims to have converged."""

from __future__ import annotations

import time
import traceback
import warnings
from dataclasses import dataclass, field, fields, replace

import numpy as np

from mfar_fem.shell import State
from mfar_fem.solve import NewtonOptions, Problem, solve_static
from mfar_fem.solve.dynamics import Dynamics, DynamicsOptions
from mfar_fem.solve.rest import RestOptions, relax, resting_problem
from mfar_fem.stress.cases import Case
from mfar_fem.stress.verify import Verdict, Verifier

OUTCOMES = ("converged", "failure", "nan", "hang", "unverified", "crash")


@dataclass
class Outcome:
    """How a case ended.

    Attributes
    ----------
    case : Case
    outcome : str
        ``converged`` (and verified), ``failure`` (named, with a usable last state), ``nan``, ``hang``, ``unverified`` (claims to
        have converged, or to have kept a good state, and has not) or ``crash`` (an exception that is no result).
    status, message : str
        The solver's own.
    residual, rounding : float
        Independent residual and its rounding, relative to the forces at work; the largest of the steps.
    reached : float
        Load factor or share of the time.
    iterations : int
    wall_s, cpu_s : float
        Solution and verification.
    aspect : float
        Longest edge over smallest height, largest of the mesh.
    warnings : list of str
        RuntimeWarnings on the way.
    state : State or None
        The last one.
    """

    case: Case
    outcome: str = "crash"
    status: str = ""
    message: str = ""
    residual: float = float("nan")
    rounding: float = float("nan")
    reached: float = 0.0
    iterations: int = 0
    wall_s: float = 0.0
    cpu_s: float = 0.0
    aspect: float = 1.0
    triangles: int = 0
    warnings: list[str] = field(default_factory=list)
    state: State | None = field(default=None, repr=False)

    def row(self) -> dict:
        """The outcome without its state, flat, for tables."""
        c = self.case
        names = ("seed", "index", "kind", "order", "support", "law", "stiffness", "bending", "thickness", "stretch", "compression",
                 "weight", "pull", "dt", "method")
        out = {name: getattr(c, name) for name in names}
        out |= {f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("case", "state", "warnings")}
        return out | {"warnings": len(self.warnings), "first_warning": self.warnings[0] if self.warnings else ""}


def aspect_ratio(surface) -> float:
    """Largest ratio of longest edge to smallest height of the triangles."""
    corners = surface.vertices[surface.triangles]
    square = np.sum((corners - corners[:, [1, 2, 0]]) ** 2, axis=2).max(axis=1)
    return float((square / (2 * surface.areas)).max())


def run_case(case: Case) -> Outcome:
    """Solve and verify a case; never raises for what happens in the solver."""
    out = Outcome(case)
    clock, cpu = time.perf_counter(), time.process_time()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", RuntimeWarning)
        try:
            surface = case.surface()
            out.aspect, out.triangles = aspect_ratio(surface), len(surface.triangles)
            _RUNS[case.kind](case, surface, out)
        except Exception as error:  # the stress test is there to find these
            where = traceback.extract_tb(error.__traceback__)[-1]
            out.outcome, out.status = "crash", type(error).__name__
            out.message = f"{error} ({where.filename.rsplit('/', 1)[-1]}:{where.lineno})"
    out.wall_s, out.cpu_s = time.perf_counter() - clock, time.process_time() - cpu
    seen = [f"{w.message} ({w.filename.rsplit('/', 1)[-1]}:{w.lineno})" for w in caught if issubclass(w.category, RuntimeWarning)]
    out.warnings = list(dict.fromkeys(seen))
    return out


def _conclude(out: Outcome, verifier: Verifier, converged: bool, numbers, verdicts: list[Verdict]) -> None:
    """Set the outcome from the solver's claim, the finiteness of all it returned, and the verdicts."""
    assert out.state is not None
    if not all(np.all(np.isfinite(v)) for v in (*numbers, out.state.u, out.state.directors)):
        out.outcome = "nan"
        return
    good = [v for v in verdicts if np.isfinite(v.residual)]
    if good:
        out.residual = max(v.relative for v in good)
        out.rounding = max(v.rounding / v.reference if v.reference > 0 else 0.0 for v in good)
    wrong = [v.reason for v in verdicts if not v.ok]
    if converged:
        out.outcome = "unverified" if wrong else "converged"
    else:
        admissible = np.isfinite(sum(verifier.sheet.energy(out.state.u, out.state.directors)))
        wrong = [] if admissible and out.status in out.message else ["the state that was kept is not admissible"]
        out.outcome = "unverified" if wrong else "failure"
    if wrong:
        out.message += f"; verification: {wrong[0]}"


def _statics(case: Case, surface, out: Outcome) -> None:
    options = NewtonOptions()
    problem = Problem(surface, case.fabric(), case.supports(surface), case.loads())
    result = solve_static(problem, 1, options, start=case.start(problem))
    out.status, out.message, out.state, out.reached = result.status, result.message, result.state, result.lam
    out.iterations = result.newton_iterations + result.wasted_iterations
    verifier = Verifier(case, surface, problem.shell.fabric, options.rtol)
    last = result.steps[-1]
    numbers = [last.reaction, last.membrane_energy, last.bending_energy, last.residual, last.residual_relative]
    verdicts = [verifier.static(result.state, result.lam)] if result.converged else []
    _conclude(out, verifier, result.converged, numbers, verdicts)


def _rest(case: Case, surface, out: Outcome) -> None:
    options = RestOptions()
    problem = resting_problem(surface, case.fabric(), case.supports(surface), case.loads())
    result = relax(problem, case.start(problem), options)
    out.iterations = result.iterations
    if not result.converged:  # what a user does next: a hundredth of the tensile stiffness first
        result = relax(problem, case.start(problem), replace(options, softening=(0.01,)))
        out.iterations += result.iterations
    out.status, out.message, out.state = result.status, result.message, result.state
    out.reached = float(result.converged)
    verifier = Verifier(case, surface, problem.shell.fabric, options.rtol)
    numbers = [result.energy, result.membrane, result.bending, result.residual, result.residual_relative, result.history]
    verdicts = [verifier.static(result.state)] if result.converged else []
    _conclude(out, verifier, result.converged, numbers, verdicts)


def _dynamics(case: Case, surface, out: Outcome) -> None:
    options = DynamicsOptions(method=case.method, dt=case.dt, mass=case.mass)
    end = case.steps * case.dt
    ramp = (lambda t: min(t / end, 1.0)) if case.support == "pulled" else (lambda t: 1.0)
    fabric, supports = case.fabric(), case.supports(surface)
    probe = Problem(surface, fabric, supports)
    run = Dynamics(surface, fabric, supports, _steady(case.loads()), options=options, schedule=ramp, start=case.start(probe))
    motions = [run.motion]
    result = run.run(end, lambda record: motions.append(run.motion))
    out.status, out.message, out.state, out.iterations = result.status, result.message, result.state, result.newton_iterations
    out.reached = result.motion.time / end
    verifier = Verifier(case, surface, fabric, options.rtol)
    numbers = [m.kinematics.v for m in motions] + [m.kinematics.a for m in motions]
    numbers += [v for r in result.records for v in vars(r).values() if v is not None]
    shown = sorted({*range(1, min(len(motions), 4)), *range(max(1, len(motions) - 3), len(motions))})
    verdicts = [verifier.step(motions[max(0, i - 2):i + 1], ramp(motions[i].time), options.rho) for i in shown]
    _conclude(out, verifier, result.converged, numbers, verdicts)


def _steady(loads: list) -> list:
    """Loads that do not follow the schedule: only supports move in the dynamic cases."""
    for load in loads:
        load.ramp = False
    return loads


_RUNS = {"statics": _statics, "rest": _rest, "dynamics": _dynamics}
