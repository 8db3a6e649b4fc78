"""Does the knowledge graph help? Networks trained with and without it, over several seeds, beside baselines that do not look.

Every network of a seed has the same weights to begin with, the same order and the same augmentation; only the knowledge term
differs.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import ParameterError
from reconstruction.keypoints import baselines
from reconstruction.keypoints.blazepose import COUNTERPARTS, BlazePose, debiased
from reconstruction.keypoints.crops import apply, image_box, read_image
from reconstruction.keypoints.data import Sample
from reconstruction.keypoints.evaluate import Errors, errors, paired_difference, seen_in, summary, table
from reconstruction.keypoints.knowledge import Knowledge
from reconstruction.keypoints.knowledge_file import load
from reconstruction.keypoints.loss import GraphLoss, LiteralLoss
from reconstruction.keypoints.predict import Detector
from reconstruction.keypoints.train import BEST, TrainSettings, train
from reconstruction.landmarks import INDEX, LANDMARKS
from reconstruction.torch_library import torch


def constraint_rates(samples: Sequence[Sample], knowledge: Knowledge | None = None) -> dict[str, float]:
    """Fraction of the *true* figures that violate each constraint, and the same for formula (6) as printed (``literal: …``).

    A graph whose constraints the truth violates is wrong, whatever it does for a network.
    """
    present = torch.tensor(np.array([s.present for s in samples])).double()
    points = torch.tensor(np.array([np.where(s.present[:, None], s.keypoints, 0.0) for s in samples]))
    scaled = np.array([apply(baselines.sample_matrix(s), p) for s, p in zip(samples, points.numpy(), strict=True)])
    rates: dict[str, float] = {}
    for prefix, term in (("", GraphLoss(knowledge if knowledge is not None else load())), ("literal: ", LiteralLoss())):
        hinge, active = term.residuals(torch.tensor(scaled), present)
        broken = ((hinge > 1e-12) * active).sum(0) / active.sum(0)
        rates |= {prefix + name: float(v) for name, v in zip(term.names, broken, strict=True)}
    return rates


def split(samples: Sequence[Sample]) -> tuple[list[Sample], list[Sample], list[Sample]]:
    """Training, validation and test samples; :class:`ParameterError` if one is empty or they share an identity.

    Every split whose name begins with "test" is for testing; the scores tell them apart. A sample of any other split is an error.
    """
    names = ("train", "validation", "test")
    for s in samples:
        if not s.split.startswith("test") and s.split not in names:
            raise ParameterError(f"{s.image_path}: split '{s.split}' is none of train, validation, test…")
    parts = {name: [s for s in samples if s.split.startswith("test" if name == "test" else name)] for name in names}
    for name, part in parts.items():
        if not part:
            raise ParameterError(f"no sample is in the split '{name}'; there are {sorted({s.split for s in samples})}")
    for a, b in (("train", "validation"), ("train", "test"), ("validation", "test")):
        shared = {s.identity for s in parts[a] if s.identity} & {s.identity for s in parts[b]}
        if shared:
            raise ParameterError(f"identity '{min(shared)}' is in both {a} and {b}; split by identity")
    return parts["train"], parts["validation"], parts["test"]


def run(
    samples: Sequence[Sample],
    out: str | Path,
    *,
    arms: Sequence[str] = ("graph", "none", "shuffled", "literal"),
    seeds: int = 5,
    settings: TrainSettings | None = None,
    knowledge: Knowledge | None = None,
    mask_boxes: Callable[[Sequence[Sample]], Sequence[tuple[float, float, float, float]]] | None = None,
    blazepose: str | Path | None = None,
    start_from: str | Path | None = None,
    replicates: int = 1000,
    progress: Callable[..., None] | None = None,
) -> dict[str, Any]:
    """Train every arm with every seed and compare them on the test split.

    Parameters
    ----------
    samples : sequence of Sample
        With the splits train, validation and test.
    out : path-like
        Folder; each run in ``ARM-seedN`` (a finished one is not repeated, a broken one goes on). Writes ``study.csv``,
        ``study.json`` and ``study.png``.
    arms : sequence of str
        Knowledge terms (:data:`reconstruction.keypoints.loss.ARMS`); the first is compared with each of the others.
    seeds : int
    settings : TrainSettings
        Of every run but for arm and seed; ``max_seconds`` is the budget of one run.
    mask_boxes : callable, optional
        Boxes of the garments' masks, for the template baseline; without it boxes of the samples, or whole images.
    blazepose : path-like, optional
        Its weights, for the outside comparison on the points it has.
    start_from : path-like, optional
        A detector (or published weights) that every run begins with: what a term does to a network that can see already.
    progress : callable, optional
        ``progress(steps, description=...)`` after every batch.

    Returns
    -------
    dict
        ``rows`` (one a method; all test pictures and points), ``differences`` (paired, first arm minus the other), ``in_sight``
        and ``differences_in_sight`` (the same of visible points of the split "test", without held-out types), ``groups`` (of the
        first arm), ``constraints`` (see :func:`constraint_rates`).
    """
    settings, out = settings or TrainSettings(), Path(out)
    out.mkdir(parents=True, exist_ok=True)
    training, validation, test = split(samples)
    found: dict[str, list[Errors]] = {arm: [] for arm in arms}
    others = baselines_of(training, test, mask_boxes)
    fixed = {"constraints": constraint_rates(training, knowledge), "settings": settings.to_dict(),
             "images": {"train": len(training), "validation": len(validation), "test": len(test)}}
    result: dict[str, Any] = {}
    for seed in range(seeds):  # all arms of a seed first: what is there at any time is paired
        for arm in arms:
            folder = out / f"{arm}-seed{seed}"
            if not (folder / BEST).exists():
                train(training, validation, folder, replace(settings, arm=arm, seed=seed), knowledge=knowledge, resume=True,
                      start_from=start_from, progress=progress)
            predictions = Detector.load(folder / BEST).predict_samples(test)
            found[arm].append(errors(predictions.points, test, predictions.scale))
        result = _judge(found, others, replicates) | fixed | {"seeds": seed + 1}
        _write(result, out)
    if blazepose is not None:
        result["rows"] += _outside(training, test, blazepose, found[arms[0]], replicates)
        _write(result, out)
    return result


def _judge(found: dict[str, list[Errors]], others: dict[str, Errors], replicates: int) -> dict[str, Any]:
    """Rows, differences and groups of the runs so far."""
    rows = [{"method": f"network, {arm}", "kind": "network", **summary(runs, replicates=replicates)} for arm, runs in found.items()]
    rows += [{"method": name, "kind": "baseline", **summary([e], replicates=replicates)} for name, e in others.items()]
    first, *rest = found
    seen = seen_in("test")
    in_sight = [{"method": f"network, {arm}", "kind": "network", **summary(runs, seen, replicates=replicates)}
                for arm, runs in found.items()]
    in_sight += [{"method": name, "kind": "baseline", **summary([e], seen, replicates=replicates)} for name, e in others.items()]
    return {
        "rows": rows, "differences": {arm: paired_difference(found[first], found[arm]) for arm in rest},
        "in_sight": in_sight, "differences_in_sight": {arm: paired_difference(found[first], found[arm], seen) for arm in rest},
        "groups": table(found[first], replicates),
    }


def baselines_of(training: Sequence[Sample], test: Sequence[Sample], mask_boxes=None) -> dict[str, Errors]:
    """Errors of methods that do not look: mean pose, mean shape in a box, mean shape at the true place, size and turn."""
    def boxes(samples):
        if mask_boxes is not None:
            return mask_boxes(samples)
        return [s.box if s.box else image_box(read_image(s.image_path).shape) for s in samples]

    return {
        "mean pose": errors(baselines.mean_pose(training, test), test),
        "template in the box": errors(baselines.box_template(training, boxes(training), test, boxes(test)), test),
        "oracle: true similarity, mean shape": errors(baselines.oracle_procrustes(training, test), test),
    }


def outside(training: Sequence[Sample], test: Sequence[Sample], path: str | Path) -> tuple[dict[str, Errors], Callable]:
    """Errors of BlazePose by name of the method, and the mask of the points that it shares with ours, on pictures of figures."""
    network = BlazePose(path)
    predicted = network.predict(test)
    figures = [s for s in training if s.style != "textile"]
    corrected = debiased(predicted, network.predict(figures), figures)
    shared = np.isin(np.arange(len(LANDMARKS)), [INDEX[name] for name in COUNTERPARTS])

    def mask(e: Errors) -> np.ndarray:
        return shared & (e.style != "textile")[:, None]  # a garment laid flat has no person in it

    named = {"BlazePose, same points, figures only": predicted, "BlazePose, mean offsets removed": corrected}
    return {name: errors(points, test) for name, points in named.items()}, mask


def _outside(training, test, path, ours: Sequence[Errors], replicates: int) -> list[dict[str, Any]]:
    theirs, mask = outside(training, test, path)
    rows = [{"method": "network, same points, figures only", "kind": "network", **summary(ours, mask, replicates=replicates)}]
    return rows + [{"method": name, "kind": "outside", **summary([e], mask, replicates=replicates)} for name, e in theirs.items()]


def _write(result: dict[str, Any], out: Path) -> None:
    from reconstruction.keypoints.plots import save_study

    (out / "study.json").write_text(json.dumps(result, indent=1, default=float) + "\n", encoding="utf-8")
    with (out / "study.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(result["rows"][0]))
        writer.writeheader()
        writer.writerows(result["rows"])
    save_study(result["rows"], out / "study.png")
