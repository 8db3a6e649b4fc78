"""Points and descriptors of one picture (SIFT, or ALIKED through :mod:`reconstruction.matching.aliked`)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reconstruction.libraries import opencv
from reconstruction.matching.settings import MatchSettings

FIRST_OCTAVE = -1
"""OpenCV's number of the octave of the doubled picture."""


@dataclass(frozen=True, eq=False)
class Features:
    """Points P = {(p_k, d_k)} of a picture.

    Attributes
    ----------
    points : (n, 2) float64 array
        px, from the centre of the top-left pixel.
    descriptors : (n, d) float32 array
        128 numbers a point with SIFT.
    size : (int, int)
        Width and height of the picture, px.
    """

    points: np.ndarray
    descriptors: np.ndarray
    size: tuple[int, int]

    def __len__(self) -> int:
        return len(self.points)


def detect(grey: np.ndarray, settings: MatchSettings, rgb: np.ndarray | None = None) -> Features:
    """Find points by the detector of the settings.

    Parameters
    ----------
    grey : (h, w) uint8 array
        The picture.
    settings : MatchSettings
    rgb : (h, w, 3) uint8 array, optional
        The same in colour, which ALIKED sees; grey is used without it.
    """
    if settings.detector == "aliked":
        from reconstruction.matching.aliked import aliked

        return aliked(np.repeat(grey[..., None], 3, axis=2) if rgb is None else rgb, settings)
    return sift(grey, settings)


def sift(grey: np.ndarray, settings: MatchSettings) -> Features:
    """SIFT points (Lowe 2004, doi:10.1023/B:VISI.0000029664.99615.94) of OpenCV, without those above the wanted octaves.

    Points are unique and sorted by strength, ties by position: the same picture always gives the same list.
    """
    cv2 = opencv()
    detector = cv2.SIFT_create(contrastThreshold=settings.contrast, edgeThreshold=settings.edge, enable_precise_upscale=True)
    keypoints, descriptors = detector.detectAndCompute(np.ascontiguousarray(grey), None)
    size = (grey.shape[1], grey.shape[0])
    if not keypoints:
        return Features(np.zeros((0, 2)), np.zeros((0, 128), np.float32), size)
    octave = np.array([signed_octave(k.octave) for k in keypoints])
    points = np.array([k.pt for k in keypoints], dtype=float)
    response = np.array([k.response for k in keypoints])
    angle = np.array([k.angle for k in keypoints])
    order = np.lexsort((angle, points[:, 1], points[:, 0], -response))
    order = order[octave[order] < FIRST_OCTAVE + settings.octaves][: settings.most_features]
    chosen = np.asarray(descriptors, dtype=np.float32)[order]
    return Features(points[order], root(chosen) if settings.root_sift else chosen, size)


def signed_octave(packed: int) -> int:
    """Octave of an OpenCV keypoint: the lowest byte, signed; -1 is the doubled picture."""
    low = packed & 255
    return low - 256 if low >= 128 else low


def root(descriptors: np.ndarray) -> np.ndarray:
    """RootSIFT: square root of the L1-normalised descriptor; Euclidean distance becomes Hellinger's."""
    total = np.maximum(descriptors.sum(axis=1, keepdims=True), 1e-12)
    return np.sqrt(descriptors / total).astype(np.float32)
