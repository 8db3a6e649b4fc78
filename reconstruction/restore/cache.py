"""Stages of a long run, each in a folder that is there completely or not at all, and kept as long as its inputs stay the same.

The key of a stage is the SHA-256 of its name and version, its options, the contents of the files it reads and the *contents* of
what the stages before it wrote. Its folder is filled under another name and moved into place when it is done, with ``stage.json``
(key, digests of its files, cost) in it: a run that is killed at any moment goes on after the last finished stage, and a
change of an option repeats the stages that depend on it and, where these give the same files, nothing else. One run at a time
works in a folder (:mod:`reconstruction.restore.lock`).
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import resource
import shutil
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mfar_fem.cli.console import jsonable
from mfar_fem.errors import InputError
from reconstruction.restore.lock import alone

log = logging.getLogger(__name__)
RECORD = "stage.json"
_BLOCK = 1 << 20


@dataclass(frozen=True)
class Done:
    """A finished stage.

    Attributes
    ----------
    name : str
    folder : pathlib.Path
        Where its files lie.
    cached : bool
        Whether it was there already.
    seconds, cpu_s : float
        What it cost when it was computed, s.
    peak_MB : float
        Largest memory of the process up to its end.
    digest : str
        Of the contents of its files.
    facts : dict
        What it returned, plain types.
    """

    name: str
    folder: Path
    cached: bool
    seconds: float
    cpu_s: float
    peak_MB: float
    digest: str
    facts: dict[str, Any]

    def row(self) -> dict[str, Any]:
        """For tables."""
        return {"stage": self.name, "seconds": self.seconds, "cpu_s": self.cpu_s, "peak_MB": self.peak_MB, "cached": self.cached}


def file_digest(path: Path) -> str:
    """SHA-256 of a file."""
    total = hashlib.sha256()
    with path.open("rb") as stream:
        while block := stream.read(_BLOCK):
            total.update(block)
    return total.hexdigest()


def digest(*parts: Any) -> str:
    """SHA-256 of plain values; of a path the contents of the file."""
    plain = [{"file": file_digest(p)} if isinstance(p, Path) else jsonable(p) for p in parts]
    return hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest()


class Stages:
    """Runs stages into subfolders of a folder, which it holds as a context: ``with Stages(folder) as stages``.

    Parameters
    ----------
    folder : path-like
        Of the whole run.
    fresh : bool
        Compute every stage again.

    Attributes
    ----------
    done : dict of str to Done
        In the order in which they were asked for.

    Raises
    ------
    InputError
        On entering: another run works in the folder.
    """

    def __init__(self, folder, fresh: bool = False):
        self.folder, self.fresh = Path(folder), fresh
        self.done: dict[str, Done] = {}
        self._held = ExitStack()

    def __enter__(self) -> Stages:
        self.folder.mkdir(parents=True, exist_ok=True)
        self._held.enter_context(alone(self.folder))
        for left in self.folder.glob(".part-*"):  # of a run that was killed
            shutil.rmtree(left, ignore_errors=True)
        return self

    def __exit__(self, *error) -> None:
        self._held.close()

    def run(self, name: str, version: int, work: Callable[[Path], Mapping[str, Any]], *, after: Sequence[str] = (),
            files: Sequence[Path] = (), options: Any = None, resumable: bool = False) -> Done:  # fmt: skip
        """Do a stage, or take what it gave before.

        Parameters
        ----------
        name : str
            Of the stage and its folder.
        version : int
            Of its code: another one is another result.
        work : callable
            ``work(folder)`` fills a folder and returns plain facts.
        after : sequence of str
            Stages whose files it reads.
        files : sequence of Path
            Further files it reads.
        options : plain values
            Everything else it depends on.
        resumable : bool
            Its unfinished folder is kept and handed to it again if the key is the same: for stages that go on by themselves.

        Raises
        ------
        InputError
            The folder cannot be written, or a stage named in `after` has not run.
        """
        missing = [a for a in after if a not in self.done]
        if missing:
            raise InputError(f"stage '{name}' comes after '{missing[0]}', which has not run")
        key = digest(name, version, options, *files, *(self.done[a].digest for a in after))
        found = None if self.fresh else self._kept(name, key)
        if found is None:
            found = self._compute(name, key, work, resumable)
        self.done[name] = found
        return found

    def _kept(self, name: str, key: str) -> Done | None:
        folder = self.folder / name
        try:
            record = json.loads((folder / RECORD).read_text(encoding="utf-8"))
            if record["key"] != key or any(file_digest(folder / f) != d for f, d in record["files"].items()):
                return None
        except (OSError, ValueError, KeyError):
            return None
        return Done(name, folder, True, record["seconds"], record["cpu_s"], record["peak_MB"], record["digest"], record["facts"])

    def _compute(self, name: str, key: str, work, resumable: bool) -> Done:
        part = self.folder / (f"{name}.unfinished" if resumable else f".part-{name}")
        mark = part / ".key"
        if part.exists() and not (resumable and not self.fresh and mark.exists() and mark.read_text() == key):
            shutil.rmtree(part)
        for left in part.rglob(".*.part*"):  # half a file (mfar_fem.files) of a process that was killed
            left.unlink()
        try:
            part.mkdir(exist_ok=True)
            mark.write_text(key)
        except OSError as error:
            raise InputError(f"cannot write '{part}': {error.strerror or error}") from error
        begin, cpu = time.perf_counter(), _cpu()
        facts = jsonable(dict(work(part)))
        seconds, spent = time.perf_counter() - begin, _cpu() - cpu
        mark.unlink()
        files = {p.relative_to(part).as_posix(): file_digest(p) for p in sorted(part.rglob("*")) if p.is_file()}
        record = {"key": key, "files": files, "digest": digest(files), "seconds": seconds, "cpu_s": spent, "peak_MB": _peak_MB(),
                  "facts": facts}  # fmt: skip
        (part / RECORD).write_text(json.dumps(record, indent=1), encoding="utf-8")
        final = self.folder / name
        if final.exists():
            shutil.rmtree(final)
        os.replace(part, final)
        log.info("%s: %.1f s", name, seconds)
        return Done(name, final, False, seconds, spent, record["peak_MB"], record["digest"], facts)


def _cpu() -> float:
    """Processor time of this process and its ended children, s."""
    own, children = resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN)
    return own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime


def _peak_MB() -> float:
    """Largest resident memory of this process so far."""
    unit = 1 if sys.platform == "darwin" else 1024  # bytes there, kilobytes elsewhere
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6
