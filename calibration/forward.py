"""What the calibration asks of a forward model, and where the levels (homogeneous, fe) are looked up.

A *level* is a factory: ``factory(experiment) -> ForwardModel``. The model lives as long as the fit, so it may keep its
mesh, its symbolic factorisation and the last converged states. `register` adds a level; a level registered by name only
(``"module:attribute"``) is imported when it is first asked for.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from calibration.experiments import Experiment
from mfar_fem.errors import MissingDependencyError, UnknownNameError


@dataclass(frozen=True, eq=False)
class Prediction:
    """What a forward model says about one experiment.

    Attributes
    ----------
    y : ndarray, shape (m,)
        Predicted ordinate, in the unit of ``Experiment.y`` (strip: N per metre of initial width). Only entries with
        ``reached`` count; the others must be finite or NaN, they are never used.
    jacobian : ndarray, shape (m, p), or None
        dy/dparameter in the order of the names asked for; None if none were asked for.
    reached : ndarray of bool, shape (m,)
        Where the model got to. Not reached: locking, inversion or a solver that did not converge.
    status : str
        'ok', or the reason why not everything was reached ('locking', 'not converged', ...).
    """

    y: np.ndarray
    jacobian: np.ndarray | None
    reached: np.ndarray
    status: str = "ok"

    @property
    def complete(self) -> bool:
        """Whether every reading was reached with finite numbers."""
        ok = bool(self.reached.all()) and bool(np.isfinite(self.y).all())
        return ok and (self.jacobian is None or bool(np.isfinite(self.jacobian).all()))


@runtime_checkable
class ForwardModel(Protocol):
    """One experiment's prediction.

    ``predict(fabric, x, names)`` gets the experiment's abscissa (strip: engineering strain u/L, shape (m,)) and the
    names of the parameters to differentiate by, 'law.mu', 'bending.warp', ... (empty: no Jacobian). It must not raise
    for a fabric that merely cannot be stretched so far: it returns ``reached`` False there.
    """

    def predict(self, fabric, x: np.ndarray, names: Sequence[str] = ()) -> Prediction:
        """The ordinates at `x`, shape (m,), and dy/dparameter by `names`, shape (m, p); what is not reached is marked."""
        ...


Factory = Callable[[Experiment], ForwardModel]

_LEVELS: dict[str, Factory | str] = {
    "homogeneous": "calibration.homogeneous:model",
    "fe": "calibration.finite_element:model",
    "fe-draft": "calibration.finite_element:draft",
    "fe-reference": "calibration.finite_element:reference",
}


def register(name: str, factory: Factory | str) -> None:
    """Add or replace a level; `factory` is a callable or its address 'module:attribute'."""
    _LEVELS[name] = factory


def level_names() -> list[str]:
    """Names of the levels."""
    return list(_LEVELS)


def level(name: str | Factory) -> Factory:
    """The factory of a level (a factory is passed through).

    Raises
    ------
    UnknownNameError
        No such level.
    MissingDependencyError
        Its module is not installed.
    """
    if callable(name):
        return name
    if name not in _LEVELS:
        raise UnknownNameError(f"unknown level '{name}'; known: {', '.join(_LEVELS)}")
    target = _LEVELS[name]
    if callable(target):
        return target
    module, attribute = target.split(":")
    try:
        return getattr(importlib.import_module(module), attribute)
    except ImportError as error:
        raise MissingDependencyError(f"the level '{name}' ({target}) cannot be loaded: {error}") from error
