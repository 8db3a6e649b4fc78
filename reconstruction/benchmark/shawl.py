"""The flying ribbon: one long band worn across the back, held by a pin on each shoulder and by the hands.

u runs across the band from the edge that is worn up (front), v along it (warp) to the wearer's left from the nape.
"""

from __future__ import annotations

import numpy as np

from .cutting import Cut
from .panels import Anchor, Edge, Garment, Panel

NECK_STATION = 0.07
"""Neckline point from the nape along the upper edge, m (assumption: half the breadth of a neck)."""


def stations(cut: Cut, shoulder: float, arm: float) -> dict[str, float]:
    """Distance from the nape, along the upper edge, of the points that hold the band, m.

    Parameters
    ----------
    cut : Cut
        Of the ribbon.
    shoulder, arm : float
        Half the breadth of the shoulders and the length from shoulder to hand, m.
    """
    hand = min(shoulder + arm * cut["slack"], cut["length"] / 2 - 0.1)
    return {"neckline": NECK_STATION, "shoulder": shoulder, "elbow": 0.5 * (shoulder + hand), "wrist": hand}


def shawl(cut: Cut, shoulder: float, arm: float) -> Garment:
    """Cut a ribbon for a wearer; see :func:`stations` for the arguments. It has no waist; its ankle points are the free tips."""
    half, width = cut["length"] / 2, cut["width"]
    corners = np.array([(0, -half), (width, -half), (width, half), (0, half)], dtype=float)
    names = ("right_end", "lower", "left_end", "upper")
    edges = tuple(Edge(n, np.array([corners[i], corners[(i + 1) % 4]])) for i, n in enumerate(names))
    anchors: dict[str, Anchor] = {}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for part, at in stations(cut, shoulder, arm).items():
            anchors[f"{side}_{part}"] = Anchor("band", (0.0, sign * at))
        anchors[f"{side}_ankle"] = Anchor("band", (width, sign * half))

    def layout(panel: str, uv: np.ndarray) -> np.ndarray:
        return np.stack([uv[:, 1], -uv[:, 0], np.zeros(len(uv))], axis=1)

    return Garment("flying-ribbon", (Panel("band", edges),), (), anchors, layout, tuple(("band", n) for n in names))
