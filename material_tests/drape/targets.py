"""Measured drapes to compare with: the figures of ``targets.csv`` by quantity and specimen."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from mfar_fem.errors import DataFileError

OUTLINES = Path(__file__).resolve().parents[3] / "shared" / "data" / "drape" / "leeds_cusick_outline_radius_mm.csv"
"""Outlines derived from the silhouettes of Gong, Mao, Wang, CVPR 2024, arXiv:2402.17664; not part of this package."""

LEEDS = {
    "cotton white": ("Leeds cotton white 59 g/m2", 0.059),
    "cotton pink": ("Leeds cotton pink 114 g/m2", 0.114),
    "cotton blue": ("Leeds cotton blue 192 g/m2", 0.192),
    "viscose white": ("Leeds viscose white 213 g/m2", 0.213),
    "wool red": ("Leeds wool red 274 g/m2", 0.274),
}
"""Named Leeds fabrics: specimen in the table and mass by area, kg/m²."""


@dataclass(frozen=True)
class Target:
    """One row: value with its range (None where not given), unit, kind and source."""

    quantity: str
    specimen: str
    value: float | None
    lower: float | None
    upper: float | None
    unit: str
    kind: str
    source: str


@cache
def targets() -> tuple[Target, ...]:
    """All rows of ``targets.csv``."""
    text = (Path(__file__).parent / "targets.csv").read_text(encoding="utf-8").splitlines()
    rows = csv.DictReader(line for line in text if not line.startswith("#"))
    found = []
    for r in rows:
        value, lower, upper = (float(r[k]) if r[k] else None for k in ("value", "lower", "upper"))
        found.append(Target(r["quantity"], r["specimen"], value, lower, upper, r["unit"], r["kind"], r["source"]))
    return tuple(found)


def measured(specimen: str, quantity: str = "drape coefficient") -> Target | None:
    """The row of a specimen, or None."""
    return next((t for t in targets() if t.specimen == specimen and t.quantity == quantity), None)


def measured_outlines(fabric: int, path: Path | str | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Outlines (k, 180), m, and nodes (k,) of a numbered Leeds fabric, one row a capture; their rotation is arbitrary.

    Raises
    ------
    DataFileError
        The file is absent, or has no such fabric.
    """
    path = OUTLINES if path is None else Path(path)
    if not path.exists():
        raise DataFileError("the measured outlines are not here; they derive from Gong, Mao, Wang 2024, arXiv:2402.17664", path)
    with path.open(encoding="utf-8") as stream:
        rows = [r for r in csv.DictReader(line for line in stream if not line.startswith("#")) if r["fabric_no"] == str(fabric)]
    if not rows:
        raise DataFileError(f"no fabric {fabric}", path, column="fabric_no")
    radii = [[float(r[f"r{angle:03d}"] or "nan") for angle in range(0, 360, 2)] for r in rows]
    good = ~np.isnan(np.array(radii)).any(axis=1)
    return 1e-3 * np.array(radii)[good], np.array([int(r["nodes_prom4mm"]) for r in rows])[good]
