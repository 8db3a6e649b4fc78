"""Writes a validation: validation.json, pictures, one self-contained validation.html."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from calibration import plots
from calibration.experiments import Dataset
from calibration.report import render, write_json
from calibration.validation import Check, CrossValidation


def write(
    folder: Path,
    fabric,
    dataset: Dataset,
    level: str,
    checks: Sequence[Check],
    intervals: Sequence[dict],
    cross: Sequence[CrossValidation],
) -> tuple[dict, dict[str, Path]]:
    """Write everything; returns the values of validation.json and the files."""
    values = {
        "fabric": fabric.name,
        "law": fabric.law.name,
        "law_parameters": dict(fabric.law.values),
        "sources": dict(fabric.sources),
        "dataset": dataset.name,
        "variant": dataset.variant,
        "description": dataset.description,
        "citation": dataset.citation,
        "level": level,
        "warnings": warnings(checks, level),
        "rmse_percent_of_range": _overall(checks),
        "predictions": [c.to_dict() for c in checks],
        "error_by_strain_interval": list(intervals),
        "cross_validation": [c.to_dict() for c in cross],
    }
    arrays = [np.where(c.prediction.reached, c.prediction.y, np.nan) for c in checks]
    pictures = {"prediction": plots.curves([c.experiment for c in checks], {fabric.law.name: arrays})}
    if intervals:
        pictures["intervals"] = plots.interval_bars(intervals)
    for k, c in enumerate(cross):
        if c.checks:
            seen = [np.where(x.prediction.reached, x.prediction.y, np.nan) for x in c.checks]
            pictures[f"cross_{k}"] = plots.curves([x.experiment for x in c.checks], {"predicted": seen}, c.label)
    for name, fig in pictures.items():
        plots.save(fig, folder, name)
    files = {"json": folder / "validation.json", "report": folder / "validation.html"}
    write_json(files["json"], values)
    images = {name: plots.as_data_uri(fig) for name, fig in pictures.items()}
    files["report"].write_text(render(values, images, "validation.html.j2"), encoding="utf-8")
    return values, files


def warnings(checks: Sequence[Check], level: str) -> list[str]:
    """What a reader must know before blaming the fabric: sentences, none if there is nothing to say."""
    oblique = [c for c in checks if c.experiment.kind == "strip" and c.experiment.direction_name not in ("warp", "weft")]
    if level != "homogeneous" or not oblique:
        return []
    names = "; ".join(dict.fromkeys(c.experiment.name for c in oblique))
    return [f"Grips keep a strip cut at an angle to the yarns from shearing next to them, and this level knows no grips: the error "
            f"of {names} is partly that of the level. Use --level fe for it."]


def _overall(checks: Sequence[Check]) -> float:
    """Root of the mean over the experiments of their squared error; infinite if one was not reached at all."""
    squares = [c.rmse_percent_of_range**2 if c.reached else np.inf for c in checks]
    return float(np.sqrt(np.mean(squares)))
