"""Folds of cloth compared by their spectra, with what unrelated cloth reaches.

The silk paper correlates the Fourier spectra of pictures of folds (its Figure 6). A spectrum of magnitudes forgets where the folds
are, and most cloth has a similar one: a similarity says something only beside null values. Here the folds are what is left of the
height over a plane when its large forms are taken away, seen along one direction; their spectra are compared within a band of
wavelengths, and beside it the folds themselves (:func:`agreement`), which shuffled phases do not survive.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import gaussian_filter

from mfar_fem.errors import InputError
from reconstruction.surface.rays import Rays
from reconstruction.surface.triangles import TriangleMesh

STEP = 4e-3
"""Grid, m."""
LONG, SHORT = 0.20, 0.03
"""Longest and shortest wavelength that counts as a fold, m; meshes of 30 mm show nothing finer than twice their edges."""
FRONT = (0.0, 1.0, 0.0)
"""Direction of looking: the benchmark's figures face against y."""


def height_map(mesh: TriangleMesh, low, high, direction=FRONT, step: float = STEP) -> np.ndarray:
    """Heights (h, w), m, against the direction of looking, over a grid across it; NaN beside the surface.

    Parameters
    ----------
    mesh : TriangleMesh
        m.
    low, high : (3,) arrays
        Box that the grid covers: the same for meshes that are compared.
    direction : (3,) array
        Unit; z is up in the map unless it looks along z.
    step : float
        m.
    """
    d = np.asarray(direction, dtype=float)
    up = np.array([0.0, 0.0, 1.0]) if abs(d[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    right = np.cross(d, up)
    right /= np.linalg.norm(right)
    up = np.cross(right, d)
    corners = np.array([[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    a, b = corners @ right, corners @ up
    x, y = np.arange(a.min(), a.max() + step, step), np.arange(b.max(), b.min() - step, -step)
    start = (corners @ d).min() - 1.0
    origins = (x[None, :, None] * right + y[:, None, None] * up + start * d).reshape(-1, 3)
    _, along, _ = Rays(mesh).first(origins, np.tile(d, (len(origins), 1)))
    return np.where(np.isfinite(along), -along, np.nan).reshape(len(y), len(x))


def folds(heights: np.ndarray, step: float = STEP, long: float = LONG, short: float = SHORT) -> np.ndarray:
    """What of a map (h, w) has wavelengths between `short` and `long`, m; zero beside the surface. Holes do not leak into it:
    smoothing is normalised by what is there."""
    there = np.isfinite(heights)
    filled = np.where(there, heights, 0.0)

    def smooth(width: float) -> np.ndarray:
        sigma = width / (2 * np.pi) / step
        weight = gaussian_filter(there.astype(float), sigma)
        return gaussian_filter(filled, sigma) / np.maximum(weight, 1e-9)

    return np.where(there, smooth(short) - smooth(long), 0.0)


def _common(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    both = np.isfinite(first) & np.isfinite(second)
    if both.sum() < 400:
        raise InputError(f"the two surfaces share {both.sum()} points of the grid; at least 400 are needed to compare their folds")
    return both


def spectrum_similarity(first: np.ndarray, second: np.ndarray, step: float = STEP) -> float:
    """Correlation of the logarithms of two maps' power spectra (h, w) within the band of folds, over where both are; -1 to 1.

    Raises
    ------
    InputError
        The surfaces hardly overlap.
    """
    both = _common(first, second)
    window = gaussian_filter(both.astype(float), 2.0)
    spectra = [np.abs(np.fft.fft2(folds(np.where(both, m, np.nan), step) * window)) ** 2 for m in (first, second)]
    k = np.hypot(*np.meshgrid(np.fft.fftfreq(both.shape[1], step), np.fft.fftfreq(both.shape[0], step)))
    band = (k > 1 / LONG) & (k < 1 / SHORT)
    logs = [np.log(gaussian_filter(s, 1.0, mode="wrap")[band] + 1e-300) for s in spectra]
    return float(np.corrcoef(*logs)[0, 1])


def agreement(first: np.ndarray, second: np.ndarray, step: float = STEP) -> float:
    """Correlation of the folds themselves, place by place, over where both maps are; 1: the same folds, 0: none in common.

    Raises
    ------
    InputError
        The surfaces hardly overlap.
    """
    both = _common(first, second)
    a, b = (folds(np.where(both, m, np.nan), step)[both] for m in (first, second))
    return float(np.corrcoef(a, b)[0, 1]) if a.std() > 0 and b.std() > 0 else 0.0


def shuffled(heights: np.ndarray, rng: np.random.Generator, step: float = STEP) -> np.ndarray:
    """The map with the phases of its folds drawn anew: the same spectrum, other folds."""
    there = np.isfinite(heights)
    fine = folds(heights, step)
    phases = np.angle(np.fft.fft2(rng.standard_normal(heights.shape)))  # those of a real map
    new = np.real(np.fft.ifft2(np.abs(np.fft.fft2(fine)) * np.exp(1j * phases)))
    return np.where(there, np.where(there, heights, 0.0) - fine + new, np.nan)


def smoothed(heights: np.ndarray, step: float = STEP) -> np.ndarray:
    """The map without its folds."""
    return np.where(np.isfinite(heights), np.where(np.isfinite(heights), heights, 0.0) - folds(heights, step), np.nan)


def null_values(truth: np.ndarray, unrelated: Sequence[np.ndarray], rng: np.random.Generator, rounds: int = 10) -> dict[str, dict]:
    """Similarities that mean nothing: of the truth with its own phases shuffled, without folds, and with unrelated garments.

    Returns
    -------
    dict
        By name of the null: ``spectrum`` and ``agreement``, lists of values.
    """
    null = {
        "phases shuffled": [shuffled(truth, rng) for _ in range(rounds)],
        "smooth": [smoothed(truth)],
        "unrelated garments": list(unrelated),
    }
    out: dict[str, dict] = {}
    for name, maps in null.items():
        pairs = [m for m in maps if m.shape == truth.shape and (np.isfinite(m) & np.isfinite(truth)).sum() >= 400]
        out[name] = {
            "spectrum": [spectrum_similarity(m, truth) for m in pairs],
            "agreement": [agreement(m, truth) for m in pairs],
        }
    return out
