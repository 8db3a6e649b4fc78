"""Fit a law to homogeneous curves, several modes and directions at once, with the exact Jacobian."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError, ParameterError
from .homogeneous import respond
from .law import Law


@dataclass(frozen=True)
class Curve:
    """A measured curve taken as homogeneous.

    Attributes
    ----------
    mode, direction
        Deformation mode and direction, as for :func:`.homogeneous.respond`.
    stretch : (m,) array
        Stretches (amount of shear for simple shear).
    stress : (m,) array
        Nominal stress, in the law's stress unit (Pa or N/m).
    weight : float
        Factor on the residuals.
    name : str
        Label; the mode and direction if empty.
    """

    mode: str
    direction: str | float
    stretch: np.ndarray
    stress: np.ndarray
    weight: float = 1.0
    name: str = ""

    def __post_init__(self):
        for key in ("stretch", "stress"):
            object.__setattr__(self, key, np.asarray(getattr(self, key), dtype=float))
        if self.stretch.shape != self.stress.shape or self.stretch.ndim != 1 or not len(self.stretch):
            raise InputError(
                f"curve '{self.label}': stretch {self.stretch.shape} and stress {self.stress.shape} must be lists "
                "of the same length, not empty"
            )
        if not (np.isfinite(self.stretch).all() and np.isfinite(self.stress).all()):
            raise InputError(f"curve '{self.label}' contains values that are not finite")

    @property
    def label(self) -> str:
        """Name, or mode and direction."""
        return self.name or f"{self.mode} {self.direction}"


@dataclass(frozen=True)
class HomogeneousFit:
    """Result of :func:`fit_curves`.

    Attributes
    ----------
    law : Law
        The law with the fitted values.
    names : tuple of str
        Parameters that were free.
    rmse : float
        Root mean square of prediction minus data over all points, in the stress unit.
    rmse_by_curve : dict
        The same for each curve.
    rmse_percent_of_range : dict
        The same over the range of each curve's data, in percent; key ``"all"``: root mean square over all points.
    residuals : (m,) array
        Weighted residuals that were minimised (divided by the range of the curve if ``relative``).
    jacobian : (m, p) array
        Their derivatives with respect to the free parameters, in the parameters' own units.
    at_bound : tuple of str
        Free parameters that ended on a bound.
    unreached : int
        Points the fitted law cannot reach (locked); their residual is that of a stress of zero plus the data.
    success : bool
    message : str
    evaluations : int
    """

    law: Law
    names: tuple[str, ...]
    rmse: float
    rmse_by_curve: dict[str, float]
    rmse_percent_of_range: dict[str, float]
    residuals: np.ndarray
    jacobian: np.ndarray
    at_bound: tuple[str, ...]
    unreached: int
    success: bool
    message: str
    evaluations: int


def fit_curves(
    law: Law,
    curves: Sequence[Curve],
    names: Sequence[str] | None = None,
    relative: bool = False,
    max_evaluations: int = 200,
) -> HomogeneousFit:
    """Least-squares fit by a trust-region method within the bounds of the parameter table.

    Parameters
    ----------
    law : Law
        Start values and fixed values.
    curves : sequence of Curve
        Data; the stress in the law's stress unit.
    names : sequence of str, optional
        Free parameters; those with ``fit=True`` in the table if omitted.
    relative : bool
        Divide the residuals of each curve by the range of its data, so that every curve counts alike.
    max_evaluations : int
        Limit on evaluations.

    Returns
    -------
    HomogeneousFit

    Raises
    ------
    ParameterError
        Unknown name.
    InputError
        No curve, or fewer points than free parameters.
    """
    from scipy.optimize import least_squares

    if not curves:
        raise InputError("no curve to fit")
    if names is None:
        names = [p.name for p in law.parameters if p.fit]
    scaling = Scaling(law, names)
    points = sum(len(c.stretch) for c in curves)
    if points < len(scaling.names):
        raise InputError(f"{points} points cannot determine {len(scaling.names)} parameters of {law.name}")
    problem = _Problem(law, curves, scaling, relative)
    out = least_squares(
        lambda x: problem(x)[0],
        scaling.to_scaled([law.values[n] for n in scaling.names]),
        jac=lambda x: problem(x)[1],
        bounds=scaling.bounds,
        x_scale="jac",
        max_nfev=max_evaluations,
        ftol=1e-12,
        xtol=1e-12,
        gtol=1e-12,
    )
    residuals, jacobian, raw, unreached = problem(out.x)
    values = scaling.to_values(out.x)
    percent = {c.label: 100.0 * _rms(r) / _range(c) for c, r in zip(curves, raw, strict=True)}
    percent["all"] = 100.0 * _rms(np.concatenate([r / _range(c) for c, r in zip(curves, raw, strict=True)]))
    lower, upper = scaling.bounds
    edge = np.minimum(out.x - lower, upper - out.x) < 1e-6 * np.maximum(1.0, np.abs(out.x))
    return HomogeneousFit(
        law=scaling.law(out.x),
        names=scaling.names,
        rmse=_rms(np.concatenate(raw)),
        rmse_by_curve={c.label: _rms(r) for c, r in zip(curves, raw, strict=True)},
        rmse_percent_of_range=percent,
        residuals=residuals,
        jacobian=jacobian / scaling.slope(values),
        at_bound=tuple(n for n, e in zip(scaling.names, edge, strict=True) if e),
        unreached=unreached,
        success=bool(out.success),
        message=str(out.message),
        evaluations=int(out.nfev),
    )


class Scaling:
    """The variables a fit moves: the logarithm of a parameter or the parameter itself, with bounds.

    Parameters
    ----------
    law : Law
        Supplies the table and the values of what is not free.
    names : sequence of str
        Free parameters.
    """

    def __init__(self, law: Law, names: Sequence[str]):
        self.base, self.names = law, tuple(names)
        if not self.names:
            raise InputError("no parameter is free: name at least one")
        rows = [law.parameter(n) for n in self.names]
        self._log = np.array([p.scale == "log" for p in rows])
        self.bounds = self.to_scaled([p.lower for p in rows]), self.to_scaled([p.upper for p in rows])

    def to_scaled(self, values) -> np.ndarray:
        """Parameter values to fit variables. *Shape:* (p,)."""
        values = np.asarray(values, dtype=float)
        return np.where(self._log, np.log(np.where(self._log, values, 1.0)), values)

    def to_values(self, x) -> np.ndarray:
        """Fit variables to parameter values, kept within the bounds. *Shape:* (p,)."""
        x = np.asarray(x, dtype=float)
        values = np.where(self._log, np.exp(np.where(self._log, x, 0.0)), x)
        rows = [self.base.parameter(n) for n in self.names]
        return np.clip(values, [p.lower for p in rows], [p.upper for p in rows])

    def slope(self, values) -> np.ndarray:
        """d value / d variable at the given values. *Shape:* (p,)."""
        return np.where(self._log, values, 1.0)

    def law(self, x) -> Law:
        """The law at fit variables `x`."""
        return self.base.replace(**dict(zip(self.names, map(float, self.to_values(x)), strict=True)))


class _Problem:
    """Residuals and Jacobian in the fit variables, computed together and remembered for the last point."""

    def __init__(self, law, curves, scaling, relative):
        self.curves, self.scaling, self.relative = list(curves), scaling, relative
        self._key, self._value = None, None

    def __call__(self, x):
        key = x.tobytes()
        if key != self._key:
            self._key, self._value = key, self._compute(x)
        return self._value

    def _compute(self, x):
        slope = self.scaling.slope(self.scaling.to_values(x))
        try:
            law = self.scaling.law(x)
        except ParameterError:  # a combination the law refuses: as bad as predicting nothing at ten times the data
            raw = [10.0 * (np.abs(c.stress) + _range(c)) for c in self.curves]
            rows = [self._scaled(c, r) for c, r in zip(self.curves, raw, strict=True)]
            return np.concatenate(rows), np.zeros((sum(map(len, raw)), len(slope))), raw, sum(map(len, raw))
        rows, jacobians, raw, unreached = [], [], [], 0
        for c in self.curves:
            r = respond(law, c.mode, c.direction, c.stretch, self.scaling.names, strict=False)
            lost = ~r.converged
            unreached += int(lost.sum())
            error = np.where(lost, 2.0 * (np.abs(c.stress) + _range(c)), r.stress - c.stress)
            raw.append(error)
            rows.append(self._scaled(c, error))
            sensitivity = np.where(lost[:, None], 0.0, r.sensitivity) * slope
            jacobians.append(self._scaled(c, sensitivity))
        return np.concatenate(rows), np.concatenate(jacobians), raw, unreached

    def _scaled(self, curve, array):
        return array * (curve.weight / (_range(curve) if self.relative else 1.0))


def _rms(r) -> float:
    return float(np.sqrt(np.mean(np.square(r))))


def _range(curve) -> float:
    low, high = min(0.0, curve.stress.min()), max(0.0, curve.stress.max())
    return float(high - low) or 1.0
