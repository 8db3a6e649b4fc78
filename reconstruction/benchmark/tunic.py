"""The straight-cut tunic: robe and half-sleeve, front and back in one piece over the shoulder fold.

Panel coordinates are those of the garment laid flat: u to the wearer's left from the middle, v down the front from the shoulder
fold; the back has negative v. A half's panel ends at the loom width; longer sleeves are pieced with a second panel, as on the
surviving robes. The under-lap of the robe is cut but lies hidden under the front: the mid-surface is the outer layer.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mfar_fem.errors import ParameterError

from .cutting import Cut
from .panels import Anchor, Edge, Garment, Panel, Seam

LAYER = 0.002
"""Distance between the two layers of the garment laid flat, m."""
NECK_BACK = 0.03
"""Depth of the neck at the back, m (assumption)."""
WAIST = 0.29
"""Waist below the shoulder fold along the side seam, fraction of the wearer's stature (shoulder 0.82, waist 0.53 to 0.61 of it)."""
SHOULDER = 0.122
"""Shoulder point from the middle along the fold, fraction of the stature (half the biacromial breadth, Drillis & Contini 1966)."""


def sleeve_depth_at(cut: Cut, u) -> np.ndarray:
    """Flat depth of the sleeve at |u|, m: linear from the side of the chest to the cuff."""
    inner, outer = cut["chest_width"] / 2, cut["cross_sleeve"] / 2
    return np.interp(np.abs(u), [inner, outer], [cut["sleeve_depth"], cut["cuff_width"]])


def half_width_at(cut: Cut, v) -> np.ndarray:
    """Flat half width of the body at |v| below the armpit, m."""
    return np.interp(np.abs(v), [cut["sleeve_depth"], cut["length"]], [cut["chest_width"] / 2, cut["hem_width"] / 2])


def tunic(cut: Cut, stature: float) -> Garment:
    """Cut a robe or a half-sleeve.

    Parameters
    ----------
    cut : Cut
        Of kind ``round-collar-robe`` or ``half-sleeve``.
    stature : float
        Of the wearer, m: it places the shoulder and waist points (the elbow is midway from shoulder to cuff).

    Raises
    ------
    ParameterError
        The parameters contradict each other.
    """
    if cut["length"] < cut["sleeve_depth"] + 0.1 or cut["cross_sleeve"] / 2 < cut["chest_width"] / 2 + 0.05:
        raise ParameterError(
            f"{cut.kind}: length {cut['length']:.2f} m or cross-sleeve width {cut['cross_sleeve']:.2f} m is too small for "
            f"a sleeve depth of {cut['sleeve_depth']:.2f} m and a chest width of {cut['chest_width']:.2f} m"
        )
    pieced = cut["cross_sleeve"] / 2 > cut["loom_width"] + 0.05
    panels, seams = [], []
    openings: list[tuple[str, str]] = []
    for side, sign in (("left", 1.0), ("right", -1.0)):
        body = f"{side}_body"
        panels.append(_body(cut, body, sign, pieced))
        seams += [
            Seam(f"{side}_side", (body, "side_front"), (body, "side_back")),
            Seam(f"{side}_underarm", (body, "underarm_front"), (body, "underarm_back")),
        ]
        openings += [(body, e.name) for e in panels[-1].edges if e.name in OPEN]
        if pieced:
            sleeve = f"{side}_sleeve"
            panels.append(_sleeve(cut, sleeve, sign))
            seams += [
                Seam(f"{side}_sleeve_underarm", (sleeve, "underarm_front"), (sleeve, "underarm_back")),
                Seam(f"{side}_piecing_front", (body, "join_front"), (sleeve, "join_front")),
                Seam(f"{side}_piecing_back", (body, "join_back"), (sleeve, "join_back")),
            ]
            openings += [(sleeve, "cuff_front"), (sleeve, "cuff_back")]
    seams += [
        Seam("middle_back", ("left_body", "centre_back"), ("right_body", "centre_back")),
        Seam("middle_front", ("left_body", "centre_front"), ("right_body", "centre_front")),
    ]
    if cut["overlap"] > 0:
        panels.append(_underlap(cut))
    return Garment(cut.kind, tuple(panels), tuple(seams), _anchors(cut, stature, pieced), _layout, tuple(openings))


OPEN = ("neck_front", "neck_back", "opening", "hem_front", "hem_back", "slit_front", "slit_back", "cuff_front", "cuff_back")


def _mirrored(name: str, named: list[tuple[str, Any]], sign: float, folds=()) -> Panel:
    """A panel from edges given for the left side; the right one is reflected and runs the other way round."""
    flip = np.array([sign, 1.0])
    edges = [Edge(label, np.asarray(points, dtype=float) * flip) for label, points in named]
    if sign < 0:
        edges = [Edge(e.name, e.points[::-1]) for e in edges[::-1]]
    return Panel(name, tuple(edges), tuple(np.asarray(f) * flip for f in folds))


def _body(cut: Cut, name: str, sign: float, pieced: bool) -> Panel:
    length, arm, chest, hem = cut["length"], cut["sleeve_depth"], cut["chest_width"] / 2, cut["hem_width"] / 2
    radius, drop = cut["collar_radius"], cut["collar_drop"]
    outer = cut["loom_width"] if pieced else cut["cross_sleeve"] / 2
    depth = float(sleeve_depth_at(cut, outer))
    slit = length - min(cut["slit"], length - arm - 0.05)
    wide = float(half_width_at(cut, slit))
    angle = np.linspace(0.0, np.pi / 2, 24)
    front_neck = np.stack([radius * np.sin(angle), drop * np.cos(angle)], axis=1)
    back_neck = np.stack([radius * np.cos(angle), -NECK_BACK * np.sin(angle)], axis=1)
    front_neck[0], front_neck[-1], back_neck[0], back_neck[-1] = (0, drop), (radius, 0), (radius, 0), (0, -NECK_BACK)
    low = drop + cut["opening"]
    end = "join" if pieced else "cuff"
    edges: list[tuple[str, Any]] = [("centre_front", [(0, length), (0, low)])]
    if low > drop:
        edges.append(("opening", [(0, low), (0, drop)]))
    edges += [
        ("neck_front", front_neck),
        ("neck_back", back_neck),
        ("centre_back", [(0, -NECK_BACK), (0, -length)]),
        ("hem_back", [(0, -length), (hem, -length)]),
    ]
    if length - slit > 1e-9:
        edges.append(("slit_back", [(hem, -length), (wide, -slit)]))
    edges += [
        ("side_back", [(wide, -slit), (chest, -arm)]),
        ("underarm_back", [(chest, -arm), (outer, -depth)]),
        (f"{end}_back", [(outer, -depth), (outer, 0)]),
        (f"{end}_front", [(outer, 0), (outer, depth)]),
        ("underarm_front", [(outer, depth), (chest, arm)]),
        ("side_front", [(chest, arm), (wide, slit)]),
    ]
    if length - slit > 1e-9:
        edges.append(("slit_front", [(wide, slit), (hem, length)]))
    edges.append(("hem_front", [(hem, length), (0, length)]))
    return _mirrored(name, edges, sign, [[(radius, 0.0), (outer, 0.0)]])


def _sleeve(cut: Cut, name: str, sign: float) -> Panel:
    inner, outer, cuff = cut["loom_width"], cut["cross_sleeve"] / 2, cut["cuff_width"]
    depth = float(sleeve_depth_at(cut, inner))
    edges: list[tuple[str, Any]] = [
        ("underarm_back", [(inner, -depth), (outer, -cuff)]),
        ("cuff_back", [(outer, -cuff), (outer, 0)]),
        ("cuff_front", [(outer, 0), (outer, cuff)]),
        ("underarm_front", [(outer, cuff), (inner, depth)]),
        ("join_front", [(inner, depth), (inner, 0)]),
        ("join_back", [(inner, 0), (inner, -depth)]),
    ]
    return _mirrored(name, edges, sign, [[(inner, 0.0), (outer, 0.0)]])


def _underlap(cut: Cut) -> Panel:
    top, bottom, width = cut["collar_drop"], cut["length"], -cut["overlap"]
    edges = (
        Edge("middle", np.array([(0, bottom), (0, top)], dtype=float)),
        Edge("top", np.array([(0, top), (width, top)], dtype=float)),
        Edge("free", np.array([(width, top), (width, bottom)], dtype=float)),
        Edge("hem", np.array([(width, bottom), (0, bottom)], dtype=float)),
    )
    return Panel("underlap", edges, draped=False)


def _anchors(cut: Cut, stature: float, pieced: bool) -> dict[str, Anchor]:
    cuff, radius = cut["cross_sleeve"] / 2, cut["collar_radius"]
    shoulder = float(np.clip(SHOULDER * stature, radius + 0.03, cuff - 0.1))
    elbow = 0.5 * (shoulder + cuff)
    low = cut["length"] - min(cut["slit"], cut["length"] - cut["sleeve_depth"] - 0.05)
    waist = float(np.clip(WAIST * stature, cut["sleeve_depth"] + 0.03, max(low - 0.02, cut["sleeve_depth"] + 0.03)))
    anchors: dict[str, Anchor] = {}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        outer = f"{side}_sleeve" if pieced else f"{side}_body"
        elbow_panel = outer if elbow > cut["loom_width"] else f"{side}_body"
        anchors |= {
            f"{side}_shoulder": Anchor(f"{side}_body", (sign * shoulder, 0.0)),
            f"{side}_elbow": Anchor(elbow_panel, (sign * elbow, 0.0)),
            f"{side}_wrist": Anchor(outer, (sign * cuff, 0.0)),
            f"{side}_neckline": Anchor(f"{side}_body", (sign * radius, 0.0)),
            f"{side}_waist": Anchor(f"{side}_body", (sign * float(half_width_at(cut, waist)), waist)),
            f"{side}_ankle": Anchor(f"{side}_body", (sign * cut["hem_width"] / 2, cut["length"])),
        }
    return anchors


def _layout(panel: str, uv: np.ndarray) -> np.ndarray:
    u, v = uv.T
    return np.stack([u, -np.abs(v), np.where(v > 1e-9, 0.0, np.where(v < -1e-9, -LAYER, -LAYER / 2))], axis=1)
