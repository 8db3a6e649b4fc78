"""A veil hat on a head: crown and brim keep their shape, the veil hangs from the brim."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mfar_fem.errors import InputError
from reconstruction.landmarks import INDEX
from reconstruction.shape.frame import BodyFrame, body_frame
from reconstruction.shape.landmarks3d import SpacePoints
from reconstruction.shape.mannequin import HEAD, NECK, mannequin
from reconstruction.shape.sewn_hat import VEIL, in_space, sew_hat
from reconstruction.shape.wearing import Worn
from reconstruction.template.dimensions import HatDimensions

CERTAIN = 0.03
"""Standard deviation up to which a landmark in space says more of a hat's lengths than the template, m."""


def put_on_hat(d: HatDimensions, points: SpacePoints, stature: float, edge: float) -> Worn:
    """Set a hat level on a head.

    Its landmarks: neckline at the base of the crown, shoulders at the edge of the brim, ankles at the veil's hem, on both sides.

    Raises
    ------
    InputError
        Neither base nor brim is known on both sides, or nothing below.
    """
    frame = body_frame(points)
    places = frame.to_body(points.points)
    d = _as_seen(d, places, points.sigma)
    sewn = sew_hat(d, edge)
    middles = [0.5 * (places[INDEX[f"left_{p}"]] + places[INDEX[f"right_{p}"]]) for p in ("neckline", "shoulder")]
    middles = [m for m in middles if np.isfinite(m).all()]
    if not middles:
        raise InputError("a veil hat needs the points at the base of its crown or at its brim, on both sides")
    middle = np.mean(middles, axis=0)
    # the wearer's axes begin at the neck, which lies below the head's middle, where the crown sits
    drop = (HEAD[0] - NECK) * stature
    frame = BodyFrame(frame.to_world(middle - np.array([0.0, 0.0, drop])), frame.axes)
    places = frame.to_body(points.points)
    start = in_space(sewn, d) + np.array([0.0, 0.0, drop])
    stiff = np.unique(sewn.faces[sewn.panel != VEIL])
    known = []
    hem = sewn.openings["hem"]
    for side, sign in (("left", 1.0), ("right", -1.0)):
        k = INDEX[f"{side}_ankle"]
        if np.isfinite(places[k]).all():
            theta = sewn.uv[hem, 0] / (0.5 * d.brim_diameter)
            known.append((int(hem[np.abs(theta - sign * 0.5 * np.pi).argmin()]), places[k], float(points.sigma[k])))
    firm = np.zeros(len(start))
    firm[stiff] = 20.0
    return Worn(sewn, start, frame, mannequin(stature, ()), known, firm, stiff=stiff, pinned=stiff)


def _as_seen(d: HatDimensions, places, sigma) -> HatDimensions:
    """With diameters and length of the veil from landmarks in space that are certain enough: pictures show a hat from the side."""
    places = np.where((sigma < CERTAIN)[:, None], places, np.nan)
    parts = ("neckline", "shoulder", "ankle")
    left, right = (np.array([places[INDEX[f"{side}_{p}"]] for p in parts]) for side in ("left", "right"))
    crown, brim, _ = np.linalg.norm(left - right, axis=1)
    brim = float(brim) if np.isfinite(brim) else d.brim_diameter
    crown = min(float(crown) if np.isfinite(crown) else d.crown_diameter, 0.9 * brim)
    veil = float(np.mean(left[1] + right[1] - left[2] - right[2], where=[False, False, True]) / 2)
    return replace(d, brim_diameter=brim, crown_diameter=crown, veil_length=veil if veil > 0 else d.veil_length)
