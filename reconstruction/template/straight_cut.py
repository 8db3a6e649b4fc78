"""Panels of garments whose sleeves run straight on from the shoulders: round-collar robe and half-sleeve.

The cut follows the loom: two widths of cloth run over the shoulders from the front hem to the back hem and are sewn together at
the centre back; the sleeves are set on as further widths with the warp in the same direction; gores widen the hem where a width
does not suffice; a straight band makes the collar. Panels lie as seen from the front, x to the wearer's left, y = 0 on the
shoulder line.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from reconstruction.template.checks import LOOM_WIDTH
from reconstruction.template.dimensions import TDimensions
from reconstruction.template.panel import Edge, Panel, Pattern, Seam, relative_control

SEAM_ALLOWANCE, HEM_ALLOWANCE = 0.012, 0.03
"""Allowances at seams and at free edges, m (usual values)."""
SHOULDER_HEIGHT, DEPTH = 1.45, 0.2
"""Where the panels hang: height of the shoulder line, distance of front and back from the body's centre, m."""
SHALLOW = ((0.75, 0.7), (0.4, 1.0))
"""Shape of the back neckline: it leaves the shoulder line slanting, not at a right angle as the front's ellipse."""
SMALLEST = 0.001
"""Overlaps, slits and collars below this are none, m."""
Piece = tuple[str, np.ndarray]
"""Name of an edge and its points: two for a straight one, four Bézier points for a curve."""


def build(garment: str, dimensions: TDimensions, loom_width: float = LOOM_WIDTH) -> Pattern:
    """Pattern of a round-collar robe or a half-sleeve.

    Parameters
    ----------
    garment : str
        Name of the pattern.
    dimensions : TDimensions
    loom_width : float
        Width of the cloth, m: decides on gores and on the number of pieces of a sleeve.
    """
    small = {name: 0.0 for name in ("overlap_neck", "slit", "collar_height") if getattr(dimensions, name) < SMALLEST}
    d = replace(dimensions, **small)  # type: ignore[arg-type]
    gore = d.hem_width > d.body_width and d.hem_width / 2 + 2 * SEAM_ALLOWANCE > loom_width
    panels: dict[str, Panel] = {}
    seams: list[Seam] = []
    for side, sign in (("left", 1), ("right", -1)):
        panels[f"front_{side}"] = _panel(f"front_{side}", _front(d, gore), sign, (0, SHOULDER_HEIGHT, DEPTH), label="body")
        panels[f"back_{side}"] = _panel(f"back_{side}", _back(d, gore), sign, (0, SHOULDER_HEIGHT, -DEPTH), label="body")
        if gore:
            for face, depth in (("front", DEPTH), ("back", -DEPTH)):
                name = f"gore_{face}_{side}"
                panels[name] = _panel(name, _gore(d), sign, (0, SHOULDER_HEIGHT, depth), label="body")
        pieces = _sleeve(d, loom_width)
        for i, piece in enumerate(pieces, 1):
            name = f"sleeve_{side}_{i}"
            panels[name] = _panel(name, piece, sign, (0, SHOULDER_HEIGHT, 0), label="arm")
        seams += _side_seams(panels, side, gore, len(pieces))
    seams.append(_seam(panels, "back_left", "centre_back", "back_right", "centre_back"))
    if d.collar_height > 0:
        band, band_seams = _collar(panels, d)
        panels["collar"] = band
        seams += band_seams
    return Pattern(garment, _without_allowance_at_folds(panels, seams), tuple(seams), {"dimensions": d})


def _line(name: str, *points) -> list[Piece]:
    """Straight pieces through points."""
    return [(name, np.array(pair, dtype=float)) for pair in itertools.pairwise(points)]


def _quarter(d: TDimensions, depth: float, shape) -> np.ndarray:
    """Bézier points of the neckline from the shoulder line down to the centre."""
    half = d.neck_width / 2
    return np.array([(half, 0.0), *((u * half, -v * depth) for u, v in shape), (0.0, -depth)])


def _side(d: TDimensions, gore: bool) -> list[Piece]:
    """From the hem's outer corner up to the armpit: slit, then side seam (or the straight seam of the gore)."""
    pit = np.array([d.body_width / 2, -d.armhole_depth])
    if gore:
        return _line("gore_seam", (d.body_width / 2, -d.length), pit)
    corner = np.array([d.hem_width / 2, -d.length])
    return _slit_and_side(corner, pit, d.slit)


def _slit_and_side(corner: np.ndarray, pit: np.ndarray, slit: float) -> list[Piece]:
    if slit == 0:
        return _line("side", corner, pit)
    top = corner + slit * (pit - corner) / np.linalg.norm(pit - corner)
    return _line("slit", corner, top) + _line("side", top, pit)


def _body(d: TDimensions, gore: bool, bottom: float) -> list[Piece]:
    """From the hem at x = `bottom` round the side to the neckline."""
    outer = d.body_width / 2 if gore else d.hem_width / 2
    pit, tip, neck = (d.body_width / 2, -d.armhole_depth), (d.body_width / 2, 0.0), (d.neck_width / 2, 0.0)
    edges = _line("hem", (bottom, -d.length), (outer, -d.length)) + _side(d, gore)
    return edges + _line("armhole", pit, tip) + _line("shoulder", tip, neck)


def _back(d: TDimensions, gore: bool) -> list[Piece]:
    neckline = _quarter(d, d.back_neck_depth, SHALLOW)
    return [*_body(d, gore, 0.0), ("neckline", neckline), *_line("centre_back", neckline[-1], (0.0, -d.length))]


def _front(d: TDimensions, gore: bool) -> list[Piece]:
    """The left front; past the centre it reaches over (or under) the other one."""
    neckline = _quarter(d, d.neck_depth, d.neckline)
    edges = [*_body(d, gore, -d.overlap_hem), ("neckline", neckline)]
    start = neckline[-1]
    if d.overlap_neck > 0:
        over = _part_to(neckline[::-1] * (-1, 1), -d.overlap_neck)
        edges.append(("neckline_overlap", over))
        start = over[-1]
    return edges + _line("lapel", start, (-d.overlap_hem, -d.length))


def _part_to(control: np.ndarray, x: float) -> np.ndarray:
    """First part of a Bézier curve, up to where its x (monotonic) reaches a value."""
    from scipy.optimize import brentq

    def split(t: float) -> np.ndarray:
        layers = [control]
        while len(layers[-1]) > 1:
            layers.append((1 - t) * layers[-1][:-1] + t * layers[-1][1:])
        return np.array([layer[0] for layer in layers])

    return split(float(brentq(lambda t: split(t)[-1, 0] - x, 0.0, 1.0, xtol=1e-14)))


def _gore(d: TDimensions) -> list[Piece]:
    """Right-angled triangle that widens a quarter of the hem."""
    pit, foot, corner = (np.array(p) for p in
                         ((d.body_width / 2, -d.armhole_depth), (d.body_width / 2, -d.length), (d.hem_width / 2, -d.length)))
    return _line("hem", foot, corner) + _slit_and_side(corner, pit, d.slit) + _line("gore_seam", pit, foot)


def _sleeve(d: TDimensions, loom_width: float) -> list[list[Piece]]:
    """A sleeve from the armhole outwards, in as many pieces as the loom asks for; y > 0 is its back, folded at the shoulder."""
    inner, outer = d.body_width / 2, d.cross_sleeve_width / 2
    count = max(1, int(np.ceil((outer - inner) / (loom_width - 2 * SEAM_ALLOWANCE))))
    if count == 1 and outer - inner + SEAM_ALLOWANCE + HEM_ALLOWANCE > loom_width:
        count = 2
    x = np.linspace(inner, outer, count + 1)
    y = np.linspace(d.armhole_depth, d.cuff_width, count + 1)
    pieces = []
    for i in range(count):
        a, b = x[i : i + 2]
        h, k = y[i : i + 2]
        piece = _line("underarm_front", (a, -h), (b, -k))
        piece += _line("cuff" if i == count - 1 else "sleeve_join_outer", (b, -k), (b, k))
        piece += _line("underarm_back", (b, k), (a, h))
        if i == 0:
            piece += _line("armhole_back", (a, h), (a, 0)) + _line("armhole_front", (a, 0), (a, -h))
        else:
            piece += _line("sleeve_join_inner", (a, h), (a, -h))
        pieces.append(piece)
    return pieces


def _collar(panels: dict[str, Panel], d: TDimensions) -> tuple[Panel, list[Seam]]:
    """The straight band along the whole neckline, and its seams."""
    route = [("front_left", "neckline_overlap"), ("front_left", "neckline"), ("back_left", "neckline"), ("back_right", "neckline"),
             ("front_right", "neckline"), ("front_right", "neckline_overlap")]
    along = [(name, index) for name, edge in route for index in panels[name].find(edge)]
    x = np.concatenate([[0.0], np.cumsum([panels[name].edge_length(index) for name, index in along])])
    height = 2 * d.collar_height
    edges = _line("neck", *((v, 0.0) for v in x)) + _line("end", (x[-1], 0.0), (x[-1], height))
    edges += _line("top", (x[-1], height), (0.0, height)) + _line("end", (0.0, height), (0.0, 0.0))
    band = _panel("collar", edges, 1, (-x[-1] / 2, SHOULDER_HEIGHT + 0.05, DEPTH), warp=(1.0, 0.0), label="neck")
    return band, [Seam((name, index), ("collar", i)) for i, (name, index) in enumerate(along)]


def _side_seams(panels: dict[str, Panel], side: str, gore: bool, pieces: int) -> list[Seam]:
    front, back, sleeve = f"front_{side}", f"back_{side}", f"sleeve_{side}_1"
    seams = [_seam(panels, front, "shoulder", back, "shoulder", "fold"), _seam(panels, front, "armhole", sleeve, "armhole_front"),
             _seam(panels, back, "armhole", sleeve, "armhole_back")]
    if gore:
        for face in (front, back):
            seams.append(_seam(panels, face, "gore_seam", f"gore_{face}", "gore_seam"))
        seams.append(_seam(panels, f"gore_{front}", "side", f"gore_{back}", "side"))
    else:
        seams.append(_seam(panels, front, "side", back, "side"))
    for i in range(1, pieces + 1):
        name = f"sleeve_{side}_{i}"
        seams.append(_seam(panels, name, "underarm_front", name, "underarm_back"))
        if i < pieces:
            seams.append(_seam(panels, name, "sleeve_join_outer", f"sleeve_{side}_{i + 1}", "sleeve_join_inner"))
    return seams


def _seam(panels: dict[str, Panel], first: str, edge: str, second: str, other: str, kind: str = "sewn") -> Seam:
    return Seam((first, panels[first].find(edge)[0]), (second, panels[second].find(other)[0]), kind)


def _panel(name: str, pieces: Sequence[Piece], sign: int, translation, warp=(0.0, 1.0), label: str = "") -> Panel:
    """Panel from a loop of pieces; with `sign` -1 its mirror image, run the other way round."""
    if sign < 0:
        pieces = [(edge, points[::-1] * (-1, 1)) for edge, points in reversed(pieces)]
    edges = []
    for i, (edge, points) in enumerate(pieces):
        curve = ("cubic", relative_control(points)) if len(points) == 4 else ("line", ())
        notches = (0.5,) if edge in ("side", "gore_seam", "centre_back", "underarm_front", "underarm_back") else ()
        allowance = HEM_ALLOWANCE if edge in ("hem", "cuff") else SEAM_ALLOWANCE
        edges.append(Edge(i, (i + 1) % len(pieces), *curve, name=edge, allowance=allowance, notches=notches))
    vertices = np.array([points[0] for _, points in pieces])
    return Panel(name, vertices, tuple(edges), np.array(warp), np.array(translation, dtype=float), label=label)


def _without_allowance_at_folds(panels: dict[str, Panel], seams: Sequence[Seam]) -> dict[str, Panel]:
    """Edges across which two panels are cut in one piece have no allowance."""
    folded = {end for seam in seams if seam.kind == "fold" for end in (seam.first, seam.second)}
    return {
        name: replace(panel, edges=tuple(replace(edge, allowance=0.0) if (name, i) in folded else edge
                                         for i, edge in enumerate(panel.edges)))
        for name, panel in panels.items()
    }
