"""Lists of samples as JSON."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import DataFileError, InputError, ParameterError
from reconstruction.keypoints.data import Sample

GARMENT = 2
"""Label of the garment's pixels in the benchmark's masks."""

def read_index(path: str | Path) -> list[Sample]:
    """Samples listed in ``samples.json`` (or the file given): ``{"samples": [{"image": ..., "keypoints": [[x, y] or null, ...],
    "visible": [...], "present": [...], "style": ..., "damage": ..., "split": ..., "identity": ...}, ...]}``; paths are relative
    to it.

    Raises
    ------
    DataFileError
        It cannot be read, is no JSON, or a sample lacks something; the message says which sample.
    """
    path = Path(path)
    if path.is_dir():
        path = path / "samples.json"
    try:
        rows = json.loads(path.read_text(encoding="utf-8"))["samples"]
    except FileNotFoundError:
        raise DataFileError("there is no such file", path=path) from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DataFileError(f"is not a list of samples: expected JSON with a list 'samples' ({error})", path=path) from error
    return [_sample(row, path, number) for number, row in enumerate(rows, 1)]


def _sample(row: Any, path: Path, number: int) -> Sample:
    """One entry of an index file."""
    try:
        given = [(float("nan"),) * 2 if p is None else p for p in row["keypoints"]]
        points = np.array(given, float)
        present = row.get("present", [bool(np.isfinite(p).all()) for p in points])
        extra = {key: row[key] for key in ("style", "damage", "split", "identity") if key in row}
        box = None
        if row.get("box"):
            x0, y0, x1, y1 = (float(v) for v in row["box"])
            box = (x0, y0, x1, y1)
        return Sample(path.parent / row["image"], points, row.get("visible", present), present, **extra, box=box)
    except KeyError as error:
        raise DataFileError(f"sample {number} has no {error}", path=path) from error
    except (TypeError, ValueError, AttributeError, ParameterError) as error:
        raise DataFileError(f"sample {number} is wrong: {error}", path=path) from error


def write_index(samples: Sequence[Sample], path: str | Path) -> None:
    """Write ``samples.json``, from which :func:`read_index` makes the same samples again."""
    path = Path(path)
    rows = [
        {
            "image": Path(os.path.relpath(s.image_path, path.parent)).as_posix(),
            "keypoints": [[float(v) for v in p] if ok else None for p, ok in zip(s.keypoints, s.present, strict=True)],
            "visible": s.visible.tolist(), "present": s.present.tolist(), "style": s.style, "damage": s.damage, "split": s.split,
            "identity": s.identity, **({"box": list(s.box)} if s.box else {}),
        }
        for s in samples
    ]
    path.write_text(json.dumps({"samples": rows}, indent=1) + "\n", encoding="utf-8")


def samples_of(folder: str | Path) -> list[Sample]:
    """Samples of a folder: its ``samples.json``, or the ``benchmark.json`` that the benchmark's generator wrote.

    Of the benchmark a point counts as visible if it is in sight *and* paint or cloth is left there.

    Raises
    ------
    DataFileError
        It has neither.
    """
    folder = Path(folder)
    if folder.suffix == ".json" and folder.name != "benchmark.json":
        return read_index(folder)
    folder = folder.parent if folder.name == "benchmark.json" else folder
    if (folder / "samples.json").exists():
        return read_index(folder)
    if not (folder / "benchmark.json").exists():
        raise DataFileError("has neither samples.json nor benchmark.json (`mfar benchmark-data` makes one)", path=folder)
    from reconstruction.benchmark import load_index

    found = []
    for s in load_index(folder).samples:
        present = s.present & np.isfinite(s.keypoints).all(axis=1)
        found.append(Sample(s.path, s.keypoints, s.visible & s.intact, present, s.style, s.damage, s.split, s.identity))
    return found


def further(folder: str | Path, others: Sequence[str | Path]) -> list[Sample]:
    """Samples of further benchmarks that train beside a first one: all of the types and damage levels that may be seen, whatever
    their split there.

    Raises
    ------
    InputError
        One of them has the seed of the first or of another: its identities would be in training and test.
    DataFileError
        One is no benchmark.
    """
    found: list[Sample] = []
    if not others:
        return found
    from reconstruction.benchmark import load_index
    from reconstruction.benchmark.splits import HELD_OUT_DAMAGE

    seeds = {load_index(folder).seed: str(folder)}
    for other in others:
        seed = load_index(other).seed
        if seed in seeds:
            raise InputError(f"'{other}' has seed {seed} as '{seeds[seed]}' has: the same garments. Make one with another --seed")
        seeds[seed] = str(other)
        seen = [s for s in samples_of(other) if s.split != "test-type" and s.damage != HELD_OUT_DAMAGE]
        found += [replace(s, split="train", identity=f"{seed}:{s.identity}") for s in seen]
    return found


def garment_boxes(folder: str | Path) -> dict[Path, tuple[float, float, float, float]]:
    """Boxes (x0, y0, x1, y1) of the garments' masks by picture, for the template baseline; empty if the benchmark has no masks
    (``--light``) or the folder is none."""
    from reconstruction.keypoints.baselines import mask_box

    folder = Path(folder)
    folder = folder.parent if folder.name == "benchmark.json" else folder
    if (folder / "samples.json").exists() or not (folder / "benchmark.json").exists():
        return {}
    from reconstruction.benchmark import load_index

    found = load_index(folder).samples
    return {s.path: mask_box(s.load_truth()["labels"] == GARMENT) for s in found if s.truth is not None}
