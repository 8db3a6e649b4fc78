"""Regenerate the figures of ``cupro_su1098/`` from the raw U3M/FAB record.

    python -m calibration.datasets.make_cupro PATH/physics_example2.json [OUT_FOLDER]

The record is not part of this package: github.com/vizoogmbh/u3m at 7ea8941, u3m1.1/physics/physics_example2.json
(BSD-3-Clause). Kept are about 20 readings a curve: those nearest to stations equally spaced along the arc length of the
curve, both axes scaled to 1, so that toe and steep end of the J are resolved alike. Readings are kept as recorded
after tare and zero (see `calibration.readers.rules`), rounded to 5 digits: nothing is interpolated or smoothed.
"""

from __future__ import annotations

import csv
import json
import sys
from pathlib import Path

import numpy as np

from calibration.readers.u3m import AXES, GAUGES, loading_curve, raw_branches

CITATION = (
    "SU-1098 Cupro; Vizoo GmbH (2019), U3M example data, Browzwear FAB tester; github.com/vizoogmbh/u3m 7ea8941 "
    "u3m1.1/physics/physics_example2.json, BSD-3-Clause; raw_data.{axis}.{test}.samplesTree[{branch}] reading {reading}"
)
CYCLES: dict[str, int | str] = {"preconditioned": 4, "virgin": 1, "envelope": "envelope"}
HEADER = ["direction", "gauge", "nominal_gauge_mm", "cycle", "strain", "line_force_N_per_m", "citation"]


def along_arc(x: np.ndarray, y: np.ndarray, count: int) -> np.ndarray:
    """Indices of at most `count` readings nearest to equal steps of arc length in axes scaled to 1 (ends included)."""
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x) / np.ptp(x), np.diff(y) / np.ptp(y)))])
    stations = np.linspace(0.0, arc[-1], count)
    return np.unique(np.abs(arc[:, None] - stations).argmin(axis=0))


def rows(document: dict, variant: str, count: int = 20) -> list[list]:
    """Rows of one variant's table."""
    out = []
    for test, gauge_name in GAUGES.items():
        for axis, direction in AXES.items():
            branches, gauge, width = raw_branches(document, axis, test)
            e, f, _, _, ids = loading_curve(branches, gauge, width, CYCLES[variant])
            for i in along_arc(e, f, count):
                branch, reading = ids[i]
                cite = CITATION.format(axis=axis, test=test, branch=branch, reading=reading)
                out.append(
                    [direction, gauge_name, f"{1e3 * gauge:.4g}", branch // 2 + 1, f"{e[i]:.5g}", f"{f[i]:.5g}", cite]
                )
    return out


def main(source: str, folder: str | None = None) -> None:
    """Write ``preconditioned.csv``, ``virgin.csv`` and ``envelope.csv``."""
    document = json.loads(Path(source).read_text(encoding="utf-8"))
    target = Path(folder) if folder else Path(__file__).parent / "cupro_su1098"
    for variant in CYCLES:
        with open(target / f"{variant}.csv", "w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(HEADER)
            writer.writerows(rows(document, variant))


if __name__ == "__main__":
    main(*sys.argv[1:])
