r"""Bending law of a fabric: linear and orthotropic, energy :math:`\tfrac12 k\cdot D k` per area.

The curvature change is ``k = [k11, k22, 2 k12]`` in the warp/weft frame (1/m), and

.. math:: D = \begin{pmatrix} B_w & D_{12} & 0\\ D_{12} & B_f & 0\\ 0 & 0 & D_{33}\end{pmatrix}

with the rigidities of warp and weft, the coupling and the twist, all in N·m (N·m² per metre of width). Textile bending
is measured apart from the membrane (ASTM D1388, KES-FB2), because the one does not follow from the other: yarns slide
over each other in bending, and crimp makes the membrane soft at rest. :meth:`Bending.ratio_to` says how far apart they
are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..errors import InputError, ParameterError


@dataclass(frozen=True)
class Bending:
    """Orthotropic bending rigidities.

    Attributes
    ----------
    warp, weft : float
        Moment per width that bends the sheet along warp (weft) to unit curvature, the other curvatures being held at
        zero, N·m. Positive.
    twist : float
        Rigidity against ``2 k12``, N·m. Positive.
    coupling : float
        D12, N·m; ``coupling**2 < warp * weft``.

    Raises
    ------
    ParameterError
        A value is not finite or the matrix is not positive definite.
    """

    warp: float
    weft: float
    twist: float
    coupling: float = 0.0

    def __post_init__(self):
        for name in ("warp", "weft", "coupling", "twist"):
            value = float(getattr(self, name))
            object.__setattr__(self, name, value)
            if not math.isfinite(value):
                raise ParameterError(f"bending: {name} = {value} is not a finite rigidity in N·m")
            if name != "coupling" and value <= 0.0:
                raise ParameterError(f"bending: {name} = {value:g} N·m must be positive")
            if name == "coupling" and value**2 >= self.warp * self.weft:
                bound = math.sqrt(self.warp * self.weft)
                raise ParameterError(
                    f"bending: coupling = {value:g} N·m makes the bending energy indefinite; "
                    f"its magnitude must stay under sqrt(warp * weft) = {bound:g} N·m"
                )

    @property
    def matrix(self) -> np.ndarray:
        """D, N·m. *Shape:* (3, 3)."""
        d = np.diag([self.warp, self.weft, self.twist])
        d[0, 1] = d[1, 0] = self.coupling
        return d

    @classmethod
    def isotropic(cls, E: float, nu: float, h: float) -> Bending:
        """Kirchhoff plate: Young's modulus E (Pa), Poisson's ratio nu, thickness h (m)."""
        if not (E > 0.0 and h > 0.0 and -1.0 < nu < 1.0):
            raise ParameterError(f"bending: E = {E:g} Pa and h = {h:g} m must be positive and -1 < nu = {nu:g} < 1")
        d = E * h**3 / (12.0 * (1.0 - nu**2))
        return cls(warp=d, weft=d, twist=0.5 * (1.0 - nu) * d, coupling=nu * d)

    @classmethod
    def derived(cls, law, thickness: float) -> Bending:
        """Solid sheet of the membrane's material: ``D = h³/12`` times the plane-stress tangent at rest.

        Parameters
        ----------
        law : Law
            Membrane law; one per area (N/m) is taken as spread evenly over the thickness (``h²/12`` times its tangent).
        thickness : float
            m.

        Raises
        ------
        ParameterError
            The law at rest is not positive definite, or couples bending and twist (not orthotropic about warp and
            weft).
        """
        if not (math.isfinite(thickness) and thickness > 0.0):
            raise ParameterError(f"bending: thickness = {thickness:g} m must be positive")
        power = 3 if law.basis == "volume" else 2
        d = np.asarray(law.tangent_at_rest()) * thickness**power / 12.0
        if max(abs(d[0, 2]), abs(d[1, 2])) > 1e-9 * np.abs(d).max():
            raise ParameterError(f"bending: the law '{law.name}' is not orthotropic about warp and weft at rest")
        return cls(warp=d[0, 0], weft=d[1, 1], twist=d[2, 2], coupling=d[0, 1])

    @classmethod
    def from_rigidities(cls, warp: float, weft: float, twist: float | None = None, coupling: float = 0.0) -> Bending:
        r"""Measured rigidities (D1388, KES), N·m.

        Without a measured twist Huber's estimate is taken, :math:`D_{12} + 2D_{33} = \sqrt{B_w B_f}` (exact for an
        isotropic plate; Timoshenko & Woinowsky-Krieger, Theory of Plates and Shells, 2nd ed., §86). With a coupling a
        free strip feels ``warp - coupling²/weft`` (see :meth:`along`).
        """
        if twist is None:
            twist = 0.5 * (math.sqrt(max(warp * weft, 0.0)) - coupling)
        return cls(warp=warp, weft=weft, twist=twist, coupling=coupling)

    def along(self, angle: float, free: bool = True) -> float:
        """Rigidity of a strip cut at an angle.

        Parameters
        ----------
        angle : float
            Between the strip's axis and the warp, rad.
        free : bool
            True: a narrow strip, free to curve across and to twist (what a cantilever test sees);
            False: bent into a cylinder.

        Returns
        -------
        float
            N·m.
        """
        c, s = math.cos(angle), math.sin(angle)
        if free:
            m = np.array([c * c, s * s, c * s])
            return float(1.0 / (m @ np.linalg.solve(self.matrix, m)))
        k = np.array([c * c, s * s, 2.0 * c * s])
        return float(k @ self.matrix @ k)

    def ratio_to(self, other: Bending) -> dict[str, float]:
        """Rigidities divided by those of another bending law, by name: ``warp``, ``weft``, ``twist``.

        ``fabric.bending.ratio_to(Bending.derived(law, h))`` is 1 for a homogeneous film. A fabric whose yarns slide is
        below; one whose membrane is soft at rest (crimp, trellis shear) may be far above.
        """
        if not isinstance(other, Bending):
            raise InputError(f"ratio_to needs a Bending, got {type(other).__name__}")
        return {name: getattr(self, name) / getattr(other, name) for name in ("warp", "weft", "twist")}
