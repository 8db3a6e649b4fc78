"""Radially averaged spectra and the dominant wavelength with its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from material_tests.spectrum.similarity import Spectrum, spectrum


@dataclass(frozen=True)
class Dominant:
    """The wavelength that carries the most variance.

    Attributes
    ----------
    wavelength, uncertainty : float
        m (pixels without a scale); the standard uncertainty joins the resolution of the frequencies and
        the scatter between quarters.
    bandwidth : float
        Full width at half maximum of the ring power over its frequency; a pure sine has the resolution of the window.
    direction : float
        Of the wave vector from x, rad, in [0, pi): the wrinkles run across it.
    coherence : float
        0: the power comes from all directions alike; 1: from one.
    resolved : bool
        Whether at least three wavelengths fit into the field.
    """

    wavelength: float
    uncertainty: float
    bandwidth: float
    direction: float
    coherence: float
    resolved: bool


def radial_average(s: Spectrum) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frequency, root mean square amplitude, and power summed over rings one resolution wide; (m,) each."""
    inside, step = s.inside, s.resolution
    k = s.frequency[inside]
    ring = np.rint(k / step).astype(int)
    power = np.bincount(ring, s.amplitude[inside] ** 2)
    count = np.bincount(ring)
    full = np.flatnonzero(count[1:]) + 1  # ring 0 holds nothing but the lowest frequencies of the longer side
    return np.bincount(ring, k)[full] / count[full], np.sqrt(power[full] / count[full]), power[full]


def dominant(values: np.ndarray, spacing: float | None = None) -> Dominant:
    """Dominant wavelength of a field (ny, nx): centroid of the ring power between its half-maximum points.

    The scatter comes from the four overlapping quarters (each 5/8 of a side long), as far as they are big enough.
    """
    s = spectrum(values, spacing)
    frequency, width, angle, coherence = _peak(s)
    spread = 0.0
    ny, nx = (5 * n // 8 for n in values.shape)
    if min(nx, ny) >= 16:
        parts = [values[rows, columns] for rows in (slice(0, ny), slice(-ny, None)) for columns in (slice(0, nx), slice(-nx, None))]
        peaks = [_peak(spectrum(p, spacing), frequency)[0] for p in parts if np.ptp(p) > 0]
        spread = float(np.std(peaks, ddof=1) / np.sqrt(len(peaks))) if len(peaks) > 1 else 0.0
    error = np.hypot(s.resolution / np.sqrt(12.0) / 2.0, spread)
    return Dominant(1.0 / frequency, float(error / frequency**2), width / frequency, angle, coherence,
                    bool(frequency >= 3.0 * s.resolution))


def _peak(s: Spectrum, near: float | None = None) -> tuple[float, float, float, float]:
    """Frequency, width, direction and coherence of the strongest ring; with ``near`` the strongest within a factor 1.5 of it."""
    k, _, power = radial_average(s)
    allowed = np.ones(len(k), dtype=bool) if near is None else (k > near / 1.5) & (k < near * 1.5)
    if not allowed.any():
        allowed[:] = True
    top = int(np.argmax(np.where(allowed, power, -1.0)))
    low = high = top
    while low > 0 and power[low - 1] > 0.5 * power[top]:
        low -= 1
    while high < len(k) - 1 and power[high + 1] > 0.5 * power[top]:
        high += 1
    step = s.resolution
    frequency, inside = s.frequency, s.inside
    chosen = inside & (frequency > k[low] - 1.5 * step) & (frequency < k[high] + 1.5 * step)
    weight = s.amplitude[chosen] ** 2
    weight = weight / weight.sum()
    mean = float(weight @ frequency[chosen])
    twice = np.sum(weight * np.exp(2j * np.arctan2(np.broadcast_to(s.fy[:, None], frequency.shape)[chosen],
                                                   np.broadcast_to(s.fx, frequency.shape)[chosen])))
    return mean, float((high - low + 1) * step), float(0.5 * np.angle(twice) % np.pi), float(abs(twice))
