"""Files of a run: history, checkpoint, VTU series with its index, last state. Each is whole whenever the process is killed."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import DataFileError
from mfar_fem.files import replace_file
from mfar_fem.surface.io import write_mesh
from mfar_fem.surface.mesh import Surface

HISTORY = (
    "time",
    "dt",
    "iterations",
    "residual",
    "residual_relative",
    "kinetic",
    "membrane",
    "bending",
    "potential",
    "contact",
    "dissipated",
    "defect",
    "speed",
    "error",
    "contacts",
    "distance",
)


class History:
    """``history.csv``: one row a step, on disk when the step is done."""

    def __init__(self, path: Path, until: float | None = None):
        kept: list[list[str]] = []
        if until is not None and path.exists():  # a resumed run: rows after its checkpoint are computed again
            with path.open(newline="", encoding="utf-8") as f:
                kept = [row for row in list(csv.reader(f))[1:] if len(row) == len(HISTORY) and float(row[0]) <= until * (1 + 1e-12)]
        self.rows = [{k: float(v) for k, v in zip(HISTORY, row, strict=True) if v} for row in kept]

        def write(partial: Path) -> None:
            with partial.open("w", newline="", encoding="utf-8") as f:
                csv.writer(f).writerows([HISTORY, *kept])

        replace_file(path, write)
        self._file = path.open("a", newline="", encoding="utf-8")
        self._writer = csv.writer(self._file)

    def add(self, row: Mapping[str, float]) -> None:
        """One step."""
        self.rows.append(dict(row))
        self._writer.writerow([repr(row[k]) if k in row else "" for k in HISTORY])
        self._file.flush()

    def close(self) -> None:
        """Done."""
        self._file.close()


def save_checkpoint(path: Path, state: Mapping[str, np.ndarray], identity: str) -> None:
    """Everything a resumed run needs; the old checkpoint stays until the new one is complete."""
    named: dict[str, Any] = dict(state)
    replace_file(path, lambda partial: np.savez(partial, identity=np.array(identity), **named))


def load_checkpoint(path: Path, identity: str) -> dict[str, np.ndarray]:
    """The state of a checkpoint.

    Raises
    ------
    DataFileError
        There is none, it is damaged, or it belongs to another scene or level.
    """
    if not path.is_file():
        raise DataFileError("there is no checkpoint to resume from: run without --resume", path=path)
    try:
        with np.load(path, allow_pickle=False) as data:
            state = {k: data[k] for k in data.files}
    except (OSError, ValueError, EOFError) as error:
        raise DataFileError(f"is not a readable checkpoint ({error})", path=path) from error
    if str(state.pop("identity", "")) != identity:
        raise DataFileError(
            "belongs to another scene, fabric or level of effort: choose another --out, or run without --resume", path=path
        )
    return state


class Series:
    """VTU files and their index ``series.pvd``."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.entries: list[tuple[int, float]] = []
        folder.mkdir(parents=True, exist_ok=True)

    def add(
        self,
        number: int,
        time: float,
        surface: Surface,
        nodes: np.ndarray,
        velocities: np.ndarray,
        fields: Mapping[str, np.ndarray],
    ) -> Path:
        """Write frame ``number``; order-2 sheets as their flat sub-triangles."""
        points, triangles, parent = flat(surface, nodes)
        path = self.folder / f"frame-{number:05d}.vtu"
        data = {name: np.asarray(values)[parent] for name, values in fields.items()}
        replace_file(path, lambda partial: write_mesh(partial, points, triangles, {"velocity": velocities[: len(points)]}, data))
        self.note(number, time)
        return path

    def note(self, number: int, time: float) -> None:
        """List a frame in the index."""
        self.entries = [e for e in self.entries if e[0] < number] + [(number, time)]
        rows = "\n".join(
            f'    <DataSet timestep="{t!r}" part="0" file="{self.folder.name}/frame-{n:05d}.vtu"/>' for n, t in self.entries
        )
        head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n  <Collection>\n'
        text = f"{head}{rows}\n  </Collection>\n</VTKFile>\n"
        replace_file(self.folder.parent / "series.pvd", lambda partial: partial.write_text(text, encoding="utf-8"))


def flat(surface: Surface, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points, flat triangles and the element each belongs to: elements of order 2 are cut in four."""
    if len(nodes) == len(surface.vertices):
        return nodes, surface.triangles, np.arange(len(surface.triangles))
    e = surface.elements
    parts = [e[:, [0, 3, 5]], e[:, [3, 1, 4]], e[:, [5, 4, 2]], e[:, [3, 4, 5]]]
    return nodes, np.concatenate(parts), np.tile(np.arange(len(e)), 4)


def save_json(path: Path, payload: Mapping[str, Any]) -> None:
    """A JSON file, replaced at once."""
    from mfar_fem.cli.console import jsonable

    text = json.dumps(jsonable(payload), indent=2, allow_nan=False) + "\n"
    replace_file(path, lambda partial: partial.write_text(text, encoding="utf-8"))
