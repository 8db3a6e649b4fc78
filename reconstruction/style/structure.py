"""Is what B shows still there? Structural similarity, contours and gradients, all of luminance.

References
----------
Wang, Bovik, Sheikh, Simoncelli: Image quality assessment: from error visibility to structural similarity. IEEE TIP 13 (2004) 600,
doi:10.1109/TIP.2003.819861. Canny, IEEE PAMI 8 (1986) 679, doi:10.1109/TPAMI.1986.4767851. Martin, Fowlkes, Malik: Learning to
detect natural image boundaries, IEEE PAMI 26 (2004) 530, doi:10.1109/TPAMI.2004.1273918 (F-score of contours with a tolerance).
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from mfar_fem.errors import ParameterError
from reconstruction.libraries import opencv
from reconstruction.style.colour import luminance


def ssim(image: np.ndarray, other: np.ndarray, sigma: float = 1.5) -> float:
    """Mean structural similarity of the luminance of two (h, w, 3) uint8 pictures (Gaussian window, K1 = 0.01, K2 = 0.03).

    1 for equal pictures, about 0 for unrelated, negative for inverted ones.

    Raises
    ------
    ParameterError
        Sizes differ.
    """
    x, y = _pair(image, other)
    blur = lambda a: ndimage.gaussian_filter(a, sigma, truncate=3.5)  # noqa: E731
    mx, my = blur(x), blur(y)
    vx, vy, cov = blur(x * x) - mx * mx, blur(y * y) - my * my, blur(x * y) - mx * my
    c1, c2 = 0.01**2, 0.03**2
    value = (2 * mx * my + c1) * (2 * cov + c2) / ((mx * mx + my * my + c1) * (vx + vy + c2))
    edge = int(3.5 * sigma + 0.5)
    return float(value[edge:-edge, edge:-edge].mean())


def gradient_correlation(image: np.ndarray, other: np.ndarray, sigma: float = 1.0) -> float:
    """Correlation of the sizes of the luminance gradients at scale `sigma` px: 1 where all contours lie at the same places."""
    x, y = (ndimage.gaussian_gradient_magnitude(a, sigma).ravel() for a in _pair(image, other))
    x, y = x - x.mean(), y - y.mean()
    size = np.linalg.norm(x) * np.linalg.norm(y)
    return float(x @ y / size) if size > 0 else 0.0


def edges(image: np.ndarray, sigma: float = 1.4, share: float = 0.10) -> np.ndarray:
    """Canny contours of luminance, (h, w) bool; the upper threshold is passed by `share` of the pixels, the lower is 0.4 of it.

    Thresholds follow the picture, so that a change of contrast alone changes nothing.

    Raises
    ------
    MissingDependencyError
        OpenCV is not installed.
    """
    cv2 = opencv("contours need")
    smooth = ndimage.gaussian_filter(luminance(image), sigma)
    dx, dy = ndimage.sobel(smooth, 1), ndimage.sobel(smooth, 0)
    high = np.quantile(np.abs(dx) + np.abs(dy), 1 - share)
    if high <= 0:
        return np.zeros(smooth.shape, dtype=bool)
    scale = 8000.0 / high  # int16 gradients with head room above the threshold
    grads = [np.clip(np.rint(g * scale), -16000, 16000).astype(np.int16) for g in (dx, dy)]
    return cv2.Canny(grads[0], grads[1], 0.4 * 8000.0, 8000.0) > 0


def edge_score(image: np.ndarray, other: np.ndarray, tolerance: float = 2.0) -> float:
    """F-score of the contours of `other` against those of `image`: harmonic mean of found and false, within `tolerance` px."""
    _pair(image, other)
    truth, found = edges(image), edges(other)
    if not truth.any() or not found.any():
        return float(truth.any() == found.any())
    precision = float((ndimage.distance_transform_edt(~truth)[found] <= tolerance).mean())
    recall = float((ndimage.distance_transform_edt(~found)[truth] <= tolerance).mean())
    return 0.0 if precision + recall == 0 else 2 * precision * recall / (precision + recall)


def _pair(image, other):
    if image.shape != other.shape:
        raise ParameterError(f"pictures must have one size, not {image.shape[:2]} and {other.shape[:2]}")
    return luminance(image), luminance(other)
