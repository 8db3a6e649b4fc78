"""A table of numbers in a text file, with the line of every row kept for the error messages."""

from __future__ import annotations

import csv
import difflib
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mfar_fem.errors import DataFileError


@dataclass(frozen=True)
class Table:
    """Rows of text under a header; ``lines[i]`` is the 1-based line of row i in the file."""

    path: Path
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: np.ndarray

    def column_index(self, name: str) -> int:
        """Index of a column; an unknown name is an error that suggests close ones."""
        if name in self.header:
            return self.header.index(name)
        near = difflib.get_close_matches(name, self.header, n=3, cutoff=0.4)
        hint = f"did you mean {' or '.join(repr(n) for n in near)}? " if near else ""
        raise DataFileError(f"no such column; {hint}columns are: {', '.join(self.header)}", self.path, column=name)

    def where(self, conditions: dict[str, object]) -> Table:
        """Rows whose columns have the values asked for (numbers compared as numbers, the rest as text)."""
        keep = np.ones(len(self.rows), bool)
        for name, wanted in conditions.items():
            i = self.column_index(name)
            hits = np.array([_equal(row[i], wanted) for row in self.rows])
            if not hits.any():
                values = sorted({row[i] for row in self.rows})
                shown = ", ".join(values[:8]) + (", ..." if len(values) > 8 else "")
                raise DataFileError(f"no row with the value '{wanted}'; values are: {shown}", self.path, column=name)
            keep &= hits
        if not keep.any():
            text = ", ".join(f"{k} = {v}" for k, v in conditions.items())
            raise DataFileError(f"no row fulfils {text} together", self.path)
        return Table(
            self.path, self.header, tuple(r for r, k in zip(self.rows, keep, strict=True) if k), self.lines[keep]
        )

    def numbers(self, name: str) -> np.ndarray:
        """A column as floats, shape (rows,); empty cells, text, NaN and infinity are errors with their line."""
        i = self.column_index(name)
        out = np.empty(len(self.rows))
        for k, row in enumerate(self.rows):
            line = int(self.lines[k])
            try:
                out[k] = float(row[i])
            except ValueError:
                text = row[i].strip()
                why = "the cell is empty" if not text else f"'{text}' is not a number"
                if "," in text:
                    why += " (a decimal comma? write a decimal point)"
                raise DataFileError(why, self.path, line, name) from None
            if not math.isfinite(out[k]):
                raise DataFileError(
                    f"the value is {row[i].strip()}; every reading must be finite", self.path, line, name
                )
        return out


def _equal(cell: str, wanted: object) -> bool:
    if isinstance(wanted, str):
        return cell.strip() == wanted
    try:
        return float(cell) == float(wanted)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return False


def read_table(path: str | Path) -> Table:
    """Read a CSV with a header line; lines that begin with '#' and blank lines are skipped.

    The delimiter is the one of ``, ; tab`` that occurs most often in the header.

    Raises
    ------
    DataFileError
        Missing or empty file, no data row, repeated column name, or a row with another number of cells (with its line).
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise DataFileError("there is no such file", path) from None
    except (OSError, UnicodeDecodeError) as error:
        raise DataFileError(f"the file cannot be read as UTF-8 text ({error})", path) from None
    numbered = [
        (k, line) for k, line in enumerate(text.splitlines(), 1) if line.strip() and not line.lstrip().startswith("#")
    ]
    if not numbered:
        raise DataFileError("the file is empty; expected a header line with column names and then readings", path)
    delimiter = max(",;\t", key=numbered[0][1].count)
    cells = [tuple(c.strip() for c in row) for row in csv.reader((line for _, line in numbered), delimiter=delimiter)]
    header = cells[0]
    if len(cells) < 2:
        raise DataFileError("there is a header but no reading", path, numbered[0][0])
    if len(set(header)) < len(header):
        raise DataFileError(f"a column name is repeated: {', '.join(header)}", path, numbered[0][0])
    for (line, _), row in zip(numbered[1:], cells[1:], strict=True):
        if len(row) != len(header):
            raise DataFileError(f"{len(row)} cells, but the header has {len(header)}", path, line)
    return Table(path, header, tuple(cells[1:]), np.array([k for k, _ in numbered[1:]]))
