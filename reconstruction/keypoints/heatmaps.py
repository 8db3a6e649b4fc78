r"""Heat maps of points: encoding by formula (5) of the silk paper, and decoding below a pixel.

.. math:: H_k(x, y) = \exp\left(-\frac{(x - x_k)^2 + (y - y_k)^2}{2 \sigma^2}\right)

The paper gives σ = 3 in its text and 2.8 in its Table 1, without a unit. H is defined on the 64 × 48 grid, so σ is taken in
**heat-map pixels** here (3 heat-map pixels are 12 pixels of the 256 × 192 input; the published networks use 2 at this size).
It is a setting everywhere. The centres are not rounded to the grid (unbiased encoding: Zhang et al., CVPR 2020,
doi:10.1109/CVPR42600.2020.00712), and input and heat map share their *borders*, not their first pixel centres:
``x_input = 4 (x_map + 1/2) - 1/2``, so that mirroring an image mirrors its heat maps.

All methods of :func:`decode` find the highest pixel first (non-maximum suppression keeps the other peaks apart, see :func:`peaks`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from mfar_fem.errors import ParameterError, UnknownNameError
from mfar_fem.tomlfile import suggest

SIGMA = 3.0
"""Default standard deviation of a heat map's Gaussian, heat-map pixels."""


def to_map(points: np.ndarray, stride: float = 4.0) -> np.ndarray:
    """Input pixels (..., 2) to heat-map pixels (both count from the centre of their own first pixel)."""
    return (np.asarray(points, float) + 0.5) / stride - 0.5


def to_input(points: np.ndarray, stride: float = 4.0) -> np.ndarray:
    """Heat-map pixels (..., 2) to input pixels: the inverse of :func:`to_map`."""
    return (np.asarray(points, float) + 0.5) * stride - 0.5


def encode(points: np.ndarray, size: tuple[int, int] = (64, 48), sigma: float = SIGMA, present=None) -> np.ndarray:
    """Heat maps by formula (5).

    Parameters
    ----------
    points : array_like, shape (..., 2)
        x, y in heat-map pixels; they may lie outside.
    size : tuple of int
        Height and width of the maps.
    sigma : float
        Heat-map pixels, positive.
    present : array_like of bool, shape (...), optional
        Maps of points that are not there are zero.

    Returns
    -------
    numpy.ndarray, shape (..., height, width), float32
    """
    if not sigma > 0:
        raise ParameterError(f"sigma is {sigma}; it must be positive (heat-map pixels)")
    points = np.asarray(points, float)
    x = np.exp(-0.5 * ((np.arange(size[1]) - points[..., :1]) / sigma) ** 2)
    y = np.exp(-0.5 * ((np.arange(size[0]) - points[..., 1:]) / sigma) ** 2)
    maps = (y[..., :, None] * x[..., None, :]).astype(np.float32)
    if present is not None:
        maps = np.where(np.asarray(present, bool)[..., None, None], maps, np.float32(0.0))
    return maps


@dataclass(frozen=True)
class Peak:
    """A local maximum: heat-map pixels and height."""

    x: float
    y: float
    score: float


def peaks(heatmap: np.ndarray, radius: int = 4, threshold: float = 0.2, limit: int = 5) -> list[Peak]:
    """Local maxima of one map (h, w), highest first: pixels that are the highest within `radius` and above `threshold`.

    A plateau of equal pixels gives one peak. Positions are refined as in :func:`decode`.
    """
    highest = ndimage.maximum_filter(heatmap, size=2 * radius + 1, mode="constant", cval=-np.inf)
    plateaus, count = ndimage.label((heatmap == highest) & (heatmap >= threshold), np.ones((3, 3)))
    first = np.unique(plateaus.ravel(), return_index=True)[1][-count:] if count else np.zeros(0, int)
    rows, columns = np.divmod(first, heatmap.shape[1])
    order = np.argsort(-heatmap[rows, columns], kind="stable")
    found: list[Peak] = []
    taken: list[tuple[int, int]] = []
    for i in order:
        y, x = int(rows[i]), int(columns[i])
        if all(max(abs(y - v), abs(x - u)) > radius for v, u in taken):
            taken.append((y, x))
            dx, dy = _log_fit(heatmap[None], np.array([y]), np.array([x]))[0]
            found.append(Peak(x + float(dx), y + float(dy), float(heatmap[y, x])))
        if len(found) == limit:
            break
    return found


def decode(heatmaps: np.ndarray, method: str = "matched", sigma: float = SIGMA) -> tuple[np.ndarray, np.ndarray]:
    """Position and height of the highest peak of every map.

    Parameters
    ----------
    heatmaps : numpy.ndarray, shape (..., h, w)
    method : str
        A name of :data:`METHODS`; "matched" (smooth with the Gaussian itself, fit a paraboloid to the logarithm, undo what the
        border did) is exact without noise and close to the Cramér-Rao bound with it; "dark" equals it in the interior and fails
        near the border.
    sigma : float
        Of the encoding, heat-map pixels ("matched" and "dark" smooth with it).

    Returns
    -------
    points : numpy.ndarray, shape (..., 2)
        x, y in heat-map pixels.
    score : numpy.ndarray, shape (...)
        Value of the highest pixel.

    Raises
    ------
    UnknownNameError
        No such method; the message lists them.
    """
    if method not in METHODS:
        raise UnknownNameError(f"no decoding is called '{method}'{suggest(method, METHODS)}")
    heatmaps = np.asarray(heatmaps, float)
    flat = heatmaps.reshape(-1, *heatmaps.shape[-2:])
    searched = flat
    if method in ("matched", "dark"):
        searched = ndimage.gaussian_filter(flat, (0.0, sigma, sigma), mode="constant", truncate=3.0)
    best = searched.reshape(len(flat), -1).argmax(axis=1)
    y, x = np.divmod(best, flat.shape[2])
    offset = METHODS[method](searched, y, x)
    points = np.stack([x, y], axis=1) + offset
    if method == "matched":
        points = _unshift(points, flat.shape[1:], sigma)
    score = flat.reshape(len(flat), -1).max(axis=1)
    return points.reshape(*heatmaps.shape[:-2], 2), score.reshape(heatmaps.shape[:-2])


def _window(maps: np.ndarray, y: np.ndarray, x: np.ndarray, radius: int) -> np.ndarray:
    """Windows (n, 2r+1, 2r+1) around a pixel of every map; NaN outside."""
    padded = np.pad(maps, ((0, 0), (radius, radius), (radius, radius)), constant_values=np.nan)
    steps = np.arange(2 * radius + 1)
    return padded[np.arange(len(maps))[:, None, None], (y[:, None] + steps)[:, :, None], (x[:, None] + steps)[:, None, :]]


def _log_fit(maps: np.ndarray, y: np.ndarray, x: np.ndarray, radius: int = 2) -> np.ndarray:
    """Least squares of a separable paraboloid to the logarithm, weighted by the square of the value (Guo 2011,
    doi:10.1109/MSP.2011.941846: the weight of equal noise); offsets (n, 2), at most 1.5 pixels."""
    window = _window(maps, y, x, radius)
    top = np.nanmax(window, axis=(1, 2), keepdims=True)
    good = window > 0.05 * np.maximum(top, 1e-12)
    weight = np.where(good, window, 0.0) ** 2
    logs = np.log(np.where(good, window, 1.0))
    v, u = np.mgrid[-radius : radius + 1, -radius : radius + 1].reshape(2, -1)
    basis = np.stack([np.ones_like(u), u, v, u * u, v * v], axis=1).astype(float)
    w = weight.reshape(len(maps), -1)
    normal = np.einsum("nk,ki,kj->nij", w, basis, basis)
    scale = np.maximum(np.trace(normal, axis1=1, axis2=2), 1e-30)
    normal += 1e-12 * scale[:, None, None] * np.eye(5)
    right = np.einsum("nk,ki->ni", w * logs.reshape(len(maps), -1), basis)
    a = np.linalg.solve(normal, right[..., None])[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        offset = np.where(a[:, 3:] < 0, -a[:, 1:3] / (2.0 * a[:, 3:]), 0.0)
    return np.clip(np.nan_to_num(offset), -1.5, 1.5)


def _taylor(maps: np.ndarray, y: np.ndarray, x: np.ndarray) -> np.ndarray:
    """One Newton step on the logarithm of the smoothed map (DARK: Zhang et al., CVPR 2020)."""
    w = np.log(np.maximum(_window(maps, y, x, 1), 1e-10))
    dx, dy = 0.5 * (w[:, 1, 2] - w[:, 1, 0]), 0.5 * (w[:, 2, 1] - w[:, 0, 1])
    dxx = w[:, 1, 2] - 2 * w[:, 1, 1] + w[:, 1, 0]
    dyy = w[:, 2, 1] - 2 * w[:, 1, 1] + w[:, 0, 1]
    dxy = 0.25 * (w[:, 2, 2] - w[:, 2, 0] - w[:, 0, 2] + w[:, 0, 0])
    determinant = dxx * dyy - dxy**2
    with np.errstate(divide="ignore", invalid="ignore"):
        step = np.stack([-(dyy * dx - dxy * dy), -(dxx * dy - dxy * dx)], axis=1) / determinant[:, None]
    usable = np.isfinite(step).all(axis=1) & (determinant > 0) & (dxx < 0)
    return np.where(usable[:, None], np.clip(step, -1.0, 1.0), 0.0)


def _quarter(maps: np.ndarray, y: np.ndarray, x: np.ndarray) -> np.ndarray:
    """A quarter of a pixel towards the higher neighbour, as in the published HRNet code."""
    w = np.nan_to_num(_window(maps, y, x, 1), nan=0.0)
    return 0.25 * np.stack([np.sign(w[:, 1, 2] - w[:, 1, 0]), np.sign(w[:, 2, 1] - w[:, 0, 1])], axis=1)


def _mass(maps: np.ndarray, y: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Centre of mass of the 7×7 window."""
    w = np.clip(np.nan_to_num(_window(maps, y, x, 3), nan=0.0), 0.0, None)
    total = np.maximum(w.sum(axis=(1, 2)), 1e-12)
    steps = np.arange(-3, 4)
    return np.stack([(w * steps).sum(axis=(1, 2)), (w * steps[:, None]).sum(axis=(1, 2))], axis=1) / total[:, None]


def _unshift(points: np.ndarray, size: tuple[int, ...], sigma: float) -> np.ndarray:
    """Correct what the border cuts off: a matched filter near it sees half a Gaussian and its peak moves inwards."""
    for axis, length in ((0, size[1]), (1, size[0])):
        positions = np.arange(0.0, length - 0.99, 0.25)
        rows = np.exp(-0.5 * ((np.arange(length) - positions[:, None]) / sigma) ** 2)
        smooth = ndimage.gaussian_filter1d(rows, sigma, axis=1, mode="constant", truncate=3.0)
        top = smooth.argmax(axis=1)
        seen = top + _log_fit_1d(smooth, top)
        increasing = np.concatenate([[True], np.diff(np.maximum.accumulate(seen)) > 1e-9])
        points[:, axis] = np.interp(points[:, axis], seen[increasing], positions[increasing])
    return points


def _log_fit_1d(rows: np.ndarray, top: np.ndarray) -> np.ndarray:
    """The offset that :func:`_log_fit` finds along one axis, for separable maps."""
    padded = np.pad(rows, ((0, 0), (2, 2)))
    w = padded[np.arange(len(rows))[:, None], top[:, None] + np.arange(5)]
    good = w > 0.05 * w.max(axis=1, keepdims=True)
    weight, logs = np.where(good, w, 0.0) ** 2, np.log(np.where(good, w, 1.0))
    u = np.arange(-2.0, 3.0)
    basis = np.stack([np.ones(5), u, u * u], axis=1)
    normal = np.einsum("nk,ki,kj->nij", weight, basis, basis)
    a = np.linalg.solve(normal, np.einsum("nk,ki->ni", weight * logs, basis)[..., None])[..., 0]
    return np.clip(-a[:, 1] / (2.0 * a[:, 2]), -1.5, 1.5)


METHODS = {
    "argmax": lambda maps, y, x: np.zeros((len(maps), 2)),
    "quarter": _quarter,
    "mass": _mass,
    "dark": _taylor,
    "log_fit": _log_fit,
    "matched": _log_fit,
}
"""Refinements below a pixel: functions of maps (n, h, w) and the rows and columns (n,) of their highest pixels."""
