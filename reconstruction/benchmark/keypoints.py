"""The twelve structural points on a draped or laid-out garment, their projections, and which can be seen.

A point is where the *cut* puts it, not where the body's joint is, so it is defined without judgement:

=========  ==================================  ==============================  ===============================
point      robe, half-sleeve                   flying ribbon                   veil hat
=========  ==================================  ==============================  ===============================
shoulder   on the fold, half the biacromial    upper edge, at the shoulder     edge of the brim: the cloth turns
           breadth from the middle             pin                             from lying to hanging
elbow      on the fold, halfway from shoulder  upper edge, halfway from        absent (no sleeve)
           to cuff                             shoulder to hand
wrist      on the fold, at the cuff            upper edge, where it is held    absent (no sleeve)
neckline   on the fold, at the collar          upper edge beside the nape      base of the crown
waist      on the side seam                    absent (no side seam)           absent (no side seam)
ankle      corner of the hem                   free tip, lower corner          hem of the veil, at the side
=========  ==================================  ==============================  ===============================

So a half-sleeve's wrist is the end of its short sleeve. Visible means: inside the image and not hidden behind cloth or body. Damage
of the painting does not make a point invisible; `intact` in the index says whether paint is left there.
"""

from __future__ import annotations

import numpy as np

from reconstruction.landmarks import LANDMARKS

from .camera import Camera
from .raycast import Caster
from .sewing import SewnMesh

TOLERANCE = 0.012
"""Cloth this close in front of a point does not hide it, m: a point on a fold is hidden by its own cloth otherwise."""


def present(mesh: SewnMesh) -> np.ndarray:
    """(12,) bool: the landmarks this garment's cut has."""
    return np.array([name in mesh.garment.anchors for name in LANDMARKS])


def place(mesh: SewnMesh, vertices: np.ndarray) -> np.ndarray:
    """Positions of the twelve points.

    Parameters
    ----------
    mesh : SewnMesh
    vertices : (n, 3) array
        Draped or flat positions, m.

    Returns
    -------
    (12, 3) array
        m; NaN where the point is absent.
    """
    points = np.full((len(LANDMARKS), 3), np.nan)
    for i, name in enumerate(LANDMARKS):
        if name in mesh.garment.anchors:
            anchor = mesh.garment.anchors[name]
            face, weights = mesh.locate(anchor.panel, anchor.uv)
            points[i] = weights @ vertices[mesh.faces[face]]
    return points


def visible(points: np.ndarray, camera: Camera, caster: Caster) -> np.ndarray:
    """Which points are seen.

    Parameters
    ----------
    points : (12, 3) array
        NaN where absent.
    camera : Camera
    caster : Caster
        Everything that can hide them.

    Returns
    -------
    (12,) bool array
    """
    seen = np.zeros(len(points), dtype=bool)
    there = np.isfinite(points).all(axis=1)
    if there.any():
        pixels, depth = camera.project(points[there])
        inside = (pixels >= -0.5).all(axis=1) & (pixels < np.array([camera.width, camera.height]) - 0.5).all(axis=1) & (depth > 0)
        back = camera.towards(points[there])
        blocked = caster.blocked(points[there] + TOLERANCE * back, back)
        seen[there] = inside & ~blocked
    return seen
