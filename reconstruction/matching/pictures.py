"""Pictures of the matching for people to judge: lines of each pair, the graph, the matrix of all pairs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from reconstruction.libraries import opencv
from reconstruction.matching.graph import MatchGraph, joined
from reconstruction.matching.pair import PairResult

KIND_COLOURS = {"mural": "#b5482f", "figurine": "#2f6db5", "textile": "#3b8a4b"}
STATUS_COLOURS = {"matched": "#1b7f3b", "degenerate": "#c77700", "failed": "#b00020"}
_INLIER, _OUTLIER = "#17c964", "#b00020"
MOST_LINES = 300
"""Lines that are drawn of a pair, at most (evenly chosen)."""
_WIDE = 800
"""Small pictures are enlarged to about this many pixels a pair."""


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
    from PIL import Image, PngImagePlugin

    gap = 12
    height = max(first.shape[0], second.shape[0])
    canvas = np.full((height, first.shape[1] + gap + second.shape[1], 3), 255, np.uint8)
    canvas[: first.shape[0], : first.shape[1]] = first
    canvas[: second.shape[0], first.shape[1] + gap :] = second
    larger = max(1, round(_WIDE / canvas.shape[1]))
    canvas = canvas.repeat(larger, axis=0).repeat(larger, axis=1)
    left = ((result.points[:, :2] + 0.5) * scales[0]) * larger - 0.5
    right = ((result.points[:, 2:] + 0.5) * scales[1] + [first.shape[1] + gap, 0]) * larger - 0.5
    for chosen, colour, alpha in ((~result.mask, _OUTLIER, 0.35), (result.mask, _INLIER, 0.8)):
        index = np.flatnonzero(chosen)
        index = index[np.unique(np.linspace(0, len(index) - 1, min(len(index), MOST_LINES)).astype(int))] if len(index) else index
        canvas = _lines(canvas, left[index], right[index], _rgb(colour), alpha)
    notes = PngImagePlugin.PngInfo()
    notes.add_text("Description", label)
    Image.fromarray(_titled(canvas, _title(result), _rgb(status_colour(result.status)))).save(path, pnginfo=notes, compress_level=1)
    return path


def _rgb(colour: str) -> tuple[int, int, int]:
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def _lines(canvas: np.ndarray, left: np.ndarray, right: np.ndarray, colour: tuple[int, int, int], alpha: float) -> np.ndarray:
    """Lines from left to right (n, 2) px with their end points, laid over a picture; matplotlib takes fifty times as long."""
    cv2 = opencv()
    over = canvas.copy()
    ends = np.round(np.stack([left, right], axis=1) * 16).astype(np.int32)  # sixteenths of a pixel
    cv2.polylines(over, list(ends[:, :, None, :]), False, colour, 1, cv2.LINE_AA, 4)
    for x, y in ends.reshape(-1, 2):
        cv2.circle(over, (int(x), int(y)), 32, colour, -1, cv2.LINE_AA, 4)
    return cv2.addWeighted(over, alpha, canvas, 1.0 - alpha, 0.0)


def _titled(canvas: np.ndarray, title: str, colour: tuple[int, int, int]) -> np.ndarray:
    """A picture with a line or two of text above it; it is made wide enough for them."""
    from matplotlib import get_data_path
    from PIL import Image, ImageDraw, ImageFont

    font = ImageFont.truetype(str(Path(get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"), 13)
    box = ImageDraw.Draw(Image.new("RGB", (1, 1))).multiline_textbbox((0, 0), title, font=font)
    wide, high = max(canvas.shape[1], int(box[2]) + 20), int(box[3]) + 16
    page = Image.new("RGB", (wide, canvas.shape[0] + high), "white")
    page.paste(Image.fromarray(canvas), ((wide - canvas.shape[1]) // 2, high))
    ImageDraw.Draw(page).multiline_text((wide / 2, 6), title, fill=colour, font=font, anchor="ma", align="center")
    return np.asarray(page)


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


def short_names(names: Sequence[str]) -> dict[str, str]:
    """Names without the folders that all of them share."""
    parts = [name.split("/") for name in names]
    shared = 0
    while parts and all(len(p) > shared + 1 and p[shared] == parts[0][shared] for p in parts):
        shared += 1
    return {name: "/".join(p[shared:]) for name, p in zip(names, parts, strict=True)}


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
    shown, short = n <= 40, short_names(names)
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
            axes.annotate(short[name], (x, y), xytext=(0, below), textcoords="offset points", ha="center", va="top", fontsize=8,
                          bbox={"fc": "white", "ec": "none", "alpha": 0.8, "pad": 0.8})  # fmt: skip
            continue
        turn = np.degrees(np.arctan2(y, x))
        upright = abs(turn) <= 90
        axes.text(x * 1.07, y * 1.07, short[name], ha="left" if upright else "right", va="center", fontsize=8 if n <= 40 else 6,
                  rotation=turn if upright else turn - 180, rotation_mode="anchor")  # fmt: skip
    handles = [Line2D([], [], color=STATUS_COLOURS[k], ls=s, label=k)
               for k, s in (("matched", "-"), ("degenerate", "--"), ("failed", ":")) if k != "failed" or shown]  # fmt: skip
    present = dict.fromkeys(graph.kinds.values())
    handles += [Line2D([], [], color=KIND_COLOURS.get(k, "#555555"), marker="o", ls="", label=k) for k in present]
    axes.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, -0.06), ncols=6, fontsize=9, frameon=False)
    tried, matched = len(graph.results), sum(r.matched for r in graph.results)
    note = "" if shown else " (failed pairs not drawn)"
    axes.set_title(f"{matched} of {tried} pairs matched{note}; {joined(graph.components())}", fontsize=11)
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
    short = list(short_names(names).values())
    axes.set_xticks(range(n), short, rotation=90, fontsize=8 if n <= 40 else 5)
    axes.set_yticks(range(n), short, fontsize=8 if n <= 40 else 5)
    axes.set_title("inliers of every pair; frame: green matched, orange degenerate, red failed, grey not tried", fontsize=9)
    figure.savefig(path, dpi=110)
    return path
