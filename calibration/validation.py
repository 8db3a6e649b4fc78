"""Validation: prediction against measurement by strain interval and direction, and cross-validation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.compare import fit_law
from calibration.experiments import Experiment
from calibration.fit import Fit
from calibration.forward import Prediction, level
from calibration.problem import Problem, law_unknowns
from calibration.runs import SERIAL, Workers, run_all

EDGES = (0.0, 0.05, 0.10, 0.15, 0.20, 0.25)


@dataclass(frozen=True, eq=False)
class Check:
    """Prediction of one experiment.

    ``rmse_percent_of_range`` is over the readings the model reached; ``reached`` is their fraction.
    """

    experiment: Experiment
    prediction: Prediction

    @property
    def reached(self) -> float:
        """Fraction of the readings the model reached, 0 to 1."""
        return float(self.prediction.reached.mean())

    @property
    def error_percent(self) -> np.ndarray:
        """Predicted minus measured in % of the range, NaN where not reached, shape (m,)."""
        y = np.where(self.prediction.reached, self.prediction.y, np.nan)
        return 100.0 * (y - self.experiment.y) / self.experiment.scale

    @property
    def rmse_percent_of_range(self) -> float:
        """Root mean square error over the readings reached, % of `Experiment.scale`; NaN if none was."""
        error = self.error_percent[self.prediction.reached]
        return float(np.sqrt(np.mean(error**2))) if error.size else float("nan")

    def to_dict(self) -> dict:
        """Row of the validation table; `range` and `gauge_m` in SI, errors in % of the range."""
        e = self.experiment
        return {
            "experiment": e.name,
            "direction": e.direction_name,
            "gauge_m": e.gauge,
            "role": e.role,
            "n_readings": len(e),
            "rmse_percent_of_range": self.rmse_percent_of_range,
            "bias_percent_of_range": float(np.nanmean(self.error_percent)) if self.reached else float("nan"),
            "reached": self.reached,
            "status": self.prediction.status,
            "range": e.scale,
        }


def predict_all(fabric, experiments: Sequence[Experiment], level_name="homogeneous") -> list[Check]:
    """Predict all experiments with one fabric, nothing fitted."""
    factory = level(level_name)
    return [Check(e, factory(e).predict(fabric, e.x)) for e in experiments]


def by_interval(checks: Sequence[Check], edges: Sequence[float] = EDGES) -> list[dict]:
    """Error of the strip tests by strain interval (the last one is open).

    Returns
    -------
    list of dict
        ``experiment``, ``direction``, ``interval`` ('0.05-0.10'), ``n_readings``, ``rmse_percent_of_range``,
        ``bias_percent_of_range`` (None where nothing was measured or reached), ``rmse_N_per_m``.
    """
    rows = []
    for c in checks:
        e = c.experiment
        if e.kind != "strip":
            continue
        for low, high in zip(edges, [*edges[1:], np.inf], strict=True):
            inside = (e.x >= low) & (e.x < high)
            if not inside.any():
                continue
            error = c.error_percent[inside & c.prediction.reached]
            rmse = float(np.sqrt(np.mean(error**2))) if error.size else None
            rows.append(
                {
                    "experiment": e.name,
                    "direction": e.direction_name,
                    "interval": f"{low:.2f}-{high:.2f}" if np.isfinite(high) else f"over {low:.2f}",
                    "n_readings": int(inside.sum()),
                    "n_reached": int(error.size),
                    "rmse_percent_of_range": rmse,
                    "bias_percent_of_range": float(error.mean()) if error.size else None,
                    "rmse_N_per_m": None if rmse is None else rmse * e.scale / 100.0,
                }
            )
    return rows


@dataclass(frozen=True, eq=False)
class CrossValidation:
    """A fit on some curves, asked for others it has not seen."""

    label: str
    fit: Fit | None
    checks: list[Check]
    error: str = ""

    def to_dict(self) -> dict:
        """Row of the cross-validation table, with the parameters of the fit (SI) if there is one."""
        out: dict[str, Any] = {"label": self.label, "error": self.error, "predicted": [c.to_dict() for c in self.checks]}
        if self.fit is not None:
            out |= {
                "fitted_on": [e.name for e in self.fit.problem.experiments],
                "rmse_of_fit_percent_of_range": self.fit.rmse_percent_of_range,
                "parameters": self.fit.parameters,
            }
        return out


def splits(experiments: Sequence[Experiment]) -> list[tuple[str, tuple[Experiment, ...], tuple[Experiment, ...]]]:
    """The cross-validations that the strips allow: (label, to fit, to predict).

    Warp and weft predict every other direction of the same gauge, and each gauge length predicts the others.
    """
    strips = [e for e in experiments if e.kind == "strip"]
    gauges = sorted({round(e.gauge, 2) for e in strips}, reverse=True)
    out = []
    for g in gauges:
        same = [e for e in strips if round(e.gauge, 2) == g]
        yarns = tuple(e for e in same if e.direction_name in ("warp", "weft"))
        others = tuple(e for e in same if e.direction_name not in ("warp", "weft"))
        if len({e.direction_name for e in yarns}) == 2 and others:
            names = " and ".join(dict.fromkeys(e.direction_name for e in others))
            out.append((f"fit warp and weft, predict {names} ({100 * g:g} cm)", yarns, others))
    for g in gauges:
        here = tuple(e for e in strips if round(e.gauge, 2) == g)
        there = tuple(e for e in strips if round(e.gauge, 2) != g)
        if there:
            out.append((f"fit the {100 * g:g} cm gauge, predict the other", here, there))
    return out


def _one(job) -> CrossValidation:
    label, fabric, train, test, level_name, starts = job
    size, unknowns = sum(len(e) for e in train), law_unknowns(fabric.law)
    if size <= len(unknowns):
        return CrossValidation(label, None, [], f"{size} readings cannot determine {len(unknowns)} parameters")
    result = fit_law(Problem(fabric, unknowns, train, level_name), starts=starts, rescale=False, tolerance=1e-5, max_evaluations=60)
    if result.fit is None:
        return CrossValidation(label, None, [], result.error)
    return CrossValidation(label, result.fit, predict_all(result.fit.fabric, test, level_name))


def cross_validate(
    fabric, experiments: Sequence[Experiment], level_name="homogeneous", *, starts=1, where: Workers = SERIAL, progress=None
) -> list[CrossValidation]:
    """Fit the fabric's law on part of the curves, from the fabric's values, and predict the rest (see `splits`)."""
    jobs = [(label, fabric, train, test, level_name, starts) for label, train, test in splits(experiments)]
    return run_all(_one, jobs, where, progress=progress)
