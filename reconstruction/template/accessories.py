"""Panels of the flying ribbon and the veil hat."""

from __future__ import annotations

import numpy as np

from reconstruction.template.dimensions import HatDimensions, RibbonDimensions
from reconstruction.template.panel import Edge, Panel, Pattern, Seam
from reconstruction.template.straight_cut import HEM_ALLOWANCE, SEAM_ALLOWANCE, SHOULDER_HEIGHT

HEAD_HEIGHT = 1.6
SMALLEST_GAP = 0.002
"""A veil less open than this, m along the brim, is closed."""


def build_ribbon(dimensions: RibbonDimensions) -> Pattern:
    """A strip with the warp along its length, hemmed all round."""
    panel = _rectangle("ribbon", dimensions.length, dimensions.width, ("hem", "end", "hem", "end"), HEM_ALLOWANCE / 3,
                       (1.0, 0.0), (-dimensions.length / 2, SHOULDER_HEIGHT, -0.2))
    return Pattern("flying-ribbon", {"ribbon": panel}, (), {"dimensions": dimensions})


def build_hat(dimensions: HatDimensions) -> Pattern:
    """Crown (the sector to which a cone develops), brim (two half rings) and veil, gathered along the brim but for the opening at
    the face.

    Edges are split at the middle of face and nape and where the veil begins, so that every seam joins one edge to one edge; the
    gathering is stated as ease.
    """
    d = dimensions
    crown, brim = d.crown_diameter / 2, d.brim_diameter / 2
    gap = d.open_angle / 2 if d.open_angle * brim > SMALLEST_GAP else 0.0
    panels = {"crown": _sector(crown, d.crown_height)}
    panels["veil"] = _strip("veil", [d.gathering * brim * (np.pi - gap)] * 2, d.veil_length, "hem", "gather")
    seams = [Seam(("crown", panels["crown"].find("crown_back_left")[0]), ("crown", panels["crown"].find("crown_back_right")[0]))]
    for i, (side, sign) in enumerate((("left", 1), ("right", -1))):
        ring = panels[f"brim_{side}"] = _half_ring(f"brim_{side}", crown, brim, gap, sign)
        veil, outer = panels["veil"].find("gather")[i], ring.find("veil_edge")[0]
        gathered = panels["veil"].edge_length(veil) - ring.edge_length(outer)
        seams += [Seam(("veil", veil), (ring.name, outer), ease=gathered),
                  Seam(("crown", panels["crown"].find("base")[i]), (ring.name, ring.find("inner")[0]))]
    for name in ("brim_front", "brim_back"):
        seams.append(Seam(("brim_left", panels["brim_left"].find(name)[0]), ("brim_right", panels["brim_right"].find(name)[0])))
    return Pattern("veil-hat", panels, tuple(seams), {"dimensions": d})


def _rectangle(name, length, width, names, allowance, warp, translation) -> Panel:
    vertices = np.array([(0, 0), (length, 0), (length, width), (0, width)], dtype=float)
    edges = tuple(Edge(i, (i + 1) % 4, name=n, allowance=allowance) for i, n in enumerate(names))
    return Panel(name, vertices, edges, np.array(warp), np.array(translation, dtype=float))


def _strip(name: str, lengths: list[float], height: float, lower: str, upper: str) -> Panel:
    """A straight band whose long edges are split at the given lengths; warp across it (downwards, as it hangs)."""
    x = np.concatenate([[0.0], np.cumsum(lengths)])
    bottom, top = [(v, 0.0) for v in x], [(v, height) for v in x[::-1]]
    n = len(lengths)
    names = [lower] * n + ["end"] + [upper] * n + ["end"]
    vertices = np.array(bottom + top)
    edges = tuple(Edge(i, (i + 1) % len(vertices), name=e, allowance=HEM_ALLOWANCE if e == "hem" else SEAM_ALLOWANCE)
                  for i, e in enumerate(names))
    return Panel(name, vertices, edges, translation=np.array([-x[-1] / 2, HEAD_HEIGHT, 0.2]), label="head")


def _sector(radius: float, height: float) -> Panel:
    """Development of a cone: apex at the origin, its base below, split at the middle."""
    slant = float(np.hypot(radius, height))
    half = np.pi * radius / slant
    points = [(0.0, 0.0), *(slant * np.array([np.sin(angle), -np.cos(angle)]) for angle in (-half, 0.0, half))]
    arc = ("circle", (slant, 0.0, 1.0))
    names = (("crown_back_right", "line", ()), ("base", *arc), ("base", *arc), ("crown_back_left", "line", ()))
    edges = tuple(Edge(i, (i + 1) % 4, kind, params, name, SEAM_ALLOWANCE) for i, (name, kind, params) in enumerate(names))
    return Panel("crown", np.array(points), edges, translation=np.array([0, HEAD_HEIGHT + 0.2, 0]), label="head")


def _half_ring(name: str, inner: float, outer: float, gap: float, sign: int) -> Panel:
    """Half of the brim, to one side of the axis through the face (at -y); the veil is set on from the angle `gap` off the face."""
    start = outer * np.array([np.sin(gap), -np.cos(gap)])
    loop = [("brim_front", np.array([0, -inner]), None), ("face", np.array([0, -outer]), outer), ("veil_edge", start, outer),
            ("brim_back", np.array([0, outer]), None), ("inner", np.array([0, inner]), -inner)]
    if gap == 0:
        loop.pop(1)
    ends = [*loop[1:], loop[0]]
    pieces = [(edge, a, b[1], radius) for (edge, a, radius), b in zip(loop, ends, strict=True)]
    if sign < 0:
        pieces = [(edge, b * (-1, 1), a * (-1, 1), radius) for edge, a, b, radius in reversed(pieces)]
    n = len(pieces)
    edges = []
    for i, (edge, _, _, radius) in enumerate(pieces):
        kind, params = ("line", ()) if radius is None else ("circle", (abs(radius), 0.0, float(radius > 0)))
        edges.append(Edge(i, (i + 1) % n, kind, params, edge, SEAM_ALLOWANCE))
    return Panel(name, np.array([a for _, a, _, _ in pieces], dtype=float), tuple(edges),
                 translation=np.array([0, HEAD_HEIGHT, 0.0]), label="head")
