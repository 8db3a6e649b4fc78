r"""Tension field of any law: the membrane that wrinkles instead of being compressed.

A sheet too thin to resist bending folds away any length that is too much. What is left is the relaxed energy

.. math:: \Psi_r(C) = \min_{A \succeq 0} \Psi(C + A)

with A the squared slopes of wrinkles finer than the mesh (Pipkin, ref. 1). Three cases: *taut* (A = 0, the stress is positive
semi-definite), *wrinkled* (:math:`A = v v^T`, tension along the wrinkles, :math:`S v = 0` across them) and *slack*
(:math:`C \preceq I`, no stress). Where :math:`\Psi` is convex in C, so is :math:`\Psi_r`. Stress and tangent follow from
the envelope theorem:

.. math:: S_r = S(C + v v^T), \qquad D_r = D - D B (\hat S + B^T D B)^{-1} B^T D, \qquad
          B = \begin{pmatrix} v_1 & 0\\ 0 & v_2\\ v_2 & v_1\end{pmatrix}

References
----------
1. A. C. Pipkin, "Relaxed energy densities for large deformations of membranes", IMA J. Appl. Math. 52 (1994) 297–308,
   doi 10.1093/imamat/52.3.297.
2. D. J. Steigmann, "Tension-field theory", Proc. R. Soc. Lond. A 429 (1990) 141–173, doi 10.1098/rspa.1990.0055.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import NotConvergedError, ParameterError
from .law import Law, Parameter, columns

SLACK, WRINKLED, TAUT = 0, 1, 2
"""Values of :meth:`TensionField.regime`."""

_REST = np.array([[1.0, 1.0, 0.0]])
_DIRECTIONS = np.arange(8) * np.pi / 8.0


class TensionField(Law):
    """Relaxed membrane of a law, with a small part of the law itself left in.

    Parameters
    ----------
    law : Law
        Stress-free at C = I, where its energy has its minimum.
    residual : float
        Fraction of the law that still resists compression, in [0, 1]: the energy is ``(1 - residual)`` of the relaxed one
        plus ``residual`` of the law's. It keeps the tangent of wrinkled and slack regions regular; 1 is the law itself.

    Raises
    ------
    ParameterError
        The law is stressed at rest, or ``residual`` is out of bounds.

    Notes
    -----
    The energy is once continuously differentiable: the tangent jumps where wrinkles appear. Where C is inadmissible (det C <= 0)
    the energy is infinite as with every law.
    """

    def __init__(self, law: Law, residual: float = 1e-3):
        row = Parameter("residual", "ε", "dimensionless", 1e-3, 0.0, 1.0, "log", "fraction of the unrelaxed law",
                        "regularisation", fit=False)
        _, S, D = law.evaluate(_REST)
        if np.abs(S).max() > 1e-8 * np.abs(D).max():
            raise ParameterError(f"tension field: the law {law.name} is stressed at rest, "
                                 f"|S| = {np.abs(S).max():.3g} {law.stress_unit}")
        values = {**law.values, "residual": row.check(residual, "tension field")}
        for name, value in (("law", law), ("_values", values), ("name", f"tension-field({law.name})"), ("basis", law.basis),
                            ("parameters", (*law.parameters, row))):
            object.__setattr__(self, name, value)

    def replace(self, **values: float) -> TensionField:
        """The same with some parameters of the law, or ``residual``, changed."""
        residual = values.pop("residual", self.residual)
        return TensionField(self.law.replace(**values) if values else self.law, residual)

    def parameter(self, name):
        """Row of the parameter table, or ParameterError."""
        for p in self.parameters:
            if p.name == name:
                return p
        raise ParameterError(f"{self.name} has no parameter '{name}'; it has: {', '.join(p.name for p in self.parameters)}")

    def __eq__(self, other):
        return type(other) is TensionField and other.law == self.law and other.residual == self.residual

    def __hash__(self):
        return hash((TensionField, self.law, self.residual))

    def __repr__(self):
        return f"TensionField({self.law!r}, residual={self.residual:g})"

    def __reduce__(self):
        return TensionField, (self.law, self.residual)

    def evaluate(self, C, order: int = 2):
        """See :meth:`.Law.evaluate`."""
        C, ok, regime, v = self._relaxed(C)
        W, S, D = self._at_relaxed(C, regime, v, order)
        e = self.residual
        if e > 0.0:
            full = self.law.evaluate(C, order)
            parts = [(1.0 - e) * r + e * f for r, f in zip((W, S, D)[: order + 1], full[: order + 1], strict=True)]
            W, S, D = (*parts, None, None)[:3]
        bad = ~(ok & np.isfinite(W))
        W = np.where(bad, np.inf, W)
        for part in (S, D)[:order]:
            part[bad] = 0.0
        return W, S, D

    def stress_sensitivity(self, C, names: Sequence[str]) -> np.ndarray:
        """See :meth:`.Law.stress_sensitivity`."""
        C, ok, regime, v = self._relaxed(C)
        own = [name for name in names if name != "residual"]
        relaxed = self.law.stress_sensitivity(_with(C, v), own)
        rows = np.flatnonzero(regime == WRINKLED)
        if len(rows):
            _, S, D = self.law.evaluate(_with(C[rows], v[rows]))
            B, H = _hessian(v[rows], S, D)
            relaxed[rows] -= D @ B @ np.linalg.solve(H, B.transpose(0, 2, 1) @ relaxed[rows])
        relaxed[regime == SLACK] = 0.0
        mixed = (1.0 - self.residual) * relaxed + self.residual * self.law.stress_sensitivity(C, own)
        out = np.zeros((len(C), 3, len(names)))
        out[:, :, [i for i, name in enumerate(names) if name != "residual"]] = mixed
        if "residual" in names:
            difference = self.law.stress(C) - self._at_relaxed(C, regime, v, 1)[1]
            out[:, :, list(names).index("residual")] = difference
        out[~(ok & np.isfinite(self.energy(C)))] = 0.0
        return out

    def regime(self, C) -> np.ndarray:
        """`SLACK`, `WRINKLED` or `TAUT` (0, 1, 2) of every point (n,)."""
        return self._relaxed(C)[2]

    def wrinkle(self, C) -> np.ndarray:
        """Vectors v (n, 2) across the wrinkles: ``|v|**2`` is what C lacks there; zero where not wrinkled, sign arbitrary."""
        return self._relaxed(C)[3]

    # -- the parts ---------------------------------------------------------------------------------------------------------
    def _relaxed(self, C):
        """C made admissible, where it was, regime (n,) and wrinkle (n, 2)."""
        c11, c22, c12, ok = columns(C)
        C = np.stack([c11, c22, c12], axis=1)
        W, S, D = self.law.evaluate(C)
        scale = np.abs(self.law.tangent_at_rest()).max()
        regime = np.where(_eigen(S)[0] >= -1e-14 * np.maximum(scale, np.abs(D).max(axis=(1, 2))), TAUT, WRINKLED)
        regime[(regime == WRINKLED) & (_eigen(C)[1] <= 1.0)] = SLACK
        regime[~np.isfinite(W)] = np.where(_eigen(C[~np.isfinite(W)])[1] <= 1.0, SLACK, WRINKLED)
        v = np.zeros((len(C), 2))
        rows = np.flatnonzero(regime == WRINKLED)
        if len(rows):
            v[rows] = _wrinkles(self.law, C[rows], S[rows], D[rows])
            regime[rows[~np.any(v[rows], axis=1)]] = TAUT
        return C, ok, regime, v

    def _at_relaxed(self, C, regime, v, order):
        """Energy, stress and tangent of the relaxed law."""
        W, S, D = self.law.evaluate(_with(C, v), order)
        slack, rows = regime == SLACK, np.flatnonzero(regime == WRINKLED)
        W[slack] = self.law.energy(_REST)[0]
        if order >= 2 and len(rows):
            B, H = _hessian(v[rows], S[rows], D[rows])
            DB = D[rows] @ B
            D[rows] -= DB @ np.linalg.solve(H, DB.transpose(0, 2, 1))
        for part in (S, D)[:order]:
            part[slack] = 0.0
        return W, S, D


def _with(C, v):
    """C + v v' as [C11, C22, C12]."""
    return C + np.stack([v[:, 0] ** 2, v[:, 1] ** 2, v[:, 0] * v[:, 1]], axis=1)


def _eigen(S):
    """Smaller and larger eigenvalue (n,) of symmetric [S11, S22, S12]."""
    mean, radius = 0.5 * (S[:, 0] + S[:, 1]), np.hypot(0.5 * (S[:, 0] - S[:, 1]), S[:, 2])
    return mean - radius, mean + radius


def _lowest(S):
    """Unit eigenvector (n, 2) of the smaller eigenvalue."""
    angle = 0.5 * np.arctan2(2.0 * S[:, 2], S[:, 0] - S[:, 1]) + 0.5 * np.pi
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _hessian(v, S, D):
    """B (n, 3, 2) and the second derivative S + B'DB (n, 2, 2) of the energy in v."""
    B = np.zeros((len(v), 3, 2))
    B[:, 0, 0] = B[:, 2, 1] = v[:, 0]
    B[:, 1, 1] = B[:, 2, 0] = v[:, 1]
    H = B.transpose(0, 2, 1) @ D @ B
    H[:, 0, 0] += S[:, 0]
    H[:, 1, 1] += S[:, 1]
    H[:, [0, 1], [1, 0]] += S[:, 2:]
    return B, H


def _wrinkles(law, C, S, D):
    """Minimise the energy over v at wrinkled points; where the minimum found is not the global one, from eight directions."""
    v, good = _minimise(law, C, _start(law, C, S, D))
    rows = np.flatnonzero(~good)
    if len(rows):
        best = np.full(len(rows), np.inf)
        for angle in _DIRECTIONS:
            n = np.tile([np.cos(angle), np.sin(angle)], (len(rows), 1))
            a = np.maximum(1.0 - C[rows, 0] * n[:, 0] ** 2 - C[rows, 1] * n[:, 1] ** 2 - 2 * C[rows, 2] * n[:, 0] * n[:, 1], 1e-6)
            trial, reached = _minimise(law, C[rows], np.sqrt(a)[:, None] * n)
            energy = np.where(reached, law.energy(_with(C[rows], trial)), np.inf)
            better = energy < best
            best[better], v[rows[better]] = energy[better], trial[better]
        lost = rows[~np.isfinite(best) & np.isfinite(law.energy(C[rows]))]
        if len(lost):
            raise NotConvergedError(f"tension field of {law.name}: no wrinkle with S v = 0 and tension along it at {len(lost)} "
                                    f"points, first C = {C[lost[0]].tolist()}")
    return v


def _start(law, C, S, D):
    """The better of two guesses: across the lowest stress by the tangent, and across the shortest direction of C back to rest."""
    n = _lowest(S)
    e = np.stack([n[:, 0] ** 2, n[:, 1] ** 2, 2 * n[:, 0] * n[:, 1]], axis=1)
    stiffness = np.einsum("ni,nij,nj->n", e, D, e)
    a = np.divide(-2.0 * _eigen(S)[0], stiffness, out=np.full(len(C), 1e-6), where=stiffness > 0)
    first = np.sqrt(np.maximum(a, 1e-300))[:, None] * n
    second = np.sqrt(np.maximum(1.0 - _eigen(C)[0], 0.0))[:, None] * _lowest(C)
    return np.where((law.energy(_with(C, first)) <= law.energy(_with(C, second)))[:, None], first, second)


def _minimise(law, C, v, limit: int = 60):
    """Newton with line search, all points at once; says where S v = 0 with tension along the wrinkles was reached."""
    v, good = v.copy(), np.zeros(len(C), dtype=bool)
    active = np.arange(len(C))
    for _ in range(limit):
        W, S, D = law.evaluate(_with(C[active], v[active]))
        B, H = _hessian(v[active], S, D)
        g = np.einsum("nij,ni->nj", B, S)
        size = np.linalg.norm(v[active], axis=1)
        scale = np.abs(D).max(axis=(1, 2))
        low = _eigen(S)[0]
        done = (np.linalg.norm(g, axis=1) <= 1e-13 * scale * size) & np.isfinite(W)
        good[active[done]] = low[done] >= -1e-11 * scale[done]
        move = _descent(H, g)
        t, moved, slope = np.ones(len(active)), done.copy(), np.sum(g * move, axis=1)
        for _ in range(30):
            rows = np.flatnonzero(~moved)
            if not len(rows):
                break
            trial = v[active[rows]] + t[rows, None] * move[rows]
            new = law.energy(_with(C[active[rows]], trial))
            noise = 1e-14 * (np.abs(W[rows]) + scale[rows] * size[rows] ** 2)
            fine = new <= W[rows] + 1e-4 * t[rows] * slope[rows] + noise
            v[active[rows[fine]]] = trial[fine]
            moved[rows[fine]] = True
            t[rows[~fine]] *= 0.5
        active = active[~done & moved]
        if not len(active):
            break
    if len(active):  # at the rounding of the law the last digits of the residual may not come
        _, S, D = law.evaluate(_with(C[active], v[active]))
        scale, low = np.abs(D).max(axis=(1, 2)), _eigen(S)[0]
        g = np.einsum("nij,ni->nj", _hessian(v[active], S, D)[0], S)
        good[active] = (np.linalg.norm(g, axis=1) <= 1e-9 * scale * np.linalg.norm(v[active], axis=1)) & (low >= -1e-9 * scale)
    return v, good


def _descent(H, g):
    """Newton step, the eigenvalues of H made positive (n, 2)."""
    values, vectors = np.linalg.eigh(H)
    floor = 1e-10 * np.abs(values).max(axis=1, keepdims=True) + 1e-300
    along = np.einsum("nij,ni->nj", vectors, g) / np.maximum(np.abs(values), floor)
    return -np.einsum("nij,nj->ni", vectors, along)
