r"""Whether a state that claims to be a solution is one, found without the code that claims it.

The residual is computed anew from :mod:`mfar_fem.stress.plain` (complex-step derivative of separately written energies),
weights and masses from closed forms, held unknowns from the geometry of the case, velocities and accelerations from the textbook
formulas of the integrators. It must be below

.. math:: 10\,\mathrm{rtol}\,F + 16\,\rho

where F is the largest of external forces, reactions and inertia (the solvers' own reference also counts forces met on the way:
hence the digit of leeway), and :math:`\rho` is what rounding can do: how much the residual changes when every unknown is moved by
a random last digit (root mean square of three draws). Where :math:`16\rho > 0.1 F` the verification cannot tell and the case
counts as not verified.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mfar_fem.stress.cases import Case
from mfar_fem.stress.plain import PlainSheet

LEEWAY = 10.0
ROUNDING = 16.0
BLIND = 0.1
EPS = np.finfo(float).eps


@dataclass(frozen=True)
class Verdict:
    """Outcome of a verification: residual, reference force F and rounding ρ in N; ``reason`` is empty where ``ok``."""

    ok: bool
    residual: float
    reference: float
    rounding: float
    reason: str = ""

    @property
    def relative(self) -> float:
        """Residual over reference."""
        return self.residual / self.reference if self.reference > 0 else 0.0


class Verifier:
    """Independent residuals of the states of one case.

    Parameters
    ----------
    case : Case
    rtol : float
        Tolerance the solver claims to have met.
    """

    def __init__(self, case: Case, surface, fabric, rtol: float):
        self.case, self.rtol = case, rtol
        self.sheet = PlainSheet(surface, fabric)
        self.n_x = 3 * len(surface.nodes)
        self.length = float(np.linalg.norm(np.diff(surface.vertices[surface.edges], axis=1), axis=2).mean())
        self.force = self.sheet.weight(case.acceleration())
        X, L = surface.nodes, case.size[0]
        if case.pull:
            self._pull(surface, L)
        left, right = np.abs(X[:, 0]) < 1e-9 * L, np.abs(X[:, 0] - L) < 1e-9 * L
        width = np.ptp(X[:, 1])
        held = left.copy()
        if case.support == "corners":
            held &= (np.abs(X[:, 1]) < 1e-9 * L * 1e-3) | (np.abs(X[:, 1] - width) < 1e-9 * L * 1e-3)
        if case.support == "pulled":
            held |= right
        self.held_nodes, self.right = held, right
        rotations = np.zeros(len(surface.edges), dtype=bool)
        if case.support == "clamped":
            rotations = np.abs(surface.vertices[surface.edges][:, :, 0]).max(axis=1) < 1e-9 * L
        self.free = ~np.concatenate([np.repeat(held, 3), np.repeat(rotations, surface.order)])
        self.X = X
        self.rng = np.random.default_rng(0)

    def _pull(self, surface, L) -> None:
        """A force per length along x on the right edge."""
        X = surface.vertices
        for i, (a, b) in enumerate(surface.edges):
            if min(X[a, 0], X[b, 0]) > L * (1 - 1e-9):
                f = self.case.pull * abs(X[b, 1] - X[a, 1])
                parts = {a: 0.5, b: 0.5} if surface.order == 1 else {a: 1 / 6, b: 1 / 6, len(X) + i: 2 / 3}
                for node, share in parts.items():
                    self.force[3 * node] += share * f

    def norm(self, r) -> float:
        """Of a residual, N: moments over the mean edge length."""
        with np.errstate(over="ignore"):
            return float(np.sqrt(np.sum(r[: self.n_x] ** 2) + np.sum((r[self.n_x:] / self.length) ** 2)))

    def held_value(self, state, lam: float) -> str:
        """Reason why the held nodes are not where they belong, or ''."""
        expected = self.X.copy()
        if self.case.support == "pulled":
            expected[self.right, 0] += lam * self.case.elongation() * self.case.size[0]
        off = np.abs(state.u[: self.n_x].reshape(-1, 3) - expected)[self.held_nodes].max(initial=0.0)
        return f"held nodes are off by {off:.1e} m" if off > 1e-12 else ""

    def static_gradient(self, u, directors, lam: float = 1.0) -> np.ndarray:
        """Elastic minus external forces (n,)."""
        g = self.sheet.gradient(u, directors)
        g[: self.n_x] -= lam * self.force
        return g

    def _judge(self, residual_of, state, reference: float, lam: float) -> Verdict:
        """Compare ``residual_of(u, directors)`` with what it may be."""
        if not np.all(np.isfinite(state.u)) or not np.isfinite(sum(self.sheet.energy(state.u, state.directors))):
            return Verdict(False, np.inf, reference, np.inf, "the state is not admissible")
        r = residual_of(state.u, state.directors)
        reference = max(reference, self.norm(np.where(self.free, 0.0, r)))
        changes = []
        for _ in range(3):
            sign = self.rng.choice((-1.0, 1.0), len(state.u))
            u = state.u + EPS * sign * np.r_[np.abs(state.u[: self.n_x]), np.ones(len(state.u) - self.n_x)]
            changes.append(self.norm(np.where(self.free, residual_of(u, state.directors) - r, 0.0)))
        rounding = float(np.sqrt(np.mean(np.square(changes))))
        residual = self.norm(np.where(self.free, r, 0.0))
        reason = self.held_value(state, lam)
        if not np.isfinite(residual):
            reason = reason or "the residual has no finite norm"
        elif not residual <= LEEWAY * self.rtol * reference + ROUNDING * rounding:
            reason = reason or f"residual {residual:.2e} N of {reference:.2e} N, rounding {rounding:.1e} N"
        elif not ROUNDING * rounding <= BLIND * reference:
            reason = reason or f"rounding {rounding:.1e} N hides the residual ({reference:.2e} N is carried)"
        return Verdict(not reason, residual, reference, rounding, reason)

    def static(self, state, lam: float = 1.0) -> Verdict:
        """Of an equilibrium at a load factor (statics, rest)."""
        reference = abs(lam) * float(np.linalg.norm(self.force))
        return self._judge(lambda u, d: self.static_gradient(u, d, lam), state, reference, lam)

    # -- dynamics ------------------------------------------------------------------------------------------------------------
    def step(self, motions, lam: float, rho: float) -> Verdict:
        """Of the last step of ``motions``, two or more :class:`mfar_fem.solve.dynamics.Motion` in a row."""
        new, old = motions[-1], motions[-2]
        M = self.sheet.mass_matrix(self.case.mass)
        h = new.time - old.time
        x0, v0, a0 = old.kinematics.x, old.kinematics.v, old.kinematics.a
        before = motions[-3] if len(motions) > 2 else None
        method = self.case.method

        def kinematics(x):
            """Velocity, and acceleration in the balance of momentum."""
            if method == "generalized-alpha":
                am, af = (2 * rho - 1) / (1 + rho), rho / (1 + rho)
                gamma = 0.5 - am + af
                beta = (1 - am + af) ** 2 / 4
                a = (x - x0 - h * v0 - h * h * (0.5 - beta) * a0) / (beta * h * h)
                return v0 + h * ((1 - gamma) * a0 + gamma * a), ((1 - am) * a + am * a0) / (1 - af)
            if method == "bdf2" and before is not None:
                h1 = old.time - before.time  # derivatives at the end of the parabola through three points
                c = np.array([1 / h + 1 / (h + h1), -(h + h1) / (h * h1), h / (h1 * (h + h1))])
                v = c[0] * x + c[1] * x0 + c[2] * before.kinematics.x
                return v, c[0] * v + c[1] * v0 + c[2] * before.kinematics.v
            v = (x - x0) / h
            return v, (v - v0) / h

        past = np.zeros(len(new.state.u))
        if method == "generalized-alpha":
            g0 = self.static_gradient(old.state.u, old.state.directors)
            past[: self.n_x] = rho * g0[: self.n_x]  # af / (1 - af)

        def residual_of(u, directors):
            r = self.static_gradient(u, directors) + past
            a = kinematics(u[: self.n_x])[1]
            r[: self.n_x] += (M @ a.reshape(-1, 3)).ravel()
            return r

        inertia = [float(np.linalg.norm(M @ a.reshape(-1, 3))) for a in (kinematics(new.kinematics.x)[1], a0)]
        verdict = self._judge(residual_of, new.state, max(float(np.linalg.norm(self.force)), *inertia), lam)
        v = kinematics(new.state.u[: self.n_x])[0]
        scale = max(np.abs(v).max(), np.abs(new.state.u[: self.n_x]).max() * 1e-3 / h)
        if verdict.ok and np.abs(v - new.kinematics.v).max() > 1e-9 * scale:
            return Verdict(False, verdict.residual, verdict.reference, verdict.rounding,
                           "the velocity is not that of the positions")
        return verdict
