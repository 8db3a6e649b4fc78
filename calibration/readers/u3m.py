"""Reader of the U3M/FAB physics JSON (open format; fabric tester with clamps at 2 and 8 cm).

``raw_data.<axis>.<test>.samplesTree`` is a list of branches, loading and unloading in turn; each is a flat list
``[distance, force, distance, force, ...]`` with the clamp distance in cm and the force in gram-force. Axes are
L (length, warp), W (width, weft) and B (45° bias); S1 and S2 are stretch tests at the nominal clamp distances
``length`` of about 2 and 8 cm. The record begins slack, with the clamps closer than ``length``. Loop-bending tests
(U1, D1, D2) are not read.

Source of the format: github.com/vizoogmbh/u3m, folder u3m1.1/physics.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from calibration.experiments import DIRECTIONS, Dataset, Experiment
from calibration.readers.rules import Rules, apply_rules
from mfar_fem.errors import DataFileError, UnknownNameError

AXES = {"L": "warp", "W": "weft", "B": "bias"}
GAUGES = {"S1": "2 cm", "S2": "8 cm"}
CM, GF = 1e-2, 9.80665e-3  # m, N (gram-force with the standard acceleration of gravity)
VARIANTS = {
    "preconditioned": "loading branch of the last cycle, after the earlier cycles have worked the cloth",
    "virgin": "loading branch of cycle 1",
    "envelope": "first-time loading: cycle 1, then of each later cycle only the readings above every force reached "
    "before. It is no single pull: between its parts the cloth was unloaded, so it lies a little below a true "
    "virgin curve",
}
RULES = Rules(tare="first-readings", slack="nominal")


def raw_branches(document: dict, axis: str, test: str, path=None) -> tuple[list[np.ndarray], float, float]:
    """Branches of one test.

    Returns
    -------
    branches : list of ndarray, shape (m, 2)
        Clamp distance (m) and force (N), verbatim; even entries load, odd ones unload.
    gauge, width : float
        Nominal clamp distance and width, m.
    """
    place = f"raw_data.{axis}.{test}"
    try:
        block = document["raw_data"][axis][test]
        gauge, width, tree = float(block["length"]) * CM, float(block["width"]) * CM, block["samplesTree"]
    except (KeyError, TypeError, ValueError) as error:
        raise DataFileError(f"no usable block {place} (missing or malformed: {error})", path) from None
    branches = []
    for k, flat in enumerate(tree):
        values = np.asarray(flat, dtype=float)
        if values.ndim != 1 or values.size % 2 or values.size == 0:
            raise DataFileError(f"{place}.samplesTree[{k}] is not a list of [distance, force] pairs", path)
        if not np.isfinite(values).all():
            raise DataFileError(f"{place}.samplesTree[{k}] holds a value that is not finite", path)
        branches.append(values.reshape(-1, 2) * (CM, GF))
    if not branches:
        raise DataFileError(f"{place}.samplesTree is empty", path)
    for key, value in (("length", gauge), ("width", width)):
        if not value > 0:
            raise DataFileError(f"{place}.{key} is {value / CM:g} cm; it must be positive", path)
    return branches, gauge, width


def loading_curve(branches, gauge: float, width: float, cycle: int | str, rules: Rules = RULES, path=None):
    """Strain and line force of a cycle's loading branch (1-based; 'last'), or of the 'envelope' of first-time loading.

    Returns strain (m,), force (m,) in N/m, gauge in m, notes, and where each reading stands, (m, 2): branch, reading.
    """
    loads = branches[0::2]
    if cycle != "envelope":
        k = len(loads) if cycle == "last" else int(cycle)
        if not 1 <= k <= len(loads):
            raise DataFileError(f"cycle {cycle} does not exist; there are {len(loads)}", path)
        return _curve(loads[k - 1], 2 * (k - 1), gauge, width, rules, path)
    strain: list[np.ndarray] = []
    force, index, notes, reached = [], [], [], -np.inf
    for k in range(len(loads)):
        e, f, length, note, ids = _curve(loads[k], 2 * k, gauge, width, rules, path)
        new = f > reached
        if strain:
            new &= e > strain[-1][-1]
        if new.any():
            strain.append(e[new])
            force.append(f[new])
            index.append(ids[new])
            notes.append(f"cycle {k + 1}: {int(new.sum())} readings of first-time loading; {'; '.join(note)}")
        peak = max(f.max(), (branches[2 * k + 1][:, 1].max() / width) if 2 * k + 1 < len(branches) else -np.inf)
        reached = max(reached, peak)
    return np.concatenate(strain), np.concatenate(force), length, notes, np.concatenate(index)


def _curve(readings, branch, gauge, width, rules, path):
    strain = readings[:, 0] / gauge - 1
    force = readings[:, 1] / width
    e, f, length, notes = apply_rules(strain, force, gauge, rules, path=path)
    rank = {value: i for i, value in reversed(list(enumerate(strain)))}
    zero = (length - gauge) / gauge
    ids = np.array([[branch, rank.get(v, int(np.argmin(abs(strain - v * (1 + zero) - zero))))] for v in e])
    return e, f, length, notes, ids


def read_u3m(
    path: str | Path, variant: str = "preconditioned", rules: Rules = RULES, *, cycle: int | str | None = None
) -> Dataset:
    """Read the strip tests of a U3M/FAB file.

    The 8 cm strips (S2) have role 'fit', the 2 cm strips (S1) role 'check'. Rules by default: tare = median of the
    first 5 readings of the branch, strain against the nominal clamp distance, readings before it dropped as slack.

    Parameters
    ----------
    path : path-like
    variant : {'preconditioned', 'virgin', 'envelope'}
    rules : Rules
    cycle : int, optional
        Loading branch of this cycle instead of the variant's.
    """
    path = Path(path)
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise DataFileError("there is no such file", path) from None
    except json.JSONDecodeError as error:
        raise DataFileError(f"not valid JSON: {error.msg}", path, error.lineno) from None
    if not isinstance(document, dict) or not isinstance(document.get("raw_data"), dict):
        raise DataFileError("not a U3M/FAB physics file: there is no 'raw_data' object", path)
    if variant not in VARIANTS:
        raise UnknownNameError(f"unknown variant '{variant}'; known: {', '.join(VARIANTS)}")
    cycles: dict[str, int | str] = {"preconditioned": "last", "virgin": 1, "envelope": "envelope"}
    which = cycle if cycle is not None else cycles[variant]
    raw, experiments = document["raw_data"], []
    citation = f"{path.name} (U3M/FAB JSON), raw_data"
    for test in ("S2", "S1"):
        for axis, name in AXES.items():
            if test not in raw.get(axis, {}):
                continue
            branches, gauge, width = raw_branches(document, axis, test, path)
            e, f, gauge, notes, _ = loading_curve(branches, gauge, width, which, rules, path)
            experiments.append(
                Experiment(
                    name=f"{name}, {GAUGES[test]} gauge",
                    x=e,
                    y=f,
                    direction=DIRECTIONS[name],
                    gauge=gauge,
                    width=width,
                    specimen=f"{axis}{test}",
                    role="fit" if test == "S2" else "check",
                    citation=f"{citation}.{axis}.{test}, {variant if cycle is None else f'cycle {cycle}'}",
                    notes=tuple(notes),
                )
            )
    if not experiments:
        raise DataFileError("no stretch test S1 or S2 under raw_data.L, .W or .B", path)
    if all(e.role == "check" for e in experiments):
        experiments = [replace(e, role="fit") for e in experiments]
    vendor = document.get("custom", {}).get("browzwear", {})
    thickness, mass = (float(vendor.get(key) or 0.0) for key in ("thickness", "mass"))  # mm, g/m²
    return Dataset(
        name=str(vendor.get("name") or path.stem),
        experiments=tuple(experiments),
        citation=citation,
        variant=variant,
        variants=tuple(VARIANTS),
        description=VARIANTS[variant],
        thickness=thickness * 1e-3 if thickness else None,
        areal_density=mass * 1e-3 if mass else None,
        sources={k: f"{path.name}, custom.browzwear" for k in ("thickness", "areal_density")},
    )
