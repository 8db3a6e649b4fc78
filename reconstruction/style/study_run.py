"""``mfar study style`` from drawing to table: train what is missing, apply everything, write numbers and pictures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from mfar_fem.errors import MissingDependencyError
from reconstruction.style.colour_transfer import METHODS, transfer
from reconstruction.style.sheet import save_sheet
from reconstruction.style.study import NONE, ORACLE, Method, by_kinds, evaluate, pairs, summary, verdict

TRAINING_SEED = 1
UNTRAINED = "untrained network"
"""Control: what the architecture does by itself, a transfer of mean and deviation in RGB."""


def network_settings(steps: int, features: str) -> dict[str, Any]:
    """The three networks of the study: formula (4) as printed with the registered pairs that it needs, with pairs that show
    different things, and the usable loss (also with pairs that show different things)."""
    from reconstruction.style.train import Settings

    base = Settings(features=features, steps=steps)
    return {
        "literal, registered": replace(base, loss="literal", registered=True),
        "literal, unregistered": replace(base, loss="literal"),
        "usable": base,
    }


def train_networks(folder: Path, steps: int, scenes: int, features: str, progress: Callable[[str, int, int], None] | None = None
                   ) -> dict[str, dict[str, Any]]:
    """Train (or go on with) the networks of the study on drawn scenes; reports of :meth:`train.Trainer.run` by name."""
    from reconstruction.style.data import drawn_pool
    from reconstruction.style.train import Trainer

    pool, reports = drawn_pool(TRAINING_SEED, scenes), {}
    for name, settings in network_settings(steps, features).items():
        trainer = Trainer(settings, pool, folder / name.replace(", ", "-"))
        tell = None if progress is None else partial(_told, progress, name, steps)
        reports[name] = trainer.run(sheet_every=steps, progress=tell)
    return reports


def run(out: Path, scenes: int = 12, steps: int = 200, training_scenes: int = 40, features: str = "small",
        weights: Mapping[str, str] | None = None, train: bool = True, size: int = 256,
        progress: Callable[[str, int, int], None] | None = None
        ) -> dict[str, Any]:
    """The study.

    Parameters
    ----------
    out : pathlib.Path
        Folder of the networks and of ``study.png``.
    scenes, training_scenes : int
        Scenes that are judged, and others that networks are trained on.
    steps : int
        Of each training.
    features : str
        Feature network of the loss (see :func:`features.load_features`).
    weights : mapping of name to file, optional
        Networks trained before, "shipped" for the one that comes with the package.
    train : bool
        Train the three networks of :func:`network_settings`.
    size : int
        Side of the pictures that are judged, px.
    progress : callable, optional
        ``progress(what, done, of)``.

    Returns
    -------
    dict
        ``table``, ``by_kinds``, ``verdict``, ``training``, ``notes``.
    """
    from reconstruction.style.align import Aligner
    from reconstruction.style.generator import Generator

    notes: list[str] = []
    reports = train_networks(out, steps, training_scenes, features, progress) if train else {}
    methods: dict[str, Method] = {name: partial(transfer, name) for name in METHODS}
    trained_with = {features}
    for name, path in {**{n: str(r["weights"]) for n, r in reports.items()}, **(weights or {})}.items():
        aligner = Aligner.load(path)
        trained_with.add(str(aligner.about.get("features", "")).partition("=")[0])
        methods.setdefault(UNTRAINED, Aligner(Generator(aligner.about["encoder"], aligner.about["skips"]).eval()).align)
        methods[name] = aligner.align
    compared = pairs(scenes, size)
    tell = None if progress is None else (lambda done, name: progress("judge", done, len(compared)))
    records = evaluate(methods, compared, _judge(trained_with, notes), progress=tell)
    chosen = compared[:6]
    columns = ["A", NONE, *methods, ORACLE]
    rows = [[p.like, p.image, *(m(p.image, p.like) for m in methods.values()), p.oracle] for p in chosen]
    save_sheet(rows, columns, out / "study.png", [f"{p.image_kind} as {p.like_kind}" for p in chosen])
    table = summary(records)
    return {"scenes": scenes, "pairs": len(compared), "features": features, "table": table, "by_kinds": by_kinds(records),
            "verdict": verdict(table), "training": reports, "notes": notes}


def _judge(trained_with: set[str], notes: list[str]):
    """Features for the third distance: ImageNet's, if they are there and no loss used them."""
    from reconstruction.style.features import load_features

    if "efficientnet-lite0" in trained_with:
        notes.append("no distance by network features: EfficientNet-Lite0 was used in training")
        return None
    try:
        return load_features("efficientnet-lite0")
    except MissingDependencyError as error:
        notes.append(f"no distance by network features: {error}")
        return None


def _told(progress, name: str, steps: int, done: int, values: dict) -> None:
    progress(f"train {name}", done, steps)
