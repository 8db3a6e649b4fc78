r"""Plane stress of compressible solids: the thickness stretch from S33 = 0, condensed out of energy and tangent."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

import numpy as np

from ..errors import NotConvergedError
from .law import Law, columns

_D = np.array([2.0, 2.0, 1.0])


def solve_thickness(residual, start, rtol: float = 1e-12, max_iterations: int = 80) -> np.ndarray:
    """Solve ``residual(C33) = 0`` point by point by a Newton iteration in ln C33 kept inside a bracket.

    Parameters
    ----------
    residual : callable
        ``residual(C33) -> (f, df)``, both (n,): a function that is negative for small and positive for large C33
        (half the stress through the thickness), and its derivative.
    start : (n,) array
        Positive start values.
    rtol : float
        Relative tolerance on C33.
    max_iterations : int
        Limit; Newton needs 4 to 8.

    Returns
    -------
    (n,) array
        C33.

    Raises
    ------
    NotConvergedError
        Some point has no root within a factor 1e12 of its start, or the limit was reached.
    """
    t = np.log(start)
    low, high = t - np.log(1e12), t + np.log(1e12)
    ends = low.copy(), high.copy()
    done = np.zeros(t.shape, dtype=bool)
    for _ in range(max_iterations):
        c33 = np.exp(t)
        f, df = residual(c33)
        low, high = np.where(f < 0.0, t, low), np.where(f < 0.0, high, t)
        slope = c33 * df
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.where(slope > 0.0, -f / slope, np.nan)
        inside = (t + step > low) & (t + step < high)
        new = np.where(inside, t + step, 0.5 * (low + high))
        new = np.where(f == 0.0, t, new)
        done = np.abs(new - t) <= rtol
        t = new
        if done.all():
            break
    stuck = ~done | (t - ends[0] < 1e-6) | (ends[1] - t < 1e-6)
    if stuck.any():
        i = int(np.argmax(stuck))
        raise NotConvergedError(
            f"plane stress: no thickness stretch with S33 = 0 at {int(stuck.sum())} of {len(t)} points "
            f"(first: point {i}, C33 near {np.exp(t[i]):.3g}); the law may lack a volumetric stiffness"
        )
    return np.exp(t)


class CompressibleLaw(Law):
    r"""A compressible solid given by its potential in ``I1 = tr C``, ``J2 = det C`` (both 3-D), C11, C22, C12, C33.

    With :math:`y = (C_{11}, C_{22}, C_{12})` and the thickness value :math:`z = C_{33}` solved from
    :math:`\partial\psi/\partial z = 0`, the condensed derivatives are

    .. math:: \nabla\Psi = \psi_y, \qquad \nabla^2\Psi = \psi_{yy} - \psi_{yz}\psi_{zy}/\psi_{zz}, \qquad
              \frac{d\psi_y}{d\theta} = \psi_{y\theta} - \psi_{yz}\psi_{z\theta}/\psi_{zz} .

    Subclasses implement the same two methods as for :class:`~.invariants.InvariantLaw`.
    """

    invariants: ClassVar[tuple[str, ...]]

    @abstractmethod
    def potential(self, q, order):
        """Energy, first and second derivatives in the invariants; see :class:`~.invariants.InvariantLaw`."""

    @abstractmethod
    def parameter_derivatives(self, q, name):
        """Derivatives of the first derivatives of the potential with respect to parameter `name`."""

    def _state(self, c11, c22, c12):
        det = c11 * c22 - c12 * c12

        def at(c33):
            q = {"C11": c11, "C22": c22, "C12": c12, "C33": c33}
            q["I1"], q["J2"] = c11 + c22 + c33, det * c33
            return q

        def residual(c33):
            first, second = self._chain(at(c33))
            return first[:, 3], second[:, 3, 3]

        return at(solve_thickness(residual, 1.0 / det))

    def _gradients(self, q):
        """Gradient (n, 4) of each invariant in (C11, C22, C12, C33)."""
        n, g = len(q["C11"]), {}
        for k in self.invariants:
            g[k] = np.zeros((n, 4))
            if k == "I1":
                g[k][:, [0, 1, 3]] = 1.0
            elif k == "J2":
                det = q["C11"] * q["C22"] - q["C12"] ** 2
                g[k][:] = np.stack([q["C22"] * q["C33"], q["C11"] * q["C33"], -2.0 * q["C12"] * q["C33"], det], axis=1)
            else:
                g[k][:, ("C11", "C22", "C12", "C33").index(k)] = 1.0
        return g

    def _chain(self, q):
        """Gradient (n, 4) and Hessian (n, 4, 4) of the potential."""
        _, first, second = self.potential(q, 2)
        g = self._gradients(q)
        n = len(q["C11"])
        gradient, hessian = np.zeros((n, 4)), np.zeros((n, 4, 4))
        for k, value in first.items():
            gradient += np.reshape(value, (-1, 1)) * g[k]
            if k == "J2":
                for i, j, entry in ((0, 1, q["C33"]), (0, 3, q["C22"]), (1, 3, q["C11"]), (2, 3, -2.0 * q["C12"])):
                    hessian[:, i, j] += value * entry
                    hessian[:, j, i] += value * entry
                hessian[:, 2, 2] -= 2.0 * value * q["C33"]
        for (k, l), value in second.items():
            outer = np.reshape(value, (-1, 1, 1)) * (g[k][:, :, None] * g[l][:, None, :])
            hessian += outer if k == l else outer + outer.transpose(0, 2, 1)
        return gradient, hessian

    def evaluate(self, C, order: int = 2):
        """Energy (n,), stress (n, 3) and tangent (n, 3, 3) condensed at S33 = 0; see :meth:`.Law.evaluate`.

        Raises
        ------
        NotConvergedError
            Some point has no thickness stretch with S33 = 0 (:func:`solve_thickness`).
        """
        c11, c22, c12, ok = columns(C)
        q = self._state(c11, c22, c12)
        energy = np.where(ok, self.potential(q, 0)[0], np.inf)
        if order < 1:
            return energy, None, None
        gradient, h = self._chain(q)
        stress = np.where(ok[:, None], gradient[:, :3] * _D, 0.0)
        if order < 2:
            return energy, stress, None
        condensed = h[:, :3, :3] - h[:, :3, 3, None] * h[:, None, 3, :3] / h[:, 3, 3, None, None]
        return energy, stress, np.where(ok[:, None, None], condensed * (_D[:, None] * _D), 0.0)

    def stress_sensitivity(self, C, names):
        """``dS_I/dtheta`` at fixed C and S33 = 0, (n, 3, len(names)); raises as :meth:`evaluate` does."""
        c11, c22, c12, ok = columns(C)
        q = self._state(c11, c22, c12)
        g, h = self._gradients(q), self._chain(q)[1]
        out = np.empty((len(ok), 3, len(names)))
        for p, name in enumerate(names):
            self.parameter(name)
            total = sum(np.reshape(v, (-1, 1)) * g[k] for k, v in self.parameter_derivatives(q, name).items())
            out[:, :, p] = _D * (total[:, :3] - h[:, :3, 3] / h[:, 3, 3, None] * total[:, 3, None])
        out[~ok] = 0.0
        return out
