"""Checkpoints read back, and a log in CSV that a continued run goes on writing."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

from mfar_fem.errors import DataFileError
from reconstruction.torch_library import torch


def load_checkpoint(path: Path) -> dict:
    """A dictionary written by :func:`reconstruction.state_dict.save_state` (only tensors and plain containers are unpickled).

    Raises
    ------
    DataFileError
        It cannot be read.
    """
    try:
        return torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # torch raises pickle, zip, EOF and runtime errors of its own
        raise DataFileError("is not a checkpoint that can be read; remove it to start again", path=path) from error


class CsvLog:
    """Rows of numbers by step.

    Parameters
    ----------
    path : pathlib.Path
    columns : sequence of str
        After ``step``.
    start : int
        Step at which the run goes on; rows from there on, of a run that was killed after its checkpoint, are dropped.
    """

    def __init__(self, path: Path, columns: Sequence[str], start: int = 0):
        self.path, self.columns = path, ("step", *columns)
        kept = [row for row in read_log(path) if int(row["step"]) < start] if start and path.is_file() else []
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, self.columns)
            writer.writeheader()
            writer.writerows(kept)

    def write(self, step: int, values: Mapping[str, float]) -> None:
        """Append one row; floats with all their digits."""
        with self.path.open("a", newline="", encoding="utf-8") as file:
            csv.DictWriter(file, self.columns).writerow({"step": step, **{k: repr(float(v)) for k, v in values.items()}})


def read_log(path: Path) -> list[dict[str, str]]:
    """Rows of a log as text."""
    with Path(path).open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))
