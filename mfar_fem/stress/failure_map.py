"""Where cases fail: a table over time step, membrane stiffness and aspect ratio, and its picture."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

DT = np.array([1e-4, 1e-3, 1e-2, 1e-1, 1.0])
STIFFNESS = np.array([1e1, 10**2.5, 1e4, 10**5.5, 1e7])
ASPECT = np.array([1.0, 10.0, 100.0, np.inf])
_NAMES = ("equant: aspect below 10", "thin: 10 to 100", "slivers: above 100")
_WORST = {"nan": 0, "hang": 0, "crash": 0, "unverified": 1, "failure": 2, "converged": 3}
#: Okabe–Ito colours and shapes, distinguishable without colour vision.
_STYLE = {"converged": ("#009E73", "o", 18), "failure": ("#E69F00", "s", 34), "unverified": ("#CC79A7", "D", 40),
          "hang": ("#000000", "X", 55), "nan": ("#D55E00", "*", 70), "crash": ("#D55E00", "P", 55)}


def failure_map(rows: Sequence[dict]) -> list[dict]:
    """Counts by cell of time step × stiffness × aspect ratio.

    Parameters
    ----------
    rows : sequence of dict
        Of :func:`mfar_fem.stress.run_stress_test`.

    Returns
    -------
    list of dict
        ``kind`` (``dynamics``, or ``statics and rest`` in which ``dt`` has no meaning and is one bin), ends of the bins, ``cases``,
        ``converged``, ``failures``, ``worst`` outcome.
    """
    out = []
    for kind, wanted in (("dynamics", ("dynamics",)), ("statics and rest", ("statics", "rest"))):
        some = [row for row in rows if row["kind"] in wanted]
        steps = list(pairwise(DT)) if kind == "dynamics" else [(DT[0], DT[-1])]
        for dt in steps:
            for stiffness in pairwise(STIFFNESS):
                for aspect in pairwise(ASPECT):
                    cell = [row["outcome"] for row in some if _in(row["dt"], dt, DT[-1]) and _in(row["aspect"], aspect, np.inf)
                            and _in(row["stiffness"], stiffness, STIFFNESS[-1])]
                    out.append({"kind": kind, "dt_low": dt[0], "dt_high": dt[1], "stiffness_low": stiffness[0],
                                "stiffness_high": stiffness[1], "aspect_low": aspect[0], "aspect_high": aspect[1],
                                "cases": len(cell), "converged": cell.count("converged"),
                                "failures": len(cell) - cell.count("converged"),
                                "worst": min(cell, key=_WORST.__getitem__) if cell else ""})
    return out


def _in(value: float, ends: tuple[float, float], last: float) -> bool:
    low, high = ends
    return low <= value < high or (high == last and value == last)


def write_failure_map(table: Sequence[dict], path: str | Path) -> Path:
    """Write the table of :func:`failure_map` as CSV."""
    path = Path(path)
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(table[0]))
        writer.writeheader()
        writer.writerows(table)
    return path


def draw_failure_map(rows: Sequence[dict], path: str | Path) -> Path:
    """Draw every case in the plane of time step (dynamics) or bending stiffness (statics, rest) and membrane stiffness.

    One panel a class of aspect ratio; shades are the share of cases that converged in the cell. PNG.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    path = Path(path)
    figure = Figure(figsize=(12.0, 7.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 3, sharey=True)
    bending = np.logspace(-9, -2, 5)
    shades = None
    for r, (kinds, x, edges, label) in enumerate(((("dynamics",), "dt", DT, "time step, s"),
                                                  (("statics", "rest"), "bending", bending, "bending stiffness, N·m"))):
        for c, aspect in enumerate(pairwise(ASPECT)):
            ax = axes[r, c]
            some = [row for row in rows if row["kind"] in kinds and _in(row["aspect"], aspect, np.inf)]
            shades = _shade(ax, some, x, edges) or shades
            for outcome, (colour, marker, size) in _STYLE.items():
                points = [(row[x], row["stiffness"]) for row in some if row["outcome"] == outcome]
                if points:
                    ax.scatter(*np.array(points).T, s=size, c=colour, marker=marker, edgecolors="white", linewidths=0.4, zorder=3)
            ax.set(xscale="log", yscale="log", xlim=(edges[0], edges[-1]), ylim=(STIFFNESS[0], STIFFNESS[-1]), xlabel=label,
                   title=f"{' and '.join(kinds)}, {_NAMES[c]} ({len(some)} cases)")
            ax.title.set_fontsize(9)
        axes[r, 0].set_ylabel("membrane stiffness, N/m")
    if shades is not None:
        bar = figure.colorbar(shades, ax=axes, label="share converged in the cell, verified (white: no case)", shrink=0.8)
        bar.ax.set_ylim(0.0, 1.0)
    seen = [o for o in _STYLE if any(row["outcome"] == o for row in rows)]
    handles = [axes[0, 0].scatter([], [], s=_STYLE[o][2], c=_STYLE[o][0], marker=_STYLE[o][1],
                                  label=f"{'named failure' if o == 'failure' else o} ({sum(row['outcome'] == o for row in rows)})")
               for o in seen]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(seen), frameon=False)
    figure.savefig(path, dpi=150)
    return path


def _shade(ax, rows, x, edges):
    """Share of converged cases by cell, with the number of cases written in it."""
    share = np.full((len(STIFFNESS) - 1, len(edges) - 1), np.nan)
    for i, stiffness in enumerate(pairwise(STIFFNESS)):
        for j, ends in enumerate(pairwise(edges)):
            cell = [row["outcome"] == "converged" for row in rows
                    if _in(row["stiffness"], stiffness, STIFFNESS[-1]) and _in(row[x], ends, edges[-1])]
            if cell:
                share[i, j] = np.mean(cell)
                ax.annotate(f"{sum(cell)}/{len(cell)}", (ends[0], stiffness[1]), xytext=(3, -9), textcoords="offset points",
                            fontsize=7)
    return ax.pcolormesh(edges, STIFFNESS, share, cmap="Greys_r", vmin=-1.0, vmax=1.15, zorder=0)
