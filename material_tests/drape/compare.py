"""The drape test for the command line: one branch or the table of branches, beside what was measured."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from material_tests.drape.branches import BranchTable, branch_table
from material_tests.drape.fe import Drape, Seed, drape
from material_tests.drape.geometry import DrapeTest
from material_tests.drape.targets import measured
from mfar_fem.solve.rest import RestOptions

FROM_FLAT = Seed("flat", 1)
"""The start of a single branch: nearly flat, because a start with n folds would put its answer in."""
_HEAVY = ("outline_m", "amplitudes_m", "x_m")


def run(fabric, size: str = "iso-30", fidelity: str = "standard", table: bool = False, folds: int | None = None,
        self_contact: bool = False, against_reference: bool = False, out: Path | None = None, workers: int = 2,
        progress: Callable[[int, int, str], None] | None = None) -> dict[str, Any]:
    """The payload of ``mfar test drape``.

    Parameters
    ----------
    fabric : Fabric
        Warp along x.
    size : str
        A key of :data:`material_tests.drape.geometry.SIZES`.
    fidelity : {'draft', 'standard', 'reference'}
    table : bool
        All branches; the headline is then the physical one of lowest energy. Else one branch: from nearly flat, or from ``folds``.
    folds : int, optional
        Folds of the single branch's start.
    self_contact : bool
    against_reference : bool
        Carry the headline branch to the mesh ``reference`` and state the error of the coefficient.
    out : path, optional
        Folder: finished branches are kept there and reused, tables and pictures written.
    workers : int
        Processes of the branch table.
    progress : callable, optional
        ``progress(done, total, text)``.

    Returns
    -------
    dict
        ``drape_coefficient_percent``, ``nodes``, ``wall_s`` (of the headline branch), ``start_up_s`` (loading kernels and solver,
        apart), ``converged``, ``stable``, ``intersecting``,
        ``physical``, energies (J), ``depth_m``, ``outline`` (``theta_deg``, ``radius_m``), ``amplitudes_m``, ``measured``,
        ``branches``, ``lowest``, ``fallen``, ``spread`` and ``table_wall_s`` (with ``table``), ``against_reference``, ``files``.
    """
    test = DrapeTest(size, fidelity)
    found = None
    begin = time.perf_counter()
    drape(fabric, DrapeTest(size, fidelity, (2, 12)), FROM_FLAT, RestOptions(max_iterations=4))  # loads kernels and libraries
    start_up = time.perf_counter() - begin
    if table:
        found = branch_table(fabric, test, out=out, workers=workers, self_contact=self_contact,
                             progress=None if progress is None else lambda done, total, row: progress(done, total, _line(row)))
        head = found.lowest or min(found.rows, key=lambda row: (not row["converged"], row["energy_J"]))
    else:
        seed = FROM_FLAT if folds is None else Seed("folds", folds)
        report = None if progress is None else (
            lambda i, energy, residual: progress(i, 0, f"energy {energy:.4e} J, residual {residual:.1e}"))
        head = drape(fabric, test, seed, self_contact=self_contact, progress=report).row()
    payload = _payload(fabric, test, head, self_contact) | {"start_up_s": start_up}
    if found is not None:
        payload |= _table(found)
    if against_reference:
        payload["against_reference"] = error_against(fabric, test, np.array(head["x_m"]), head, self_contact=self_contact)
    if out is not None:
        from material_tests.drape.plots import save

        rows = list(found.rows) if found is not None else [head]
        payload["files"] = save(Path(out), payload, rows, test)
    return payload


def _payload(fabric, test: DrapeTest, head: Mapping[str, Any], self_contact: bool) -> dict[str, Any]:
    return {
        "test": "drape", "standard": test.standard, "size": test.size,
        "specimen_diameter_m": 2 * test.specimen_radius, "disc_diameter_m": 2 * test.disc_radius,
        "fabric": fabric.name, "law": fabric.law.name, "fidelity": test.fidelity, "cells": list(test.mesh),
        "self_contact": self_contact,
        **{key: value for key, value in head.items() if key not in _HEAVY},
        "outline": {"theta_deg": list(np.arange(0.0, 360.0, 360.0 / len(head["outline_m"]))), "radius_m": head["outline_m"]},
        "amplitudes_m": head["amplitudes_m"],
        "measured": _measured(fabric.name),
    }


def _measured(name: str) -> dict[str, Any] | None:
    dc, nodes = measured(name), measured(name, "nodes")
    if dc is None:
        return None
    return {"drape_coefficient_percent": dc.value, "lower": dc.lower, "upper": dc.upper,
            "nodes": None if nodes is None else nodes.value, "source": dc.source}


def _table(found: BranchTable) -> dict[str, Any]:
    def name(row):
        return None if row is None else row["seed"]

    light = [{key: value for key, value in row.items() if key not in _HEAVY} for row in found.rows]
    return {"branches": light, "lowest": name(found.lowest), "fallen": name(found.fallen), "spread": found.spread(),
            "table_wall_s": found.wall_s}


def _line(row: Mapping[str, Any]) -> str:
    return f"{row['seed']}: {row['drape_coefficient_percent']:.1f} %, {row['nodes']} nodes"


def error_against(fabric, test: DrapeTest, x: np.ndarray, head: Mapping[str, Any], cells: tuple[int, int] | None = None,
                  self_contact: bool = False) -> dict[str, Any]:
    """The same branch on a finer mesh (default: ``reference``), and the error of this one against it.

    Returns
    -------
    dict
        ``drape_coefficient_percent`` and ``nodes`` there, ``error_points`` of the coefficient, ``energy_error``, ``wall_s``,
        ``same_branch``: whether it kept its folds, moved by less than 5 mm (root mean square) and its energy by less than 10 %.
    """
    from material_tests.drape.seeds import prolong

    finer = DrapeTest(test.size, "reference", cells)
    start = prolong(test.surface(), x, test.mesh, finer.surface())
    seed = Seed(head["kind"], head["number"], head["amplitude_m"])
    fine: Drape = drape(fabric, finer, seed, self_contact=self_contact, start=start)
    moved = float(np.sqrt(np.mean(np.sum((fine.x - start) ** 2, axis=1))))
    dc = fine.reading.drape_coefficient
    return {"cells": list(finer.mesh), "drape_coefficient_percent": dc, "nodes": fine.reading.nodes,
            "error_points": head["drape_coefficient_percent"] - dc, "energy_J": fine.rest.energy,
            "energy_error": (head["energy_J"] - fine.rest.energy) / abs(fine.rest.energy), "wall_s": fine.wall_s,
            "iterations": fine.rest.iterations, "converged": fine.rest.converged, "stable": fine.rest.stable,
            "moved_m": moved, "same_branch": moved < 5e-3 and fine.reading.nodes == head["nodes"] and
            abs(head["energy_J"] - fine.rest.energy) < 0.1 * abs(fine.rest.energy)}


def render(payload: Mapping[str, Any]) -> list[Any]:
    """What is printed of a payload: rich tables and lines."""
    from rich.table import Table

    title = (f"{payload['fabric']}: drape, {payload['standard']}, {1e3 * payload['specimen_diameter_m']:.0f} mm on "
             f"{1e3 * payload['disc_diameter_m']:.0f} mm, {payload['fidelity']}")
    table = Table(title=title)
    table.add_column("quantity")
    table.add_column("value", justify="right")
    known = payload["measured"]
    rows = [("start", payload["seed"]), ("drape coefficient, %", f"{payload['drape_coefficient_percent']:.1f}"),
            ("nodes", str(payload["nodes"])), ("depth, mm", f"{1e3 * payload['depth_m']:.1f}")]
    if known:
        rows += [("measured coefficient, %", f"{known['drape_coefficient_percent']:.1f}"),
                 ("measured nodes", "–" if known["nodes"] is None else f"{known['nodes']:.0f}")]
    rows += [(f"{part} energy, mJ", f"{1e3 * payload[part + '_J']:.4f}") for part in ("membrane", "bending", "gravity")]
    rows += [("energy, mJ", f"{1e3 * payload['energy_J']:.4f}"), ("at rest", payload["message"]),
             ("through itself", _word(payload["intersecting"])), ("wall time, s", f"{payload['wall_s']:.1f}")]
    for row in rows:
        table.add_row(*row)
    out: list[Any] = [table]
    if "branches" in payload:
        out += _render_branches(payload)
    if "against_reference" in payload:
        r = payload["against_reference"]
        other = "" if r["same_branch"] else "; the finer mesh went to another branch"
        out.append(f"against reference ({r['cells'][0]} × {r['cells'][1]} cells, {r['drape_coefficient_percent']:.1f} %, "
                   f"{r['nodes']} nodes): {r['error_points']:+.2f} points{other}")
    return [*out, *(f"written: {path}" for path in payload.get("files", []))]


def _render_branches(payload: Mapping[str, Any]) -> list[Any]:
    from rich.table import Table

    table = Table(title="branches, lowest energy first")
    for column in ("start", "DC, %", "nodes", "energy, mJ", "stable", "through itself", "iterations", "s"):
        table.add_column(column, justify="left" if column == "start" else "right")
    for row in sorted(payload["branches"], key=lambda row: row["energy_J"]):
        mark = "" if row["physical"] else "dim"
        table.add_row(row["seed"], f"{row['drape_coefficient_percent']:.1f}", str(row["nodes"]), f"{1e3 * row['energy_J']:.4f}",
                      _word(row["stable"]), _word(row["intersecting"]), str(row["iterations"]), f"{row['wall_s']:.1f}", style=mark)
    lines = []
    if payload["spread"]:
        dc, nodes = payload["spread"]["drape_coefficient_percent"], payload["spread"]["nodes"]
        lines.append(f"lowest: {payload['lowest']}; from a flat fall: {payload['fallen']}; physical branches span {dc[0]:.1f} to "
                     f"{dc[1]:.1f} % and {nodes[0]} to {nodes[1]} nodes ({payload['table_wall_s']:.0f} s)")
    else:
        lines.append("[yellow]no branch is at rest, stable and free of self-intersection[/yellow]")
    return [table, *lines]


def _word(flag: bool | None) -> str:
    return "–" if flag is None else "yes" if flag else "no"
