"""Experiments and datasets: what was measured, on what specimen, and how far it is trusted.

An `Experiment` is one curve after its rules (tare, slack, branch) were applied; `Experiment.notes` says in words
what they did. A `Dataset` is several of them, with the fabric's thickness, areal density and bending where known.
Everything is SI and immutable.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from mfar_fem.errors import InputError, UnknownNameError

KINDS = {
    "strip": ("engineering strain u/L", "", "line force", "N/m"),
    "cantilever": ("chord angle below the horizontal", "rad", "overhang length", "m"),
}
"""Kind of test: name and SI unit of the abscissa ``x``, name and SI unit of the measured ordinate ``y``."""

DIRECTIONS = {"warp": 0.0, "weft": math.pi / 2, "bias": math.pi / 4}


def direction_name(angle: float) -> str:
    """Name of a direction given by its angle from the warp in rad: 'warp', 'weft', 'bias' or '30°'."""
    for name, value in DIRECTIONS.items():
        if abs(angle - value) < 1e-9:
            return name
    return f"{math.degrees(angle):g}°"


@dataclass(frozen=True, eq=False)
class Experiment:
    """One measured curve of one specimen.

    Parameters
    ----------
    name : str
    x : ndarray, shape (m,)
        Strip: engineering strain u/L (gauge length L), strictly increasing. Cantilever: chord angle, rad.
    y : ndarray, shape (m,)
        Strip: force over the initial width, N/m. Cantilever: overhang length, m.
    kind : {'strip', 'cantilever'}
    direction : float
        Angle of the specimen's length from the warp, rad.
    gauge, width : float
        Free length between the clamps and width, m (0 where it does not apply).
    weight : float
        Weight of this experiment's mean squared residual in the fit.
    specimen : str
        Name of the specimen; the bootstrap over specimens resamples those of equal kind, direction and gauge.
    role : {'fit', 'check'}
        'check' curves are never fitted by default; they are there for cross-validation.
    citation : str
        Where the figures come from.
    notes : tuple of str
        What the tare, slack and branch rules did.
    """

    name: str
    x: np.ndarray
    y: np.ndarray
    kind: str = "strip"
    direction: float = 0.0
    gauge: float = 0.0
    width: float = 0.0
    weight: float = 1.0
    specimen: str = ""
    role: str = "fit"
    citation: str = ""
    notes: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        for key in ("x", "y"):
            array = np.array(getattr(self, key), dtype=float)
            array.setflags(write=False)
            object.__setattr__(self, key, array)
        if self.kind not in KINDS:
            raise UnknownNameError(f"unknown kind of test '{self.kind}'; known: {', '.join(KINDS)}")
        if self.x.ndim != 1 or self.x.shape != self.y.shape or self.x.size == 0:
            raise InputError(f"experiment '{self.name}': x and y must be two 1-D arrays of one length, at least 1")
        if not (np.isfinite(self.x).all() and np.isfinite(self.y).all()):
            raise InputError(f"experiment '{self.name}': x and y must be finite")
        if not self.weight > 0:
            raise InputError(f"experiment '{self.name}': weight is {self.weight:g}; it must be positive")
        if self.kind == "strip":
            for key in ("gauge", "width"):
                if not getattr(self, key) > 0:
                    raise InputError(f"experiment '{self.name}': {key} is {getattr(self, key):g} m; must be positive")

    def __len__(self) -> int:
        return self.x.size

    @property
    def strain(self) -> np.ndarray:
        """Engineering strain u/L, shape (m,) (strip tests)."""
        return self._only("strip").x

    @property
    def force(self) -> np.ndarray:
        """Force over the initial width, N/m, shape (m,) (strip tests)."""
        return self._only("strip").y

    @property
    def direction_name(self) -> str:
        """Name of the direction, see :func:`direction_name`."""
        return direction_name(self.direction)

    @property
    def scale(self) -> float:
        """What residuals are divided by: the range of a curve, or the mean where a single quantity was repeated."""
        return float(np.ptp(self.y)) if self.kind == "strip" and np.ptp(self.y) > 0 else float(np.abs(self.y).mean())

    def _only(self, kind: str) -> Experiment:
        if self.kind != kind:
            raise InputError(f"experiment '{self.name}' is a {self.kind} test, not a {kind} test")
        return self


@dataclass(frozen=True, eq=False)
class Dataset:
    """Several experiments on one fabric.

    ``thickness`` (m), ``areal_density`` (kg/m²) and ``bending`` (N·m by name: 'warp', 'weft', and their ranges
    'warp_low', ...) are None or empty where unknown; ``sources`` cites them. ``variants`` lists the other states of
    the same fabric that the same source offers (virgin, preconditioned, ...).
    """

    name: str
    experiments: tuple[Experiment, ...]
    title: str = ""
    citation: str = ""
    variant: str = ""
    variants: tuple[str, ...] = ()
    description: str = ""
    thickness: float | None = None
    areal_density: float | None = None
    bending: dict[str, float] = field(default_factory=dict)
    sources: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.experiments:
            raise InputError(f"dataset '{self.name}' has no experiment")
        names = [e.name for e in self.experiments]
        double = sorted({n for n in names if names.count(n) > 1})
        if double:
            raise InputError(f"dataset '{self.name}': experiment names must differ; repeated: {', '.join(double)}")

    def __len__(self) -> int:
        return len(self.experiments)

    def select(
        self,
        *,
        role: str | None = None,
        kind: str | None = None,
        directions: Iterable[str] | None = None,
        names: Iterable[str] | None = None,
    ) -> tuple[Experiment, ...]:
        """Experiments that fulfil all the conditions given (possibly none)."""
        directions = None if directions is None else set(directions)
        names = None if names is None else set(names)
        return tuple(
            e
            for e in self.experiments
            if (role is None or e.role == role)
            and (kind is None or e.kind == kind)
            and (directions is None or e.direction_name in directions)
            and (names is None or e.name in names)
        )

    def with_experiments(self, experiments: Iterable[Experiment]) -> Dataset:
        """The same fabric with other experiments."""
        return replace(self, experiments=tuple(experiments))
