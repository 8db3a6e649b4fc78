"""Against data: what the unmeasured shear, the specimen's size, the bending hysteresis and the bending law do to the drape."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from material_tests.drape.branches import BranchTable, branch_table
from material_tests.drape.compare import error_against
from material_tests.drape.fe import Seed, drape
from material_tests.drape.geometry import DrapeTest
from material_tests.drape.targets import measured
from mfar_fem.errors import ParameterError
from mfar_fem.materials import Bending

SHEAR = (5.0, 15.0, 30.0, 50.0)
"""Trellis shear stiffness of woven apparel fabrics, N/m."""
STARTS = (Seed("flat", 1), Seed("flat", 2), *(Seed("folds", n) for n in (3, 5, 7, 9)))
STUDY_SIZES = ("iso-30", "jis-254")


def with_shear(fabric, G: float):
    """The fabric with the trellis shear stiffness ``G``, N/m.

    Raises
    ------
    ParameterError
        The law has no parameter ``G``.
    """
    if "G" not in fabric.law.values:
        raise ParameterError(f"the law '{fabric.law.name}' has no shear stiffness 'G' to sweep")
    return fabric.replace(law=type(fabric.law)(**{**fabric.law.values, "G": G / fabric.membrane_scale}))


def with_bending(fabric, factor: float = 1.0, twist: float = 1.0, coupling: float = 0.0):
    """The fabric with its rigidities times ``factor`` and its twist (Huber's estimate if ``coupling`` is given) times ``twist``.

    ``coupling`` is D12 over √(B_w B_f): the Poisson ratio of the bending.
    """
    b = fabric.bending
    d12 = coupling * math.sqrt(b.warp * b.weft) * factor if coupling else factor * b.coupling
    base = Bending.from_rigidities(factor * b.warp, factor * b.weft, None if coupling else factor * b.twist, d12)
    return fabric.replace(bending=Bending(base.warp, base.weft, twist * base.twist, base.coupling))


def mean_curvature(fabric, test: DrapeTest, bending_energy: float) -> float:
    """Root mean square curvature of the ring, 1/m, from its bending energy (J)."""
    area = math.pi * (test.specimen_radius**2 - test.disc_radius**2)
    return math.sqrt(2.0 * bending_energy / (area * math.sqrt(fabric.bending.warp * fabric.bending.weft)))


def hysteretic(fabric, test: DrapeTest, hysteresis: float, start: Seed, rounds: int = 4) -> tuple[Any, float]:
    r"""The fabric as stiff as a monotone fall makes it: friction adds the moment HB to :math:`B\kappa`.

    The secant rigidity is :math:`B + HB/\kappa`, with half the width ``hysteresis`` (2HB, N) of the loop and the mean curvature of
    the drape that it leads to (fixed point, halved steps in log B). It is an upper estimate: where the sheet unbends on its way
    the friction acts the other way.

    Returns
    -------
    (fabric, factor on B)
    """
    B, factor = math.sqrt(fabric.bending.warp * fabric.bending.weft), 1.0
    for _ in range(rounds):
        stiff = with_bending(fabric, factor)
        kappa = mean_curvature(stiff, test, drape(stiff, test, start).rest.bending)
        factor = math.sqrt(factor * (1.0 + 0.5 * hysteresis / (B * max(kappa, 1e-6))))
    return with_bending(fabric, factor), factor


def variants(fabric, test: DrapeTest) -> dict[str, Any]:
    """The fabric and what its elastic preset leaves open: hysteresis (where 2HB is known), twist, Poisson coupling."""
    out = {"as measured": fabric}
    loop = measured(fabric.name, "bending hysteresis 2HB")
    if loop is not None and loop.value is not None:
        stiff, factor = hysteretic(fabric, test, loop.value, STARTS[0])
        out[f"hysteresis: B × {factor:.2f}"] = stiff
    out["twist × 0.5"] = with_bending(fabric, twist=0.5)
    out["twist × 2"] = with_bending(fabric, twist=2.0)
    out["bending coupling 0.3"] = with_bending(fabric, coupling=0.3)
    values = fabric.law.values
    if "nu" in values:
        out["membrane Poisson 0"] = fabric.replace(law=type(fabric.law)(**{**values, "nu": 0.0}))
    return out


def summary(table: BranchTable) -> dict[str, Any]:
    """Lowest, flat-start and extreme coefficients and nodes of a table."""
    low, flat, spread = table.lowest, table.fallen, table.spread()
    pick = ("drape_coefficient_percent", "nodes")
    return {"lowest": None if low is None else [low[k] for k in pick], "flat": None if flat is None else [flat[k] for k in pick],
            "dc": spread.get(pick[0]), "nodes": spread.get(pick[1]), "branches": len(table.rows), "physical": len(table.physical)}


def study(fabric, fidelity: str = "draft", shear: Sequence[float] = SHEAR, sizes: Sequence[str] = STUDY_SIZES,
          starts: Sequence[Seed] = STARTS, out: Path | None = None, workers: int = 2,
          progress: Callable[[str, Mapping[str, Any]], None] | None = None) -> dict[str, Any]:
    """Drape coefficient and nodes with their bands: shear swept on each specimen, then the other unknowns at the given shear.

    Parameters
    ----------
    fabric : Fabric
    shear : sequence of float
        N/m.
    out : path, optional
        Finished branches are kept there and reused.
    progress : callable, optional
        ``progress(label, summary)`` after every table.

    Returns
    -------
    dict
        ``rows``: label, size, :func:`summary`; ``bands`` by size: least and largest coefficient and nodes over all; ``measured``.
    """
    rows = []

    def add(label, cloth, size):
        found = summary(branch_table(cloth, DrapeTest(size, fidelity), starts, out, workers))
        rows.append({"label": label, "size": size, **found})
        if progress is not None:
            progress(f"{label}, {size}", found)

    for size in sizes:
        for G in shear:
            add(f"G {G:g} N/m", with_shear(fabric, G), size)
        test = DrapeTest(size, fidelity)
        for label, cloth in variants(fabric, test).items():
            add(label, cloth, size)
        for G in (shear[0], shear[-1]):
            stiff = [cloth for label, cloth in variants(with_shear(fabric, G), test).items() if label.startswith("hysteresis")]
            if stiff:
                add(f"G {G:g} N/m with hysteresis", stiff[0], size)
    bands = {}
    for size in sizes:
        part = [row for row in rows if row["size"] == size and row["dc"]]
        bands[size] = {key: [min(row[key][0] for row in part), max(row[key][1] for row in part)] for key in ("dc", "nodes")}
    dc, nodes = measured(fabric.name), measured(fabric.name, "nodes")
    return {"fabric": fabric.name, "fidelity": fidelity, "rows": rows, "bands": bands,
            "measured": None if dc is None else {"dc": dc.value, "nodes": None if nodes is None else nodes.value}}


def mesh_convergence(fabric, test: DrapeTest, start: Seed,
                     meshes: Sequence[tuple[int, int]] = ((7, 144), (10, 192), (14, 288), (18, 384)), carried: bool = True,
                     progress: Callable[[dict[str, Any]], None] | None = None) -> list[dict[str, Any]]:
    """One branch on finer and finer meshes (cells across and round): coefficient, nodes, energy, and how far the sheet moved.

    ``carried``: every mesh starts from the coarsest one's rest state; otherwise from ``start`` itself, which finds the branch anew
    where the coarse sheet folds too sharply to be carried (``moved_m`` is nan then).
    """
    coarse = DrapeTest(test.size, test.fidelity, meshes[0])
    first, rows = drape(fabric, coarse, start).row(), []
    for cells in meshes:
        if cells == meshes[0]:
            found = first | {"moved_m": 0.0, "same_branch": True}
        elif carried:
            found = error_against(fabric, coarse, np.array(first["x_m"]), first, (cells[0], cells[1]))
        else:
            found = drape(fabric, DrapeTest(test.size, test.fidelity, (cells[0], cells[1])), start).row()
            found |= {"moved_m": math.nan, "same_branch": found["nodes"] == first["nodes"]}
        keys = ("drape_coefficient_percent", "nodes", "energy_J", "moved_m", "same_branch")
        rows.append({"cells": list(cells)} | {key: found[key] for key in keys})
        if progress is not None:
            progress(rows[-1])
    return rows


def render_convergence(rows: Sequence[Mapping[str, Any]]) -> list[Any]:
    """The branch over the meshes as a rich table, and the difference of the two finest."""
    from rich.table import Table

    table = Table(title="one branch, finer and finer")
    for column in ("cells", "DC, %", "nodes", "energy, mJ", "same branch"):
        table.add_column(column, justify="right")
    for row in rows:
        table.add_row("{} × {}".format(*row["cells"]), f"{row['drape_coefficient_percent']:.2f}", str(row["nodes"]),
                      f"{1e3 * row['energy_J']:.4f}", "yes" if row["same_branch"] else "NO")
    last = [row["drape_coefficient_percent"] for row in rows[-2:]]
    return [table, f"between the two finest: {abs(last[-1] - last[0]):.2f} points"]


def render_study(result: Mapping[str, Any]) -> list[Any]:
    """The study as rich tables and lines."""
    from rich.table import Table

    table = Table(title=f"{result['fabric']}: drape with its bands, {result['fidelity']}")
    for column in ("specimen", "variant", "lowest: DC, %", "nodes", "flat start: DC, %", "nodes", "band of DC, %", "band of nodes"):
        left = column in ("specimen", "variant")
        table.add_column(column, justify="left" if left else "right", no_wrap=column.startswith("band") or column == "specimen")
    for row in result["rows"]:
        pairs = [("–", "–") if row[k] is None else (f"{row[k][0]:.1f}", str(row[k][1])) for k in ("lowest", "flat")]
        band = ("–", "–") if not row["dc"] else (f"{row['dc'][0]:.1f}–{row['dc'][1]:.1f}", f"{row['nodes'][0]}–{row['nodes'][1]}")
        table.add_row(row["size"], row["label"], *pairs[0], *pairs[1], *band)
    known, lines = result["measured"], []
    for size, band in result["bands"].items():
        text = f"{size}: {band['dc'][0]:.1f} to {band['dc'][1]:.1f} %, {band['nodes'][0]} to {band['nodes'][1]} nodes"
        if known:
            inside = [band["dc"][0] <= known["dc"] <= band["dc"][1]]
            inside += [] if known["nodes"] is None else [band["nodes"][0] <= known["nodes"] <= band["nodes"][1]]
            text += f"; measured {known['dc']:g} %, {known['nodes']:g} nodes: {'inside' if all(inside) else 'outside'}"
        lines.append(text)
    return [table, *lines]
