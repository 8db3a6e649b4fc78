"""The wearer's axes: x to the left, y backwards, z up, from the middle of the neckline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mfar_fem.errors import InputError
from reconstruction.landmarks import INDEX, PARTS
from reconstruction.shape.landmarks3d import SpacePoints


@dataclass(frozen=True, eq=False)
class BodyFrame:
    """Rigid map between the world of the cameras and the wearer.

    Attributes
    ----------
    origin : (3,) array
        m, world.
    axes : (3, 3) array
        Rows: left, back, up.
    """

    origin: np.ndarray
    axes: np.ndarray

    def to_body(self, points) -> np.ndarray:
        """Coordinates of the wearer (..., 3) of world points."""
        return (np.asarray(points) - self.origin) @ self.axes.T

    def to_world(self, points) -> np.ndarray:
        """World points (..., 3)."""
        return np.asarray(points) @ self.axes + self.origin

    def camera(self, camera) -> np.ndarray:
        """Camera (3, 4) that takes the wearer's coordinates."""
        camera = np.asarray(camera, dtype=float)
        return np.column_stack([camera[:, :3] @ self.axes.T, camera[:, :3] @ self.origin + camera[:, 3]])


def body_frame(points: SpacePoints) -> BodyFrame:
    """Axes from landmarks: left from the pairs, up from the lower ones to the upper ones.

    Raises
    ------
    InputError
        Too few landmarks: a left and a right one and two levels are needed.
    """
    pairs, middles = [], {}
    for part in PARTS:
        left, right = points.points[INDEX[f"left_{part}"]], points.points[INDEX[f"right_{part}"]]
        if np.isfinite(left).all() and np.isfinite(right).all():
            pairs.append(left - right)
            middles[part] = 0.5 * (left + right)
    top = middles.get("neckline", middles.get("shoulder"))
    low = middles.get("ankle", middles.get("waist"))
    if top is None or low is None:
        raise InputError(
            "the wearer's axes need neckline or shoulders, and ankles or waist, on both sides in space; found: "
            + (", ".join(middles) or "no pair")
        )
    left = np.sum(pairs, axis=0)
    up = top - low
    up /= np.linalg.norm(up)
    left = left - (left @ up) * up
    if np.linalg.norm(left) < 0.05:
        raise InputError("left and right landmarks lie above each other; the wearer's axes cannot be told")
    left /= np.linalg.norm(left)
    return BodyFrame(np.asarray(top), np.stack([left, np.cross(up, left), up]))
