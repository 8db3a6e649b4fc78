"""Levels of effort: one object that sets shell order, mesh, time step, tolerance and linear solver; each can be overridden."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

from mfar_fem.errors import ParameterError, UnknownNameError
from mfar_fem.solve.integrators import METHODS

CONTACT_ERROR = 0.5
"""Error left in a step with contact, as a share of the step's own: about a twentieth of what halving the step changes (docs)."""


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
    iteration_error : float or None
        Error that Newton's method may leave in a time step, as a share of the local error of the step (0: only the residual
        counts), see :class:`mfar_fem.solve.dynamics.DynamicsOptions`. None: 0.5 in scenes with contact, where the last digits of
        a residual are dear, else 0.
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
    iteration_error: float | None = None

    def __post_init__(self):
        if self.order not in (0, 1, 2):
            raise ParameterError(f"the order must be 0 (position-based), 1 or 2, got {self.order!r}")
        if not (int(self.cells) == self.cells and self.cells >= 1):
            raise ParameterError(f"cells must be a positive whole number, got {self.cells!r}")
        for name in ("dt", "rtol", "mesh_size"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise ParameterError(f"{name} must be positive, got {value!r}")
        if self.iteration_error is not None and not self.iteration_error >= 0:
            raise ParameterError(f"iteration_error must be at least 0, got {self.iteration_error!r}")
        if self.method not in METHODS:
            raise ParameterError(f"unknown time integrator '{self.method}'; choose one of {', '.join(METHODS)}")

    def error_left(self, contact: bool) -> float:
        """The ``iteration_error`` of a scene with or without contact."""
        return (CONTACT_ERROR if contact else 0.0) if self.iteration_error is None else self.iteration_error

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
