"""Making a whole benchmark: identities in parallel, resumable, then the index and a contact sheet."""

from __future__ import annotations

import json
import logging
import multiprocessing
import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import MfarError, ParameterError
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
        if (record := complete(root, identity, light, size, figure)) is not None:
            records[identity.name] = record
    kept = sorted(records)
    todo = [i for i in wanted if i.name not in records]
    for identity, result in _run(root, todo, workers, light, size, figure):
        if isinstance(result, MfarError):
            failed[identity.name] = str(result)
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
    write_atomically(root / INDEX, json.dumps(index).encode())
    return {
        "identities": len(ordered),
        "images": sum(len(r["images"]) for r in ordered.values()),
        "made": sorted(set(ordered) - set(kept)),
        "kept": kept,
        "failed": failed,
        **_summary(wanted, ordered),
    }


def _run(root: Path, todo: list[Identity], workers: int, light: bool, size: float, figure: Figure):
    """Yield (identity, record or error) as they are done."""
    if workers == 1 or len(todo) < 2:
        for identity in todo:
            yield identity, _attempt(root, identity, light, size, figure)
        return
    with ProcessPoolExecutor(min(workers, len(todo)), mp_context=multiprocessing.get_context("spawn")) as pool:
        waiting = {pool.submit(_attempt, root, identity, light, size, figure): identity for identity in todo}
        for future in as_completed(waiting):
            yield waiting[future], future.result()


def _attempt(root: Path, identity: Identity, light: bool, size: float, figure: Figure) -> dict[str, Any] | MfarError:
    from mfar_fem.errors import InputError, NotConvergedError, SurfaceError

    try:
        return make(root, identity, light, size, figure)
    except (NotConvergedError, SurfaceError) as error:  # this identity; wrong input stops the run
        return type(error)(str(error)) if not isinstance(error, InputError) else SurfaceError(str(error))


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


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file so that it is either the old or the new one, never half."""
    part = path.with_name(f".part-{path.name}-{os.getpid()}")
    part.write_bytes(data)
    os.replace(part, path)
