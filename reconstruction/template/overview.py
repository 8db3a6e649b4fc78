"""One picture to judge a template by: the images with points and fitted edges, and the panels at scale."""

from __future__ import annotations

import itertools
import math
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from reconstruction.keypoints_file import ImageKeypoints
from reconstruction.landmarks import PAIRS
from reconstruction.measure.vote import WEIGHTS
from reconstruction.template.layout import arrange
from reconstruction.template.panel import Pattern
from reconstruction.template.svg import arrow

if TYPE_CHECKING:
    from reconstruction.template.pipeline import Template

EDGE_COLOURS = {"collar": "#d62728", "hem": "#1f77b4", "lapel": "#9467bd", "cuff": "#ff7f0e", "side": "#2ca02c",
                "underarm": "#8c564b"}
MOST, COLUMNS = 15, 5
"""Pictures shown, and in a row."""


def write_overview(path, template: Template, images: Sequence[ImageKeypoints]) -> None:
    """Write the PNG: pictures above, the panels at one scale and the lengths below.

    Parameters
    ----------
    path : path
    template : Template
    images : sequence of ImageKeypoints
        At most :data:`MOST` are shown (the title says of how many), the kinds in turn, textiles first; an image that cannot be
        opened is drawn as its points alone.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shown = _choice(images, MOST)
    columns = min(COLUMNS, max(len(shown), 1))
    rows = math.ceil(len(shown) / COLUMNS) if shown else 1
    figure = Figure(figsize=(16, 4.2 * rows + 9), layout="constrained")
    FigureCanvasAgg(figure)
    parts: Any = figure.subfigures(2, 1, height_ratios=[4.2 * rows, 9])
    top, bottom = parts
    grid = top.add_gridspec(rows, columns)
    for i, image in enumerate(shown):
        _draw_image(top.add_subplot(grid[divmod(i, COLUMNS)]), image, template)
    most = f" ({len(shown)} of {len(images)} pictures)" if len(shown) < len(images) else ""
    top.suptitle(f"{template.pattern.name}: points and fitted edges{most}", fontsize=12)
    if handles := _legend(shown, template):
        top.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=9, frameon=False)
    panels, table = bottom.subplots(1, 2, width_ratios=[3, 1.15])
    draw_pattern(panels, template.pattern)
    panels.set_title("panels at one scale: cut solid, seam dashed, warp as arrow", fontsize=10)
    table.set_axis_off()
    table.text(0, 1, _lengths(template), family="monospace", fontsize=9, va="top", transform=table.transAxes)
    figure.savefig(path, dpi=110, bbox_inches="tight")


def _legend(shown: Sequence[ImageKeypoints], template: Template) -> list:
    """A line for each kind of edge in the pictures, the two markers of points."""
    from matplotlib.lines import Line2D

    names = {b.name for image in shown for b in template.boundaries.get(str(image.path), ())}
    lines = [Line2D([], [], color=c, lw=2, label=key) for key, c in EDGE_COLOURS.items() if any(key in name for name in names)]
    points = [Line2D([], [], ls="", marker=m, color="#ffd700", markeredgecolor="black", label=f"the wearer's {side}")
              for m, side in ((">", "left"), ("<", "right"))] if shown else []  # fmt: skip
    return lines + points


def _lengths(template: Template) -> str:
    """Voted lengths and assumed ones, cm, as text."""
    lines = ["voted lengths, cm", ""]
    lines += [f"{v.name.replace('_', ' '):<20}{100 * v.value:6.1f} ± {100 * v.sigma:.1f}" for v in template.votes.values()]
    lines += ["", "assumed", "", *(textwrap.fill(f"{name.replace('_', ' ')}: {how}", 38, subsequent_indent="  ")
                                   for name, how in template.assumed.items())]  # fmt: skip
    if template.conflicts:
        lines += ["", f"{len(template.conflicts)} conflicts (conflicts.csv)"]
    return "\n".join(lines)


def draw_pattern(axes, pattern: Pattern) -> None:
    """Draw all panels (cut line solid, sewing line dashed, warp as arrow) with a bar of half a metre, axes in metres."""
    placed = arrange(pattern)
    for p in placed:
        axes.fill(*p.cut.T, facecolor="#f6f1e6", edgecolor="#222222", linewidth=0.9)
        axes.plot(*np.vstack([p.sew, p.sew[:1]]).T, color="#aa3333", linewidth=0.7, linestyle=(0, (5, 3)))
        axes.plot(*arrow(p.grain, 0.03).T, color="#224466", linewidth=1)
        for stroke in p.notches:
            axes.plot(*stroke.T, color="#222222", linewidth=0.8)
        axes.text(*p.text, p.panel.name, fontsize=6, ha="center" if p.text_centred else "left")
    low = min(p.cut[:, 1].min() for p in placed) - 0.06
    axes.plot([0, 0.5], [low, low], color="#222222", linewidth=2)
    axes.text(0.52, low, "0.5 m", va="center", fontsize=8)
    axes.set_aspect("equal")
    axes.set_axis_off()


def _choice(images: Sequence[ImageKeypoints], count: int) -> list[ImageKeypoints]:
    """The first image of every kind, then the second of every kind, and so on."""
    queues = [[image for image in images if image.kind == kind] for kind in WEIGHTS]
    turns = [image for turn in itertools.zip_longest(*queues) for image in turn if image is not None]
    return turns[:count]


def _draw_image(axes, image: ImageKeypoints, template: Template) -> None:
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(image.path) as picture:
            axes.imshow(np.asarray(picture.convert("RGB")))
    except (OSError, UnidentifiedImageError):
        axes.invert_yaxis()
        axes.set_aspect("equal")
    for boundary in template.boundaries.get(str(image.path), ()):
        colour = next((c for key, c in EDGE_COLOURS.items() if key in boundary.name), "#17becf")
        axes.plot(*boundary.curve(np.linspace(0, 1, 200)).T, color=colour, linewidth=1.8)
    for left, right in PAIRS:
        for i, marker in ((left, ">"), (right, "<")):
            if image.present[i]:
                axes.plot(*image.points[i], marker, color="#ffd700", markeredgecolor="black", markersize=5)
    name = image.name if len(image.name) <= 32 else "…" + image.name[-31:]
    axes.set_title(f"{name} ({image.kind})", fontsize=8)
    axes.set_axis_off()
