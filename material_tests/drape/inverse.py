"""The inverse drape: which bending rigidity explains a measured coefficient, and do real fabrics of like weight have it?

The coefficient jumps between branches, so that a rigidity is not found to better than their spread: the target is the mean over a
few starts, and the answer comes with the band that the unmeasured shear (5 to 50 N/m) leaves.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from material_tests.drape.fe import Seed, drape
from material_tests.drape.geometry import DrapeTest
from material_tests.drape.targets import LEEDS, measured
from mfar_fem.errors import DataFileError, InputError, UnknownNameError
from mfar_fem.materials import Bending, Fabric, get_law

POPULATION = Path(__file__).resolve().parents[3] / "shared" / "data" / "bending" / "feng2022_618_fabrics_SI.csv"
"""Feng, Huang, Xu, Wang 2022, ACM TOG 41(6), doi:10.1145/3550454.3555464: 618 fabrics by cantilever; not part of this package."""
STARTS = (Seed("flat", 1), Seed("folds", 4), Seed("folds", 7))
LIMITS = (1e-7, 1e-3)
TENSILE, POISSON, THICKNESS = 3000.0, 0.2, 3e-4
"""Assumed tensile stiffness (N/m), Poisson ratio and thickness (m, of no effect but on the modulus) of an unmeasured woven."""


@dataclass(frozen=True)
class InverseResult:
    """Rigidity that explains a coefficient.

    Attributes
    ----------
    target : float
        %.
    rigidity : float
        B, N·m; warp and weft alike.
    shear : float
        Assumed trellis shear stiffness, N/m.
    bracket : (float, float)
        Rigidities between which the coefficient passes the target.
    coefficient : float
        Mean coefficient at ``rigidity``, %, from the curve through what was computed.
    evaluations : (k, 3) array
        B, mean coefficient and its spread over the starts.
    """

    target: float
    rigidity: float
    shear: float
    bracket: tuple[float, float]
    coefficient: float
    evaluations: np.ndarray


def woven(areal_density: float, B: float, shear: float, name: str = "unmeasured woven") -> Fabric:
    """A woven fabric of given weight (kg/m²), rigidity (N·m, warp and weft) and shear (N/m); the rest is assumed."""
    law = get_law("st-venant-kirchhoff", Ew=TENSILE / THICKNESS, Ef=TENSILE / THICKNESS, nu=POISSON, G=shear / THICKNESS)
    return Fabric(name, law, THICKNESS, areal_density, Bending.from_rigidities(B, B))


def rigidity_from_drape(target: float, areal_density: float, shear: float, test: DrapeTest | None = None,
                        starts: Sequence[Seed] = STARTS, rtol: float = 0.1,
                        progress: Callable[[float, float], None] | None = None) -> InverseResult:
    """The rigidity at which the mean coefficient over the starts is the measured one.

    Parameters
    ----------
    target : float
        Drape coefficient, %, in (2, 98).
    areal_density : float
        kg/m².
    shear : float
        Trellis shear stiffness, N/m.
    test : DrapeTest
        Default: 30 cm, draft.
    rtol : float
        Relative width of the final bracket of B.
    progress : callable, optional
        ``progress(B, coefficient)``.

    Raises
    ------
    InputError
        The target is out of range, or no rigidity in :data:`LIMITS` gives it.
    """
    if not 2.0 < target < 98.0:
        raise InputError(f"a drape coefficient between 2 and 98 % can be explained, not {target:g}")
    test = test or DrapeTest("iso-30", "draft")
    memory: dict[float, tuple[float, float]] = {}
    shapes: dict[float, list[np.ndarray]] = {}

    def coefficient(log_b: float) -> float:
        near = min(shapes, key=lambda b: abs(b - log_b), default=None)  # warm: from the nearest rigidity, along its branches
        first = [None] * len(starts) if near is None else shapes[near]
        cloth = woven(areal_density, math.exp(log_b), shear)
        found = [drape(cloth, test, seed, start=x) for seed, x in zip(starts, first, strict=True)]
        shapes[log_b] = [d.x for d in found]
        good = [d.reading.drape_coefficient for d in found if d.rest.converged]
        if not good:
            raise InputError(f"no start came to rest at B = {math.exp(log_b):.3g} N·m: {found[0].rest.message}")
        memory[log_b] = (float(np.mean(good)), float(np.ptp(good)))
        if progress is not None:
            progress(math.exp(log_b), memory[log_b][0])
        return memory[log_b][0]

    weight = 9.80665 * areal_density
    first = math.log(weight * (0.012 * (target / 40.0) ** 0.8) ** 3)  # bending length grows with the coefficient
    low, high = _bracket(coefficient, first, target)
    f_low, f_high = memory[low][0] - target, memory[high][0] - target
    while high - low > rtol:
        share = min(max(-f_low / (f_high - f_low), 0.15), 0.85)
        middle = low + share * (high - low)
        f = coefficient(middle) - target
        if f < 0.0:
            low, f_low = middle, f
        else:
            high, f_high = middle, f
    share = -f_low / (f_high - f_low)
    order = sorted(memory)
    return InverseResult(target, math.exp(low + share * (high - low)), shear, (math.exp(low), math.exp(high)),
                         target, np.array([[math.exp(b), *memory[b]] for b in order]))


def _bracket(coefficient: Callable[[float], float], first: float, target: float) -> tuple[float, float]:
    limits = tuple(map(math.log, LIMITS))
    point = min(max(first, limits[0]), limits[1])
    below = coefficient(point) < target
    step = math.log(2.0) if below else -math.log(2.0)
    while True:
        following = min(max(point + step, limits[0]), limits[1])
        if following == point:
            raise InputError(f"no rigidity between {LIMITS[0]:g} and {LIMITS[1]:g} N·m gives a drape coefficient of {target:g} %")
        if (coefficient(following) < target) != below:
            return (point, following) if below else (following, point)
        point, step = following, 1.5 * step


def population(path: Path | str | None = None) -> np.ndarray:
    """Areal mass (kg/m²) and mean rigidity √(warp · weft) (N·m) of the 618 measured fabrics, shape (n, 2).

    Raises
    ------
    DataFileError
        The file is absent or lacks a column.
    """
    path = POPULATION if path is None else Path(path)
    if not path.exists():
        raise DataFileError("the measured rigidities are not here; they are data of Feng et al. 2022, doi:10.1145/3550454.3555464, "
                            "to be placed there", path)
    with path.open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(line for line in stream if not line.startswith("#")))
    for column in ("areal_mass_g_m2", "alpha_warp_Nm", "alpha_weft_Nm"):
        if not rows or column not in rows[0]:
            raise DataFileError("a column is missing", path, column=column)
    table = np.array([[float(r["areal_mass_g_m2"]), float(r["alpha_warp_Nm"]), float(r["alpha_weft_Nm"])] for r in rows])
    good = np.all(np.isfinite(table) & (table > 0.0), axis=1)
    return np.column_stack([1e-3 * table[good, 0], np.sqrt(table[good, 1] * table[good, 2])])


def percentile(rigidity: float, areal_density: float, table: np.ndarray, width: float = 0.2) -> dict[str, float]:
    """Where a rigidity lies among fabrics whose mass is within ``width`` of it: ``percentile``, ``count``, ``median`` (N·m)."""
    like = table[np.abs(table[:, 0] / areal_density - 1.0) <= width, 1]
    if len(like) == 0:
        return {"percentile": math.nan, "count": 0, "median": math.nan}
    return {"percentile": 100.0 * float(np.mean(like <= rigidity)), "count": len(like), "median": float(np.median(like))}


def inverse_study(names: Sequence[str] = tuple(LEEDS), shear: Sequence[float] = (5.0, 15.0, 50.0), test: DrapeTest | None = None,
                  data: Path | str | None = None, progress: Callable[[dict[str, Any]], None] | None = None) -> list[dict[str, Any]]:
    """The named Leeds fabrics explained: B for each assumed shear, and its place among fabrics of like weight.

    Returns
    -------
    list of dict
        ``name``, ``areal_density``, ``target``, ``shear``, ``rigidity_Nm``, ``bracket_Nm``, ``percentile``, ``count``,
        ``median_Nm``, ``spread_points`` (``failure`` where no rigidity explains it).

    Raises
    ------
    UnknownNameError, DataFileError
    """
    table, rows = population(data), []
    for name in names:
        if name not in LEEDS:
            raise UnknownNameError(f"no Leeds fabric '{name}'; choose one of {', '.join(LEEDS)}")
        specimen, density = LEEDS[name]
        known = measured(specimen)
        assert known is not None and known.value is not None
        target = known.value
        for G in shear:
            row: dict[str, Any] = {"name": name, "areal_density": density, "target": target, "shear": G}
            try:
                found = rigidity_from_drape(target, density, G, test)
            except InputError as error:
                row |= {"rigidity_Nm": math.nan, "failure": str(error)}
            else:
                place = percentile(found.rigidity, density, table)
                row |= {"rigidity_Nm": found.rigidity, "bracket_Nm": found.bracket, "percentile": place["percentile"],
                        "count": place["count"], "median_Nm": place["median"],
                        "spread_points": float(np.interp(found.rigidity, found.evaluations[:, 0], found.evaluations[:, 2]))}
            rows.append(row)
            if progress is not None:
                progress(row)
    return rows


def render_inverse(rows: Sequence[dict[str, Any]]):
    """The inverse study as a rich table."""
    from rich.table import Table

    table = Table(title="rigidity that explains the measured drape, among measured fabrics of like weight (± 20 %)")
    for column in ("fabric", "g/m²", "DC, %", "shear, N/m", "B, µN·m", "percentile", "of", "their median, µN·m"):
        table.add_column(column, justify="left" if column == "fabric" else "right")
    for r in rows:
        head = (r["name"], f"{1e3 * r['areal_density']:.0f}", f"{r['target']:.1f}", f"{r['shear']:g}")
        if "failure" in r:
            table.add_row(*head, "none", "–", "–", "–")
        else:
            table.add_row(*head, f"{1e6 * r['rigidity_Nm']:.3g}", f"{r['percentile']:.0f}", str(r["count"]),
                          f"{1e6 * r['median_Nm']:.3g}")
    return table
