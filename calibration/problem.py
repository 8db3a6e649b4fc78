"""The least-squares problem: unknowns, weights, residuals and their Jacobian over several experiments at once.

Residual of reading i of experiment e, with ``scale_e`` the range of its measured curve::

    r_i = sqrt(weight_e * N / (m_e * sum(weights))) * (predicted_i - measured_i) / scale_e

so that every experiment counts by its weight, whatever the number m_e of its readings; N is the number of all readings.
With equal weights and equally long curves r is simply the error as a fraction of the force range.

Unknowns are moved in the coordinate q: ln(theta) where the parameter's scale is 'log', theta itself otherwise.
"""

from __future__ import annotations

import hashlib
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from calibration.experiments import Experiment
from calibration.forward import Factory, Prediction, level
from mfar_fem.errors import InputError, ParameterError

if TYPE_CHECKING:
    from mfar_fem.materials.fabric import Fabric

BENDING = ("warp", "weft", "twist", "coupling")


@dataclass(frozen=True)
class Unknown:
    """A parameter the fit may move: 'law.<name>' or 'bending.<name>', SI, with bounds and scale ('log' or 'linear')."""

    name: str
    symbol: str
    unit: str
    initial: float
    lower: float
    upper: float
    scale: str = "log"

    def to_q(self, value):
        """From the parameter to the coordinate the fit moves in."""
        return np.log(value) if self.scale == "log" else np.asarray(value, float)

    def from_q(self, q):
        """From the coordinate back to the parameter, kept inside the bounds against rounding."""
        return np.clip(np.exp(q) if self.scale == "log" else q, self.lower, self.upper)

    def slope(self, value: float) -> float:
        """dtheta/dq."""
        return value if self.scale == "log" else 1.0


def law_unknowns(law, names: Sequence[str] | None = None) -> tuple[Unknown, ...]:
    """Unknowns of a law: the parameters named, or all that its table marks as fitted."""
    known = {p.name: p for p in law.parameters}
    for name in names or ():
        if name not in known:
            raise ParameterError(f"the law '{law.name}' has no parameter '{name}'; it has: {', '.join(known)}")
    chosen = [known[n] for n in names] if names is not None else [p for p in known.values() if p.fit]
    return tuple(_unknown(p, law.values[p.name]) for p in chosen)


def _unknown(p, value: float) -> Unknown:
    scale, lower = p.scale, p.lower
    if scale == "log" and lower <= 0.0:
        lower = 1e-9 * (p.default if p.default > 0 else min(p.upper, 1.0))
    return Unknown(f"law.{p.name}", p.symbol, p.unit, min(max(value, lower), p.upper), lower, p.upper, scale)


def bending_unknowns(fabric, names: Sequence[str]) -> tuple[Unknown, ...]:
    """Unknowns of the bending law, in log scale between 1/1000 and 1000 times the present value (coupling: linear)."""
    out = []
    for name in names:
        if name not in BENDING:
            raise ParameterError(f"bending has no rigidity '{name}'; it has: {', '.join(BENDING)}")
        value = getattr(fabric.bending, name)
        if name == "coupling":
            bound = 0.999 * math.sqrt(fabric.bending.warp * fabric.bending.weft)
            out.append(Unknown("bending.coupling", "D12", "N*m", value, -bound, bound, "linear"))
        else:
            out.append(Unknown(f"bending.{name}", f"B_{name}", "N*m", value, 1e-3 * value, 1e3 * value))
    return tuple(out)


@dataclass(frozen=True, eq=False)
class Problem:
    """Fit of a fabric's unknowns to experiments.

    Parameters
    ----------
    fabric : Fabric
        Holds the values of everything that is not unknown.
    unknowns : tuple of Unknown
    experiments : tuple of Experiment
    level : str or factory
        Level of the forward model (`calibration.forward`).
    bending_derived : bool
        Bending follows from the membrane law as for a solid sheet of the fabric's thickness.
    multiplicity : tuple of ndarray, optional
        How often every reading counts (bootstrap over points), one array an experiment.
    """

    fabric: Fabric
    unknowns: tuple[Unknown, ...]
    experiments: tuple[Experiment, ...]
    level: str | Factory = "homogeneous"
    bending_derived: bool = False
    multiplicity: tuple[np.ndarray, ...] | None = None
    _models: list = field(default_factory=list, repr=False)

    def __post_init__(self) -> None:
        if not self.experiments:
            raise InputError("there is no experiment to fit")
        if not self.unknowns:
            raise InputError("there is nothing to fit: name at least one parameter")
        if self.size <= len(self.unknowns):
            raise InputError(f"{self.size} readings cannot determine {len(self.unknowns)} parameters")

    def __getstate__(self):
        return {**self.__dict__, "_models": []}  # models hold meshes and caches: every process makes its own

    # -- sizes and weights -----------------------------------------------------------------------------------------

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns, in the order of q."""
        return tuple(u.name for u in self.unknowns)

    @property
    def size(self) -> int:
        """Number of readings."""
        return sum(len(e) for e in self.experiments)

    @property
    def slices(self) -> list[slice]:
        """Where every experiment's readings stand in the residual vector."""
        ends = np.cumsum([0, *(len(e) for e in self.experiments)])
        return [slice(a, b) for a, b in itertools.pairwise(ends)]

    def weights(self) -> np.ndarray:
        """Factor from predicted - measured (SI) to the residual r, shape (n,)."""
        total = sum(e.weight for e in self.experiments)
        parts = []
        for k, e in enumerate(self.experiments):
            w = np.full(len(e), math.sqrt(e.weight * self.size / (len(e) * total)) / e.scale)
            parts.append(w if self.multiplicity is None else w * np.sqrt(self.multiplicity[k]))
        return np.concatenate(parts)

    def measured(self) -> np.ndarray:
        """All measured ordinates, SI, shape (n,)."""
        return np.concatenate([e.y for e in self.experiments])

    # -- coordinates -----------------------------------------------------------------------------------------------

    def q0(self) -> np.ndarray:
        """Initial values of the unknowns in the coordinate q, shape (p,)."""
        return np.array([float(u.to_q(u.initial)) for u in self.unknowns])

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds in the coordinate q, shape (p,) each."""
        with np.errstate(divide="ignore"):
            lower, upper = (np.array([float(u.to_q(getattr(u, k))) for u in self.unknowns]) for k in ("lower", "upper"))
        return lower, upper

    def values(self, q) -> dict[str, float]:
        """Parameter values by name, SI."""
        return {u.name: float(u.from_q(x)) for u, x in zip(self.unknowns, q, strict=True)}

    def fabric_at(self, values: Mapping[str, float]):
        """The fabric with these parameter values; ParameterError where the law refuses them together."""
        law = {k.split(".", 1)[1]: v for k, v in values.items() if k.startswith("law.")}
        bending = {k.split(".", 1)[1]: v for k, v in values.items() if k.startswith("bending.")}
        fabric = self.fabric.replace(law=self.fabric.law.replace(**law)) if law else self.fabric
        if self.bending_derived:
            fabric = fabric.replace(bending=type(fabric.bending).derived(fabric.law, fabric.thickness))
        return fabric.replace(bending=replace(fabric.bending, **bending)) if bending else fabric

    # -- residuals -------------------------------------------------------------------------------------------------

    def models(self) -> list:
        """The forward models, made once."""
        if not self._models:
            factory = level(self.level)
            self._models.extend(factory(e) for e in self.experiments)
        return self._models

    def predict(self, values: Mapping[str, float], jacobian: bool = True) -> list[Prediction]:
        """Predictions of all experiments; Jacobians with respect to the parameters, in the order of `names`."""
        fabric = self.fabric_at(values)
        out = []
        for e, model in zip(self.experiments, self.models(), strict=True):
            names = self.names if jacobian else ()
            if jacobian and self.bending_derived and e.kind == "cantilever":
                out.append(self._predict_derived(fabric, e, model))
            else:
                out.append(model.predict(fabric, e.x, names))
        return out

    def _predict_derived(self, fabric, e: Experiment, model) -> Prediction:
        """Chain rule through the bending that follows from the law."""
        direct = [f"bending.{b}" for b in BENDING]
        p = model.predict(fabric, e.x, direct)
        chain = np.zeros((len(direct), len(self.names)))
        for j, name in enumerate(self.names):
            if name.startswith("law."):
                chain[:, j] = derived_bending_slope(fabric, name[4:])
        return replace(p, jacobian=p.jacobian @ chain)

    def evaluate(self, q, jacobian: bool = True):
        """Residuals at a point.

        Returns
        -------
        r : ndarray, shape (n,)
            Entries are +inf where the model did not get there (locking, no convergence, parameters the law refuses):
            the trust-region method then refuses the step and shortens it.
        J : ndarray, shape (n, p), or None
            dr/dq; 0 in rows that were not reached.
        predictions : list of Prediction
        """
        values = self.values(q)
        try:
            predictions = self.predict(values, jacobian)
        except ParameterError:
            return np.full(self.size, np.inf), None, []
        w, y = self.weights(), self.measured()
        r, J = np.full(self.size, np.inf), np.zeros((self.size, len(self.unknowns)))
        slope = np.array([u.slope(values[u.name]) for u in self.unknowns])
        for part, p in zip(self.slices, predictions, strict=True):
            ok = p.reached & np.isfinite(p.y)
            r[part][ok] = (w[part] * (np.where(ok, p.y, 0.0) - y[part]))[ok]
            if jacobian:
                J[part][ok] = (w[part][:, None] * p.jacobian * slope)[ok]
        r[w == 0.0] = 0.0
        return r, (J if jacobian else None), predictions

    # -- variations ------------------------------------------------------------------------------------------------

    def fixed(self, name: str, value: float) -> Problem:
        """The problem with one unknown held at a value."""
        keep = tuple(u for u in self.unknowns if u.name != name)
        if len(keep) == len(self.unknowns):
            raise ParameterError(f"'{name}' is not an unknown; unknowns are: {', '.join(self.names)}")
        return self.vary(fabric=self.fabric_at({name: value}), unknowns=keep)

    def started_at(self, values: Mapping[str, float]) -> Problem:
        """The problem with other initial values."""
        moved = tuple(
            replace(u, initial=float(np.clip(values.get(u.name, u.initial), u.lower, u.upper))) for u in self.unknowns
        )
        return self.vary(unknowns=moved)

    def vary(self, **changes) -> Problem:
        """A copy with some attributes changed; models are shared if experiments and level stay."""
        shared = not ({"experiments", "level"} & set(changes))
        return replace(self, _models=self._models if shared and self._models else [], **changes)

    def signature(self) -> str:
        """Identifies data, unknowns, law, level and weights (for checkpoints)."""
        h = hashlib.sha256()
        for u in self.unknowns:
            h.update(repr((u.name, u.lower, u.upper, u.scale)).encode())
        for e in self.experiments:
            h.update(repr((e.name, e.kind, e.direction, e.gauge, e.width, e.weight)).encode())
            h.update(e.x.tobytes() + e.y.tobytes())
        fixed = {k: v for k, v in self.fabric.law.values.items() if f"law.{k}" not in self.names}
        h.update(repr((self.fabric.law.name, fixed, self.fabric.thickness, str(self.level))).encode())
        return h.hexdigest()[:24]


def derived_bending_slope(fabric, name: str, step: float = 1e-4) -> np.ndarray:
    """d(warp, weft, twist, coupling)/dtheta of a bending that follows from the law (fourth-order differences), (4,)."""
    law, value = fabric.law, fabric.law.values[name]
    p = law.parameter(name)
    h = step * (abs(value) if value else 1.0)
    h = min(h, (p.upper - value) / 2 if p.upper > value else h, (value - p.lower) / 2 if value > p.lower else h)

    def at(v):
        b = type(fabric.bending).derived(law.replace(**{name: v}), fabric.thickness)
        return np.array([getattr(b, k) for k in BENDING])

    if value + 2 * h > p.upper:
        return (3 * at(value) - 4 * at(value - h) + at(value - 2 * h)) / (2 * h)
    if value - 2 * h < p.lower:
        return (-3 * at(value) + 4 * at(value + h) - at(value + 2 * h)) / (2 * h)
    return (8 * (at(value + h) - at(value - h)) - at(value + 2 * h) + at(value - 2 * h)) / (12 * h)
