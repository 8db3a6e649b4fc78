"""Making a whole benchmark: identities in parallel, resumable, then the index and a contact sheet."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import NotConvergedError, ParameterError, SurfaceError
from mfar_fem.files import replace_bytes
from mfar_fem.processes import side_by_side
from reconstruction.landmarks import LANDMARKS

from .identity import SIZE
from .index import FORMAT, INDEX
from .splits import Identity, identities
from .store import VERSION, Figure, complete, make

log = logging.getLogger(__name__)
SHEET = "contact_sheet.png"


def build(
    folder,
    count: int = 70,
    seed: int = 0,
    workers: int = 1,
    light: bool = False,
    size: float = SIZE,
    figure: Figure = None,
    pictures: int = 0,
    progress: Callable[[int, int, str], None] | None = None,
) -> dict[str, Any]:
    """Make a benchmark or complete one.

    Parameters
    ----------
    folder : str or path-like
    count : int
        Identities of the three seen types; a seventh more of the held-out type comes on top.
    seed : int
        Of everything.
    workers : int
        Processes.
    light : bool
        Without depth, normals and labels.
    size : float
        Edge length of the cloth's mesh, m.
    figure : (str, str), optional
        OBJ file and keypoints of a body that all identities wear their garments on: then the splits no longer separate bodies.
    pictures : int
        Of each identity, at most, drawn from its eight (or eleven); 0 for all. Draping costs as much as two to four pictures:
        for training, many identities with few pictures teach more in the same time.
    progress : callable, optional
        ``progress(done, total, name)`` after each identity.

    Returns
    -------
    dict
        ``identities``, ``images`` (numbers), ``made``, ``kept`` (names), ``failed`` (name to message), ``splits`` (name to number
        of identities), and the worst (of stretch also the mean) of stretch, penetration (m) and crossing edges.

    Raises
    ------
    ParameterError
        `count`, `seed` or `workers` out of range.
    """
    if workers < 1:
        raise ParameterError(f"workers must be at least 1, not {workers}")
    root = Path(folder)
    wanted = identities(count, seed)
    root.mkdir(parents=True, exist_ok=True)
    records: dict[str, dict[str, Any]] = {}
    failed: dict[str, str] = {}
    for identity in wanted:
        if (record := complete(root, identity, light, size, figure, pictures)) is not None:
            records[identity.name] = record
    kept = sorted(records)
    calls = {i: (root, i, light, size, figure, pictures) for i in wanted if i.name not in records}
    for identity, result in side_by_side(_attempt, calls, workers):
        if isinstance(result, str):
            failed[identity.name] = result
            log.warning("%s: %s", identity.stem, result)
        else:
            records[identity.name] = result
        if progress is not None:
            progress(len(records) + len(failed), len(wanted), identity.name)
    ordered = {i.name: records[i.name] for i in wanted if i.name in records}
    index = {
        "format": FORMAT,
        "version": VERSION,
        "seed": seed,
        "light": light,
        "landmarks": list(LANDMARKS),
        "failed": failed,
        "identities": ordered,
    }
    replace_bytes(root / INDEX, json.dumps(index).encode())
    return {
        "identities": len(ordered),
        "images": sum(len(r["images"]) for r in ordered.values()),
        "made": sorted(set(ordered) - set(kept)),
        "kept": kept,
        "failed": failed,
        **_summary(wanted, ordered),
    }


def _attempt(root: Path, identity: Identity, light: bool, size: float, figure: Figure, pictures: int = 0) -> dict[str, Any] | str:
    """The record of an identity, or why this one cannot be made; wrong input stops the run."""
    try:
        return make(root, identity, light, size, figure, pictures)
    except (NotConvergedError, SurfaceError) as error:
        return str(error)


def _summary(wanted: list[Identity], records: dict[str, dict[str, Any]]) -> dict[str, Any]:
    splits: dict[str, int] = {}
    for identity in wanted:
        if identity.name in records:
            splits[identity.split] = splits.get(identity.split, 0) + 1
    figures = [r["facts"]["drape"] for r in records.values()]
    worst = {
        key: float(max((f[key] for f in figures), default=0.0)) for key in ("mean_stretch", "max_penetration", "crossing_edges")
    }
    mean = float(np.mean([f["mean_stretch"] for f in figures])) if figures else 0.0
    return {
        "splits": splits,
        "mean_stretch": mean,
        "worst_mean_stretch": worst["mean_stretch"],
        "max_penetration": worst["max_penetration"],
        "worst_crossing_edges": worst["crossing_edges"],
    }
