"""Rows of the figures: a value with its interval, of something, by a method."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mfar_fem.errors import InputError
from reconstruction.report.content import Table


@dataclass(frozen=True)
class Estimate:
    """A value with its interval.

    Attributes
    ----------
    of : str
        Garment, keypoint, pair or group of features.
    method : str
    value : float
    low, high : float, optional
        Ends of the interval; both or none.
    n : int, optional
        Number of independent cases behind it.

    Raises
    ------
    InputError
        A value or an end that is not finite, one end alone, or a value outside its interval.
    """

    of: str
    method: str
    value: float
    low: float | None = None
    high: float | None = None
    n: int | None = None

    def __post_init__(self):
        where = f"'{self.of}' by '{self.method}'"
        if (self.low is None) != (self.high is None):
            raise InputError(f"the interval of {where} has one end; give both or none")
        ends = (self.value, *(() if self.low is None else (self.low, self.high)))
        if not all(math.isfinite(x) for x in ends):
            raise InputError(f"{where} is {ends}; leave out what has no value")
        if self.low is not None and not self.low - 1e-9 <= self.value <= self.high + 1e-9:
            raise InputError(f"the value of {where}, {self.value:g}, lies outside its interval {self.low:g} to {self.high:g}")

    def words(self, unit: str = "") -> str:
        """As in a sentence."""
        interval = "" if self.low is None else f" ({self.low:.3g} to {self.high:.3g})"
        return f"{self.of}, {self.method}: {self.value:.3g}{unit}{interval}"


def ordered(rows: Sequence[Estimate]) -> tuple[list[str], list[str]]:
    """Things and methods in the order in which they first appear.

    Raises
    ------
    InputError
        No rows, or two of the same thing and method.
    """
    if not rows:
        raise InputError("a figure needs at least one row")
    seen = set()
    for r in rows:
        if (r.of, r.method) in seen:
            raise InputError(f"two rows are of '{r.of}' by '{r.method}'")
        seen.add((r.of, r.method))
    return list(dict.fromkeys(r.of for r in rows)), list(dict.fromkeys(r.method for r in rows))


def estimate_table(rows: Sequence[Estimate], quantity: str, paper: Mapping[str, Mapping[str, float]] | None = None,
                   caption: str = "", level: str = "95 %") -> Table:
    """The rows of a figure as a table, for who cannot see it or wants the digits.

    Parameters
    ----------
    rows : sequence of Estimate
    quantity : str
        With its unit, the head of the values.
    paper : mapping, optional
        Of method and thing to what the paper prints.
    caption : str
    level : str
        Of the intervals.
    """
    ordered(rows)
    columns = ["of", "method", quantity, f"{level} interval", "cases"]
    body: list[list[object]] = [
        [r.of, r.method, float(r.value), "none" if r.low is None else f"{r.low:.3g} to {r.high:.3g}", r.n] for r in rows
    ]
    if paper is not None:
        columns.append("paper, other data")
        for row, r in zip(body, rows, strict=True):
            row.append(paper.get(r.method, {}).get(r.of))
    return Table(columns, body, caption)


def time_table(rows: Mapping[str, tuple[float, float | None]], machine: str) -> Table:
    """Table 2: time for one garment, beside the paper's.

    Parameters
    ----------
    rows : mapping of str to (float, float or None)
        By method: reconstruction, simulation (None if there was none), s.
    machine : str
        What these times are of: cores, kind.
    """
    from reconstruction.report import paper

    body: list[list[object]] = []
    for method, (first, second) in rows.items():
        body.append([method, f"{first:.1f}", None if second is None else f"{second:.1f}",
                     None if second is None else f"{first + second:.1f}", machine])  # fmt: skip
    for method, times in paper.TIMES_S.items():
        body.append([method, *(f"{t:.1f}" for t in times), f"{paper.LABEL}: 18 cores and a P100"])
    return Table(["method", "reconstruction, s", "simulation, s", "both, s", "machine"], body, "Time for one garment (Table 2)")
