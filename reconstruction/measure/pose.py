"""Pose of the canonical skeleton behind the landmarks of one picture: scaled orthography with limbs of fixed length.

This is the first stage of the paper's two-stage matching (2-D murals are "projected onto a canonical human body model"). The
torso is rigid, the limbs keep their lengths; what a limb lacks in the picture is depth, and its sign cannot be seen: C. J. Taylor,
Reconstruction of articulated objects from point correspondences in a single uncalibrated image, CVIU 80 (2000) 349-363,
doi:10.1006/cviu.2000.0878. Every ambiguous limb is listed and :meth:`PoseFit.alternatives` goes through all combinations.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from mfar_fem.errors import InputError
from reconstruction.keypoints_file import ImageKeypoints
from reconstruction.landmarks import LANDMARKS
from reconstruction.measure.scale import image_scale
from reconstruction.measure.skeleton import LIMBS, TORSO, Skeleton

ROTATION_SIGMA = 0.5
"""Standard deviation of the torso's rotation vector about the frontal view, rad (prior: figures mostly face the viewer)."""
DEPTH_SIGN_FLOOR = 0.02
"""A limb whose depth is below this part of its length counts as lying in the picture: both signs give nearly the same point."""
MAX_EVALUATIONS = 100
"""Of the residuals; fits of points that a skeleton can take need 10 to 30."""
_CHILD = {"upper_arm": "forearm"}


@dataclass(frozen=True)
class PoseFit:
    """Landmarks in space behind those of a picture.

    Attributes
    ----------
    points : (12, 3) array
        m, world axes (x right in the picture, y away from the viewer, z up), torso centre at the origin; NaN where the picture
        has none.
    pixels_per_metre : float
    offset : (2,) array
        Pixel of the torso's centre.
    rotation : (3,) array
        Rotation vector of the torso from the frontal view, rad.
    ambiguous : tuple of str
        Limbs (and ``torso``) whose sign of depth the picture does not tell; the fit has arms and legs towards the viewer.
    stretched : dict of str to float
        Limbs seen longer than their length at this scale, and by which factor.
    residual : float
        Root mean square distance of projected and given points, px.
    """

    points: np.ndarray
    pixels_per_metre: float
    offset: np.ndarray
    rotation: np.ndarray
    ambiguous: tuple[str, ...]
    stretched: dict[str, float]
    residual: float

    def to_dict(self) -> dict[str, Any]:
        """Plain data; absent landmarks are null."""
        points = [[float(v) for v in p] if np.isfinite(p).all() else None for p in self.points]
        return {
            "landmarks": list(LANDMARKS), "points_m": points, "pixels_per_metre": self.pixels_per_metre,
            "offset_px": self.offset.tolist(), "torso_rotation_rad": self.rotation.tolist(), "ambiguous": list(self.ambiguous),
            "combinations": 2 ** len(self.ambiguous), "stretched": self.stretched, "residual_px": self.residual,
        }

    def project(self, points=None) -> np.ndarray:
        """Pixels (n, 2) of points (n, 3), by default the landmarks."""
        points = self.points if points is None else np.asarray(points)
        return self.pixels_per_metre * points[:, [0, 2]] * (1, -1) + self.offset

    def flipped(self, part: str) -> PoseFit:
        """The same picture with the depth of a limb (or of the torso) reversed; limbs beyond it are carried along.

        Parameters
        ----------
        part : str
            A name of :data:`reconstruction.measure.skeleton.LIMBS` or ``torso``.
        """
        points = self.points.copy()
        if part == "torso":
            moved = -2 * points[list(TORSO), 1]
            points[list(TORSO), 1] += moved
            shift = dict(zip(TORSO, moved, strict=True))
            for _, a, b in LIMBS:
                shift[b] = shift[a]
                points[b, 1] += shift[b]
            return replace(self, points=points, rotation=self.rotation * (-1, 1, -1))
        _, a, b = next(limb for limb in LIMBS if limb[0] == part)
        moved = -2 * (points[b, 1] - points[a, 1])
        side, _, name = part.partition("_")
        beyond = [end for limb, _, end in LIMBS if limb == f"{side}_{_CHILD.get(name)}"]
        points[[b, *beyond], 1] += moved
        return replace(self, points=points)

    def alternatives(self) -> Iterator[PoseFit]:
        """All 2^k combinations of the ambiguous signs, the fit itself first."""
        for flips in product((False, True), repeat=len(self.ambiguous)):
            fit = self
            for part, flip in zip(self.ambiguous, flips, strict=True):
                fit = fit.flipped(part) if flip else fit
            yield fit


def fit_pose(points, skeleton: Skeleton, sigma=1.0, pixels_per_metre: float | None = None, scale_sigma: float = 0.05) -> PoseFit:
    """Fit the skeleton's pose to the landmarks of a picture.

    Parameters
    ----------
    points : (12, 2) array
        px; NaN where absent.
    skeleton : Skeleton
    sigma : float or (12,) array
        Standard deviation of the points, px.
    pixels_per_metre : float, optional
        Scale if it is known from elsewhere, with its relative standard deviation `scale_sigma`. Without it torso and limbs set
        the scale.

    Raises
    ------
    InputError
        Fewer than three points of the torso.
    """
    from scipy.optimize import least_squares
    from scipy.spatial.transform import Rotation

    points = np.asarray(points, dtype=float)
    sigma = np.broadcast_to(np.asarray(sigma, dtype=float), (12,))
    here = np.isfinite(points).all(axis=1)
    torso = [i for i in TORSO if here[i]]
    if len(torso) < 3:
        raise InputError(f"a pose needs three points of the torso; present are {[LANDMARKS[i] for i in torso]}")
    centre = skeleton.points[list(TORSO)].mean(axis=0)
    rest = skeleton.points - centre
    limbs = [(name, a, b, skeleton.length(name)) for name, a, b in LIMBS if here[a] and here[b]]
    offset = points[torso].mean(axis=0)
    guess = pixels_per_metre or _spread(points[torso]) / _spread(rest[torso][:, [0, 2]])

    def place(x: np.ndarray) -> np.ndarray:
        """Landmarks (m, 12, 3) of parameters (m, n)."""
        space = np.full((len(x), 12, 3), np.nan)
        turn = Rotation.from_rotvec(x[:, 1:4]).as_matrix()
        space[:, list(TORSO)] = np.einsum("mij,kj->mki", turn, rest[list(TORSO)])
        for n, (_, a, b, length) in enumerate(limbs):
            direction = x[:, 6 + 3 * n : 9 + 3 * n]
            space[:, b] = space[:, a] + length * direction / np.linalg.norm(direction, axis=1, keepdims=True)
        return space

    used = here & np.isfinite(place(np.ones((1, 6 + 3 * len(limbs))))[0]).all(axis=1)

    def residuals(x: np.ndarray) -> np.ndarray:
        """Of parameters (m, n), a row each."""
        seen = np.exp(x[:, 0, None, None]) * place(x)[:, :, [0, 2]] * (1, -1) + x[:, None, 4:6]
        parts = [((seen - points)[:, used] / sigma[used, None]).reshape(len(x), -1), x[:, 1:4] / ROTATION_SIGMA]
        # the length of a direction has no meaning: keep it near 1
        parts.append(np.linalg.norm(x[:, 6:].reshape(len(x), -1, 3), axis=2) - 1)
        if pixels_per_metre is not None:
            parts.append((x[:, :1] - np.log(pixels_per_metre)) / scale_sigma)
        return np.concatenate(parts, axis=1)

    def jacobian(x: np.ndarray) -> np.ndarray:
        """Forward differences, all parameters in one go: a tenth of the time of one after the other."""
        step = np.sqrt(np.finfo(float).eps) * np.where(x >= 0, 1.0, -1.0) * np.maximum(1.0, np.abs(x))
        values = residuals(np.vstack([x, x + np.diag(step)]))
        return ((values[1:] - values[0]) / (x + step - x)[:, None]).T

    def start(tilt: float) -> np.ndarray:
        x = np.concatenate([[np.log(guess)], [tilt, 0, 0], offset, np.zeros(3 * len(limbs))])
        for n, (_, a, b, length) in enumerate(limbs):
            flat = (points[b] - points[a]) / guess * (1, -1)
            depth = np.sqrt(max(length**2 - flat @ flat, (0.05 * length) ** 2))
            direction = np.array([flat[0], -depth, flat[1]])  # towards the viewer
            x[6 + 3 * n : 9 + 3 * n] = direction / np.linalg.norm(direction)
        return x

    def solve(tilt: float):
        return least_squares(
            lambda x: residuals(x[None])[0], start(tilt), jacobian, x_scale="jac", xtol=1e-7, ftol=1e-7, max_nfev=MAX_EVALUATIONS
        )

    best = solve(0.0)
    if best.cost > here.sum():  # worse than the points' own noise: try a torso that leans
        best = min(best, solve(0.4), key=lambda result: result.cost)
    x = best.x
    space, scale = place(x[None])[0], float(np.exp(x[0]))
    space[~here & ~np.isin(np.arange(12), TORSO)] = np.nan
    stretched, ambiguous = {}, []
    for name, a, b, length in limbs:
        seen_length = float(np.linalg.norm(points[b] - points[a])) / scale
        if seen_length > length * (1 + 3 * np.hypot(sigma[a], sigma[b]) / (scale * length)):
            stretched[name] = seen_length / length
        if abs(space[b, 1] - space[a, 1]) > DEPTH_SIGN_FLOOR * length:
            ambiguous.append(name)
    if np.ptp(space[list(TORSO), 1]) > DEPTH_SIGN_FLOOR * np.ptp(rest[list(TORSO), 2]):
        ambiguous.append("torso")
    fit = PoseFit(space, scale, x[4:6], x[1:4], tuple(ambiguous), stretched, 0.0)
    miss = (fit.project() - points)[here & np.isfinite(space).all(axis=1)]
    fit = replace(fit, residual=float(np.sqrt(np.mean(np.sum(miss**2, axis=1)))))
    for name, a, b, _ in limbs:
        if name in ambiguous and fit.points[b, 1] > fit.points[a, 1]:
            fit = fit.flipped(name)
    return fit


def image_pose(image: ImageKeypoints, skeleton: Skeleton | None = None) -> PoseFit:
    """Pose behind the landmarks of an image, with the image's own scale and uncertainties.

    Parameters
    ----------
    image : ImageKeypoints
    skeleton : Skeleton, optional
        By default the canonical one of the figure's stature (male if it is not said).
    """
    scale = image_scale(image)
    skeleton = skeleton or Skeleton.canonical(image.stature)
    return fit_pose(image.points, skeleton, image.sigma, 1 / scale.metres_per_pixel, max(scale.relative_sigma, 1e-3))


def _spread(points: np.ndarray) -> float:
    """Root mean square distance from the mean."""
    return float(np.sqrt(np.mean(np.sum((points - points.mean(axis=0)) ** 2, axis=1))))
