r"""Two dispersed families of fibres in a neo-Hookean matrix, after Gasser, Ogden and Holzapfel."""

from __future__ import annotations

import numpy as np

from .invariants import InvariantLaw
from .law import Parameter

_GOH = "[1] Gasser, Ogden, Holzapfel 2006, doi 10.1098/rsif.2005.0073"
_LIMIT = 500.0
_FAMILIES = (("C11", "k1w", "k2w"), ("C22", "k1f", "k2f"))


class GasserOgdenHolzapfel(InvariantLaw):
    r"""Exponential fibres along warp and weft, dispersed about these axes, that carry tension only; incompressible.

    .. math::
        \Psi = \tfrac12\mu(I_1 - 3)
               + \sum_{y=w,f}\frac{k_{1y}}{2k_{2y}}\Big[e^{k_{2y}\langle\bar E_y\rangle^2} - 1\Big],
        \qquad \bar E_y = \kappa(I_1 - 3) + (1 - 3\kappa)(I_{4y} - 1)

    Parameters
    ----------
    mu : float
        Shear modulus of the matrix, Pa.
    k1w, k1f : float
        Fibre moduli, Pa; at rest a taut family adds :math:`4 k_1 (1 - 3\kappa)^2` to its stiffness.
    k2w, k2f : float
        Exponents.
    kappa : float
        Dispersion, 0 (aligned) to 1/3 (isotropic).

    Notes
    -----
    The tension switch :math:`\langle\cdot\rangle` acts on :math:`\bar E_y`, not on :math:`I_4 - 1`, so that the stress
    stays continuous for every dispersion; the tangent jumps where a family goes slack. For exponents above 500 the
    energy is taken as infinite (floating-point range).

    References
    ----------
    1. T. C. Gasser, R. W. Ogden, G. A. Holzapfel, "Hyperelastic modelling of arterial layers with distributed collagen
       fibre orientations", J. R. Soc. Interface 3 (2006) 15–35, doi 10.1098/rsif.2005.0073.
    """

    name = "gasser-ogden-holzapfel"
    basis = "volume"
    parameters = (
        Parameter("mu", "μ", "Pa", 1e5, 1e-3, 1e13, "log", "shear modulus of the matrix", _GOH),
        Parameter("k1w", "k_{1w}", "Pa", 2e6, 1e-3, 1e13, "log", "modulus of the warp", _GOH),
        Parameter("k2w", "k_{2w}", "dimensionless", 50.0, 1e-4, 1e6, "log", "exponent of the warp", _GOH),
        Parameter("k1f", "k_{1f}", "Pa", 5e6, 1e-3, 1e13, "log", "modulus of the weft", _GOH),
        Parameter("k2f", "k_{2f}", "dimensionless", 50.0, 1e-4, 1e6, "log", "exponent of the weft", _GOH),
        Parameter("kappa", "κ", "dimensionless", 0.0, 0.0, 1.0 / 3.0, "linear", "dispersion", _GOH),
    )
    invariants = ("I1", "C11", "C22")

    def _taut(self, q, axis):
        kappa = self.kappa
        return np.maximum(kappa * (q["I1"] - 3.0) + (1.0 - 3.0 * kappa) * (q[axis] - 1.0), 0.0)

    def admissible(self, q):
        """Where the energy is finite, (n,) bool: both exponents below 500, short of overflow."""
        w, f = self._taut(q, "C11"), self._taut(q, "C22")
        return (self.k2w * w * w < _LIMIT) & (self.k2f * f * f < _LIMIT)

    def potential(self, q, order):
        """Energy, J/m^3, and its derivatives in I1, C11, C22; shapes as in :meth:`.InvariantLaw.potential`."""
        kappa, aligned = self.kappa, 1.0 - 3.0 * self.kappa
        psi = 0.5 * self.mu * (q["I1"] - 3.0)
        first, second = {"I1": 0.5 * self.mu}, {("I1", "I1"): 0.0}
        for axis, n1, n2 in _FAMILIES:
            k1, k2, e = self.values[n1], self.values[n2], self._taut(q, axis)
            x = k2 * e * e
            grow = np.exp(x)
            psi = psi + 0.5 * k1 / k2 * np.expm1(x)
            d1, d2 = k1 * e * grow, k1 * grow * (1.0 + 2.0 * x) * (e > 0.0)
            first["I1"] = first["I1"] + kappa * d1
            first[axis] = aligned * d1
            second["I1", "I1"] = second["I1", "I1"] + kappa**2 * d2
            second["I1", axis] = kappa * aligned * d2
            second[axis, axis] = aligned**2 * d2
        return psi, first, second

    def parameter_derivatives(self, q, name):
        """Derivatives of ``dPsi/dI1``, ``dC11``, ``dC22`` with respect to one parameter, (n,) or a number; absent is zero."""
        kappa, aligned = self.kappa, 1.0 - 3.0 * self.kappa
        if name == "mu":
            return {"I1": 0.5}
        out = {"I1": 0.0}
        for axis, n1, n2 in _FAMILIES:
            k1, k2, e = self.values[n1], self.values[n2], self._taut(q, axis)
            grow = np.exp(k2 * e * e)
            if name == "kappa":
                de = ((q["I1"] - 3.0) - 3.0 * (q[axis] - 1.0)) * (e > 0.0)
                d, dd = k1 * e * grow, k1 * grow * (1.0 + 2.0 * k2 * e * e) * de
                out["I1"] = out["I1"] + d + kappa * dd
                out[axis] = aligned * dd - 3.0 * d
            elif name in (n1, n2):
                dd = e * grow if name == n1 else k1 * e**3 * grow
                out["I1"] = kappa * dd
                out[axis] = aligned * dd
        return out
