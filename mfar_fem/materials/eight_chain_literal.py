r"""The energy exactly as the silk paper prints it, for reproduction."""

from __future__ import annotations

from .eight_chain_silk import chain_energy, chain_energy_parameter, require_stable_nu
from .invariants import InvariantLaw
from .law import Parameter

_PAPER = "formula (11) and Table 1 of the silk paper"


class EightChainLiteral(InvariantLaw):
    r"""Formula (11) as printed, with det H a constant; incompressible, plane stress. Use it to reproduce, not to model.

    .. math::
        \Psi = \mu\Big[\frac{I_1 - 3}{\varphi} + \ln\varphi\Big], \qquad
        \varphi = 1 - \frac{I_1 - 3}{3\nu} + \det H

    Parameters
    ----------
    mu : float
        Modulus, Pa.
    nu : float
        Locking parameter, > 1/3.
    detH : float
        Determinant of the anisotropy tensor H of formula (12), a constant >= 0.

    Notes
    -----
    What the printed formulas mean when taken at their word:

    1. Formula (13) of the paper is not :math:`2\,\partial\Psi/\partial C`: its isotropic part lacks
       :math:`-1/(3\nu\varphi)`, the derivative of :math:`\ln\varphi`. The difference is 6.8 % of the initial stiffness
       at :math:`\nu = 5.2`. Here the stress is derived from the energy.
    2. The initial shear modulus is :math:`2\mu(1 - 1/(3\nu))` (for det H = 0), not :math:`\mu`; the law is unstable
       for :math:`\nu \le 1/3` and locks where :math:`\varphi \to 0`, at :math:`I_1 - 3 = 3\nu(1 + \det H)`.
    3. H is :math:`\eta\omega_1 a_0 \otimes a_0` plus a vector that vanishes for straight yarns: rank one, so
       :math:`\det H = 0`, and it does not depend on C. As printed the anisotropic law is isotropic. A positive det H
       would *soften* it: nominal stress at 10 % of 45.0 kPa for 0, 34.6 for 0.3, 22.4 for 1.
    4. Between 5 % and 25 % strain the tensile curve hardly depends on :math:`\nu` (102.1 kPa for 5.2, 106.3 for 52, at
       25 %): a tensile test alone cannot identify it.

    With det H > 0 the energy at rest is :math:`\mu\ln(1 + \det H)`; it is subtracted here. The stress is unaffected.

    References
    ----------
    1. E. M. Arruda, M. C. Boyce, J. Mech. Phys. Solids 41 (1993) 389–412, doi 10.1016/0022-5096(93)90013-6 (the
       eight-chain model the paper starts from).
    """

    name = "eight-chain-literal"
    basis = "volume"
    parameters = (
        Parameter("mu", "μ", "Pa", 87.5e3, 1e-3, 1e13, "log", "modulus of the chain network", _PAPER),
        Parameter("nu", "ν", "dimensionless", 5.2, 1.0 / 3.0, 1e6, "log", "locking parameter, > 1/3", _PAPER),
        Parameter("detH", "det H", "dimensionless", 0.0, 0.0, 1e3, "linear", "constant det H", _PAPER, fit=False),
    )
    invariants = ("I1",)

    def validate(self):
        """ParameterError unless nu > 1/3."""
        require_stable_nu(self)

    def admissible(self, q):
        """Where the energy is finite, (n,) bool: ``I1 - 3 < 3 nu (1 + det H)``, where phi is positive."""
        return q["I1"] - 3.0 < 3.0 * self.nu * (1.0 + self.detH)

    def potential(self, q, order):
        """Energy, J/m^3, 0 at rest, and its derivatives in I1; shapes as in :meth:`.InvariantLaw.potential`."""
        psi, d1, d2 = chain_energy(q["I1"] - 3.0, self.mu, self.nu, self.detH)
        rest = chain_energy(0.0, self.mu, self.nu, self.detH)[0]
        return psi - rest, {"I1": d1}, {("I1", "I1"): d2}

    def parameter_derivatives(self, q, name):
        """``d(dPsi/dI1)/dtheta`` for mu, nu or detH, (n,)."""
        which = "d" if name == "detH" else name
        return {"I1": chain_energy_parameter(q["I1"] - 3.0, self.mu, self.nu, which, self.detH)}
