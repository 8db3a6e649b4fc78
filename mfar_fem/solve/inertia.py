r"""Inertia as a potential: with the relations of :mod:`mfar_fem.solve.integrators` a step minimises

.. math:: \tfrac12 k\,(x - x^*)^T M (x - x^*) + W(x) + \dots

where :math:`k` holds the accelerations and the mass-proportional damping, and :math:`x^*` what the past asks for.
"""

from __future__ import annotations

import numpy as np

from mfar_fem.shell import Shell, State
from mfar_fem.solve.integrators import Kinematics, StepRule
from mfar_fem.solve.mass import Mass


class Inertia:
    """Incremental potential of the mass, a load in the sense of :mod:`mfar_fem.loads`.

    Parameters
    ----------
    areal_density : float
        kg/m².
    kind : {'consistent', 'lumped'}
    damping : float
        Mass-proportional damping :math:`c_M`, 1/s: force ``-c_M M v``; every motion decays like ``exp(-c_M t / 2)`` at least.
    """

    conservative, internal = True, True

    def __init__(self, areal_density: float, kind: str = "consistent", damping: float = 0.0):
        self.areal_density, self.kind, self.damping = areal_density, kind, damping
        self.factor = 0.0
        self._data: np.ndarray = np.zeros(0)
        self._old_force = np.zeros(0)

    def bind(self, shell: Shell) -> None:
        """Assemble the mass."""
        self.mass = Mass(shell, self.areal_density, self.kind)
        self.n_positions = shell.alpha_offset
        self.element_dofs = shell.element_dofs[:, : 3 * shell.surface.elements.shape[1]]
        self._centre = shell.surface.nodes.copy()
        self._old_force = np.zeros(shell.n)

    def begin_step(self, rule: StepRule, k: Kinematics, old_force: np.ndarray | None = None) -> None:
        """Take over the relations of a step; ``old_force`` (n,) is the gradient of all else at its start (generalised-α)."""
        m = rule.mass_weight / rule.force_weight * rule.ca
        d = self.damping * rule.cv
        self.factor = m + d
        centre = (m * rule.xa + d * rule.xv - rule.old_mass / rule.force_weight * k.a) / self.factor
        self._centre = centre.reshape(-1, 3)
        weight = rule.old_force / rule.force_weight
        self._old_force = weight * old_force if weight and old_force is not None else np.zeros(len(self._old_force))

    def force(self, x: np.ndarray) -> np.ndarray:
        """Gradient (3 nn,) of the quadratic term at positions (nn, 3)."""
        return (self.factor * self.mass(x - self._centre)).ravel()

    def energy(self, shell: Shell, state: State, lam: float) -> float:
        """Value of the incremental potential, J."""
        d = shell.positions(state) - self._centre
        return 0.5 * self.factor * float(np.sum(d * self.mass(d))) + float(self._old_force @ state.u)

    def gradient(self, shell: Shell, state: State, lam: float, out: np.ndarray) -> None:
        """Add the inertial force, N."""
        out[: self.n_positions] += self.force(shell.positions(state))
        out += self._old_force

    def hessian(self, shell: Shell, state: State, lam: float, data, positions, exact: bool) -> None:
        """Add the mass matrix times the factor of the step."""
        if len(self._data) != len(data):
            blocks = np.einsum("eij,cd->eicjd", self.mass.blocks, np.eye(3)).reshape(len(positions), -1)
            self._data = np.bincount(positions.ravel(), blocks.ravel(), minlength=len(data))
        data += self.factor * self._data
