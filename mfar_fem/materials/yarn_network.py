r"""Yarns as chains that straighten and lock, crossed into a trellis; energy per area of fabric."""

from __future__ import annotations

import numpy as np

from .invariants import InvariantLaw
from .law import Parameter

_SOURCE = "this project; start values fitted to cupro SU-1098"


class YarnNetwork(InvariantLaw):
    r"""Two crossing families of crimped yarns, trellis shear that locks, and a coupling; per area (N/m).

    .. math::
        \Psi = \sum_{y=w,f} -K_y L_y^2\,[x_y + \ln(1 - x_y)]
             - G L_s^2 \ln\!\Big(1 - \frac{s^2}{L_s^2}\Big)\Big/2 + K_{12} E_w E_f
    """

    name = "yarn-network"
    basis = "area"
    parameters = (
        Parameter("Kw", "K_w", "N/m", 884.0, 1e-3, 1e9, "log", "initial stiffness of the warp", _SOURCE),
        Parameter("Lw", "L_w", "dimensionless", 0.064, 1e-3, 10.0, "log", "locking Green strain of the warp", _SOURCE),
        Parameter("Kf", "K_f", "N/m", 3230.0, 1e-3, 1e9, "log", "initial stiffness of the weft", _SOURCE),
        Parameter("Lf", "L_f", "dimensionless", 0.060, 1e-3, 10.0, "log", "locking Green strain of the weft", _SOURCE),
        Parameter("G", "G", "N/m", 5.0, 1e-6, 1e9, "log", "initial trellis shear stiffness", _SOURCE),
        Parameter("Ls", "L_s", "dimensionless", 0.6, 1e-2, 10.0, "log", "shear at which the trellis locks", _SOURCE),
        Parameter("K12", "K_{12}", "N/m", 0.0, -1e9, 1e9, "linear", "coupling of warp and weft", _SOURCE),
    )
    invariants = ("C11", "C22", "C12")

    def admissible(self, q):
        ok = (q["C11"] < 1.0 + 2.0 * self.Lw) & (q["C22"] < 1.0 + 2.0 * self.Lf)
        return ok & (np.abs(q["C12"]) < self.Ls)

    def potential(self, q, order):
        ew, ef, s = 0.5 * (q["C11"] - 1.0), 0.5 * (q["C22"] - 1.0), q["C12"]
        xw, xf, z = ew / self.Lw, ef / self.Lf, (s / self.Ls) ** 2
        rw, rf, rs = 1.0 / (1.0 - xw), 1.0 / (1.0 - xf), 1.0 / (1.0 - z)
        k = self.K12
        psi = k * ew * ef + 0.5 * self.G * self.Ls**2 * np.log(rs)
        psi += self.Kw * self.Lw**2 * (np.log(rw) - xw) + self.Kf * self.Lf**2 * (np.log(rf) - xf)
        if order == 0:
            return psi, {}, {}
        first = {
            "C11": 0.5 * (self.Kw * ew * rw + k * ef),
            "C22": 0.5 * (self.Kf * ef * rf + k * ew),
            "C12": self.G * s * rs,
        }
        if order == 1:
            return psi, first, {}
        second = {
            ("C11", "C11"): 0.25 * self.Kw * rw * rw,
            ("C22", "C22"): 0.25 * self.Kf * rf * rf,
            ("C11", "C22"): 0.25 * k,
            ("C12", "C12"): self.G * (1.0 + z) * rs * rs,
        }
        return psi, first, second

    def parameter_derivatives(self, q, name):
        ew, ef, s = 0.5 * (q["C11"] - 1.0), 0.5 * (q["C22"] - 1.0), q["C12"]
        rw, rf, rs = 1.0 / (1.0 - ew / self.Lw), 1.0 / (1.0 - ef / self.Lf), 1.0 / (1.0 - (s / self.Ls) ** 2)
        if name == "Kw":
            return {"C11": 0.5 * ew * rw}
        if name == "Kf":
            return {"C22": 0.5 * ef * rf}
        if name == "Lw":
            return {"C11": -0.5 * self.Kw * (ew * rw / self.Lw) ** 2}
        if name == "Lf":
            return {"C22": -0.5 * self.Kf * (ef * rf / self.Lf) ** 2}
        if name == "G":
            return {"C12": s * rs}
        if name == "Ls":
            return {"C12": -2.0 * self.G * s**3 * rs * rs / self.Ls**3}
        return {"C11": 0.5 * ef, "C22": 0.5 * ew}
