r"""Neo-Hookean sheet, incompressible and compressible."""

from __future__ import annotations

import numpy as np

from .invariants import InvariantLaw
from .law import Parameter
from .plane_stress import CompressibleLaw

_TRELOAR = "[1] Treloar 1943, doi 10.1039/tf9433900241"
_SIMO = "[1] Simo & Taylor 1991, doi 10.1016/0045-7825(91)90100-K"


class NeoHookean(InvariantLaw):
    r"""Gaussian network; incompressible, plane stress.

    .. math:: \Psi = \tfrac12\mu (I_1 - 3)

    Parameters
    ----------
    mu : float
        Shear modulus, Pa.

    References
    ----------
    1. L. R. G. Treloar, "The elasticity of a network of long-chain molecules I", Trans. Faraday Soc. 39 (1943) 36–41,
       doi 10.1039/tf9433900036; II, ibid. 241–246, doi 10.1039/tf9433900241.
    """

    name = "neo-hookean"
    basis = "volume"
    parameters = (Parameter("mu", "μ", "Pa", 1e5, 1e-3, 1e13, "log", "shear modulus", _TRELOAR),)
    invariants = ("I1",)

    def potential(self, q, order):
        """Energy ``mu/2 (I1 - 3)``, J/m^3, and its constant slope; see :meth:`.InvariantLaw.potential`."""
        return 0.5 * self.mu * (q["I1"] - 3.0), {"I1": 0.5 * self.mu}, {}

    def parameter_derivatives(self, q, name):
        """``d(dPsi/dI1)/dmu`` = 1/2."""
        return {"I1": 0.5}


class CompressibleNeoHookean(CompressibleLaw):
    r"""Neo-Hookean solid of finite bulk modulus; the thickness stretch follows from zero normal stress.

    .. math:: \Psi = \tfrac12\mu (J^{-2/3} I_1 - 3) + \tfrac14\kappa (J^2 - 1 - 2\ln J)

    Parameters
    ----------
    mu : float
        Shear modulus, Pa.
    kappa : float
        Bulk modulus, Pa; for ``kappa >> mu`` the law tends to the incompressible one.

    References
    ----------
    1. J. C. Simo, R. L. Taylor, "Quasi-incompressible finite elasticity in principal stretches", Comput. Methods Appl.
       Mech. Eng. 85 (1991) 273–310, doi 10.1016/0045-7825(91)90100-K.
    """

    name = "neo-hookean-compressible"
    basis = "volume"
    parameters = (
        Parameter("mu", "μ", "Pa", 1e5, 1e-3, 1e13, "log", "shear modulus", _SIMO),
        Parameter("kappa", "κ", "Pa", 1e6, 1e-3, 1e16, "log", "bulk modulus", _SIMO),
    )
    invariants = ("I1", "J2")

    def potential(self, q, order):
        """Energy, J/m^3, and its derivatives in I1 and J2 = J^2; shapes as in :meth:`.InvariantLaw.potential`."""
        d, i1, mu, k = q["J2"], q["I1"], self.mu, self.kappa
        a = d ** (-1.0 / 3.0)
        psi = 0.5 * mu * (a * i1 - 3.0) + 0.25 * k * (d - 1.0 - np.log(d))
        first = {"I1": 0.5 * mu * a, "J2": -mu / 6.0 * a / d * i1 + 0.25 * k * (1.0 - 1.0 / d)}
        second = {
            ("I1", "J2"): -mu / 6.0 * a / d,
            ("J2", "J2"): 2.0 / 9.0 * mu * a / (d * d) * i1 + 0.25 * k / (d * d),
        }
        return psi, first, second

    def parameter_derivatives(self, q, name):
        """Derivatives of ``dPsi/dI1`` and ``dPsi/dJ2`` with respect to mu or kappa, (n,) each; what is absent is zero."""
        d = q["J2"]
        if name == "kappa":
            return {"J2": 0.25 * (1.0 - 1.0 / d)}
        a = d ** (-1.0 / 3.0)
        return {"I1": 0.5 * a, "J2": -a / d * q["I1"] / 6.0}
