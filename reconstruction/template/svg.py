"""A pattern as SVG at true scale: one user unit is one millimetre."""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from reconstruction.template.layout import Placed, arrange
from reconstruction.template.panel import Pattern

MARGIN, BAR = 20.0, 100.0
"""Margin of the sheet and length of the scale bar, mm."""
STYLE = {
    "cut": 'fill="#f6f1e6" stroke="#222222" stroke-width="0.8"',
    "sew": 'fill="none" stroke="#aa3333" stroke-width="0.5" stroke-dasharray="5 2.5"',
    "grain": 'fill="none" stroke="#224466" stroke-width="0.7"',
    "notch": 'fill="none" stroke="#222222" stroke-width="0.6"',
    "scale": 'fill="none" stroke="#222222" stroke-width="1.2"',
}
"""Presentation attributes of every class (not a style sheet: plotters' programs often read none)."""


def write_svg(path, pattern: Pattern) -> None:
    """Write the drawing; print it at 100 % and the bar measures 100 mm."""
    Path(path).write_text(svg(pattern), encoding="utf-8")


def svg(pattern: Pattern) -> str:
    """The drawing as text: a group per panel with ``cut``, ``sew``, ``grain`` and ``notch``, its name, and a scale bar."""
    placed = arrange(pattern)
    everything = np.vstack([p.cut for p in placed]) * 1000
    low, size = everything.min(axis=0), np.ptp(everything, axis=0)
    width, height = max(size[0], 2 * BAR) + 2 * MARGIN, size[1] + 2 * MARGIN + 30

    def page(points: np.ndarray) -> np.ndarray:  # y runs down on the sheet
        flat = (np.asarray(points) * 1000 - low) * (1, -1)
        return flat + np.array([MARGIN, MARGIN + size[1]])

    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.3f}mm" height="{height:.3f}mm" '
        f'viewBox="0 0 {width:.3f} {height:.3f}">',
        f"  <title>{escape(pattern.name)}: cutting template, 1 unit = 1 mm</title>",
        *(line for p in placed for line in _panel(p, page)),
    ]
    y = height - MARGIN
    lines += [
        _stroke("scale", f"M {MARGIN:.3f} {y:.3f} L {MARGIN + BAR:.3f} {y:.3f}", 'id="scale-bar" '),
        f'  <text x="{MARGIN}" y="{y - 4:.3f}" font-size="9" font-family="sans-serif">100 mm</text>',
        f'  <text x="{MARGIN + BAR + 12}" y="{y:.3f}" font-size="9" font-family="sans-serif">{escape(pattern.name)}; '
        "solid: cut, dashed: sew, arrow: warp</text>",
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


def _panel(p: Placed, page) -> list[str]:
    name = p.panel.name
    lines = [f"  <g id={quoteattr(name)}>"]
    lines.append(_stroke("cut", f"{_path(page(p.cut))} Z"))
    lines.append(_stroke("sew", f"{_path(page(p.sew))} Z"))
    lines.append(_stroke("grain", _path(arrow(page(p.grain)))))
    lines += [_stroke("notch", _path(page(stroke))) for stroke in p.notches]
    x, y = page(p.text)
    anchor = "middle" if p.text_centred else "start"
    size = f'font-size="{1000 * p.text_height:.1f}" font-family="sans-serif" text-anchor="{anchor}"'
    lines.append(f'    <text x="{x:.2f}" y="{y:.2f}" {size}>{escape(name)}</text>')
    return [*lines, "  </g>"]


def arrow(ends: np.ndarray, head: float = 8.0) -> np.ndarray:
    """One stroke that draws a line with a head at its second end, (6, 2)."""
    a, b = ends
    back = (a - b) / np.linalg.norm(b - a) * head
    side = 0.5 * np.array([-back[1], back[0]])
    return np.stack([a, b, b + back + side, b, b + back - side, b])


def _stroke(kind: str, d: str, more: str = "") -> str:
    return f'    <path {more}class="{kind}" {STYLE[kind]} d="{d}"/>'


def _path(points: np.ndarray) -> str:
    return "M " + " L ".join(f"{x:.4f} {y:.4f}" for x, y in points)
