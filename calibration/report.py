"""Writes what a study found: calibration.json, parameters.toml, pictures, and one self-contained report.html."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from calibration import plots
from calibration.study import Study
from calibration.words import number, short

HERE = Path(__file__).parent


def payload(study: Study) -> dict:
    """The study as plain values for calibration.json (SI; infinities become null when written)."""
    f, linear = study.fit, study.linear
    parameters = {}
    for u in f.problem.unknowns:
        p = study.profiles.get(u.name)
        parameters[u.name] = {
            "value": f.parameters[u.name],
            "unit": u.unit,
            "lower": u.lower,
            "upper": u.upper,
            "scale": u.scale,
            "linear_interval": linear.intervals[u.name],
            "profile_interval": None if p is None else p.interval,
            "bootstrap_interval": None if study.bootstrap is None else study.bootstrap.intervals[u.name],
            "at_bound": f.at_bounds().get(u.name),
            "words": study.words["parameters"][u.name],
        }
    return {
        "best_law": study.best.law,
        "level": study.level,
        "rmse_percent_of_range": f.rmse_percent_of_range,
        "rmse_by_experiment": f.rmse_by_experiment,
        "converged": f.converged,
        "status": f.status,
        "dataset": {
            "name": study.dataset.name,
            "variant": study.dataset.variant,
            "description": study.dataset.description,
            "citation": study.dataset.citation,
            "experiments": [
                {
                    "name": e.name, "kind": e.kind, "direction": e.direction_name, "gauge_m": e.gauge, "width_m": e.width,
                    "weight": e.weight, "role": e.role, "n_readings": len(e), "notes": e.notes, "citation": e.citation,
                }
                for e in study.dataset.experiments
            ],
        },
        "parameters": parameters,
        "warnings": study.words["warnings"],
        "residual_variance": linear.variance,
        "residual_autocorrelation": linear.autocorrelation,
        "condition_number": linear.condition,
        "correlation": {"names": linear.names, "matrix": linear.correlation},
        "covariance_of_fit_coordinates": linear.covariance,
        "laws": {name: [r.to_dict() for r in results] for name, results in study.levels.items()},
        "levels": study.level_pairs(),
        "predictions": [c.to_dict() for c in study.checks],
        "error_by_strain_interval": study.intervals,
        "cross_validation": [c.to_dict() for c in study.cross],
        "profiles": {
            k: {"values": p.values, "delta": p.delta, "threshold": p.threshold, "note": p.note}
            for k, p in study.profiles.items()
        },
        "bootstrap": None
        if study.bootstrap is None
        else {
            "method": study.bootstrap.method,
            "replicates": len(study.bootstrap.values),
            "failed": study.bootstrap.failed,
            "median": study.bootstrap.median,
            "intervals": study.bootstrap.intervals,
        },
        "timings_s": study.timings,
        "settings": study.settings,
    }  # fmt: skip


def figures(study: Study) -> dict:
    """All pictures of a study by name."""
    f = study.fit
    fitted = list(f.problem.experiments)
    shown = {f"{study.best.law} ({study.level})": [p.y for p in f.predictions]}
    if study.level != "homogeneous":
        from calibration.validation import predict_all

        flat = predict_all(f.fabric, fitted, "homogeneous")
        shown["same values, homogeneous"] = [np.where(c.prediction.reached, c.prediction.y, np.nan) for c in flat]
    out = {
        "fit": plots.curves(fitted, shown),
        "residuals": plots.residual_plot(fitted, [p.y for p in f.predictions]),
        "laws": plots.law_bars([r.to_dict() for r in study.levels[study.level]]),
        "correlation": plots.correlation_map(study.linear.names, study.linear.correlation),
    }
    units = {u.name: u.unit for u in f.problem.unknowns}
    scales = {u.name: u.scale for u in f.problem.unknowns}
    profile = plots.profile_plots(study.profiles, units, scales) if study.profiles else None
    if profile is not None:
        out["profiles"] = profile
    seen = {e.name for e in fitted}
    checked = [c for c in study.checks if c.experiment.name not in seen]
    if checked:
        label = f"{study.best.law}, fitted to the others"
        arrays = [np.where(c.prediction.reached, c.prediction.y, np.nan) for c in checked]
        out["check"] = plots.curves([c.experiment for c in checked], {label: arrays})
    if study.intervals:
        out["intervals"] = plots.interval_bars(study.intervals)
    if study.level != "homogeneous" and len(study.levels["homogeneous"]) > 1:
        alone = len(study.levels[study.level]) == 1  # then the only comparison is the homogeneous one
        out["laws" if alone else "laws_homogeneous"] = plots.law_bars([r.to_dict() for r in study.levels["homogeneous"]])
    return out


def write_json(path: Path, values: Mapping) -> None:
    """Write JSON as a whole or not at all; NaN and infinities become null."""
    from mfar_fem.cli.console import jsonable

    partial = path.with_name(path.name + ".part")
    partial.write_text(json.dumps(jsonable(values), indent=1, allow_nan=False) + "\n", encoding="utf-8")
    partial.replace(path)


def write(study: Study, folder: Path | str, extra: Mapping | None = None) -> dict[str, Path]:
    """Write all results of a study into a folder.

    Parameters
    ----------
    study : Study
    folder : path-like
    extra : mapping, optional
        Added to calibration.json, and shown in the report as the section 'Further predictions' if it holds the key
        'predictions_in_words', a list of sentences.

    Returns
    -------
    dict of str to Path
        'json', 'parameters' (absent if the law is not registered and so cannot be named in a file), 'report'.
    """
    from mfar_fem.errors import InputError

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    values = payload(study) | dict(extra or {})
    files = {"json": folder / "calibration.json", "report": folder / "report.html"}
    write_json(files["json"], values)
    try:
        files["parameters"] = Path(study.calibrated().save(folder / "parameters.toml"))
    except InputError as error:
        values["warnings"] = [*values["warnings"], f"parameters.toml was not written: {error}"]
    pictures = figures(study)
    for name, fig in pictures.items():
        plots.save(fig, folder, name)
    images = {name: plots.as_data_uri(fig) for name, fig in pictures.items()}
    files["report"].write_text(render(values, images, "report.html.j2"), encoding="utf-8")
    return files


def render(values: Mapping, images: Mapping[str, str], template: str) -> str:
    """Fill a template of this package; the page needs no other file and no network."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    env = Environment(loader=FileSystemLoader(HERE / "templates"), autoescape=True, undefined=StrictUndefined)
    env.filters |= {"number": _number, "short": short, "interval": _interval}
    from mfar_fem import __version__

    when = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    return env.get_template(template).render(v=values, images=images, version=__version__, when=when)


def _number(value, digits: int | None = None, unit: str = "") -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "–"
    if digits is not None:
        return f"{value:.{digits}f}" if abs(value) < 1e5 else f"{value:.2e}"
    return number(float(value), unit)


def _interval(pair) -> str:
    if pair is None:
        return "–"
    low, high = (None if x is None or not math.isfinite(x) else x for x in pair)
    if low is None and high is None:
        return "not determined"
    if high is None:
        assert low is not None
        return f"≥ {number(low)}, no upper bound"
    if low is None:
        return f"≤ {number(high)}, no lower bound"
    return f"{number(low)} … {number(high)}"
