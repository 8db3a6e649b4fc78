"""Levels of effort: one object that sets shell order, mesh, time step, tolerance and linear solver; each can be overridden."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

from mfar_fem.errors import ParameterError, UnknownNameError
from mfar_fem.solve.integrators import METHODS


@dataclass(frozen=True)
class Fidelity:
    """What a computation spends.

    Attributes
    ----------
    name : str
    order : {0, 1, 2}
        0: position-based dynamics; 1, 2: shell elements of that order.
    cells : int
        Mesh cells along the longest side of the sheet (``mesh_size``, m, overrides it).
    dt : float
        Time step, s.
    method : str
        Time integrator, see :mod:`mfar_fem.solve.integrators` (orders 1 and 2).
    rtol : float
        Relative residual of a time step; at rest of the static residual.
    linear_solver : str
        See :class:`mfar_fem.solve.linear.LinearSolver`.
    mesh_size : float or None
        Length of the cells, m.
    substeps : int or None
        Of position-based dynamics in a time step; None: chosen from stiffness and mesh.
    accept_after : int
        Newton iterations after which a step with contact is accepted though its residual is above tolerance (0: never), see
        :class:`mfar_fem.solve.dynamics.DynamicsOptions`.
    """

    name: str
    order: int
    cells: int
    dt: float
    method: str = "implicit-euler"
    rtol: float = 1e-6
    linear_solver: str = "direct"
    mesh_size: float | None = None
    substeps: int | None = None
    accept_after: int = 0

    def __post_init__(self):
        if self.order not in (0, 1, 2):
            raise ParameterError(f"the order must be 0 (position-based), 1 or 2, got {self.order!r}")
        if not (int(self.cells) == self.cells and self.cells >= 1):
            raise ParameterError(f"cells must be a positive whole number, got {self.cells!r}")
        for name in ("dt", "rtol", "mesh_size"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise ParameterError(f"{name} must be positive, got {value!r}")
        if self.method not in METHODS:
            raise ParameterError(f"unknown time integrator '{self.method}'; choose one of {', '.join(METHODS)}")

    def size(self, longest: float) -> float:
        """Length of the cells, m, on a sheet whose longest side is ``longest`` (m)."""
        return self.mesh_size or longest / self.cells

    def override(self, **changes) -> Fidelity:
        """The level with some settings changed; None leaves one as it is."""
        known = {f.name for f in fields(self)}
        for key in changes:
            if key not in known:
                raise ParameterError(f"fidelity has no setting '{key}'; it has: {', '.join(sorted(known))}")
        return replace(self, **{key: value for key, value in changes.items() if value is not None})


LEVELS = {
    "draft": Fidelity("draft", 0, 40, 2e-3),
    "standard": Fidelity("standard", 1, 40, 2e-3),
    "reference": Fidelity("reference", 2, 40, 2e-3),
}
"""The levels of scenes. Virtual tests have their own: a drape test is of order 2 at every level, since order 1 is too stiff."""


def fidelity(name: str, **changes) -> Fidelity:
    """A level by name, with settings overridden.

    Raises
    ------
    UnknownNameError
        The message lists the levels that exist.
    """
    if name not in LEVELS:
        raise UnknownNameError(f"unknown fidelity '{name}'; known: {', '.join(LEVELS)}")
    return LEVELS[name].override(**changes)
