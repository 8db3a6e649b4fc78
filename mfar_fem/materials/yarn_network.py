r"""Yarns as chains that straighten and lock, crossed into a trellis; energy per area of fabric."""

from __future__ import annotations

import numpy as np

from ..errors import ParameterError
from .invariants import InvariantLaw
from .law import Parameter

_HERE = "form: this law's docstring; default: fit to the tensile curves of cupro SU-1098 [4]"


class YarnNetwork(InvariantLaw):
    r"""Two families of crimped yarns, a trellis that locks, and crimp interchange; per area (N/m), no thickness.

    With the Green strains :math:`E_w, E_f` along warp and weft, :math:`s = I_8 = C_{12}`, and the *taut part* of a
    strain :math:`p(E) = \tfrac12\big(E + \sqrt{E^2 + \delta^2}\big)`,

    .. math::
        \Psi = \sum_{y=w,f} K_y\Big\{\tfrac12 r E_y^2 - L_y^2\big[x_y + \ln(1 - x_y)\big] - c_y E_y\Big\}
             + \frac{G L_s^2}{6}\Big[\Big(1 - \frac{s^2}{L_s^2}\Big)^{-3} - 1\Big]
             + K_{12}\Big[p_w p_f - \frac{\delta}{4}(E_w + E_f)\Big] + \text{const}

    where :math:`x_y = p(E_y)/L_y`, :math:`K_{12} = \nu\sqrt{K_w K_f}`, and :math:`c_y` is the constant that makes the
    reference state stress-free (:math:`2 c_y = p_0/(1 - p_0/L_y)`, :math:`p_0 = \delta/2`).

    Parameters
    ----------
    Kw, Kf : float
        Stiffness of the taut yarns, N/m.
    Lw, Lf : float
        Taut Green strain at which the crimp is used up and the yarn locks; the energy is infinite from there on.
    G : float
        Initial stiffness of trellis shear, N/m; :math:`S_{12} = G s\,(1 - s^2/L_s^2)^{-4}`.
    Ls : float
        Shear :math:`|s|` at which the trellis locks; for inextensible yarns the sine of the locking angle.
    nu : float
        Crimp interchange, 0 to below 1: coupling of the taut strains relative to the geometric mean stiffness.
    delta : float
        Width of the toe: the strain over which a slack yarn becomes taut. The stiffness at rest is about half of
        ``K`` and falls as :math:`K\delta^2/4E^2` in compression, where the yarn stress stays above about
        :math:`-K\delta/4`: yarns buckle rather than carry.
    r : float
        Stiffness that remains in compression, relative to ``K``; keeps the tangent regular where yarns are
        slack. A setting rather than a material constant, so a fit leaves it alone.

    Notes
    -----
    *Why this form.* Without the toe, a chain of length ``L`` carries up to :math:`-K L` in compression, tens to
    hundreds of N/m, and the bias test, where the yarns that reach neither grip are pushed together at 0.1 to 10 N/m,
    comes out an order too stiff in its first half. The trellis needs stiffness below 0.1 N/m at first and a lock near
    the right angle; an exponent of 4 locks gently enough for Newton's method (exponents 3 to 6 fit alike), and below
    0.1 N/m ``G`` itself is hardly determined by those curves. Coupling the taut strains, not the strains, makes the
    interchange vanish when one family is slack. The energy is convex in E for :math:`0 \le \nu < 1`: each term is a
    convex function of s or a convex increasing one of the convex ``p``, and the coupling is dominated by the two yarn
    terms.

    *Finite elements.* With yarns a thousand times stiffer than the trellis, shear is carried in thin layers along the
    yarns that leave the corners of the grips, and the mesh decides what it costs. Cells whose diagonals do not follow the yarns
    lock in tension: a bias strip of 8 x 5 cm with one diagonal a cell is tens of per cent too stiff. With both diagonals along the
    yarns (`material_tests.strip.fe`) its force at 12 % strain is still 11 % too high on 160 triangles and 0.4 % on 1000
    (0.5 and 0.1 % at 16 %), and the fit moves with it: ``G`` 0.075 and 0.099 N/m, ``Ls`` 0.767 and 0.774, at RMSE 1.04 and
    1.08 % of the range. ``G`` belongs to the mesh it was fitted on; ``mfar study mesh`` prints the table.

    References
    ----------
    1. S. Kawabata, M. Niwa, H. Kawai, "The finite-deformation theory of plain-weave fabrics", J. Text. Inst. 64 (1973)
       21–46, doi 10.1080/00405007308630416 (crimp interchange).
    2. M. J. King, P. Jearanaisilawong, S. Socrate, "A continuum constitutive model for the mechanical behavior of woven
       fabrics", Int. J. Solids Struct. 42 (2005) 3867–3896, doi 10.1016/j.ijsolstr.2004.10.030 (yarn and trellis terms,
       locking).
    3. E. M. Arruda, M. C. Boyce, J. Mech. Phys. Solids 41 (1993) 389–412, doi 10.1016/0022-5096(93)90013-6 (a chain of
       limited extension).
    4. Vizoo GmbH, U3M 1.1, physics example 2 (cupro SU-1098, Browzwear FAB), BSD-3-Clause,
       https://github.com/vizoogmbh/u3m.
    """

    name = "yarn-network"
    basis = "area"
    parameters = (
        Parameter("Kw", "K_w", "N/m", 970.0, 1e-2, 1e8, "log", "stiffness of the taut warp", _HERE),
        Parameter("Lw", "L_w", "dimensionless", 0.068, 1e-3, 10.0, "log", "locking strain of the warp", _HERE),
        Parameter("Kf", "K_f", "N/m", 4460.0, 1e-2, 1e8, "log", "stiffness of the taut weft", _HERE),
        Parameter("Lf", "L_f", "dimensionless", 0.112, 1e-3, 10.0, "log", "locking strain of the weft", _HERE),
        Parameter("G", "G", "N/m", 0.1, 1e-3, 1e6, "log", "initial trellis shear stiffness", _HERE),
        Parameter("Ls", "L_s", "dimensionless", 0.81, 1e-2, 10.0, "log", "shear at which the trellis locks", _HERE),
        Parameter("nu", "ν", "dimensionless", 0.05, 0.0, 0.95, "linear", "crimp interchange", _HERE),
        Parameter("delta", "δ", "dimensionless", 0.0132, 1e-5, 0.2, "log", "width of the toe", _HERE),
        Parameter("r", "r", "dimensionless", 0.01, 0.0, 1.0, "linear", "residual compression", "setting", fit=False),
    )
    invariants = ("C11", "C22", "C12")

    def validate(self):
        """ParameterError unless delta < 2 Lw and delta < 2 Lf: otherwise the yarns are locked at rest."""
        for name in ("Lw", "Lf"):
            if self.delta >= 2.0 * self.values[name]:
                raise ParameterError(
                    f"{self.name}: delta = {self.delta:g} must be below 2 {name} = {2 * self.values[name]:g}, "
                    "or the yarns are locked at rest"
                )

    @property
    def K12(self) -> float:
        """Coupling stiffness ``nu sqrt(Kw Kf)``, N/m."""
        return self.nu * (self.Kw * self.Kf) ** 0.5

    def _taut(self, strain):
        """Taut part p of a strain, p' and p''."""
        w = np.sqrt(strain * strain + self.delta**2)
        p = 0.5 * (strain + w)
        return p, p / w, 0.5 * self.delta**2 / (w * w * w)

    def admissible(self, q):
        """Where the energy is finite, (n,) bool: taut strains below Lw and Lf, shear below Ls."""
        w = self._taut(0.5 * (q["C11"] - 1.0))[0] < self.Lw
        f = self._taut(0.5 * (q["C22"] - 1.0))[0] < self.Lf
        return w & f & (np.abs(q["C12"]) < self.Ls)

    def _yarn(self, strain, taut, K, L, order):
        """Energy, stress and stiffness of one family."""
        p, p1, p2 = taut
        lock, lock0, p0 = 1.0 / (1.0 - p / L), 1.0 / (1.0 - 0.5 * self.delta / L), 0.5 * self.delta
        pull = p * lock
        c = 0.5 * p0 * lock0
        rest = L * L * np.log(lock0) - L * p0
        energy = K * ((0.5 * self.r * strain - c) * strain + L * L * np.log(lock) - L * p - rest)
        stress = K * (self.r * strain + p1 * pull - c)
        if order < 2:
            return energy, stress, None
        return energy, stress, K * (self.r + (p1 * lock) ** 2 + p2 * pull)

    def potential(self, q, order):
        """Energy, J/m^2, 0 at rest, and its derivatives in C11, C22, C12; shapes as in :meth:`.InvariantLaw.potential`."""
        ew, ef, s = 0.5 * (q["C11"] - 1.0), 0.5 * (q["C22"] - 1.0), q["C12"]
        tw, tf = self._taut(ew), self._taut(ef)
        (pw, pw1, pw2), (pf, pf1, pf2) = tw, tf
        psi_w, sw, kw = self._yarn(ew, tw, self.Kw, self.Lw, order)
        psi_f, sf, kf = self._yarn(ef, tf, self.Kf, self.Lf, order)
        k, d, area = self.K12, self.delta, (s / self.Ls) ** 2
        z = 1.0 / (1.0 - area)
        z3 = z * z * z
        psi = psi_w + psi_f + self.G * self.Ls**2 / 6.0 * (z3 - 1.0)
        psi += k * (pw * pf - 0.25 * d * (ew + ef + d))
        if order == 0:
            return psi, {}, {}
        z4 = z3 * z
        first = {
            "C11": 0.5 * (sw + k * (pw1 * pf - 0.25 * d)),
            "C22": 0.5 * (sf + k * (pf1 * pw - 0.25 * d)),
            "C12": self.G * s * z4,
        }
        if order == 1:
            return psi, first, {}
        second = {
            ("C11", "C11"): 0.25 * (kw + k * pw2 * pf),
            ("C22", "C22"): 0.25 * (kf + k * pf2 * pw),
            ("C11", "C22"): 0.25 * k * pw1 * pf1,
            ("C12", "C12"): self.G * z4 * (1.0 + 8.0 * area * z),
        }
        return psi, first, second

    def parameter_derivatives(self, q, name):
        """Derivatives of ``dPsi/dC11``, ``dC22``, ``dC12`` with respect to one parameter, (n,) each; what is absent is zero."""
        ew, ef, s = 0.5 * (q["C11"] - 1.0), 0.5 * (q["C22"] - 1.0), q["C12"]
        if name in ("G", "Ls"):
            z = 1.0 / (1.0 - (s / self.Ls) ** 2)
            return {"C12": s * z**4 if name == "G" else -8.0 * self.G * (s / self.Ls) ** 3 * z**5}
        tw, tf = self._taut(ew), self._taut(ef)
        d = self.delta
        # coupling stress over K12, and its derivative with respect to delta
        cw, cf = tw[1] * tf[0] - 0.25 * d, tf[1] * tw[0] - 0.25 * d
        if name == "nu":
            k = (self.Kw * self.Kf) ** 0.5
            return {"C11": 0.5 * k * cw, "C22": 0.5 * k * cf}
        if name in ("Kw", "Kf"):
            k, warp = 0.5 * self.K12 / self.values[name], name == "Kw"
            own = self._yarn(ew, tw, 1.0, self.Lw, 1)[1] if warp else self._yarn(ef, tf, 1.0, self.Lf, 1)[1]
            return {"C11": 0.5 * (k * cw + own * warp), "C22": 0.5 * (k * cf + own * (not warp))}
        if name == "r":
            return {"C11": 0.5 * self.Kw * ew, "C22": 0.5 * self.Kf * ef}
        if name == "Lw":
            return {"C11": 0.5 * self.Kw * self._yarn_by_lock(tw, self.Lw)}
        if name == "Lf":
            return {"C22": 0.5 * self.Kf * self._yarn_by_lock(tf, self.Lf)}
        (dpw, dpw1, yw), (dpf, dpf1, yf) = self._by_delta(ew, tw, self.Lw), self._by_delta(ef, tf, self.Lf)
        k = self.K12
        return {
            "C11": 0.5 * (self.Kw * yw + k * (dpw1 * tf[0] + tw[1] * dpf - 0.25)),
            "C22": 0.5 * (self.Kf * yf + k * (dpf1 * tw[0] + tf[1] * dpw - 0.25)),
        }

    def _yarn_by_lock(self, taut, L):
        """Derivative of a family's stress over K with respect to L."""
        p0 = 0.5 * self.delta
        return 0.5 * (p0 / (L - p0)) ** 2 - taut[1] * (taut[0] / (L - taut[0])) ** 2

    def _by_delta(self, strain, taut, L):
        """Derivatives of p, p' and a family's stress over K with respect to delta."""
        p, p1, _ = taut
        w = np.sqrt(strain * strain + self.delta**2)
        dp, dp1 = 0.5 * self.delta / w, -0.5 * strain * self.delta / (w * w * w)
        lock, lock0 = 1.0 / (1.0 - p / L), 1.0 / (1.0 - 0.5 * self.delta / L)
        return dp, dp1, dp1 * p * lock + p1 * dp * lock * lock - 0.25 * lock0**2
