"""Metres per pixel of an image, with its uncertainty: from scale marks, resolution, stature or proportions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mfar_fem.errors import InputError
from reconstruction.keypoints_file import ImageKeypoints
from reconstruction.landmarks import INDEX
from reconstruction.measure.frame import CannotMeasureError, TooFewPointsError
from reconstruction.measure.skeleton import Skeleton

STATURE_SPREAD = 0.04
"""Relative standard deviation of adult stature within one sex (7 cm at 1.75 m; assumption, modern populations)."""
KNOWN_STATURE_SPREAD = 0.01
"""The same where the figure's own height is given: assumption."""
PROPORTION_SPREAD = 0.10
"""Relative standard deviation of a scale taken from proportions of a drawn or modelled figure: assumption."""
DPI_SPREAD = 0.002
"""Relative standard deviation of a scanner's resolution: assumption."""


class NoScaleError(CannotMeasureError):
    """Nothing says how large what a picture shows is; of several pictures it can be left out."""


# Spans of a standing figure that are foreshortened little: vertical ones and the shoulders.
_SPANS = (("neckline", "waist"), ("shoulder", "waist"), ("waist", "ankle"))


@dataclass(frozen=True)
class Scale:
    """Metres per pixel.

    Attributes
    ----------
    metres_per_pixel : float
    relative_sigma : float
        Standard deviation over value.
    method : str
    """

    metres_per_pixel: float
    relative_sigma: float
    method: str


def image_scale(image: ImageKeypoints) -> Scale:
    """The scale of an image from what its entry gives.

    Parameters
    ----------
    image : ImageKeypoints
        Marks, resolution or extent in ``scale``; without it the proportions of the figure.

    Raises
    ------
    NoScaleError
        Nothing sets the scale: a textile without marks, or a figure of unknown sex.
    TooFewPointsError
        A figure with too few points.
    """
    given = image.scale
    if given is None:
        if image.figure is None:
            raise NoScaleError(f"{image.path}: nothing sets the scale. In sources.toml give this picture 'scale' (marks and their "
                               "length), 'dpi', or 'figure' (male or female); in keypoints.json 'scale' or 'figure'")
        return from_proportions(image)
    if "marks" in given:
        return from_marks(given["marks"], given["length"], given.get("sigma", 1.0), image.path)
    if "dpi" in given:
        return Scale(0.0254 / given["dpi"], DPI_SPREAD, f"resolution {given['dpi']:g} dpi")
    if "metres_per_pixel" in given:
        return Scale(given["metres_per_pixel"], given.get("relative_sigma", 0.0), "given metres per pixel")
    if image.figure is None:
        raise NoScaleError(f"{image.path}: 'scale' gives head and foot but 'figure' does not say whose stature (male or female)")
    return from_stature(given["head"], given["foot"], image.stature, given.get("sigma", 1.0), image.path,
                        STATURE_SPREAD if image.height is None else KNOWN_STATURE_SPREAD)


def from_marks(marks, length: float, sigma: float = 1.0, path="") -> Scale:
    """Scale from two points at a known distance.

    Parameters
    ----------
    marks : (2, 2) array
        px.
    length : float
        m.
    sigma : float
        Standard deviation of each mark's coordinates, px.
    """
    a, b = np.asarray(marks, dtype=float)
    extent = _extent(a, b, path)
    return Scale(length / extent, np.sqrt(2) * sigma / extent, f"scale marks {length:g} m apart")


def from_stature(head, foot, stature: float, sigma: float = 1.0, path="", spread: float = STATURE_SPREAD) -> Scale:
    """Scale from the extent of a standing figure, crown to sole, and its stature in m (paper, fusion section: 1.75 or 1.65)."""
    extent = _extent(np.asarray(head, dtype=float), np.asarray(foot, dtype=float), path)
    return Scale(stature / extent, float(np.hypot(np.sqrt(2) * sigma / extent, spread)), f"stature {stature:g} m")


def from_proportions(image: ImageKeypoints, skeleton: Skeleton | None = None) -> Scale:
    """Scale of a cropped figure from the proportions of the canonical skeleton.

    The median over the spans that a standing figure hardly foreshortens (shoulder width; neckline, shoulders and waist; waist and
    ankles); the spread is the larger of :data:`PROPORTION_SPREAD` and the scatter of the spans.

    Raises
    ------
    TooFewPointsError
        No span has both its ends.
    """
    skeleton = skeleton or Skeleton.canonical(image.stature)
    ratios = []
    shoulders = [INDEX["left_shoulder"], INDEX["right_shoulder"]]
    if image.present[shoulders].all():
        seen = np.linalg.norm(np.diff(image.points[shoulders], axis=0))
        ratios.append(np.linalg.norm(np.diff(skeleton.points[shoulders], axis=0)) / seen)
    for upper, lower in _SPANS:
        pairs = [[INDEX[f"left_{part}"], INDEX[f"right_{part}"]] for part in (upper, lower)]
        if image.present[np.ravel(pairs)].all():
            seen = np.linalg.norm(np.subtract(*(image.points[pair].mean(axis=0) for pair in pairs)))
            ratios.append(np.linalg.norm(np.subtract(*(skeleton.points[pair].mean(axis=0) for pair in pairs))) / seen)
    if not ratios or not np.isfinite(ratios).all():
        raise TooFewPointsError(
            f"{image.path}: no scale from proportions: it needs both shoulders, or two of shoulders, waist, ankles"
        )
    value = float(np.median(ratios))
    scatter = float(np.std(ratios, ddof=1)) / value if len(ratios) > 1 else 0.0
    return Scale(value, max(PROPORTION_SPREAD, scatter), f"proportions of the skeleton ({len(ratios)} spans)")


def _extent(a: np.ndarray, b: np.ndarray, path) -> float:
    extent = float(np.linalg.norm(a - b))
    if extent < 1:
        raise InputError(f"{path}: the two points that set the scale are {extent:.3g} px apart; they must be apart at least 1 px")
    return extent
