"""Configurations in which point pairs do not determine a fundamental matrix, recognised by name."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reconstruction.matching.epipolar import apply, sampson_distance, transfer_distance
from reconstruction.matching.robust import Model

NOISE = 1.0
"""Standard deviation of a point's position that the criterion assumes, px."""
COLLINEAR = 0.02
"""Points whose scatter across their best line is a smaller fraction of that along it lie on the line."""


@dataclass(frozen=True)
class Degeneracy:
    """What was found.

    Attributes
    ----------
    name : str or None
        ``identical``, ``similarity``, ``planar``, ``collinear``, or None.
    homography_share : float
        Inliers of the homography among those of the fundamental matrix.
    gric_fundamental, gric_homography : float
        Torr's criterion of both models, the smaller is the better.
    """

    name: str | None
    homography_share: float = float("nan")
    gric_fundamental: float = float("nan")
    gric_homography: float = float("nan")


EXPLAINED = {
    "identical": "one picture lies on the other without change: a copy, or the same camera twice",
    "similarity": "turning, scaling and shifting one picture gives the other: no parallax",
    "planar": "a homography explains the matches: a flat object, or a camera that only turned; register by the homography",
    "collinear": "the matches lie on a line",
}
"""Names in words."""


def examine(fundamental: Model, homography: Model | None, first: np.ndarray, second: np.ndarray) -> Degeneracy:
    """Whether the inliers of a fundamental matrix determine it.

    Parameters
    ----------
    fundamental, homography : Model
        Robust models of the same putative matches.
    first, second : (m, 2) array
        The putative matches, px.

    Notes
    -----
    A plane and a camera turning about its centre both give a homography; without the camera's calibration nothing tells them apart.
    """
    chosen = fundamental.inliers
    if is_collinear(first[chosen]) or is_collinear(second[chosen]):
        return Degeneracy("collinear")
    if homography is None:
        return Degeneracy(None, 0.0)
    share = float((homography.inliers & chosen).sum() / max(chosen.sum(), 1))
    g_f = gric(sampson_distance(fundamental.matrix, first[chosen], second[chosen]), dimension=3, parameters=7)
    g_h = gric(transfer_distance(homography.matrix, first[chosen], second[chosen]), dimension=2, parameters=8)
    if g_h > g_f:
        return Degeneracy(None, share, g_f, g_h)
    return Degeneracy(_kind_of_homography(homography, first, second), share, g_f, g_h)


def gric(distance: np.ndarray, dimension: int, parameters: int, noise: float = NOISE) -> float:
    """Geometric robust information criterion (Torr, Fitzgibbon & Zisserman 1999, doi:10.1023/A:1008140928553).

    sum min(e^2 / noise^2, 2 (4 - d)) + d n ln 4 + k ln(4 n), for n pairs (of 4 coordinates) on a manifold of dimension d with k
    parameters: 3 and 7 for a fundamental matrix, 2 and 8 for a homography.
    """
    n = max(len(distance), 1)
    cut = 2.0 * (4 - dimension)
    return float(np.minimum((distance / noise) ** 2, cut).sum() + dimension * n * np.log(4) + parameters * np.log(4 * n))


def is_collinear(points: np.ndarray) -> bool:
    """Whether points lie on one line, up to :data:`NOISE` or a small share of their extent."""
    if len(points) < 3:
        return True
    along, across = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[:2] / np.sqrt(len(points))
    return bool(across <= max(NOISE, COLLINEAR * along))


def _kind_of_homography(model: Model, first: np.ndarray, second: np.ndarray) -> str:
    """Whether a similarity, or nothing at all, does as well as the homography."""
    a, b = first[model.inliers], second[model.inliers]
    if np.median(np.linalg.norm(a - b, axis=1)) < 0.5:
        return "identical"
    reached = np.median(np.linalg.norm(apply(model.matrix, a) - b, axis=1))
    residual = np.median(np.linalg.norm(_similarity(a, b) - b, axis=1))
    return "similarity" if residual <= max(NOISE, 1.5 * reached) else "planar"


def _similarity(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """First points moved on the second ones by rotation, scale and shift, in the least-squares sense (complex regression)."""
    z, w = first @ [1, 1j], second @ [1, 1j]
    zc, wc = z - z.mean(), w - w.mean()
    mapped = w.mean() + np.vdot(zc, wc) / max(np.vdot(zc, zc).real, 1e-30) * zc
    return np.column_stack([mapped.real, mapped.imag])
