r"""The eight-chain network of Arruda and Boyce, the reference law of rubber."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..errors import ParameterError
from .invariants import InvariantLaw
from .langevin import inverse_langevin, log_beta_over_sinh
from .law import Parameter

_AB = "[1] Arruda & Boyce 1993, doi 10.1016/0022-5096(93)90013-6"


class ArrudaBoyce(InvariantLaw):
    r"""Eight chains from the centre to the corners of a cube, each with the inverse Langevin force; incompressible.

    .. math::
        \Psi = \mu N\Big[x\beta + \ln\frac{\beta}{\sinh\beta}\Big] - \Psi_0, \qquad
        x = \sqrt{\frac{I_1}{3N}}, \qquad \beta = \mathcal L^{-1}(x), \quad \mathcal L(\beta) = \coth\beta - \frac1\beta

    Parameters
    ----------
    mu : float
        Chain density times temperature, :math:`\mu = n k \Theta`, Pa; the initial shear modulus is slightly larger,
        :math:`\tfrac13\mu\sqrt N\,\mathcal L^{-1}(1/\sqrt N)`.
    N : float
        Number of rigid links of a chain, > 1; the energy is infinite from :math:`I_1 = 3N` on.

    Notes
    -----
    The inverse Langevin function is exact to rounding (:mod:`.langevin`), not a truncated series.

    References
    ----------
    1. E. M. Arruda, M. C. Boyce, "A three-dimensional constitutive model for the large stretch behavior of rubber
       elastic materials", J. Mech. Phys. Solids 41 (1993) 389–412, doi 10.1016/0022-5096(93)90013-6.
    """

    name = "arruda-boyce"
    basis = "volume"
    parameters = (
        Parameter("mu", "μ", "Pa", 0.27e6, 1e-3, 1e13, "log", "chain density times temperature, n k Θ", _AB),
        Parameter("N", "N", "dimensionless", 26.5, 1.0, 1e6, "log", "links of a chain", _AB),
    )
    invariants = ("I1",)

    def validate(self):
        """ParameterError unless N > 1."""
        if self.N <= 1.0:
            raise ParameterError(f"{self.name}: N = {self.N:g} would lock the chains at rest; N > 1 is needed")

    def admissible(self, q):
        """Where the energy is finite, (n,) bool: ``I1 < 3 N``, short of locking."""
        return q["I1"] < 3.0 * self.N * (1.0 - 1e-12)

    def _unit(self, i1):
        """Energy over mu (without its rest value), x, beta, beta'."""
        x = np.sqrt(i1 / (3.0 * self.N))
        beta, slope = inverse_langevin(x)
        return self.N * (x * beta + log_beta_over_sinh(beta)), x, beta, slope

    @cached_property
    def _rest(self):
        return float(self._unit(np.array([3.0]))[0][0])

    def potential(self, q, order):
        """Energy, J/m^3, 0 at rest, and its derivatives in I1; shapes as in :meth:`.InvariantLaw.potential`."""
        psi, x, beta, slope = self._unit(q["I1"])
        first = {"I1": self.mu / 6.0 * beta / x}
        second = {("I1", "I1"): self.mu / (36.0 * self.N) * (slope - beta / x) / (x * x)}
        return self.mu * (psi - self._rest), first, second

    def parameter_derivatives(self, q, name):
        """``d(dPsi/dI1)/dtheta`` for mu or N, (n,)."""
        _, x, beta, slope = self._unit(q["I1"])
        if name == "mu":
            return {"I1": beta / (6.0 * x)}
        return {"I1": -self.mu / (12.0 * self.N) * (slope - beta / x)}
