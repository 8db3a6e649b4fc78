r"""Exponential orthotropic law after Fung: the J-shaped toe of soft tissue and of crimped yarns."""

from __future__ import annotations

import numpy as np

from .invariants import InvariantLaw
from .law import Parameter

_FUNG = "[1] Fung, Fronek, Patitucci 1979, doi 10.1152/ajpheart.1979.237.5.H620"
_LIMIT = 500.0


class Fung(InvariantLaw):
    r"""Exponential of a quadratic form in the Green strain.

    .. math::
        \Psi = \tfrac12 c\,(e^Q - 1), \qquad
        Q = A_1 E_{11}^2 + A_2 E_{22}^2 + 2\nu\sqrt{A_1 A_2}\,E_{11} E_{22} + A_3 (2E_{12})^2

    Parameters
    ----------
    c : float
        Modulus, Pa; the stiffnesses at rest are ``c A1``, ``c A2``, ``c A3``.
    A1, A2, A3 : float
        Exponents of warp, weft and shear.
    nu : float
        Coupling in (-1, 1), so that Q stays positive definite.

    Notes
    -----
    As stiff in compression as in tension. For Q > 500 the energy is taken as infinite (floating-point range).

    References
    ----------
    1. Y. C. Fung, K. Fronek, P. Patitucci, "Pseudoelasticity of arteries and the choice of its mathematical
       expression", Am. J. Physiol. 237 (1979) H620–H631, doi 10.1152/ajpheart.1979.237.5.H620.
    """

    name = "fung"
    basis = "volume"
    parameters = (
        Parameter("c", "c", "Pa", 1e4, 1e-6, 1e12, "log", "modulus", _FUNG),
        Parameter("A1", "A_1", "dimensionless", 800.0, 1e-4, 1e8, "log", "exponent of the warp", _FUNG),
        Parameter("A2", "A_2", "dimensionless", 2000.0, 1e-4, 1e8, "log", "exponent of the weft", _FUNG),
        Parameter("A3", "A_3", "dimensionless", 10.0, 1e-4, 1e8, "log", "exponent of shear", _FUNG),
        Parameter("nu", "ν", "dimensionless", 0.1, -0.99, 0.99, "linear", "coupling of warp and weft", _FUNG),
    )
    invariants = ("C11", "C22", "C12")

    def _form(self, q):
        """Q and its derivatives in the invariants."""
        e1, e2, s = 0.5 * (q["C11"] - 1.0), 0.5 * (q["C22"] - 1.0), q["C12"]
        a12 = self.nu * (self.A1 * self.A2) ** 0.5
        g1, g2, g3 = self.A1 * e1 + a12 * e2, self.A2 * e2 + a12 * e1, 2.0 * self.A3 * s
        return g1 * e1 + g2 * e2 + 0.5 * g3 * s, {"C11": g1, "C22": g2, "C12": g3}

    def admissible(self, q):
        """Where the energy is finite, (n,) bool: ``Q < 500``, short of overflow."""
        return self._form(q)[0] < _LIMIT

    def potential(self, q, order):
        """Energy, J/m^3, and its derivatives in C11, C22, C12; shapes as in :meth:`.InvariantLaw.potential`."""
        form, g = self._form(q)
        psi = 0.5 * self.c * np.expm1(form)
        if order == 0:
            return psi, {}, {}
        f = psi + 0.5 * self.c
        first = {k: f * v for k, v in g.items()}
        if order == 1:
            return psi, first, {}
        a12 = self.nu * (self.A1 * self.A2) ** 0.5
        constant = {("C11", "C11"): 0.5 * self.A1, ("C22", "C22"): 0.5 * self.A2, ("C11", "C22"): 0.5 * a12}
        constant["C12", "C12"] = 2.0 * self.A3
        keys = list(g)
        second = {
            (k, l): f * (g[k] * g[l] + constant.get((k, l), 0.0)) for i, k in enumerate(keys) for l in keys[i:]
        }
        return psi, first, second

    def parameter_derivatives(self, q, name):
        """Derivatives of ``dPsi/dC11``, ``dC22``, ``dC12`` with respect to one parameter, (n,) each."""
        form, g = self._form(q)
        f = 0.5 * self.c * np.exp(form)
        if name == "c":
            return {k: 0.5 * np.exp(form) * v for k, v in g.items()}
        e1, e2, s = 0.5 * (q["C11"] - 1.0), 0.5 * (q["C22"] - 1.0), q["C12"]
        root = (self.A1 * self.A2) ** 0.5
        d1, d2, d12, d3 = {
            "A1": (1.0, 0.0, 0.5 * self.nu * root / self.A1, 0.0),
            "A2": (0.0, 1.0, 0.5 * self.nu * root / self.A2, 0.0),
            "A3": (0.0, 0.0, 0.0, 1.0),
            "nu": (0.0, 0.0, root, 0.0),
        }[name]
        dform = d1 * e1 * e1 + d2 * e2 * e2 + 2.0 * d12 * e1 * e2 + d3 * s * s
        dg = {"C11": d1 * e1 + d12 * e2, "C22": d2 * e2 + d12 * e1, "C12": 2.0 * d3 * s}
        return {k: f * (dform * v + dg[k]) for k, v in g.items()}
