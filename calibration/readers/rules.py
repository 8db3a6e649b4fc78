"""From raw readings to a curve: tare, slack, branch, and the check that a loading branch extends.

The order is fixed: branch, tare, slack, retreat, upper limit. Every rule leaves a sentence in ``Experiment.notes``.
Nothing is smoothed and no reading is moved but by the two constants tare and zero.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from mfar_fem.errors import DataFileError, InputError

TARES = ("none", "first-readings")
SLACKS = ("none", "nominal", "preload")


@dataclass(frozen=True)
class Rules:
    """How raw readings become a curve.

    Parameters
    ----------
    tare : {'none', 'first-readings'}
        'first-readings' subtracts the median force of the first ``tare_readings`` readings of the branch, taken
        while the specimen still hangs slack.
    tare_readings : int
    slack : {'none', 'nominal', 'preload'}
        Where strain is zero. 'none': as recorded. 'nominal': where the clamps are the nominal gauge length apart;
        readings before it are slack and dropped, strain = (distance - gauge) / gauge. 'preload': where the line force
        first exceeds ``preload``; the gauge length becomes the clamp distance there, readings before it are dropped and
        the preload stays in the force.
    preload : float
        N/m.
    retreat_tolerance : float
        As a fraction of the branch's range. A loading branch may fall behind its running maximum by so much
        (encoder jitter); such readings are dropped. A larger retreat is an error.
    max_force, max_strain : float
        Readings after the first that exceeds it are dropped.
    """

    tare: str = "none"
    tare_readings: int = 5
    slack: str = "none"
    preload: float = 0.0
    retreat_tolerance: float = 0.005
    max_force: float = np.inf
    max_strain: float = np.inf

    def __post_init__(self) -> None:
        if self.tare not in TARES:
            raise InputError(f"unknown tare rule '{self.tare}'; known: {', '.join(TARES)}")
        if self.slack not in SLACKS:
            raise InputError(f"unknown slack rule '{self.slack}'; known: {', '.join(SLACKS)}")
        if self.tare_readings < 1:
            raise InputError(f"tare_readings is {self.tare_readings}; at least 1 is needed")
        if not 0 <= self.retreat_tolerance < 1:
            raise InputError(f"retreat_tolerance is {self.retreat_tolerance:g}; it is a fraction between 0 and 1")
        if self.slack == "preload" and not self.preload > 0:
            raise InputError("slack = 'preload' needs a positive preload, for instance preload = \"0.5 N/m\"")


def split_branches(extension: np.ndarray, tolerance: float = 0.02) -> list[slice]:
    """Alternate loading and unloading branches of one continuous record.

    A turn counts once the extension has come back by ``tolerance`` of the whole range: jitter splits no branch.

    Returns
    -------
    list of slice
        Even entries load, odd ones unload; neighbours share the turning reading.
    """
    extension = np.asarray(extension, float)
    limit = tolerance * np.ptp(extension)
    turns, sign, extreme = [0], 1.0, 0
    for i, value in enumerate(extension):
        if sign * (value - extension[extreme]) >= 0:
            extreme = i
        elif sign * (extension[extreme] - value) > limit:
            turns.append(extreme)
            sign, extreme = -sign, i
    turns.append(len(extension) - 1)
    return [slice(a, b + 1) for a, b in itertools.pairwise(turns)]


def check_finite_positive(value: float, key: str, path=None, line: int | None = None) -> float:
    """The value, or a DataFileError that names key and place."""
    if not (np.isfinite(value) and value > 0):
        raise DataFileError(f"{key} is {value:g} in SI units; it must be positive", path, line, key)
    return value


def apply_rules(
    strain: np.ndarray,
    force: np.ndarray,
    gauge: float,
    rules: Rules,
    *,
    path=None,
    lines: np.ndarray | None = None,
    column: str | None = None,
) -> tuple[np.ndarray, np.ndarray, float, list[str]]:
    """Apply tare, slack, retreat and limits to one loading branch.

    Parameters
    ----------
    strain : ndarray, shape (m,)
        (distance - gauge) / gauge, or the recorded strain.
    force : ndarray, shape (m,)
        N/m.
    gauge : float
        Nominal gauge length, m.
    path, lines, column
        For the error messages: the file, the line of every reading and the extension column's name.

    Returns
    -------
    strain, force : ndarray, shape (k,)
    gauge : float
        Gauge length that the strain refers to, m.
    notes : list of str
    """
    strain, force, notes = np.array(strain, float), np.array(force, float), []
    lines = np.full(strain.size, -1) if lines is None else np.asarray(lines)
    if rules.tare == "first-readings":
        tare = float(np.median(force[: rules.tare_readings]))
        force = force - tare
        notes.append(f"tare {tare:.4g} N/m (median of the first {rules.tare_readings} readings) subtracted")
    if rules.slack == "nominal":
        keep = strain >= 0
        notes.append(f"{int((~keep).sum())} slack readings below the nominal gauge length dropped")
    elif rules.slack == "preload":
        over = np.flatnonzero(force > rules.preload)
        if over.size == 0:
            raise DataFileError(
                f"the line force never exceeds the preload of {rules.preload:g} N/m", path, column=column
            )
        zero = strain[over[0]]
        keep = np.arange(strain.size) >= over[0]
        strain, gauge = (strain - zero) / (1 + zero), gauge * (1 + zero)
        notes.append(f"zero strain at the preload {rules.preload:g} N/m, gauge length there {1e3 * gauge:.4g} mm")
    else:
        keep = np.ones(strain.size, bool)
    strain, force, lines = strain[keep], force[keep], lines[keep]
    if strain.size < 2:
        raise DataFileError(f"{strain.size} readings left after the slack rule '{rules.slack}'", path, column=column)
    strain, force, note = _forward_only(strain, force, rules.retreat_tolerance, path, lines, column)
    notes += note
    over = np.flatnonzero((force > rules.max_force) | (strain > rules.max_strain))
    if over.size:
        notes.append(f"{strain.size - over[0]} readings past the limit dropped")
        strain, force = strain[: over[0]], force[: over[0]]
    if strain.size < 3:
        raise DataFileError(f"only {strain.size} usable readings; a curve needs at least 3", path, column=column)
    return strain, force, gauge, notes


def _forward_only(strain, force, tolerance, path, lines, column):
    span = np.ptp(strain)
    before = np.maximum.accumulate(strain)
    retreat = before - strain
    worst = int(np.argmax(retreat > tolerance * span)) if (retreat > tolerance * span).any() else -1
    if span == 0:
        raise DataFileError("the extension never changes", path, int(lines[0]) if lines[0] > 0 else None, column)
    if worst >= 0:
        raise DataFileError(
            f"the extension falls back by {retreat[worst] / span:.2%} of its range on a loading branch (tolerance "
            f"{tolerance:.2%}); select one branch with [branch] cycle = N, or raise rules.retreat_tolerance",
            path,
            int(lines[worst]) if lines[worst] > 0 else None,
            column,
        )
    keep = np.ones(strain.size, bool)
    keep[1:] = strain[1:] > before[:-1]
    dropped = int((~keep).sum())
    note = (
        [f"{dropped} readings that did not advance (jitter within {tolerance:.2%} of the range) dropped"]
        if dropped
        else []
    )
    return strain[keep], force[keep], note
