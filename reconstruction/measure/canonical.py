"""Pictures of figures on the canonical body: the common frame of the silk paper's two-stage matching.

A thin-plate spline (Duchon 1977, doi:10.1007/BFb0086566; Bookstein 1989, doi:10.1109/34.24792) through the landmarks takes the
frontal view of the canonical skeleton to the picture. Its straight interpolation is all that twelve points tell: folds, depth and
what is hidden stay as they are drawn. A figure seen from behind is taken to the canonical back.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RBFInterpolator

from reconstruction.keypoints_file import ImageKeypoints
from reconstruction.landmarks import PAIRS
from reconstruction.libraries import opencv
from reconstruction.measure.frame import TooFewPointsError
from reconstruction.measure.skeleton import Skeleton

PIXELS_PER_METRE = 220.0
"""Resolution of a canonical picture."""
MARGIN = 0.15
"""Round the skeleton, m."""
FEWEST = 4
"""Landmarks without which there is no map."""


@dataclass(frozen=True, eq=False)
class CanonicalMap:
    """From a canonical picture to the given one.

    Attributes
    ----------
    spline : RBFInterpolator
        Canonical metres (n, 2), x to the right of the picture and y downwards from the crown, to pixels of the picture.
    size : (int, int)
        Width and height of the canonical picture, px.
    behind : bool
        The figure is seen from behind.
    landmarks : (12, 2) array
        Where the skeleton has them in the canonical picture, px.
    """

    spline: RBFInterpolator
    size: tuple[int, int]
    behind: bool
    landmarks: np.ndarray

    def to_picture(self, points) -> np.ndarray:
        """Pixels (n, 2) of the given picture for pixels (n, 2) of the canonical one."""
        return self.spline(_metres(np.asarray(points, dtype=float), self.size))

    def unwarp(self, rgb: np.ndarray) -> np.ndarray:
        """The picture (h, w, ...) as the canonical figure would show it; black where it has nothing."""
        width, height = self.size
        step = 4  # the spline is smooth: every fourth pixel, bilinear between
        x, y = np.meshgrid(np.arange(0, width + step, step), np.arange(0, height + step, step))
        coarse = self.to_picture(np.stack([x, y], axis=-1).reshape(-1, 2)).reshape(*x.shape, 2).astype(np.float32)
        cv2 = opencv()
        u, v = np.meshgrid(np.arange(width, dtype=np.float32) / step, np.arange(height, dtype=np.float32) / step)
        field = cv2.remap(coarse, u, v, cv2.INTER_LINEAR)
        return cv2.remap(rgb, field, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)


def canonical_map(image: ImageKeypoints, skeleton: Skeleton | None = None) -> CanonicalMap:
    """The map of a picture.

    Parameters
    ----------
    image : ImageKeypoints
    skeleton : Skeleton, optional
        By default the canonical one of the figure (a man's for a textile).

    Raises
    ------
    TooFewPointsError
        Fewer than :data:`FEWEST` landmarks, or all of them on a line.
    """
    skeleton = skeleton or Skeleton.canonical(image.stature)
    here = np.isfinite(image.points).all(axis=1)
    behind = _behind(image.points)
    plan = np.column_stack([skeleton.points[:, 0] * (-1.0 if behind else 1.0), skeleton.stature - skeleton.points[:, 2]])
    known = plan[here]
    if here.sum() < FEWEST or np.linalg.matrix_rank(known - known.mean(axis=0), tol=0.02) < 2:
        raise TooFewPointsError(f"{image.path}: {int(here.sum())} landmarks do not fix a map to the canonical body: it needs "
                                f"{FEWEST} that do not lie on a line")  # fmt: skip
    spline = RBFInterpolator(known, image.points[here], kernel="thin_plate_spline", degree=1)
    half = np.abs(skeleton.points[:, 0]).max() + MARGIN
    size = (round(2 * half * PIXELS_PER_METRE), round((skeleton.stature + 2 * MARGIN) * PIXELS_PER_METRE))
    return CanonicalMap(spline, size, behind, _pixels(plan, size))


def _metres(pixels: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    return (pixels - [0.5 * (size[0] - 1), MARGIN * PIXELS_PER_METRE]) / PIXELS_PER_METRE


def _pixels(metres: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    return metres * PIXELS_PER_METRE + [0.5 * (size[0] - 1), MARGIN * PIXELS_PER_METRE]


def _behind(points: np.ndarray) -> bool:
    """Whether the wearer's left is on the left of the picture, by all pairs together (long ones weigh most)."""
    across = [points[left, 0] - points[right, 0] for left, right in PAIRS]
    return bool(np.nansum(across) < 0)
