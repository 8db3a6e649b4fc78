r"""A membrane law with its tensile stiffness divided: a first approximation of a nearly inextensible sheet, quickly reached.

.. math:: \Psi_s = s\,\Psi + (1 - s)\,\tfrac12 G_0\,(2 E_{12})^2

keeps the shear stiffness at rest :math:`G_0`, which decides how cloth drapes, and divides the rest. No result rests on it: a
relaxation ends with :math:`s = 1`.
"""

from __future__ import annotations

import numpy as np

from mfar_fem.errors import ParameterError


class Softened:
    """A law of which only the share ``s`` of the energy counts, its shear at rest apart.

    Parameters
    ----------
    law : Law
        The law itself; anything with ``evaluate``, ``tangent_at_rest`` and ``basis``.
    share : float
        s in (0, 1].

    Raises
    ------
    ParameterError
        ``share`` outside (0, 1].
    """

    def __init__(self, law, share: float):
        if not 0.0 < share <= 1.0:
            raise ParameterError(f"the share of the tensile stiffness must lie in (0, 1], got {share}")
        self.law, self.share, self.basis = law, float(share), law.basis
        self.name = f"{law.name} at {share:g} of its tensile stiffness"
        self._shear = (1.0 - self.share) * float(law.tangent_at_rest()[2, 2])

    def evaluate(self, C, order: int = 2):
        """Energy (n,), stress (n, 3) and tangent (n, 3, 3) at C (n, 3), as :meth:`mfar_fem.materials.Law.evaluate`."""
        W, S, D = self.law.evaluate(C, order)
        shear = np.asarray(C)[:, 2]
        W = self.share * W + 0.5 * self._shear * shear**2
        if S is not None:
            S = self.share * S
            S[:, 2] += self._shear * shear
        if D is not None:
            D = self.share * D
            D[:, 2, 2] += self._shear
        return W, S, D

    def tangent_at_rest(self) -> np.ndarray:
        """Tangent at C = I, shape (3, 3)."""
        return self.evaluate(np.array([[1.0, 1.0, 0.0]]))[2][0]
