"""The landmarks in space, from pictures whose cameras are known."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mfar_fem.errors import InputError
from reconstruction.landmarks import INDEX, LANDMARKS

GATE = 4.0
"""Standard deviations beyond which a picture's point is taken for a mistake."""
LEAST_SIGMA = 1.5
"""Standard deviation that no detected point goes below, px: detectors are surer than they are right."""


@dataclass(frozen=True, eq=False)
class SpacePoints:
    """Landmarks in space.

    Attributes
    ----------
    points : (12, 3) array
        m; NaN where fewer than two pictures agree.
    sigma : (12,) array
        Standard deviation (largest axis), m; NaN.
    views : (12,) array of int
        Pictures that agree.
    """

    points: np.ndarray
    sigma: np.ndarray
    views: np.ndarray

    @property
    def found(self) -> np.ndarray:
        """(12,) bool."""
        return np.isfinite(self.points).all(axis=1)

    def __getitem__(self, name: str) -> np.ndarray:
        return self.points[INDEX[name]]


def triangulate(cameras: Sequence[np.ndarray], points, sigma, gate: float = GATE) -> SpacePoints:
    """Triangulate the twelve landmarks; points that do not agree with the others are left out.

    Of every landmark the pair of pictures is sought that most pictures agree with; then the agreeing ones are adjusted together
    (Gauss-Newton on the reprojection).

    Parameters
    ----------
    cameras : sequence of (3, 4) array
        World (m) to pixels.
    points : (n, 12, 2) array
        Pixels; NaN where absent.
    sigma : (n, 12) array
        px.
    gate : float

    Raises
    ------
    InputError
        Fewer than two cameras, or no landmark found in space.
    """
    cameras = [np.asarray(c, dtype=float) for c in cameras]
    points, sigma = np.asarray(points, dtype=float), np.maximum(np.asarray(sigma, dtype=float), LEAST_SIGMA)
    if len(cameras) < 2:
        raise InputError(f"points in space need two pictures with cameras at least; there are {len(cameras)}")
    out, spread, count = np.full((12, 3), np.nan), np.full(12, np.nan), np.zeros(12, dtype=int)
    for k in range(12):
        seen = [i for i in range(len(cameras)) if np.isfinite(points[i, k]).all()]
        best: list[int] = []
        for pair in itertools.combinations(seen, 2):
            x = _linear([cameras[i] for i in pair], points[list(pair), k])
            agree = [i for i in seen if _miss(cameras[i], x, points[i, k]) < gate * sigma[i, k]]
            if set(pair) <= set(agree) and len(agree) > len(best):
                best = agree
        if len(best) < 2:
            continue
        x = _linear([cameras[i] for i in best], points[best, k])
        x, information = _adjusted(x, [cameras[i] for i in best], points[best, k], sigma[best, k])
        out[k], spread[k], count[k] = x, 1.0 / np.sqrt(max(np.linalg.eigvalsh(information)[0], 1e-12)), len(best)
    if not np.isfinite(out).any():
        raise InputError(f"none of {', '.join(LANDMARKS)} is found alike in two pictures with cameras: check points and cameras")
    return SpacePoints(out, spread, count)


def _linear(cameras, pixels) -> np.ndarray:
    """Direct linear transformation (Hartley & Zisserman, Multiple View Geometry, 2nd ed., 2004, section 12.2)."""
    rows = []
    for camera, (x, y) in zip(cameras, pixels, strict=True):
        norm = np.linalg.norm(camera[2, :3])
        rows += [(x * camera[2] - camera[0]) / norm, (y * camera[2] - camera[1]) / norm]
    a = np.array(rows)
    return np.linalg.lstsq(a[:, :3], -a[:, 3], rcond=None)[0]


def _miss(camera, x, pixel) -> float:
    p = camera @ np.append(x, 1.0)
    return float(np.linalg.norm(p[:2] / p[2] - pixel))


def _adjusted(x, cameras, pixels, sigma, steps: int = 5) -> tuple[np.ndarray, np.ndarray]:
    """Least squares on the reprojection; the point and its information matrix."""
    for _ in range(steps):
        jacobian, residual = [], []
        for camera, pixel, s in zip(cameras, pixels, sigma, strict=True):
            p = camera @ np.append(x, 1.0)
            jacobian.append((camera[:2, :3] - np.outer(p[:2] / p[2], camera[2, :3])) / p[2] / s)
            residual.append((pixel - p[:2] / p[2]) / s)
        j = np.concatenate(jacobian)
        x = x + np.linalg.lstsq(j, np.concatenate(residual), rcond=None)[0]
    return x, j.T @ j
