r"""The project's law for silk: the eight-chain energy with an anisotropic chain stretch."""

from __future__ import annotations

import numpy as np

from ..errors import ParameterError
from .invariants import InvariantLaw
from .law import Parameter

_PAPER = "formula (11) and Table 1 of the silk paper"
_CELL = "[1] Bischoff, Arruda, Grosh 2002, doi 10.1115/1.1485754"


class EightChainSilk(InvariantLaw):
    r"""Eight-chain energy whose chain stretch feels the yarns; incompressible, plane stress.

    .. math::
        \Psi = \mu\Big[\frac{\tilde I}{\varphi} + \ln\varphi\Big], \qquad \varphi = 1 - \frac{\tilde I}{3\nu}, \qquad
        \tilde I = I_1 - 3 + \eta\big[\omega_1 (I_{4w} - 1 - \ln I_{4w}) + \omega_2 (I_{4f} - 1 - \ln I_{4f})\big]

    with :math:`I_1 = C_{11} + C_{22} + 1/\det C`, :math:`I_{4w} = C_{11}`, :math:`I_{4f} = C_{22}`.

    Parameters
    ----------
    mu : float
        Modulus of the network, Pa. Not the shear modulus: that is :math:`2\mu(1 - 1/(3\nu))` at rest for
        :math:`\eta = 0`.
    nu : float
        Locking parameter (number of segments of a chain), > 1/3; the energy is infinite from
        :math:`\tilde I = 3\nu` on. For :math:`\nu \le 1/3` the state at rest would be unstable.
    eta : float
        Strength of the anisotropy; 0 gives the isotropic law.
    omega1, omega2 : float
        Shares of warp and weft. Only the products :math:`\eta\omega_i` enter, so a fit keeps ``eta`` fixed.

    Notes
    -----
    Stress-free at C = I. The logarithms make the yarns resist their own collapse. A tensile curve up to 25 % hardly
    depends on ``nu``: expect it to stay undetermined unless the data come near locking.

    References
    ----------
    1. J. E. Bischoff, E. M. Arruda, K. Grosh, "A microstructurally based orthotropic hyperelastic constitutive law",
       J. Appl. Mech. 69 (2002) 570–579, doi 10.1115/1.1485754 (anisotropic unit cell).
    2. E. M. Arruda, M. C. Boyce, J. Mech. Phys. Solids 41 (1993) 389–412, doi 10.1016/0022-5096(93)90013-6.
    """

    name = "eight-chain-silk"
    basis = "volume"
    parameters = (
        Parameter("mu", "μ", "Pa", 87.5e3, 1e-3, 1e13, "log", "modulus of the chain network", _PAPER),
        Parameter("nu", "ν", "dimensionless", 5.2, 1.0 / 3.0, 1e6, "log", "locking parameter, > 1/3", _PAPER),
        Parameter("eta", "η", "dimensionless", 1.8, 0.0, 1e6, "linear", "strength of anisotropy", _PAPER, fit=False),
        Parameter("omega1", "ω₁", "dimensionless", 0.75, 0.0, 1e6, "linear", "share of the warp", _CELL),
        Parameter("omega2", "ω₂", "dimensionless", 0.25, 0.0, 1e6, "linear", "share of the weft", _CELL),
    )
    invariants = ("I1", "C11", "C22")

    def validate(self):
        """ParameterError unless nu > 1/3."""
        require_stable_nu(self)

    def _measure(self, q):
        """Chain measure and its derivatives in C11, C22 beyond those of I1."""
        a, b = q["C11"], q["C22"]
        k1, k2 = self.eta * self.omega1, self.eta * self.omega2
        i = q["I1"] - 3.0 + k1 * (a - 1.0 - np.log(a)) + k2 * (b - 1.0 - np.log(b))
        return i, k1 * (1.0 - 1.0 / a), k2 * (1.0 - 1.0 / b)

    def admissible(self, q):
        """Where the energy is finite, (n,) bool: the chain measure is below ``3 nu``."""
        return self._measure(q)[0] < 3.0 * self.nu

    def potential(self, q, order):
        """Energy, J/m^3, and its derivatives in I1, C11, C22; shapes as in :meth:`.InvariantLaw.potential`."""
        i, ga, gb = self._measure(q)
        psi, d1, d2 = chain_energy(i, self.mu, self.nu)
        if order == 0:
            return psi, {}, {}
        first = {"I1": d1, "C11": d1 * ga, "C22": d1 * gb}
        if order == 1:
            return psi, first, {}
        k1, k2 = self.eta * self.omega1, self.eta * self.omega2
        second = {
            ("I1", "I1"): d2,
            ("I1", "C11"): d2 * ga,
            ("I1", "C22"): d2 * gb,
            ("C11", "C22"): d2 * ga * gb,
            ("C11", "C11"): d2 * ga * ga + d1 * k1 / q["C11"] ** 2,
            ("C22", "C22"): d2 * gb * gb + d1 * k2 / q["C22"] ** 2,
        }
        return psi, first, second

    def parameter_derivatives(self, q, name):
        """Derivatives of ``dPsi/dI1``, ``dC11``, ``dC22`` with respect to one parameter, (n,) each."""
        i, ga, gb = self._measure(q)
        if name in ("mu", "nu"):
            d = chain_energy_parameter(i, self.mu, self.nu, name)
            return {"I1": d, "C11": d * ga, "C22": d * gb}
        a, b = q["C11"], q["C22"]
        w1, w2 = {"eta": (self.omega1, self.omega2), "omega1": (self.eta, 0.0), "omega2": (0.0, self.eta)}[name]
        _, d1, d2 = chain_energy(i, self.mu, self.nu)
        di = d2 * (w1 * (a - 1.0 - np.log(a)) + w2 * (b - 1.0 - np.log(b)))
        return {"I1": di, "C11": di * ga + d1 * w1 * (1.0 - 1.0 / a), "C22": di * gb + d1 * w2 * (1.0 - 1.0 / b)}


def require_stable_nu(law) -> None:
    """Raise ParameterError unless ``nu > 1/3``."""
    if law.nu <= 1.0 / 3.0:
        raise ParameterError(f"{law.name}: nu = {law.nu:g} makes the state at rest unstable; nu > 1/3 is needed")


def chain_energy(i, mu, nu, d=0.0):
    """``mu [i/phi + ln phi]``, ``phi = 1 + d - i/(3 nu)``, with its first two derivatives in `i`.

    ``d`` is the constant of the literal law, whose energy at rest, ``mu ln(1 + d)``, is not subtracted.
    """
    k = 1.0 / (3.0 * nu)
    r = 1.0 / (1.0 + d - k * i)
    psi = mu * (i * r - np.log(r))
    ik = i * k
    d1 = mu * r * (1.0 - k + ik * r)
    d2 = mu * k * r * r * (2.0 - k + 2.0 * ik * r)
    return psi, d1, d2


def chain_energy_parameter(i, mu, nu, name, d=0.0):
    """Derivative of the first derivative of :func:`chain_energy` with respect to ``mu``, ``nu`` or ``d``."""
    if name == "mu":
        return chain_energy(i, 1.0, nu, d)[1]
    k = 1.0 / (3.0 * nu)
    r = 1.0 / (1.0 + d - k * i)
    if name == "d":
        return -mu * r * r * (1.0 - k + 2.0 * i * k * r)
    # r depends on k through phi: dr/dk = i r^2; dk/dnu = -k/nu
    dk = mu * (i * r * r * (1.0 - k + i * k * r) + r * (-1.0 + i * r + i * k * i * r * r))
    return -k / nu * dk
