r"""Drag of the air, quadratic in the velocity relative to it.

:class:`AirDrag`, the default, acts per area: :math:`-\gamma_n |v_n| v_n` along the normal and :math:`-\gamma_t |v_t| v_t` along
the sheet, N/m²; :math:`v` is relative to the air. It does not change with the mesh. :class:`VertexDrag` is formula (16) of the silk
paper, :math:`-\gamma |v| v` at every *vertex*: refine the mesh and the drag grows with the number of vertices.

Both are derivatives of a convex dissipation potential :math:`D(v)` once the normals are those of the predicted configuration; the
incremental potential is :math:`D(v(x)) / c_v` with :math:`v = c_v (x - x_v)`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mfar_fem.errors import InputError
from mfar_fem.shell import Shell, State
from mfar_fem.shell.geometry import tangents, unit_normals
from mfar_fem.solve.integrators import StepRule
from mfar_fem.solve.mass import element_quadrature

AirField = Callable[[np.ndarray, float], np.ndarray]
"""Velocity of the air: ``air(x (m, 3), t) -> (m, 3)``, m/s."""


def _air(velocity) -> AirField:
    if callable(velocity):
        return velocity
    constant = np.asarray(velocity, dtype=float)
    if constant.shape != (3,) or not np.all(np.isfinite(constant)):
        raise InputError(f"the velocity of the air must be three finite numbers (m/s) or a function of (x, t), got {velocity!r}")
    return lambda x, t: np.broadcast_to(constant, x.shape)


class AirDrag:
    """Quadratic drag per reference area.

    Parameters
    ----------
    normal, tangential : float
        γ_n and γ_t, N·s²/m⁴ (that is kg/m³: half the air density times a drag coefficient; 0.6 is a plate across the wind).
    air : (3,) array or callable
        Velocity of the air, m/s, constant or ``air(x, t)``.
    """

    conservative, internal = True, True

    def __init__(self, normal: float, tangential: float = 0.0, air=(0.0, 0.0, 0.0)):
        for name, value in (("normal", normal), ("tangential", tangential)):
            if not (np.isfinite(value) and value >= 0):
                raise InputError(f"the {name} drag coefficient must be >= 0 N·s²/m⁴, got {value}")
        self.normal, self.tangential, self.air = float(normal), float(tangential), _air(air)
        self._rule: StepRule | None = None

    def bind(self, shell: Shell) -> None:
        """Prepare the quadrature."""
        self._rule = None
        self.element_dofs = shell.element_dofs[:, : 3 * shell.surface.elements.shape[1]]
        self._weights, self._N, self._dN = element_quadrature(shell)

    def begin_step(self, shell: Shell, rule: StepRule, predicted: np.ndarray, t: float) -> None:
        """Freeze normals and air at the ``predicted`` positions (nn, 3) and the new time ``t`` (s)."""
        elements = shell.surface.elements
        self._rule = rule
        self._normals = unit_normals(tangents(predicted, elements, self._dN))
        at = np.einsum("qi,eic->eqc", self._N, predicted[elements])
        self._wind = np.ascontiguousarray(self.air(at.reshape(-1, 3), t), dtype=float).reshape(at.shape)

    def _arguments(self, shell: Shell, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray,
                                                               np.ndarray, float, float]:
        assert self._rule is not None
        velocity = self._rule.cv * (x - self._rule.xv.reshape(-1, 3))
        return velocity, shell.surface.elements, self._N, self._weights, self._normals, self._wind, self.normal, self.tangential

    def energy(self, shell: Shell, state: State, lam: float) -> float:
        """Incremental potential, J."""
        from mfar_fem import drag_kernels

        if self._rule is None:
            return 0.0
        return drag_kernels.potential(*self._arguments(shell, shell.positions(state))) / self._rule.cv

    def force(self, shell: Shell, x: np.ndarray) -> np.ndarray:
        """Minus the drag (3 nn,), N, at positions (nn, 3)."""
        return self._assemble(shell, x, np.zeros((1, 1), dtype=np.int32), np.zeros(0), False)

    def _assemble(self, shell: Shell, x: np.ndarray, positions, data, want: bool) -> np.ndarray:
        from mfar_fem import drag_kernels

        assert self._rule is not None
        out = np.zeros(x.shape)
        drag_kernels.assemble(*self._arguments(shell, x), self._rule.cv, want, positions, out, data)
        return out.ravel()

    def gradient(self, shell: Shell, state: State, lam: float, out: np.ndarray) -> None:
        """Add minus the drag."""
        if self._rule is not None:
            out[: shell.alpha_offset] += self.force(shell, shell.positions(state))

    def hessian(self, shell: Shell, state: State, lam: float, data, positions, exact: bool) -> None:
        """Add the positive semi-definite derivative."""
        if self._rule is not None:
            self._assemble(shell, shell.positions(state), positions, data, True)


class VertexDrag:
    """Formula (16) of the silk paper as printed: ``-γ |v| v`` at every vertex, γ in N·s²/m². **It depends on the mesh.**"""

    conservative, internal = True, True
    element_dofs: np.ndarray | None

    def __init__(self, gamma: float, air=(0.0, 0.0, 0.0)):
        if not (np.isfinite(gamma) and gamma >= 0):
            raise InputError(f"the drag coefficient per vertex must be >= 0 N·s²/m², got {gamma}")
        self.gamma, self.air = float(gamma), _air(air)
        self._rule: StepRule | None = None

    def bind(self, shell: Shell) -> None:
        """One block a vertex (mid-side nodes are no vertices)."""
        self._rule = None
        self._vertices = np.arange(len(shell.surface.vertices))
        self.element_dofs = 3 * self._vertices[:, None] + np.arange(3)

    def begin_step(self, shell: Shell, rule: StepRule, predicted: np.ndarray, t: float) -> None:
        """Freeze the air at the ``predicted`` positions."""
        self._rule = rule
        self._wind = self.air(predicted[self._vertices], t)

    def _velocity(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        assert self._rule is not None
        v = self._rule.cv * (x - self._rule.xv.reshape(-1, 3))[self._vertices] - self._wind
        return v, np.linalg.norm(v, axis=1)

    def energy(self, shell: Shell, state: State, lam: float) -> float:
        """Incremental potential, J."""
        if self._rule is None:
            return 0.0
        return self.gamma * float(np.sum(self._velocity(shell.positions(state))[1] ** 3)) / (3 * self._rule.cv)

    def force(self, shell: Shell, x: np.ndarray) -> np.ndarray:
        """Minus the drag (3 nn,), N, at positions (nn, 3)."""
        v, speed = self._velocity(x)
        out = np.zeros(x.shape)
        out[self._vertices] = self.gamma * speed[:, None] * v
        return out.ravel()

    def gradient(self, shell: Shell, state: State, lam: float, out: np.ndarray) -> None:
        """Add minus the drag."""
        if self._rule is not None:
            out[: shell.alpha_offset] += self.force(shell, shell.positions(state))

    def hessian(self, shell: Shell, state: State, lam: float, data, positions, exact: bool) -> None:
        """Add the positive semi-definite derivative."""
        if self._rule is None:
            return
        v, speed = self._velocity(shell.positions(state))
        along = v / np.maximum(speed, 1e-300)[:, None]
        block = self.gamma * speed[:, None, None] * (np.eye(3) + along[:, :, None] * along[:, None, :])
        np.add.at(data, positions, (self._rule.cv * block).reshape(len(v), -1))
