"""Pictures of the matching for people to judge: lines of each pair, the graph, the matrix of all pairs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from reconstruction.matching.graph import MatchGraph
from reconstruction.matching.pair import PairResult

KIND_COLOURS = {"mural": "#b5482f", "figurine": "#2f6db5", "textile": "#3b8a4b"}
STATUS_COLOURS = {"matched": "#1b7f3b", "degenerate": "#c77700", "failed": "#b00020"}
_OUTLIER = "#b00020"
MOST_LINES = 300
"""Lines that are drawn of a pair, at most (evenly chosen)."""


def _figure(width: float, height: float) -> Any:
    """A matplotlib figure that needs no display and leaves no global state."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def status_colour(status: str) -> str:
    """Colour of a verdict."""
    return STATUS_COLOURS[status.split(":")[0]]


def match_lines(path: Path, result: PairResult, first: np.ndarray, second: np.ndarray,
                scales: tuple[float, float] = (1.0, 1.0), label: str = "") -> Path:
    """Draw two pictures side by side with lines between their putative matches, inliers green.

    Parameters
    ----------
    path : pathlib.Path
        PNG to write.
    result : PairResult
        The pair.
    first, second : (h, w, 3) uint8 array
        The pictures, or smaller copies.
    scales : (float, float)
        Pixels of the copies to one of the points.
    label : str
        Kept in the file (see :func:`is_drawn`).
    """
    from matplotlib.collections import LineCollection

    gap = 12
    height = max(first.shape[0], second.shape[0])
    canvas = np.full((height, first.shape[1] + gap + second.shape[1], 3), 255, np.uint8)
    canvas[: first.shape[0], : first.shape[1]] = first
    canvas[: second.shape[0], first.shape[1] + gap :] = second
    figure = _figure(11, max(2.2, 11 * height / canvas.shape[1] + 0.7))
    axes = figure.add_subplot()
    axes.imshow(canvas)
    left = (result.points[:, :2] + 0.5) * scales[0] - 0.5
    right = (result.points[:, 2:] + 0.5) * scales[1] - 0.5 + [first.shape[1] + gap, 0]
    for chosen, colour, alpha, width in ((~result.mask, _OUTLIER, 0.35, 0.6), (result.mask, "#17c964", 0.8, 0.8)):
        index = np.flatnonzero(chosen)
        index = index[np.unique(np.linspace(0, len(index) - 1, min(len(index), MOST_LINES)).astype(int))] if len(index) else index
        lines = list(np.stack([left[index], right[index]], axis=1))
        axes.add_collection(LineCollection(lines, colors=colour, alpha=alpha, linewidths=width))
        axes.scatter(*np.concatenate([left[index], right[index]]).T, s=3, color=colour, alpha=alpha)
    axes.set_axis_off()
    axes.set_xlim(0, canvas.shape[1])
    axes.set_ylim(height, 0)
    axes.set_title(_title(result), color=status_colour(result.status), fontsize=10)
    figure.savefig(path, dpi=110, metadata={"Description": label})
    return path


def is_drawn(path: Path, label: str) -> bool:
    """Whether a whole picture with this label is there already."""
    from PIL import Image

    try:
        with Image.open(path) as picture:
            picture.load()
            return picture.info.get("Description") == label
    except (OSError, SyntaxError, ValueError):
        return False


def _title(result: PairResult) -> str:
    text = f"{result.a} – {result.b}: {result.status}; {result.inliers} inliers (green) of {result.putative} putative matches"
    if np.isfinite(result.sampson):
        text += f"\nmedian Sampson distance {result.sampson:.2f} px to the estimated F"
    if np.isfinite(result.sampson_cameras):
        text += f", {result.sampson_cameras:.2f} px to the given cameras"
    return text


def graph_drawing(path: Path, graph: MatchGraph, thumbnails: Mapping[str, np.ndarray] | None = None) -> Path:
    """Draw the match graph on a circle: nodes by kind (with pictures if there are at most 16), edges by status, as wide as the
    logarithm of their inliers. Failed pairs are drawn thin up to 40 pictures and left out, with a note, beyond."""
    from matplotlib.lines import Line2D
    from matplotlib.offsetbox import AnnotationBbox, OffsetImage

    figure = _figure(9, 9)
    axes = figure.add_subplot()
    names = graph.names
    n = len(names)
    angle = np.pi / 2 - 2 * np.pi * np.arange(n) / max(n, 1)
    place = {name: np.array([np.cos(t), np.sin(t)]) for name, t in zip(names, angle, strict=True)}
    shown = n <= 40
    thumbnails = thumbnails or {}
    for result in sorted(graph.results, key=lambda r: (r.matched, r.status.startswith("degenerate"))):
        kind = result.status.split(":")[0]
        if kind == "failed" and not shown:
            continue
        style = {"matched": "-", "degenerate": "--", "failed": ":"}[kind]
        width = 0.5 if kind == "failed" else 0.6 + 0.9 * np.log10(max(result.inliers, 1))
        axes.plot(*np.array([place[result.a], place[result.b]]).T, style, color=status_colour(result.status), lw=width,
                  alpha=0.35 if kind == "failed" else 0.85, zorder=1)  # fmt: skip
    for name, kind in graph.kinds.items():
        x, y = place[name]
        colour = KIND_COLOURS.get(kind, "#555555")
        pictured = n <= 16 and name in thumbnails
        if pictured:
            zoom = 74 / max(thumbnails[name].shape[:2])
            frame = {"edgecolor": colour, "lw": 2}
            axes.add_artist(AnnotationBbox(OffsetImage(thumbnails[name], zoom=zoom), (x, y), pad=0.15, bboxprops=frame))
        else:
            axes.scatter([x], [y], s=90 if n <= 40 else 30, color=colour, zorder=2)
        if pictured:
            below = -0.5 * 74 * thumbnails[name].shape[0] / max(thumbnails[name].shape[:2]) - 8
            axes.annotate(name, (x, y), xytext=(0, below), textcoords="offset points", ha="center", va="top", fontsize=8,
                          bbox={"fc": "white", "ec": "none", "alpha": 0.8, "pad": 0.8})  # fmt: skip
            continue
        turn = np.degrees(np.arctan2(y, x))
        upright = abs(turn) <= 90
        axes.text(x * 1.07, y * 1.07, name, ha="left" if upright else "right", va="center", fontsize=8 if n <= 40 else 6,
                  rotation=turn if upright else turn - 180, rotation_mode="anchor")  # fmt: skip
    handles = [Line2D([], [], color=STATUS_COLOURS[k], ls=s, label=k)
               for k, s in (("matched", "-"), ("degenerate", "--"), ("failed", ":")) if k != "failed" or shown]  # fmt: skip
    present = dict.fromkeys(graph.kinds.values())
    handles += [Line2D([], [], color=KIND_COLOURS.get(k, "#555555"), marker="o", ls="", label=k) for k in present]
    axes.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, -0.06), ncols=6, fontsize=9, frameon=False)
    tried, matched = len(graph.results), sum(r.matched for r in graph.results)
    note = "" if shown else " (failed pairs not drawn)"
    axes.set_title(f"{matched} of {tried} pairs matched, {len(graph.components())} groups{note}", fontsize=11)
    axes.set_xlim(-1.35, 1.35)
    axes.set_ylim(-1.35, 1.35)
    axes.set_aspect("equal")
    axes.set_axis_off()
    figure.savefig(path, dpi=110)
    return path


def matrix(path: Path, graph: MatchGraph) -> Path:
    """Draw the matrix of all pairs: colour and number are the inliers, the frame is the status; grey was not tried."""
    from matplotlib.colors import LogNorm
    from matplotlib.patches import Rectangle

    names = graph.names
    n = len(names)
    index = {name: i for i, name in enumerate(names)}
    values = np.full((n, n), np.nan)
    for result in graph.results:
        i, j = index[result.a], index[result.b]
        values[i, j] = values[j, i] = max(result.inliers, 1)
    size = min(max(5.0, 0.55 * n + 2.5), 16)
    figure = _figure(size + 1, size)
    axes = figure.add_subplot()
    axes.set_facecolor("#e4e4e4")
    top = max(10.0, float(np.nanmax(values))) if np.isfinite(values).any() else 10.0
    picture = axes.imshow(np.ma.masked_invalid(values), norm=LogNorm(1, top), cmap="cividis")
    figure.colorbar(picture, ax=axes, label="inliers", shrink=0.8)
    for result in graph.results:
        i, j = index[result.a], index[result.b]
        for x, y in ((i, j), (j, i)):
            colour = status_colour(result.status)
            axes.add_patch(Rectangle((x - 0.44, y - 0.44), 0.88, 0.88, fill=False, ec=colour, lw=2 if n < 30 else 1))
            if n <= 25:
                bright = values[i, j] > np.sqrt(top)
                axes.text(x, y, str(result.inliers), ha="center", va="center", fontsize=7, color="black" if bright else "white")
    axes.set_xticks(range(n), names, rotation=90, fontsize=8 if n <= 40 else 5)
    axes.set_yticks(range(n), names, fontsize=8 if n <= 40 else 5)
    axes.set_title("inliers of every pair; frame: green matched, orange degenerate, red failed, grey not tried", fontsize=9)
    figure.savefig(path, dpi=110)
    return path
