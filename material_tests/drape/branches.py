"""The branch table: many starts, each relaxed to its own rest state, because a drape has no one answer.

Every finished branch is appended to a file of JSON lines at once, keyed by a hash of all that went into it: a killed run loses the
branches in progress, and the next one takes up the rest.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from material_tests.drape.fe import OPTIONS, Seed, drape
from material_tests.drape.geometry import DrapeTest
from mfar_fem.errors import InputError
from mfar_fem.processes import side_by_side

FOLDS = tuple(range(2, 11))
FLAT = (1, 2, 3)
FALLS = (1,)
FORMAT = 2
"""Counts changes of what a stored branch means; a stored one of another format is not used."""


def default_seeds(folds: Sequence[int] = FOLDS, flat: Sequence[int] = FLAT, falls: Sequence[int] = FALLS,
                  amplitude: float = 1e-3) -> list[Seed]:
    """Starts with n folds, and nearly flat ones with recorded random seeds: relaxed, and let fall through air."""
    return [*(Seed("fall", n, amplitude) for n in falls), *(Seed("folds", n) for n in folds),
            *(Seed("flat", n, amplitude) for n in flat)]


@dataclass(frozen=True)
class BranchTable:
    """Rest states of one fabric and test.

    Attributes
    ----------
    rows : tuple of dict
        :meth:`material_tests.drape.fe.Drape.row` of every start, with ``reused``.
    wall_s : float
    """

    rows: tuple[dict[str, Any], ...]
    wall_s: float

    @property
    def physical(self) -> list[dict[str, Any]]:
        """Branches at rest, stable and not through themselves, lowest energy first."""
        return sorted((row for row in self.rows if row["physical"]), key=lambda row: row["energy_J"])

    @property
    def lowest(self) -> dict[str, Any] | None:
        """The physical branch of lowest energy."""
        return next(iter(self.physical), None)

    @property
    def fallen(self) -> dict[str, Any] | None:
        """The branch a true fall from flat reaches (where none was computed or physical: the first relaxed from flat)."""
        flat = [row for kind in ("fall", "flat") for row in self.rows if row["kind"] == kind and row["physical"]]
        return next(iter(flat), None)

    def spread(self) -> dict[str, tuple[float, float]]:
        """Least and largest coefficient (%), nodes and energy (J) of the physical branches."""
        names = ("drape_coefficient_percent", "nodes", "energy_J")
        return {n: (min(r[n] for r in self.physical), max(r[n] for r in self.physical)) for n in names} if self.physical else {}


def branch_table(fabric, test: DrapeTest | None = None, starts: Sequence[Seed] | None = None, out: Path | str | None = None,
                 workers: int = 2, self_contact: bool = False,
                 progress: Callable[[int, int, dict[str, Any]], None] | None = None) -> BranchTable:
    """Relax many starts.

    Parameters
    ----------
    fabric : Fabric
    test : DrapeTest
    starts : sequence of Seed
        Default: :func:`default_seeds`.
    out : path, optional
        Folder of ``branches.jsonl``; what it already holds of this fabric and test is reused.
    workers : int
        Processes.
    self_contact : bool
    progress : callable, optional
        ``progress(done, total, row)`` after every branch.

    Raises
    ------
    InputError
        Fewer than one worker; the folder cannot be written.
    """
    if workers < 1:
        raise InputError(f"a branch table needs at least one worker, not {workers}")
    clock = time.perf_counter()
    test, starts = test or DrapeTest(), list(default_seeds() if starts is None else starts)
    keys = [branch_key(fabric, test, seed, self_contact) for seed in starts]
    path = None if out is None else Path(out) / "branches.jsonl"
    known = {} if path is None else read_branches(path)
    rows = {key: known[key] | {"reused": True} for key in keys if key in known}
    todo = {key: seed for key, seed in zip(keys, starts, strict=True) if key not in rows}
    done = 0
    for done, row in enumerate(rows.values(), 1):
        if progress is not None:
            progress(done, len(keys), row)
    for key, row in side_by_side(_branch, {key: (fabric, test, seed, self_contact) for key, seed in todo.items()}, workers):
        if path is not None:
            _append(path, key, row)
        rows[key] = row | {"reused": False}
        done += 1
        if progress is not None:
            progress(done, len(keys), rows[key])
    return BranchTable(tuple(rows[key] for key in keys), time.perf_counter() - clock)


def _branch(fabric, test, seed, self_contact) -> dict[str, Any]:
    return drape(fabric, test, seed, self_contact=self_contact).row()


def branch_key(fabric, test: DrapeTest, seed: Seed, self_contact: bool = False) -> str:
    """Hash of all that decides a branch."""
    bending, law = fabric.bending, fabric.law
    cloth = [law.name, dict(law.values), fabric.thickness, fabric.areal_density, bending.matrix.tolist()]
    content = [FORMAT, cloth, test.size, test.mesh, asdict(seed), asdict(OPTIONS), self_contact]
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()[:16]


def read_branches(path: Path) -> dict[str, dict[str, Any]]:
    """Stored branches by key; a last line cut short by a kill is left out."""
    rows: dict[str, dict[str, Any]] = {}
    if not path.exists():
        return rows
    for line in path.read_text(encoding="utf-8").splitlines():
        with contextlib.suppress(json.JSONDecodeError, KeyError):
            stored = json.loads(line)
            rows[stored["key"]] = stored["row"]
    return rows


def _append(path: Path, key: str, row: dict[str, Any]) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        cut = path.exists() and not path.read_bytes().endswith(b"\n") and path.stat().st_size > 0
        with path.open("a", encoding="utf-8") as stream:
            stream.write(("\n" if cut else "") + json.dumps({"key": key, "row": row}) + "\n")
    except OSError as error:
        raise InputError(f"cannot write the branches to '{path}': {error.strerror or error}") from error
