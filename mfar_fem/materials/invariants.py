r"""From a formula in a few invariants to stress, tangent and parameter sensitivities, by one chain rule.

A law written as :math:`\Psi = \psi(q_1, q_2, \dots)` gives :math:`\psi`, :math:`\psi_k = \partial\psi/\partial q_k` and
:math:`\psi_{kl}`; with :math:`y = (C_{11}, C_{22}, C_{12})` and :math:`D = \mathrm{diag}(2, 2, 1)`,

.. math:: S = D \sum_k \psi_k \nabla q_k, \qquad
          \frac{\partial S}{\partial E} = D \Big[\sum_k \psi_k \nabla^2 q_k
          + \sum_{kl} \psi_{kl} \nabla q_k \nabla q_l^T\Big] D .

The invariants are those of an incompressible sheet in plane stress: ``C11`` (= I4 of the warp), ``C22`` (= I4 of the
weft), ``C12`` (= I8), ``C33`` = 1/det C and ``I1`` = C11 + C22 + 1/det C. A law per area that uses none but the first
three knows nothing of the thickness.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

import numpy as np

from .law import Law, columns

Terms = dict[str, np.ndarray]
_D = (2.0, 2.0, 1.0)
_UNIT = {"C11": (1.0, 0.0, 0.0), "C22": (0.0, 1.0, 0.0), "C12": (0.0, 0.0, 1.0)}
_PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def thickness_derivatives(c11, c22, c12):
    """Value, gradient (3) and Hessian (pairs 00 01 02 11 12 22) of ``C33 = 1/det C`` in ``(C11, C22, C12)``."""
    v = 1.0 / (c11 * c22 - c12 * c12)
    v2 = v * v
    g = (-c22 * v2, -c11 * v2, 2.0 * c12 * v2)
    w = 2.0 * v2 * v
    h = (
        w * c22 * c22,
        w * c11 * c22 - v2,
        -2.0 * w * c12 * c22,
        w * c11 * c11,
        -2.0 * w * c12 * c11,
        2.0 * v2 + 4.0 * w * c12 * c12,
    )
    return v, g, h


class InvariantLaw(Law):
    """A law given by its potential in the invariants named in ``invariants``.

    Subclasses implement :meth:`potential` and :meth:`parameter_derivatives`, and :meth:`admissible` if the formula
    has a limit (locking).
    """

    invariants: ClassVar[tuple[str, ...]]

    @abstractmethod
    def potential(self, q: Terms, order: int) -> tuple[np.ndarray, Terms, dict[tuple[str, str], np.ndarray]]:
        """Energy, first and second derivatives with respect to the invariants.

        Parameters
        ----------
        q : dict of (n,) arrays
            Values of the invariants, admissible.
        order : {0, 1, 2}
            What is above it may be left out (an empty dict).

        Returns
        -------
        psi : (n,) array
        first : dict name -> (n,) array or float
        second : dict (name, name) -> (n,) array or float
            Each unordered pair once; what is absent is zero.
        """

    @abstractmethod
    def parameter_derivatives(self, q: Terms, name: str) -> Terms:
        """Derivatives of the *first* derivatives of the potential with respect to parameter `name`."""

    def admissible(self, q: Terms) -> np.ndarray | None:
        """Where the potential is finite, (n,) bool; None if it is for every positive definite C."""
        return None

    # -- chain rule ----------------------------------------------------------------------------------------------

    def _prepare(self, C):
        """Invariants with their derivatives; inadmissible points are moved to the identity and masked."""
        c11, c22, c12, ok = columns(C)
        q, curved = self._invariants(c11, c22, c12)
        limit = self.admissible(q)
        if limit is not None and not limit.all():
            ok = ok & limit
            c11, c22, c12 = np.where(ok, c11, 1.0), np.where(ok, c22, 1.0), np.where(ok, c12, 0.0)
            q, curved = self._invariants(c11, c22, c12)
        return q, curved, ok

    def _invariants(self, c11, c22, c12):
        q = {"C11": c11, "C22": c22, "C12": c12}
        curved = {}
        if "I1" in self.invariants or "C33" in self.invariants:
            v, g, h = thickness_derivatives(c11, c22, c12)
            q["C33"], q["I1"] = v, c11 + c22 + v
            curved["C33"] = (g, h)
            curved["I1"] = ((1.0 + g[0], 1.0 + g[1], g[2]), h)
        return q, curved

    def evaluate(self, C, order: int = 2):
        """Energy (n,), stress (n, 3) and tangent (n, 3, 3) by the chain rule of the module; see :meth:`.Law.evaluate`."""
        q, curved, ok = self._prepare(C)
        psi, first, second = self.potential(q, order)
        n, good = len(ok), bool(ok.all())
        energy = np.empty(n)
        energy[:] = psi
        if not good:
            energy[~ok] = np.inf
        if order < 1:
            return energy, None, None
        stress = np.empty((n, 3))
        for i, column in enumerate(_pull(first, curved)):
            stress[:, i] = column
        tangent = self._tangent(first, second, curved, n) if order > 1 else None
        if not good:
            stress[~ok] = 0.0
            if tangent is not None:
                tangent[~ok] = 0.0
        return energy, stress, tangent

    def _tangent(self, first, second, curved, n):
        packed = [0.0] * 6
        for k, value in first.items():
            if k in curved:
                for m, h in enumerate(curved[k][1]):
                    packed[m] = packed[m] + value * h
        for (k, l), value in second.items():
            gk = curved[k][0] if k in curved else _UNIT[k]
            gl = curved[l][0] if l in curved else _UNIT[l]
            for m, (i, j) in enumerate(_PAIRS):
                packed[m] = packed[m] + _product(value, gk, gl, i, j, k == l)
        tangent = np.empty((n, 3, 3))
        for m, (i, j) in enumerate(_PAIRS):
            tangent[:, i, j] = packed[m] * (_D[i] * _D[j])
            if i != j:
                tangent[:, j, i] = tangent[:, i, j]
        return tangent

    def stress_sensitivity(self, C, names):
        """``dS_I/dtheta`` from :meth:`parameter_derivatives`, (n, 3, len(names)); see :meth:`.Law.stress_sensitivity`."""
        q, curved, ok = self._prepare(C)
        out = np.empty((len(ok), 3, len(names)))
        for p, name in enumerate(names):
            self.parameter(name)
            for i, column in enumerate(_pull(self.parameter_derivatives(q, name), curved)):
                out[:, i, p] = column
        if not ok.all():
            out[~ok] = 0.0
        return out


def _pull(first, curved):
    """Stress columns from derivatives with respect to the invariants."""
    columns_ = [0.0, 0.0, 0.0]
    for k, value in first.items():
        gradient = curved[k][0] if k in curved else _UNIT[k]
        for i, g in enumerate(gradient):
            if not isinstance(g, float) or g != 0.0:
                columns_[i] = columns_[i] + (_D[i] * value) * g
    return columns_


def _product(value, gk, gl, i, j, same):
    """Entry (i, j) of ``value * sym(gk gl^T)``; a pair k != l stands for both orders."""
    if _zero(gk[i]) or _zero(gl[j]):
        one = 0.0
    else:
        one = value * gk[i] * gl[j]
    if same:
        return one
    other = 0.0 if _zero(gk[j]) or _zero(gl[i]) else value * gk[j] * gl[i]
    return one + other


def _zero(g):
    return isinstance(g, float) and g == 0.0
