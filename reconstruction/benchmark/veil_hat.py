"""The veil hat: a pointed crown, a flat brim in two halves and a gathered veil, open in front.

Crown and brim are stiff (they keep their shape when worn); the veil hangs. The crown's panel is the sector to which its cone
develops. The brim's halves meet in front and at the back.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mfar_fem.errors import ParameterError

from .cutting import Cut
from .panels import Anchor, Edge, Garment, Panel, Seam

STIFF = ("crown", "left_brim", "right_brim")
"""Panels that keep their shape."""
CLEARANCE = 0.012
"""Room between skull and crown, m (assumption)."""
GAP = 0.12
"""Distance between the pieces laid out flat, m."""


@dataclass(frozen=True)
class HatShape:
    """Lengths derived from the cut and the head: radius of the crown's base and of the brim, height of the crown (m), half the
    angle of the open front (rad) and the veil's width along the brim (m)."""

    base: float
    brim: float
    height: float
    gap: float
    veil_width: float

    @property
    def slant(self) -> float:
        """Slant height of the crown, m."""
        return float(np.hypot(self.base, self.height))

    @property
    def sector(self) -> float:
        """Half the angle of the crown's sector, rad."""
        return float(np.pi * self.base / self.slant)


def hat_shape(cut: Cut, skull: float) -> HatShape:
    """The hat's lengths for a skull of radius `skull` (m): the cone clears a sphere centred on its base.

    Raises
    ------
    ParameterError
        The crown is too low for the head or the brim too narrow.
    """
    room, height, brim = skull + CLEARANCE, cut["crown_height"], cut["brim_radius"]
    if height <= 1.2 * room:
        raise ParameterError(f"veil-hat: a crown {height:.3f} m high does not clear a skull of radius {skull:.3f} m")
    base = float(room * height / np.sqrt(height**2 - room**2))  # distance centre-cone = room
    if brim < base + 0.03:
        raise ParameterError(f"veil-hat: brim radius {brim:.3f} m must exceed the crown's base {base:.3f} m by 0.03 m")
    gap = 0.5 * cut["front_gap"] / brim
    return HatShape(base, brim, height, gap, float(cut["fullness"] * brim * 2 * (np.pi - gap)))


def veil_hat(cut: Cut, skull: float) -> Garment:
    """Cut a veil hat for a head: shoulder points on the edge of the brim, neckline at the base of the crown, ankle at the hem."""
    s = hat_shape(cut, skull)
    half, drop = s.veil_width / 2, cut["veil_length"]
    angle = np.linspace(-s.sector, s.sector, 49)
    arc = s.slant * np.stack([np.sin(angle), np.cos(angle)], axis=1)
    crown = Panel(
        "crown",
        (
            Edge("back_right", np.array([[0.0, 0.0], arc[0]])),
            Edge("base_right", arc[:25]),
            Edge("base_left", arc[24:]),
            Edge("back_left", np.array([arc[-1], [0.0, 0.0]])),
        ),
    )
    panels, seams = [crown], [Seam("crown_back", ("crown", "back_left"), ("crown", "back_right"))]
    for side, sign in (("left", 1.0), ("right", -1.0)):
        panels.append(_half_brim(s, f"{side}_brim", sign))
        seams += [
            Seam(f"{side}_crown_brim", ("crown", f"base_{side}"), (f"{side}_brim", "inner"), flip=sign < 0),
            Seam(f"{side}_veil", ("veil", f"top_{side}"), (f"{side}_brim", "veiled"), flip=sign < 0, eased=True),
        ]
    seams += [
        Seam("brim_front", ("left_brim", "front"), ("right_brim", "front"), flip=False),
        Seam("brim_back", ("left_brim", "back"), ("right_brim", "back"), flip=False),
    ]
    corners = [(-half, 0.0), (0.0, 0.0), (half, 0.0), (half, drop), (-half, drop)]
    names = ("top_right", "top_left", "left_edge", "hem", "right_edge")
    panels.append(
        Panel("veil", tuple(Edge(n, np.array([corners[i], corners[(i + 1) % 5]])) for i, n in enumerate(names)), outward=1)
    )
    side_u = half * (np.pi / 2) / (np.pi - s.gap)
    anchors: dict[str, Anchor] = {}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        anchors |= {
            f"{side}_shoulder": Anchor(f"{side}_brim", (sign * s.brim, 0.0)),
            f"{side}_neckline": Anchor(f"{side}_brim", (sign * s.base, 0.0)),
            f"{side}_ankle": Anchor("veil", (sign * side_u, drop)),
        }

    def layout(panel: str, uv: np.ndarray) -> np.ndarray:
        u, v = uv.T
        top = 2 * s.brim + GAP  # the veil below the brim, the crown above it
        y = {"veil": -v - s.brim - GAP, "crown": s.brim + GAP + s.slant - v + max(0.0, -s.slant * np.cos(s.sector))}.get(panel, -v)
        return np.stack([u, y - top / 2, np.zeros(len(u))], axis=1)

    openings = (("veil", "left_edge"), ("veil", "right_edge"), ("veil", "hem"), ("left_brim", "free"), ("right_brim", "free"))
    return Garment("veil-hat", tuple(panels), tuple(seams), anchors, layout, openings)


def _half_brim(s: HatShape, name: str, sign: float) -> Panel:
    """Half an annulus, u to the wearer's left and v forwards; the open front has no veil."""
    back_to_front = np.linspace(0.0, np.pi, 49)
    cut_at = np.linspace(0.0, np.pi - s.gap, 41)
    rest = np.linspace(np.pi - s.gap, np.pi, 9)
    ring = lambda radius, angle: radius * np.stack([sign * np.sin(angle), -np.cos(angle)], axis=1)  # noqa: E731
    inner = ring(s.base, back_to_front)
    veiled, free = ring(s.brim, cut_at), ring(s.brim, rest)
    for line in (inner, veiled):
        line[0, 0] = 0.0
    inner[-1, 0] = free[-1, 0] = 0.0
    edges = [
        Edge("veiled", veiled),
        Edge("free", free),
        Edge("front", np.array([free[-1], inner[-1]])),
        Edge("inner", inner[::-1]),
        Edge("back", np.array([inner[0], veiled[0]])),
    ]
    return Panel(name, tuple(edges))
