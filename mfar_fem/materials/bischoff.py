r"""The orthotropic eight-chain network of Bischoff, Arruda and Grosh."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..errors import ParameterError
from .invariants import InvariantLaw
from .langevin import inverse_langevin, log_beta_over_sinh
from .law import Parameter

_BAG = "[1] Bischoff, Arruda, Grosh 2002, doi 10.1115/1.1485754"
_AXES = {"C11": "a", "C22": "b", "C33": "c"}


class Bischoff(InvariantLaw):
    r"""Chains from the centre to the corners of a box of sides a (warp), b (weft), c (thickness); incompressible.

    .. math::
        \Psi = \frac{\mu}{4}\Big\{ 2N \sum_{\pm}\Big[\frac{\rho_\pm}{N}\beta_\pm
               + \ln\frac{\beta_\pm}{\sinh\beta_\pm}\Big]
               - \frac{\beta_P}{\sqrt N}\ln\big[\lambda_a^{a^2}\lambda_b^{b^2}\lambda_c^{c^2}\big]\Big\} - \Psi_0

    with :math:`\rho_\pm^2 = \tfrac14(a^2 C_{11} + b^2 C_{22} + c^2 C_{33} \pm 2ab\,C_{12})`,
    :math:`N = \tfrac14(a^2 + b^2 + c^2)`, :math:`\beta_\pm = \mathcal L^{-1}(\rho_\pm/N)`,
    :math:`\beta_P = \mathcal L^{-1}(1/\sqrt N)`, :math:`\lambda_a^2 = C_{11}` and so on,
    :math:`C_{33} = 1/\det C`. Four of the eight chains lie on each value of :math:`\rho`, as :math:`C_{13} = C_{23} = 0`
    in a sheet.

    Parameters
    ----------
    mu : float
        Chain density times temperature, Pa.
    a, b, c : float
        Sides of the box in link lengths, N > 1. Equal sides give cubic symmetry, and the law of Arruda and Boyce for
        stretches along the axes.

    Notes
    -----
    The bulk term of the paper is replaced by exact incompressibility, which gives plane stress in closed form.
    The logarithm makes the reference state stress-free.

    References
    ----------
    1. J. E. Bischoff, E. M. Arruda, K. Grosh, "A microstructurally based orthotropic hyperelastic constitutive law",
       J. Appl. Mech. 69 (2002) 570–579, doi 10.1115/1.1485754.
    """

    name = "bischoff"
    basis = "volume"
    parameters = (
        Parameter("mu", "μ", "Pa", 1e5, 1e-3, 1e13, "log", "chain density times temperature", _BAG),
        Parameter("a", "a", "dimensionless", 1.9, 1e-3, 1e3, "log", "side of the box along the warp", _BAG),
        Parameter("b", "b", "dimensionless", 1.6, 1e-3, 1e3, "log", "side of the box along the weft", _BAG),
        Parameter("c", "c", "dimensionless", 1.3, 1e-3, 1e3, "log", "side of the box through the thickness", _BAG),
    )
    invariants = ("C11", "C22", "C12", "C33")

    def validate(self):
        """ParameterError unless N = (a^2 + b^2 + c^2)/4 > 1."""
        if self.N <= 1.0:
            raise ParameterError(
                f"{self.name}: N = (a^2 + b^2 + c^2)/4 = {self.N:g} would lock the chains at rest; N > 1 is needed"
            )

    @property
    def N(self) -> float:
        """Number of links of a chain."""
        return 0.25 * (self.a**2 + self.b**2 + self.c**2)

    @cached_property
    def _rest(self):
        """beta_P, its slope and the rest value of one bracket."""
        beta, slope = (float(v[0]) for v in inverse_langevin(np.array([self.N**-0.5])))
        return beta, slope, beta * self.N**-0.5 + float(log_beta_over_sinh(beta))

    def _squares(self, q):
        mean = 0.25 * (self.a**2 * q["C11"] + self.b**2 * q["C22"] + self.c**2 * q["C33"])
        shear = 0.5 * self.a * self.b * q["C12"]
        return mean + shear, mean - shear

    def _rates(self, sign):
        """Derivatives of rho^2 in the invariants."""
        rates = {k: 0.25 * self.values[m] ** 2 for k, m in _AXES.items()}
        rates["C12"] = sign * 0.5 * self.a * self.b
        return rates

    def admissible(self, q):
        """Where the energy is finite, (n,) bool: both chain lengths above 0 and below their limit, ``0 < rho < N``."""
        limit = (self.N * (1.0 - 1e-12)) ** 2
        u, v = self._squares(q)
        return (u < limit) & (v < limit) & (u > 0.0) & (v > 0.0)

    def potential(self, q, order):
        """Energy, J/m^3, 0 at rest, and its derivatives in C11, C22, C12, C33; shapes as in :meth:`.InvariantLaw.potential`."""
        mu, n = self.mu, self.N
        beta_p, _, rest = self._rest
        pull = 0.125 * mu * beta_p / n**0.5
        psi, first, second = 0.0, {}, {}
        for k, m in _AXES.items():
            m2 = self.values[m] ** 2
            psi = psi - pull * m2 * np.log(q[k])
            first[k] = -pull * m2 / q[k]
            second[k, k] = pull * m2 / (q[k] * q[k])
        first["C12"] = 0.0
        for sign, u in zip((1.0, -1.0), self._squares(q), strict=True):
            rho = np.sqrt(u)
            beta, slope = inverse_langevin(rho / n)
            psi = psi + 0.5 * mu * n * (rho / n * beta + log_beta_over_sinh(beta) - rest)
            d1 = 0.25 * mu * beta / rho
            d2 = 0.125 * mu * (slope / n - beta / rho) / u
            rates = self._rates(sign)
            for k in self.invariants:
                first[k] = first[k] + d1 * rates[k]
            for i, k in enumerate(self.invariants):
                for l in self.invariants[i:]:
                    second[k, l] = second.get((k, l), 0.0) + d2 * (rates[k] * rates[l])
        return psi, first, second

    def parameter_derivatives(self, q, name):
        """Derivatives of ``dPsi/dC11``, ``dC22``, ``dC12``, ``dC33`` with respect to mu or a side, (n,) each."""
        if name == "mu":
            return {k: v / self.mu for k, v in self.potential(q, 1)[1].items()}
        mu, n, side = self.mu, self.N, self.values[name]
        beta_p, slope_p, _ = self._rest
        dn = 0.5 * side
        pull = 0.125 * mu * beta_p / n**0.5
        dpull = -0.0625 * mu * n**-1.5 * (slope_p * n**-0.5 + beta_p) * dn
        out = {k: -dpull * self.values[m] ** 2 / q[k] for k, m in _AXES.items()}
        own = next(k for k, m in _AXES.items() if m == name)
        out[own] = out[own] - 2.0 * pull * side / q[own]
        out["C12"] = 0.0
        other = {"a": self.b, "b": self.a, "c": 0.0}[name]
        for sign, u in zip((1.0, -1.0), self._squares(q), strict=True):
            rho = np.sqrt(u)
            beta, slope = inverse_langevin(rho / n)
            d1 = 0.25 * mu * beta / rho
            du = 0.5 * side * q[own] + sign * 0.5 * other * q["C12"]
            dd1 = 0.125 * mu * (slope / n - beta / rho) / u * du - 0.25 * mu * slope / n**2 * dn
            for k, rate in self._rates(sign).items():
                out[k] = out[k] + dd1 * rate
            out[own] = out[own] + d1 * 0.5 * side
            out["C12"] = out["C12"] + d1 * sign * 0.5 * other
        return out
