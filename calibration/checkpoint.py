"""Checkpoint of a fit: one JSON file, written as a whole or not at all."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np

from mfar_fem.errors import DataFileError, InputError

VERSION = 1


class Checkpoint:
    """State of every start of a fit: where it stands, its cost, whether it is finished.

    Parameters
    ----------
    path : path-like or None
        None keeps the state in memory only.
    signature : str
        Of the problem; a file of another problem is refused.
    resume : bool
        False forgets what the file says.
    """

    def __init__(self, path: str | Path | None, signature: str, resume: bool = True):
        self.path = None if path is None else Path(path)
        self.signature = signature
        self.starts: dict[str, dict] = {}
        if self.path is not None and resume and self.path.exists():
            self._load()

    def _load(self) -> None:
        assert self.path is not None
        try:
            state = json.loads(self.path.read_text(encoding="utf-8"))
            version, signature, starts = state["version"], state["signature"], state["starts"]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise DataFileError(f"not a usable checkpoint ({error}); start afresh with --fresh", self.path) from None
        if version != VERSION or signature != self.signature:
            raise InputError(
                f"the checkpoint {self.path} belongs to other data, another law or other settings; "
                "start afresh with --fresh, or choose another output folder"
            )
        self.starts = starts

    def get(self, key: str) -> dict | None:
        """State of a start: 'q', 'cost', 'evaluations', 'done', 'status'; None if it was not begun."""
        return self.starts.get(key)

    def put(self, key: str, q, cost: float, evaluations: int, done: bool = False, status: str = "") -> None:
        """Note the last accepted iterate of a start and write the file atomically."""
        self.starts[key] = {
            "q": [float(v) for v in np.atleast_1d(q)],
            "cost": float(cost),
            "evaluations": int(evaluations),
            "done": done,
            "status": status,
        }
        if self.path is None:
            return
        self.path.parent.mkdir(parents=True, exist_ok=True)
        partial = self.path.with_name(self.path.name + ".part")
        state = {"version": VERSION, "signature": self.signature, "starts": self.starts}
        with open(partial, "w", encoding="utf-8") as stream:
            json.dump(state, stream, indent=1)
            stream.flush()
            os.fsync(stream.fileno())
        partial.replace(self.path)
