"""The common form of the figures: points with intervals along a horizontal axis, things below each other, wide and narrow."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from reconstruction.report.content import Picture
from reconstruction.report.estimates import Estimate, ordered

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#AA4499", "#806000", "#444444")
MARKS = ("o", "s", "D", "^", "v", "P")
STYLE: dict[Any, Any] = {
    "font.size": 9, "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True, "axes.grid.axis": "x",
    "grid.color": "#e0e0e0", "grid.linewidth": 0.6, "axes.axisbelow": True, "legend.frameon": False, "svg.fonttype": "path",
    "svg.hashsalt": "mfar", "figure.dpi": 100,
}  # fmt: skip
WIDTHS = (7.6, 3.7)
"""Inches of the wide and of the narrow form: the letters have the same size on a desk and on a telephone."""
ROW = 0.17
"""Inches for a mark."""


def picture(draw: Callable[[Any], None], height: float, alt: str, caption: str) -> Picture:
    """Draw twice, wide and narrow, as SVG.

    Parameters
    ----------
    draw : callable
        Takes matplotlib axes.
    height : float
        in; the narrow form is higher by what its legend needs.
    """
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    made = []
    with matplotlib.rc_context(STYLE):
        for width in WIDTHS:
            fig = Figure(figsize=(width, height), layout="constrained")
            FigureCanvasSVG(fig)
            ax = fig.subplots()
            draw(ax)
            handles, labels = ax.get_legend_handles_labels()
            columns = max(1, int(width / (0.55 + 0.075 * max(map(len, labels)))))
            lines = -(-len(labels) // columns)
            fig.set_size_inches(width, height + 0.2 * lines)
            fig.legend(handles, labels, loc="outside upper left", ncols=columns, borderaxespad=0.2, columnspacing=1.2)
            out = io.BytesIO()
            fig.savefig(out, format="svg", metadata={"Date": None})
            made.append(out.getvalue())
    return Picture(made[0], alt, caption, made[1])


def places(rows: Sequence[Estimate]) -> tuple[list[str], list[str], dict[tuple[str, str], float], dict[str, float]]:
    """Things, methods, the height of every mark by (thing, method), and of the middle of every thing."""
    things, methods = ordered(rows)
    step = len(methods) + 1.2
    at = {(t, m): i * step + j for i, t in enumerate(things) for j, m in enumerate(methods)}
    return things, methods, at, {t: i * step + 0.5 * (len(methods) - 1) for i, t in enumerate(things)}


def height(rows: Sequence[Estimate]) -> float:
    """Of a figure of these rows, in."""
    things, methods = ordered(rows)
    return 0.75 + ROW * len(things) * (len(methods) + 1.2)


def logarithmic(ax) -> None:
    """A logarithmic horizontal axis with plain numbers."""
    from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

    ax.set_xscale("log")
    ax.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    ax.xaxis.set_major_formatter(FormatStrFormatter("%g"))
    ax.xaxis.set_minor_formatter(NullFormatter())


def key(ax, label: str, **look) -> None:
    """A hollow box in the legend that stands for no mark of its own."""
    from matplotlib.patches import Rectangle

    ax.add_patch(Rectangle((0, 0), 0, 0, transform=ax.transAxes, facecolor="none", edgecolor="#444444", label=label, **look))


def points(ax, rows: Sequence[Estimate], paper: Mapping[str, Mapping[str, float]] | None = None, label: str = "") -> None:
    """Draw estimates, and the paper's values hollow where it has the same thing and method."""
    things, methods, at, middle = places(rows)
    for j, method in enumerate(methods):
        colour, mark = COLOURS[j % len(COLOURS)], MARKS[j % len(MARKS)]
        own = [r for r in rows if r.method == method]
        for r in own:
            if r.low is not None:
                ax.plot([r.low, r.high], [at[r.of, method]] * 2, color=colour, lw=2, solid_capstyle="butt")
        ax.plot([r.value for r in own], [at[r.of, method] for r in own], mark, color=colour, ms=5.5, label=method)
        theirs = [(value, at[t, method]) for t, value in (paper or {}).get(method, {}).items() if (t, method) in at]
        if theirs:
            ax.plot(*zip(*theirs, strict=True), mark, mfc="none", mec=colour, ms=6.5, mew=1.1)
    if any((t, m) in at for m in (paper or {}) for t in (paper or {})[m]):
        ax.plot([], [], "o", mfc="none", mec="#444444", ms=6.5, label=label)
    ax.set_yticks([middle[t] for t in things], [t.replace("_", " ").replace("-", " ") for t in things])
    ax.tick_params(axis="y", length=0)
    ax.set_ylim(max(at.values()) + 0.9, -0.9)
