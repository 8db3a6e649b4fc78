r"""Orthotropic St. Venant–Kirchhoff law in plane stress: the linear baseline of textile mechanics."""

from __future__ import annotations

from .invariants import InvariantLaw
from .law import Parameter

_SOURCE = "[1] Clyde, Teran, Tamstorf 2017, doi 10.1145/3099564.3099577"


class StVenantKirchhoff(InvariantLaw):
    r"""Quadratic energy in the Green strain, warp and weft as the orthotropic axes.

    .. math::
        \Psi = \tfrac12 Q_{11} E_{11}^2 + \tfrac12 Q_{22} E_{22}^2 + Q_{12} E_{11} E_{22} + 2 G E_{12}^2, \qquad
        Q_{11} = \frac{E_w}{1-\nu^2},\; Q_{22} = \frac{E_f}{1-\nu^2},\; Q_{12} = \frac{\nu\sqrt{E_w E_f}}{1-\nu^2}

    Parameters
    ----------
    Ew, Ef : float
        Young's modulus along warp and weft, Pa.
    nu : float
        Geometric mean :math:`\nu = \sqrt{\nu_{wf}\nu_{fw}}` of the two Poisson ratios, so that any value in (-1, 1)
        gives a positive definite law; :math:`\nu_{wf} = \nu\sqrt{E_w/E_f}` is the contraction of the weft under
        tension along the warp. For :math:`E_w = E_f` it is the Poisson ratio.
    G : float
        Shear modulus, Pa.

    Notes
    -----
    Linear in E, so it cannot be J-shaped; under strong compression its tangent loses ellipticity, as that of every
    St. Venant–Kirchhoff law.

    References
    ----------
    1. D. Clyde, J. Teran, R. Tamstorf, "Modeling and data-driven parameter estimation for woven fabrics", SCA 2017,
       doi 10.1145/3099564.3099577 (orthotropic membrane of cloth).
    """

    name = "st-venant-kirchhoff"
    basis = "volume"
    parameters = (
        Parameter("Ew", "E_w", "Pa", 1e7, 1.0, 1e13, "log", "Young's modulus along the warp", _SOURCE),
        Parameter("Ef", "E_f", "Pa", 1e7, 1.0, 1e13, "log", "Young's modulus along the weft", _SOURCE),
        Parameter("nu", "ν", "dimensionless", 0.3, -0.999, 0.999, "linear", "geometric mean Poisson ratio", _SOURCE),
        Parameter("G", "G", "Pa", 1e6, 1e-3, 1e13, "log", "shear modulus", _SOURCE),
    )
    invariants = ("C11", "C22", "C12")

    @classmethod
    def isotropic(cls, E: float, nu: float) -> StVenantKirchhoff:
        """Isotropic case: ``G = E / (2 (1 + nu))``; E in Pa."""
        return cls(Ew=E, Ef=E, nu=nu, G=0.5 * E / (1.0 + nu))

    def _moduli(self):
        d = 1.0 - self.nu**2
        return self.Ew / d, self.Ef / d, self.nu * (self.Ew * self.Ef) ** 0.5 / d

    def potential(self, q, order):
        """Energy, J/m^3, and its derivatives in C11, C22, C12; shapes as in :meth:`.InvariantLaw.potential`."""
        e1, e2, s = 0.5 * (q["C11"] - 1.0), 0.5 * (q["C22"] - 1.0), q["C12"]
        a, b, c = self._moduli()
        t1, t2, t3 = a * e1 + c * e2, b * e2 + c * e1, self.G * s
        psi = 0.5 * (t1 * e1 + t2 * e2 + t3 * s)
        if order == 0:
            return psi, {}, {}
        first = {"C11": 0.5 * t1, "C22": 0.5 * t2, "C12": t3}
        second = {("C11", "C11"): 0.25 * a, ("C22", "C22"): 0.25 * b, ("C11", "C22"): 0.25 * c}
        second["C12", "C12"] = self.G
        return psi, first, second

    def parameter_derivatives(self, q, name):
        """Derivatives of ``dPsi/dC11``, ``dC22``, ``dC12`` with respect to one parameter, (n,) each; what is absent is zero."""
        e1, e2 = 0.5 * (q["C11"] - 1.0), 0.5 * (q["C22"] - 1.0)
        if name == "G":
            return {"C12": q["C12"]}
        nu, d, root = self.nu, 1.0 - self.nu**2, (self.Ew * self.Ef) ** 0.5
        a, b, c = {
            "Ew": (1.0 / d, 0.0, 0.5 * nu * root / self.Ew / d),
            "Ef": (0.0, 1.0 / d, 0.5 * nu * root / self.Ef / d),
            "nu": (2.0 * nu * self.Ew / d**2, 2.0 * nu * self.Ef / d**2, (1.0 + nu**2) * root / d**2),
        }[name]
        return {"C11": 0.5 * (a * e1 + c * e2), "C22": 0.5 * (b * e2 + c * e1)}
