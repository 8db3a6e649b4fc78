"""Consistency of a pattern: outlines, seams, loom width."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from reconstruction.measure.silhouette import signed_area
from reconstruction.template.geometry import extent, is_simple, offset
from reconstruction.template.panel import Panel, Pattern

LENGTH_TOLERANCE = 1e-3
"""Two sewn edges may differ by this after the stated ease, m."""
LOOM_WIDTH = 0.575
"""Width of the cloth, m: surviving Tang silks are 55-60 cm wide between selvedges."""


@dataclass(frozen=True)
class Finding:
    """Something wrong (``error``) or to be known (``warning``) about a pattern."""

    level: str
    where: str
    message: str


def cut_line(panel: Panel) -> np.ndarray:
    """Outline with seam allowances, (n, 2) m: where the scissors go (in the direction of the panel's edges)."""
    pieces = [panel.edge_points(i) for i in range(len(panel.edges))]
    distances = [edge.allowance for edge in panel.edges]
    mirror = np.array([-1.0, 1.0])
    if signed_area(panel.outline()) < 0:
        return offset([piece * mirror for piece in pieces], distances) * mirror
    return offset(pieces, distances)


def check(pattern: Pattern, loom_width: float = LOOM_WIDTH) -> list[Finding]:
    """All findings about a pattern.

    Errors: an edge without length; an outline that is not a closed, simple loop; a warp that is no unit vector; a seam to an edge
    that does not exist; an edge in two seams; sewn edges whose lengths differ from the stated ease by more than
    :data:`LENGTH_TOLERANCE`.
    Warnings: a panel wider (across the warp, with allowances) than the loom; one whose edges run clockwise.
    """
    found = []
    for name, panel in pattern.panels.items():
        ends = [(edge.start, edge.end) for edge in panel.edges]
        if any(a[1] != b[0] for a, b in zip(ends, ends[1:] + ends[:1], strict=True)):
            found.append(Finding("error", name, "its edges do not form a closed loop"))
            continue
        short = [i for i in range(len(panel.edges)) if panel.edge_length(i) < 1e-6]
        if short:
            found.append(Finding("error", name, f"its edges {short} have no length"))
            continue
        outline = panel.outline()
        if not is_simple(outline):
            found.append(Finding("error", name, "its outline crosses or touches itself"))
        elif signed_area(outline) < 0:
            found.append(Finding("warning", name, "its outline runs clockwise: it is seen from its inside"))
        if abs(np.linalg.norm(panel.warp) - 1) > 1e-9:
            found.append(Finding("error", name, f"its warp direction {panel.warp.tolist()} is no unit vector"))
            continue
        across = np.array([-panel.warp[1], panel.warp[0]])
        width = extent(cut_line(panel), across)
        if width > loom_width:
            found.append(Finding("warning", name, f"is {100 * width:.1f} cm wide across the warp with its allowances; cloth of "
                                                  f"{100 * loom_width:.1f} cm needs a seam in it"))
    return found + _seams(pattern)


def _seams(pattern: Pattern) -> list[Finding]:
    found: list[Finding] = []
    used: Counter[tuple[str, int]] = Counter()
    for seam in pattern.seams:
        where = f"{seam.first[0]}[{seam.first[1]}] - {seam.second[0]}[{seam.second[1]}]"
        missing = [p for p, i in (seam.first, seam.second) if p not in pattern.panels or not 0 <= i < len(pattern.panels[p].edges)]
        if missing:
            found.append(Finding("error", where, f"there is no such edge in {', '.join(missing)}"))
            continue
        used.update((seam.first, seam.second))
        a, b = pattern.seam_lengths(seam)
        if abs(a - b - seam.ease) > LENGTH_TOLERANCE:
            message = f"lengths {1000 * a:.1f} and {1000 * b:.1f} mm differ by {1000 * (a - b):+.1f} mm; the stated ease is "
            found.append(Finding("error", where, message + f"{1000 * seam.ease:+.1f} mm"))
    found += [Finding("error", f"{p}[{i}]", f"lies in {n} seams") for (p, i), n in used.items() if n > 1]
    return found
