"""Bounded trust-region least squares over several experiments, with exact Jacobian, multi-start and resumption."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from calibration.checkpoint import Checkpoint
from calibration.experiments import Experiment
from calibration.forward import Prediction
from calibration.problem import Problem
from mfar_fem.errors import NotConvergedError

logger = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Fit:
    """Result of a fit.

    Attributes
    ----------
    problem : Problem
    parameters : dict of str to float
        Fitted values by name, SI.
    q : ndarray, shape (p,)
        The same in the fit's coordinate (ln theta for log-scaled ones).
    residuals : ndarray, shape (n,)
        Weighted residuals r (see `calibration.problem`).
    jacobian : ndarray, shape (n, p)
        dr/dq.
    cost : float
        Sum of r² over 2.
    predictions : list of Prediction
        By experiment.
    n_evaluations : int
        Forward evaluations of the whole set, all starts together.
    converged : bool
    status : str
        In words.
    """

    problem: Problem
    parameters: dict[str, float]
    q: np.ndarray
    residuals: np.ndarray
    jacobian: np.ndarray
    cost: float
    predictions: list[Prediction]
    n_evaluations: int
    converged: bool
    status: str

    @property
    def fabric(self):
        """The fabric with the fitted values."""
        return self.problem.fabric_at(self.parameters)

    @property
    def law(self):
        """The fitted law."""
        return self.fabric.law

    @property
    def ssr(self) -> float:
        """Sum of squared weighted residuals."""
        return 2.0 * self.cost

    @property
    def degrees_of_freedom(self) -> int:
        """Number of readings less number of unknowns."""
        return self.problem.size - len(self.q)

    @property
    def rmse_by_experiment(self) -> dict[str, float]:
        """Root mean square error of every curve, % of its measured force range (of the mean for repeated values)."""
        pairs = zip(self.problem.experiments, self.predictions, strict=True)
        return {e.name: rmse_percent(e, p.y) for e, p in pairs}

    @property
    def rmse_percent_of_range(self) -> float:
        """Root of the mean over the experiments of their squared error in % of range: each curve counts alike."""
        return float(np.sqrt(np.mean(np.square(list(self.rmse_by_experiment.values())))))

    def at_bounds(self, tolerance: float = 1e-6) -> dict[str, str]:
        """Unknowns that ended on a bound: name to 'lower' or 'upper'."""
        low, high = self.problem.bounds()
        out = {}
        for name, q, a, b in zip(self.problem.names, self.q, low, high, strict=True):
            span = tolerance * (b - a if np.isfinite(b - a) else max(1.0, abs(q)))
            if q - a <= span:
                out[name] = "lower"
            elif b - q <= span:
                out[name] = "upper"
        return out


def rmse_percent(e: Experiment, y: np.ndarray) -> float:
    """Root mean square of y - measured in % of the experiment's scale; inf if a prediction is missing."""
    return float(100.0 * np.sqrt(np.mean(np.square(y - e.y))) / e.scale) if np.isfinite(y).all() else float("inf")


class _Evaluator:
    """Keeps the last evaluation, so that residual and Jacobian of one point cost one forward run."""

    def __init__(self, problem: Problem, on_accept: Callable[[np.ndarray, float, int], None]):
        self.problem, self.on_accept, self.count, self.key = problem, on_accept, 0, None

    def at(self, q):
        key = np.asarray(q, float).tobytes()
        if key != self.key:
            self.count += 1
            self.value, self.key = self.problem.evaluate(q, jacobian=True), key
        return self.value

    def residual(self, q):
        return self.at(q)[0]

    def jacobian(self, q):
        r, J, _ = self.at(q)  # the trust-region method asks for the Jacobian only where it has accepted a step
        self.on_accept(q, 0.5 * float(r @ r), self.count)
        return J


def fit(
    problem: Problem,
    *,
    starts: int = 1,
    seed: int = 0,
    checkpoint: str | Path | None = None,
    resume: bool = True,
    max_evaluations: int = 200,
    tolerance: float = 1e-9,
    progress: Callable[[int, float], None] | None = None,
) -> Fit:
    """Fit the unknowns.

    A step to where the forward model fails (locking, no convergence, values the law refuses together) has an infinite
    residual there: it is refused and the trust region shrunk; no penalty term distorts the minimum, no NaN arises.

    Parameters
    ----------
    problem : Problem
    starts : int
        The first start is the initial value; others are drawn around it (factor 30 either way in log scale, within
        the bounds) with `seed`, the most promising of 8 draws each. The best end is returned.
    seed : int
    checkpoint : path-like, optional
        JSON file with the last accepted iterate of every start, written atomically; an existing one of the same
        problem is resumed from (`resume`), so an interrupted fit loses at most the step under way.
    resume : bool
    max_evaluations : int
        Forward evaluations a start.
    tolerance : float
        Relative change of cost and parameters, and scaled gradient, at which a start is finished.
    progress : callable, optional
        Called with (evaluations, cost) at every accepted iterate.

    Returns
    -------
    Fit

    Raises
    ------
    NotConvergedError
        No start where the forward model works was found.
    """
    state = Checkpoint(checkpoint, problem.signature(), resume)
    evaluations, best, failures = 0, None, []
    for k in range(starts):
        key = str(k)
        known = state.get(key)
        if known is None:
            q0, used = _start(problem, k, seed)
            evaluations += used
            if q0 is None:
                failures.append(k)
                continue
        else:
            q0 = np.asarray(known["q"])
        evaluations += known["evaluations"] if known else 0
        if known is None or not known["done"]:
            q, used, converged, status = _run(problem, q0, state, key, max_evaluations, tolerance, progress)
            evaluations += used
        else:
            q, converged, status = q0, known["status"] == "converged", known["status"]
        q = _snapped(problem, q)
        r, J, predictions = problem.evaluate(q)
        cost = 0.5 * float(r @ r)
        if np.isfinite(cost) and (best is None or cost < best.cost * (1 - 1e-12)):
            best = Fit(problem, problem.values(q), q, r, J, cost, predictions, 0, converged, status)
    if best is None:
        raise NotConvergedError(
            f"{problem.fabric.law.name}: the forward model reaches all readings at none of the starting values tried; "
            "give other initial values or raise the number of starts"
        )
    return replace(best, n_evaluations=evaluations)


def _snapped(problem: Problem, q: np.ndarray) -> np.ndarray:
    """Linear-scaled values that ended a hair inside a bound, as the interior method leaves them, put on it."""
    low, high = problem.bounds()
    linear = np.array([u.scale != "log" for u in problem.unknowns]) & np.isfinite(high - low)
    near = 1e-8 * np.where(linear, high - low, 0.0)
    q = np.where(linear & (q - low < near), low, q)
    return np.where(linear & (high - q < near), high, q)


def _run(problem, q0, state, key, max_evaluations, tolerance, progress):
    from scipy.optimize import least_squares

    low, high = problem.bounds()
    before = (state.get(key) or {}).get("evaluations", 0)

    def accept(q, cost, count):
        state.put(key, q, cost, before + count)
        if progress is not None:
            progress(count, cost)

    evaluator = _Evaluator(problem, accept)
    inside = np.clip(q0, low + 1e-12 * np.maximum(1, abs(low)), high - 1e-12 * np.maximum(1, abs(high)))
    solution = least_squares(
        evaluator.residual,
        inside,
        jac=evaluator.jacobian,
        bounds=(low, high),
        method="trf",
        x_scale="jac",
        ftol=tolerance,
        xtol=tolerance,
        gtol=tolerance,
        max_nfev=max_evaluations,
    )
    converged = bool(solution.status > 0)
    status = "converged" if converged else f"stopped after {max_evaluations} evaluations"
    state.put(key, solution.x, solution.cost, before + evaluator.count, done=True, status=status)
    return solution.x, evaluator.count, converged, status


def _start(problem: Problem, k: int, seed: int) -> tuple[np.ndarray | None, int]:
    """A starting point at which the forward model works: the initial values for k = 0, drawn ones otherwise."""
    q0, (low, high) = problem.q0(), problem.bounds()
    count = 0
    if k == 0:
        r, _, _ = problem.evaluate(q0, jacobian=False)
        count = 1
        if np.isfinite(r).all():
            return q0, count
    rng = np.random.default_rng([seed, k])
    best, best_cost = None, np.inf
    for attempt in range(8 if k else 60):
        reach = np.log(30.0) * (1.0 if k else min(1.0, (attempt + 1) / 20))
        q = np.empty_like(q0)
        for j, u in enumerate(problem.unknowns):
            if u.scale == "log":
                a, b = max(low[j], q0[j] - reach), min(high[j], q0[j] + reach)
            else:
                width = reach / np.log(30.0) * (abs(q0[j]) if q0[j] else 1.0)
                a, b = max(low[j], q0[j] - width), min(high[j], q0[j] + width)
            q[j] = rng.uniform(a, b)
        r, _, _ = problem.evaluate(q, jacobian=False)
        count += 1
        cost = float(r @ r) if np.isfinite(r).all() else np.inf
        if cost < best_cost:
            best, best_cost = q, cost
            if k == 0:
                break
    return best, count


def fit_values(problem: Problem, values: Mapping[str, float]) -> Fit:
    """The `Fit` record of given values, without fitting (for validation and for reports)."""
    q = np.array([float(u.to_q(values[u.name])) for u in problem.unknowns])
    r, J, predictions = problem.evaluate(q)
    return Fit(problem, problem.values(q), q, r, J, 0.5 * float(r @ r), predictions, 1, True, "given")
