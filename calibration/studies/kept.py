"""Independent runs whose results are kept in files, so that an interrupted study goes on where it stopped."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from calibration.runs import SERIAL, Workers, run_all
from mfar_fem import __version__


def signature(*parts: Any) -> str:
    """Identifies the settings of a run by their ``repr`` and the version of this package."""
    return hashlib.sha256(repr((__version__, parts)).encode()).hexdigest()[:24]


def read(path: Path | None, key: str) -> Any:
    """The result kept under this signature, or None (no file, unreadable, or of other settings)."""
    if path is None or not path.exists():
        return None
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        return kept["result"] if kept["signature"] == key else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def keep(path: Path | None, key: str, result: Any) -> None:
    """Write a result (JSON types) as a whole or not at all."""
    if path is None:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f"{path.name}.{os.getpid()}.part")
    partial.write_text(json.dumps({"signature": key, "result": result}, indent=1), encoding="utf-8")
    partial.replace(path)


def run_kept(
    function: Callable[[Any], Any],
    items: Sequence[Any],
    names: Sequence[str],
    folder: Path | None = None,
    *,
    resume: bool = True,
    where: Workers = SERIAL,
    progress: Callable[[int, int], None] | None = None,
) -> list[Any]:
    """``[function(item) for item in items]``; what `folder` holds already is not computed again.

    Every run writes its own file as soon as it is done (on a cluster the workers must see the same file system).

    Parameters
    ----------
    function : callable
        Picklable, of one item; returns plain JSON types.
    items : sequence
        Their ``repr`` identifies the settings.
    names : sequence of str
        File names without extension.
    folder : Path, optional
        None keeps nothing.
    """
    files = [None if folder is None else folder / f"{name}.json" for name in names]
    keys = [signature(function.__module__, function.__qualname__, item) for item in items]
    results = [read(f, k) if resume else None for f, k in zip(files, keys, strict=True)]
    todo = [i for i, r in enumerate(results) if r is None]
    done = len(items) - len(todo)
    if progress is not None:
        progress(done, len(items))

    def report(finished: int, total: int) -> None:
        if progress is not None:
            progress(done + finished, len(items))

    jobs = [(function, items[i], files[i], keys[i]) for i in todo]
    for i, result in zip(todo, run_all(_run, jobs, where, progress=report), strict=True):
        results[i] = result
    return results


def _run(job):
    function, item, path, key = job
    result = function(item)
    keep(path, key, result)
    return result
