"""What follows a training: calibration on the validation images, scores and pictures on the test images."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from reconstruction.keypoints.calibration import reliability
from reconstruction.keypoints.crops import read_image
from reconstruction.keypoints.data import Sample
from reconstruction.keypoints.evaluate import WITHIN, errors, table
from reconstruction.keypoints.plots import save_heatmaps, save_predictions, save_reliability
from reconstruction.keypoints.postures import Postures
from reconstruction.keypoints.predict import Detector, outcomes
from reconstruction.keypoints.train import BEST

DETECTOR = "detector.pt"


def finish(folder: str | Path, validation: Sequence[Sample], test: Sequence[Sample], replicates: int = 1000,
           training: Sequence[Sample] = ()) -> dict[str, Any]:  # fmt: skip
    """Calibrate the best network of a run and judge it.

    Parameters
    ----------
    folder : path-like
        Of the run; gets ``detector.pt`` (calibrated), ``scores.json``, ``reliability.png``, ``predictions.png`` and
        ``heatmaps.png``.
    validation, test : sequence of Sample
        For the calibration; for everything that is reported.
    training : sequence of Sample
        Whose postures the detector keeps (:mod:`reconstruction.keypoints.postures`); none: points are decoded one by one.

    Returns
    -------
    dict
        ``groups`` (see :func:`reconstruction.keypoints.evaluate.table`), ``calibration_error`` and ``calibration_error_before``
        (of the height of the peaks), ``present_accuracy`` (at one half) with ``present_chance`` (always saying the commoner).
    """
    folder = Path(folder)
    detector = Detector.load(folder / BEST)
    if training:
        detector.postures = Postures.of(training, detector.margin)
    detector.calibrate(validation)
    detector.notes = {"trained_by": "mfar train keypoints", "validation_images": len(validation)}
    detector.save(folder / DETECTOR)
    p = detector.predict_samples(test, keep_heatmaps=True)
    score, near, present = outcomes(test, p, WITHIN)
    before = reliability(np.clip(score[present], 0.0, 1.0), near[present])
    after = reliability(p.confidence[present], near[present])
    save_reliability(before, after, folder / "reliability.png", WITHIN)
    chosen = np.unique(np.linspace(0, len(test) - 1, min(12, len(test))).astype(int))
    images = [read_image(test[i].image_path) for i in chosen]
    truth = [np.where(test[i].present[:, None], test[i].keypoints, np.nan) for i in chosen]
    save_predictions(images, p.select(chosen), folder / "predictions.png", [test[i].image_path.name for i in chosen], truth)
    first = int(chosen[0])
    if p.heatmaps is not None:
        save_heatmaps(images[0], p.matrices[first], p.heatmaps[first], folder / "heatmaps.png")
    result = {
        "groups": table([errors(p.points, test, p.scale)], replicates),
        "calibration_error": after.error,
        "calibration_error_before": before.error,
        "present_accuracy": float(np.mean((p.present >= 0.5) == present)),
        "present_chance": float(max(present.mean(), 1 - present.mean())),
    }
    (folder / "scores.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    return result
