"""Epipolar geometry of point pairs: distances to a fundamental matrix, and its least-squares estimate.

Formula (3) of the silk paper compares the absolute value of p_B' F p_A with 3.5 pixels. That is an algebraic residual: it
changes with the arbitrary scale of F and is no distance. Here distances in pixels take its place.
"""

from __future__ import annotations

import numpy as np


def homogeneous(points: np.ndarray) -> np.ndarray:
    """(n, 2) points with a column of ones, (n, 3)."""
    return np.column_stack([points, np.ones(len(points))])


def algebraic_residual(matrix: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Residual of formula (3), p_B' F p_A, (n,): no distance, shown for comparison only."""
    return np.einsum("ni,ij,nj->n", homogeneous(second), matrix, homogeneous(first))


def sampson_distance(matrix: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """First-order distance of point pairs to the epipolar constraint.

    abs(x2' F x1) / sqrt((F x1)_1^2 + (F x1)_2^2 + (F' x2)_1^2 + (F' x2)_2^2) (Hartley & Zisserman, 2004, eq. 11.9).

    Parameters
    ----------
    matrix : (3, 3) array
        Fundamental matrix, x2' F x1 = 0.
    first, second : (n, 2) array
        Points in the two pictures, px.

    Returns
    -------
    (n,) array
        px; infinite where both epipolar lines vanish.
    """
    a, b = homogeneous(first), homogeneous(second)
    lines2, lines1 = a @ matrix.T, b @ matrix
    norm = np.sqrt(lines2[:, 0] ** 2 + lines2[:, 1] ** 2 + lines1[:, 0] ** 2 + lines1[:, 1] ** 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.abs(np.einsum("ni,ni->n", b, lines2)) / norm
    return np.where(norm > 0, distance, np.inf)


def epipolar_distance(matrix: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Distance of each point to the epipolar line of its partner, the larger of the two, (n,), px."""
    a, b = homogeneous(first), homogeneous(second)
    lines2, lines1 = a @ matrix.T, b @ matrix
    residual = np.abs(np.einsum("ni,ni->n", b, lines2))
    norm = np.minimum(np.hypot(lines2[:, 0], lines2[:, 1]), np.hypot(lines1[:, 0], lines1[:, 1]))
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = residual / norm
    return np.where(norm > 0, distance, np.inf)


def transfer_distance(homography: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Symmetric transfer distance of a homography, the larger of the two directions, (n,), px."""
    with np.errstate(divide="ignore", invalid="ignore"):
        forward = np.linalg.norm(apply(homography, first) - second, axis=1)
        back = np.linalg.norm(apply(np.linalg.inv(homography), second) - first, axis=1)
    worst = np.maximum(forward, back)
    return np.where(np.isfinite(worst), worst, np.inf)


def apply(homography: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points (n, 2) mapped by a homography."""
    mapped = homogeneous(points) @ homography.T
    return mapped[:, :2] / mapped[:, 2:]


def normaliser(points: np.ndarray) -> np.ndarray:
    """Similarity that moves points to the origin with a mean distance of sqrt 2 (Hartley 1997, doi:10.1109/34.601246), (3, 3)."""
    middle = points.mean(axis=0)
    spread = np.linalg.norm(points - middle, axis=1).mean()
    s = np.sqrt(2) / spread if spread > 0 else 1.0
    return np.array([[s, 0, -s * middle[0]], [0, s, -s * middle[1]], [0, 0, 1]])


def eight_point(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Normalised eight-point estimate of the fundamental matrix (Hartley 1997, doi:10.1109/34.601246).

    Parameters
    ----------
    first, second : (n, 2) array
        At least 8 point pairs, px.

    Returns
    -------
    (3, 3) array
        Rank 2, Frobenius norm 1.
    """
    t1, t2 = normaliser(first), normaliser(second)
    a, b = homogeneous(first) @ t1.T, homogeneous(second) @ t2.T
    rows = (b[:, :, None] * a[:, None, :]).reshape(len(a), 9)
    f = np.linalg.svd(rows)[2][-1].reshape(3, 3) if len(rows) < 9 else np.linalg.eigh(rows.T @ rows)[1][:, 0].reshape(3, 3)
    u, s, vt = np.linalg.svd(f)
    matrix = t2.T @ (u * [s[0], s[1], 0.0]) @ vt @ t1
    return matrix / np.linalg.norm(matrix)


def refined(matrix: np.ndarray, first: np.ndarray, second: np.ndarray, scale: float = 0.5) -> np.ndarray:
    """Fundamental matrix of least robust cost sum rho(Sampson distance), near a first estimate.

    F = U diag(cos t, sin t, 0) V' with rotations U and V, seven parameters in all (Bartoli & Sturm 2004,
    doi:10.1109/TPAMI.2004.1262342); rho is the soft-L1 loss, quadratic below `scale`.

    Parameters
    ----------
    matrix : (3, 3) array
        First estimate.
    first, second : (n, 2) array
        Point pairs, px; at least 7.
    scale : float
        px.

    Returns
    -------
    (3, 3) array
        Rank 2, Frobenius norm 1.
    """
    from scipy.optimize import least_squares
    from scipy.spatial.transform import Rotation

    t1, t2 = normaliser(first), normaliser(second)
    u, s, vt = np.linalg.svd(np.linalg.inv(t2).T @ matrix @ np.linalg.inv(t1))

    def build(p: np.ndarray) -> np.ndarray:
        turn_u, turn_v = Rotation.from_rotvec(p[:3]).as_matrix(), Rotation.from_rotvec(p[3:6]).as_matrix()
        return t2.T @ (u @ turn_u) @ np.diag([np.cos(p[6]), np.sin(p[6]), 0.0]) @ (turn_v.T @ vt) @ t1

    def residual(p: np.ndarray) -> np.ndarray:
        f = build(p)
        a, b = homogeneous(first), homogeneous(second)
        lines2, lines1 = a @ f.T, b @ f
        norm = np.sqrt(lines2[:, 0] ** 2 + lines2[:, 1] ** 2 + lines1[:, 0] ** 2 + lines1[:, 1] ** 2)
        return (b * lines2).sum(axis=1) / np.maximum(norm, 1e-300)

    start = np.append(np.zeros(6), np.arctan2(s[1], s[0]))
    found = build(least_squares(residual, start, loss="soft_l1", f_scale=scale, x_scale="jac", max_nfev=50).x)
    return found / np.linalg.norm(found)
