"""The garment's own axes in a picture: across (to the wearer's left) and down (to the hem)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mfar_fem.errors import InputError
from reconstruction.landmarks import INDEX, PARTS


class CannotMeasureError(InputError):
    """A picture cannot be measured; of several pictures it can be left out."""


class TooFewPointsError(CannotMeasureError):
    """A picture shows too few of the landmarks to be measured."""


@dataclass(frozen=True)
class Frame:
    """Unit vectors and the pivot of a garment in a picture.

    Attributes
    ----------
    across : (2,) array
        Towards the wearer's left.
    down : (2,) array
        Towards the hem, perpendicular to it.
    origin : (2,) array
        Middle of the neckline points, or of the shoulders, px.
    """

    across: np.ndarray
    down: np.ndarray
    origin: np.ndarray

    def coordinates(self, points) -> np.ndarray:
        """(across, down) coordinates (n, 2) of points, px from the origin."""
        return (np.asarray(points) - self.origin) @ np.stack([self.across, self.down]).T

    def pixels(self, coordinates) -> np.ndarray:
        """Pixels of (across, down) coordinates (n, 2)."""
        return self.origin + np.asarray(coordinates) @ np.stack([self.across, self.down])


def pair(points: np.ndarray, part: str) -> tuple[np.ndarray, np.ndarray] | None:
    """Left and right point of a part, or None if one is absent."""
    left, right = points[INDEX[f"left_{part}"]], points[INDEX[f"right_{part}"]]
    return (left, right) if np.isfinite(left).all() and np.isfinite(right).all() else None


def garment_frame(points: np.ndarray, path="", polygon: np.ndarray | None = None) -> Frame:
    """Axes from the landmarks: `across` is the sum of all right-to-left vectors (long ones weigh most).

    `down` is where the points of waist and ankles lie, single ones too: seen from behind, left and right have changed sides.
    Without any it is where most of the contour lies.

    Parameters
    ----------
    points : (12, 2) array
        px; NaN where absent.
    polygon : (n, 2) array, optional
        Contour of the garment, px.

    Raises
    ------
    TooFewPointsError
        Neckline and shoulders are both missing.
    InputError
        Left and right points coincide.
    """
    pairs = {part: found for part in PARTS if (found := pair(points, part)) is not None}
    top = pairs.get("neckline") or pairs.get("shoulder")
    if top is None:
        raise TooFewPointsError(f"{path}: the garment's axes need both points of the neckline or of the shoulders")
    across = np.sum([left - right for left, right in pairs.values()], axis=0)
    length = float(np.linalg.norm(across))
    if length < 1:
        raise InputError(f"{path}: left and right points coincide; the garment has no direction across")
    across = across / length
    down = np.array([-across[1], across[0]])
    below = points[[INDEX[f"{side}_{part}"] for part in ("waist", "ankle") for side in ("left", "right")]]
    below = below[np.isfinite(below).all(axis=1)]
    if not len(below) and polygon is not None:
        below = polygon
    if len(below) and np.mean((below - np.mean(top, axis=0)) @ down) < 0:
        down = -down
    return Frame(across, down, np.mean(top, axis=0))
