"""Profile likelihood: one parameter held, the others refitted exactly, until the data refuse.

With ``SSR(theta_k)`` the smallest weighted sum of squares at a fixed value of one parameter, the interval at a level is
where ``(SSR(theta_k) - SSR_min) / s² <= F(level; 1, n - p)``, s² = SSR_min / (n - p) (Bates & Watts, Nonlinear
Regression Analysis and Its Applications, 1988, doi 10.1002/9780470316757, section 6.1). Unlike the linear interval it
needs no symmetry, and it is open at a side where the data set no end before the parameter's bound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.fit import Fit, fit
from calibration.problem import Problem
from calibration.runs import SERIAL, Failed, Workers, run_all
from mfar_fem.errors import MfarError, ParameterError


@dataclass(frozen=True, eq=False)
class Profile:
    """Profile of one parameter.

    Attributes
    ----------
    name : str
    best : float
        The fitted value, SI.
    values : ndarray, shape (k,)
        Grid, ascending, SI.
    delta : ndarray, shape (k,)
        (SSR - SSR_min) / s²; +inf where the model could not be evaluated.
    threshold : float
        The F quantile that delta is compared with.
    low, high : float or None
        Interval ends; None where delta stays under the threshold up to the bound: "no lower (upper) bound".
    lower_limit, upper_limit : float
        The parameter's bounds.
    level : float
    improved : float or None
        If the profile found a smaller SSR than the fit, that SSR: the fit was not the best minimum.
    note : str
    """

    name: str
    best: float
    values: np.ndarray
    delta: np.ndarray
    threshold: float
    low: float | None
    high: float | None
    lower_limit: float
    upper_limit: float
    level: float
    improved: float | None = None
    note: str = ""

    @property
    def interval(self) -> tuple[float | None, float | None]:
        """``(low, high)``, SI; None where delta stays under the threshold up to the parameter's bound."""
        return self.low, self.high


CLOSE = 0.01
"""How near sqrt(delta) must come to its threshold, relative."""
REFIT_TOLERANCE = 1e-5
"""Of the refits: the sum of squares is flat at its minimum, so this is far more than `CLOSE` needs."""


class _Tracer:
    """SSR as a function of one parameter's coordinate, each refit started from the nearest one already done."""

    def __init__(self, f: Fit, k: int, max_evaluations: int, threshold: float, s2: float):
        self.f, self.k, self.max_evaluations, self.threshold, self.s2 = f, k, max_evaluations, threshold, s2
        self.unknown = f.problem.unknowns[k]
        self.points: dict[float, tuple[float, dict[str, float]]] = {float(f.q[k]): (f.ssr, dict(f.parameters))}

    def ssr(self, q: float) -> float:
        if q not in self.points:
            self.points[q] = self._refit(q, self._guess(q))
        return self.points[q][0]

    def _guess(self, q: float) -> dict[str, float]:
        """The others where they are expected: on the line through the two nearest refits, or along the linear valley."""
        unknowns = self.f.problem.unknowns
        done = sorted((x for x in self.points if np.isfinite(self.points[x][0])), key=lambda x: abs(x - q))
        a = np.array([float(u.to_q(self.points[done[0]][1][u.name])) for u in unknowns])
        if len(done) > 1:
            b = np.array([float(u.to_q(self.points[done[1]][1][u.name])) for u in unknowns])
            slope = (a - b) / (done[0] - done[1])
        else:
            own, others = self.f.jacobian[:, self.k], np.delete(self.f.jacobian, self.k, axis=1)
            slope = np.insert(-np.linalg.lstsq(others, own, rcond=1e-10)[0], self.k, 1.0)
        moved = a + np.clip(slope * (q - done[0]), -1.0, 1.0) if len(unknowns) > 1 else a
        return {u.name: float(u.from_q(x)) for u, x in zip(unknowns, moved, strict=True)}

    def _refit(self, q: float, start: dict[str, float]) -> tuple[float, dict[str, float]]:
        problem, name = self.f.problem, self.unknown.name
        value = float(self.unknown.from_q(q))
        if len(problem.unknowns) == 1:
            r, _, _ = problem.evaluate(np.array([q]), jacobian=False)
            return (float(r @ r) if np.isfinite(r).all() else np.inf), {name: value}
        base = problem.started_at(start)
        others = {k: v for k, v in start.items() if k != name}
        try:
            base = base.vary(fabric=base.fabric_at({**others, name: value}))
            quick = _gauss_newton(base.fixed(name, value), CLOSE * self.threshold * self.s2)
            if quick is not None:
                return quick[0], {**quick[1], name: value}
            f = fit(base.fixed(name, value), max_evaluations=self.max_evaluations, tolerance=REFIT_TOLERANCE)
        except (ParameterError, MfarError):
            return np.inf, start
        return f.ssr, {**f.parameters, name: value}


def _gauss_newton(problem: Problem, enough: float, tries: int = 8) -> tuple[float, dict[str, float]] | None:
    """Refit by Gauss–Newton steps (shortened where they overshoot) from a good start; None where that does not settle.

    Ends as soon as the linearised problem (with its bounds) promises less than ``enough`` of the sum of squares; that
    promise is then taken off. Returns the sum of squares and the parameters.
    """
    from scipy.optimize import lsq_linear

    low, high = problem.bounds()
    q = np.array([float(u.to_q(u.initial)) for u in problem.unknowns])
    last, before, taken = np.inf, q, np.zeros(q.size)
    for _ in range(tries):
        r, J, _ = problem.evaluate(q)
        if J is None or not np.isfinite(r).all():
            return None
        ssr = float(r @ r)
        if ssr > last:
            taken = 0.4 * taken
            q = np.clip(before + taken, low, high)
            continue
        scale = np.maximum(np.linalg.norm(J, axis=0), 1e-300)
        room_low, room_high = np.minimum((low - q) * scale, 0.0), np.maximum((high - q) * scale, 0.0)
        free = room_high - room_low > 0
        move = np.zeros(q.size)
        move[free] = lsq_linear(J[:, free] / scale[free], -r, bounds=(room_low[free], room_high[free]), tol=1e-12).x / scale[free]
        left = r + J @ move
        promise = ssr - float(left @ left)
        if promise < enough:
            return ssr - max(promise, 0.0), problem.values(q + move)
        damping = 1.0 if not taken.any() else 0.6  # a curved model overshoots near the end and would swing
        before, last, taken = q, ssr, damping * np.clip(move, -1.0, 1.0)
        q = np.clip(q + taken, low, high)
    return None


def profile(f: Fit, name: str, *, confidence: float = 0.95, max_evaluations: int = 60, max_points: int = 14) -> Profile:
    """Profile one parameter of a fit.

    The grid is chosen on the way: the first step is the linear standard deviation, then steps grow by up to 3 so
    that sqrt(delta) rises evenly; the end of the interval is located to 1 % of the threshold in sqrt(delta) by regula
    falsi with a refit at every trial.
    """
    from scipy.stats import f as fisher

    problem: Problem = f.problem
    k = problem.names.index(name)
    n, p = f.jacobian.shape
    threshold = float(fisher.ppf(confidence, 1, n - p))
    s2 = max(f.ssr / (n - p), np.finfo(float).tiny)
    low, high = (b[k] for b in problem.bounds())
    tracer = _Tracer(f, k, max_evaluations, threshold, s2)

    def z(q: float) -> float:  # signed root, clipped at zero: nearly linear in q near the optimum
        return float(np.sqrt(max(tracer.ssr(q) - f.ssr, 0.0) / s2))

    step = _sd(f, k, s2)
    ends = [
        _search(z, float(f.q[k]), side, step, bound, np.sqrt(threshold), max_points)
        for side, bound in ((-1, low), (+1, high))
    ]
    u = problem.unknowns[k]
    grid = sorted(tracer.points)
    ssr = np.array([tracer.points[q][0] for q in grid])
    least = float(ssr.min())
    return Profile(
        name=name,
        best=f.parameters[name],
        values=np.array([float(u.from_q(q)) for q in grid]),
        delta=(ssr - f.ssr) / s2,
        threshold=threshold,
        low=None if ends[0] is None else float(u.from_q(ends[0])),
        high=None if ends[1] is None else float(u.from_q(ends[1])),
        lower_limit=u.lower,
        upper_limit=u.upper,
        level=confidence,
        improved=least if least < f.ssr * (1 - 1e-4) else None,
    )


def _sd(f: Fit, k: int, s2: float) -> float:
    """Linear standard deviation, kept within reason: a first step that exists even for a singular Jacobian."""
    own, others = f.jacobian[:, k], np.delete(f.jacobian, k, axis=1)
    free = own - others @ np.linalg.lstsq(others, own, rcond=1e-10)[0] if others.size else own
    sd = np.sqrt(s2) / max(float(np.linalg.norm(free)), 1e-3 * float(np.linalg.norm(own)), 1e-300)
    u = f.problem.unknowns[k]
    span = u.upper - u.lower
    size = 1.0 if u.scale == "log" else max(abs(f.q[k]), 0.2 * span if np.isfinite(span) else 1.0)
    return float(np.clip(sd, 1e-6 * size, size))


def _search(z, q0: float, side: int, step: float, bound: float, target: float, max_points: int) -> float | None:
    """Walk from the optimum until z passes the target, then close in; None if it never does before the bound."""
    a, za = q0, 0.0
    for _ in range(max_points):
        b = a + side * step
        at_bound = side * (b - bound) >= 0
        b = bound if at_bound else b
        zb = z(b)
        if zb >= target:
            return _close_in(z, a, za, b, zb, target)
        if at_bound:
            return None
        rate = max(zb - za, 1e-3 * target)
        wanted = 0.5 * target if zb < 0.5 * target else 1.2 * (target - zb)
        step = abs(b - a) * float(np.clip(wanted / rate, 0.3, 3.0))
        a, za = b, zb
    zb = z(bound) if np.isfinite(bound) else 0.0
    return _close_in(z, a, za, bound, zb, target) if zb >= target else None


def _close_in(z, a: float, za: float, b: float, zb: float, target: float, tries: int = 10) -> float:
    for i in range(tries):
        if abs(zb - target) < CLOSE * target:
            return b
        linear = a + (b - a) * (target - za) / (zb - za) if np.isfinite(zb) else np.nan
        c = linear if np.isfinite(zb) and i % 3 != 2 else 0.5 * (a + b)
        zc = z(c)
        if abs(zc - target) < CLOSE * target:
            return c
        if zc >= target:
            b, zb = c, zc
        else:
            a, za = c, zc
    return a + (b - a) * (target - za) / (zb - za) if np.isfinite(zb) else a


def _one(job: tuple[Fit, str, float, int]) -> Profile:
    f, name, confidence, max_evaluations = job
    return profile(f, name, confidence=confidence, max_evaluations=max_evaluations)


def profiles(
    f: Fit,
    names=None,
    *,
    confidence: float = 0.95,
    max_evaluations: int = 60,
    where: Workers = SERIAL,
    progress=None,
) -> dict[str, Profile]:
    """Profiles of several parameters (all by default), as independent runs; a failed one says why in its note."""
    names = list(f.problem.names if names is None else names)
    jobs = [(f, name, confidence, max_evaluations) for name in names]
    results = run_all(_one, jobs, where, progress=progress, on_error="keep")
    out = {}
    for name, result in zip(names, results, strict=True):
        if isinstance(result, Failed):
            if not isinstance(result.error, MfarError):
                raise result.error
            k = f.problem.names.index(name)
            u = f.problem.unknowns[k]
            here = np.array([f.parameters[name]])
            result = Profile(
                name, here[0], here, np.zeros(1), np.nan, None, None, u.lower, u.upper, confidence, None,
                f"could not be computed: {result.error}",
            )  # fmt: skip
        out[name] = result
    return out
