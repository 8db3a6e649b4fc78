"""Colour spaces: sRGB, CIELAB (D65) and the decorrelated logarithmic space lαβ.

References
----------
IEC 61966-2-1 (sRGB); CIE 15:2004 (CIELAB). Ruderman, Cronin, Chiao: Statistics of cone responses to natural images, JOSA A 15
(1998) 2036, doi:10.1364/JOSAA.15.002036 (lαβ), with the cone matrix of Reinhard et al., doi:10.1109/38.946629.
"""

from __future__ import annotations

import numpy as np

WHITE = np.array([0.95047, 1.0, 1.08883])
"""XYZ of D65."""
_XYZ = np.array([[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]])
_LMS = np.array([[0.3811, 0.5783, 0.0402], [0.1967, 0.7244, 0.0782], [0.0241, 0.1288, 0.8444]])
_LAB = np.diag(1 / np.sqrt([3.0, 6.0, 2.0])) @ np.array([[1, 1, 1], [1, 1, -2], [1, -1, 0.0]])
_EPSILON, _KAPPA = 216 / 24389, 24389 / 27


def linear_from_srgb(rgb: np.ndarray) -> np.ndarray:
    """Linear light of sRGB values, both in [0, 1], (..., 3)."""
    return np.where(rgb <= 0.04045, rgb / 12.92, ((np.maximum(rgb, 0.04045) + 0.055) / 1.055) ** 2.4)


def srgb_from_linear(light: np.ndarray) -> np.ndarray:
    """Inverse of :func:`linear_from_srgb`; negative light stays on the linear piece."""
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 0.0031308) ** (1 / 2.4) - 0.055)


def lab_from_srgb(rgb: np.ndarray) -> np.ndarray:
    """CIELAB (L* from 0 to 100) of sRGB in [0, 1], (..., 3)."""
    t = linear_from_srgb(np.asarray(rgb, dtype=float)) @ _XYZ.T / WHITE
    f = np.where(t > _EPSILON, np.cbrt(t), (_KAPPA * t + 16) / 116)
    return np.stack([116 * f[..., 1] - 16, 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])], axis=-1)


def srgb_from_lab(lab: np.ndarray) -> np.ndarray:
    """sRGB of CIELAB, not clipped: colours outside the gamut are outside [0, 1]."""
    fy = (lab[..., 0] + 16) / 116
    f = np.stack([fy + lab[..., 1] / 500, fy, fy - lab[..., 2] / 200], axis=-1)
    t = np.where(f**3 > _EPSILON, f**3, (116 * f - 16) / _KAPPA)
    return srgb_from_linear((t * WHITE) @ np.linalg.inv(_XYZ).T)


def lalphabeta_from_srgb(rgb: np.ndarray) -> np.ndarray:
    """lαβ (logarithms to base 10) of sRGB in [0, 1]; black is taken as one part in 10 000."""
    return np.log10(np.maximum(linear_from_srgb(np.asarray(rgb, dtype=float)) @ _LMS.T, 1e-4)) @ _LAB.T


def srgb_from_lalphabeta(lab: np.ndarray) -> np.ndarray:
    """sRGB of lαβ, not clipped (see :func:`srgb_from_lab`)."""
    return srgb_from_linear(10.0 ** (lab @ np.linalg.inv(_LAB).T) @ np.linalg.inv(_LMS).T)


def to_float(image: np.ndarray) -> np.ndarray:
    """(h, w, 3) uint8 as float in [0, 1]; floats are passed on."""
    return image / 255.0 if image.dtype == np.uint8 else np.asarray(image, dtype=float)


def to_uint8(rgb: np.ndarray) -> np.ndarray:
    """Rounded and clipped to 8 bits."""
    return np.rint(255.0 * np.clip(rgb, 0.0, 1.0)).astype(np.uint8)


def luminance(image: np.ndarray) -> np.ndarray:
    """L* of a picture over 100, (h, w) in [0, 1]."""
    return lab_from_srgb(to_float(image))[..., 0] / 100.0
