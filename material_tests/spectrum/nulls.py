"""What the similarity is worth: its values for fields that have nothing, or everything but the picture, in common with the first.

phase-shuffled
    The first field with the phases of its Fourier transform drawn anew: another picture, the same amplitudes.
another-specimen
    Gaussian noise whose expected spectrum is the first one's, smoothed over neighbouring frequencies: what an independent
    sample of the same cloth would give. Near π/4.
same-radial-spectrum
    Gaussian noise whose expected spectrum is the first one's, averaged over directions.
unrelated-wrinkles
    A Gaussian field of wrinkles with a direction of its own and a wavelength within a factor two of the first one's.
smooth
    A Gaussian field correlated over a quarter of the side, of the same variance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import fft

from material_tests.spectrum.radial import radial_average
from material_tests.spectrum.similarity import Spectrum, of_prepared, prepared, similarity, spectrum

NULLS = ("phase-shuffled", "another-specimen", "same-radial-spectrum", "unrelated-wrinkles", "smooth")


@dataclass(frozen=True, eq=False)
class Null:
    """Distribution of the similarity under one null; `values` has shape (draws,)."""

    name: str
    values: np.ndarray

    def to_dict(self, measured: float) -> dict:
        """Mean, standard deviation, central 95 %, and where ``measured`` lies in it."""
        mean, sd = float(self.values.mean()), float(self.values.std(ddof=1))
        low, high = (float(v) for v in np.quantile(self.values, [0.025, 0.975]))
        out = {"mean": mean, "sd": sd, "low_95": low, "high_95": high, "draws": len(self.values),
               "percentile": 100.0 * float(np.mean(self.values < measured)), "exceeds_95": bool(measured > high)}
        if self.name == "phase-shuffled":
            return out | {"z": None}  # all values are 1: it shows what the metric cannot see
        return out | {"z": (measured - mean) / sd}


def null_distribution(name: str, values: np.ndarray, wavelength: float, draws: int, rng) -> Null:
    """Similarity of a field (ny, nx) with ``draws`` fields of a null.

    Parameters
    ----------
    name : str
        One of `NULLS`.
    wavelength : float
        Dominant wavelength of the field in pixels (for unrelated-wrinkles).
    rng : numpy Generator
    """
    own = prepared(values)
    target = of_prepared(own)
    found = np.empty(draws)
    shape = smoothed_filter(target) if name == "another-specimen" else radial_filter(target)
    for i in range(draws):
        if name == "phase-shuffled":
            other = of_prepared(phase_shuffled(own, rng))
        elif name in ("another-specimen", "same-radial-spectrum"):
            other = spectrum(gaussian_field(shape, rng))
        elif name == "unrelated-wrinkles":
            other = spectrum(wrinkles(values.shape, wavelength * 2.0 ** rng.uniform(-1, 1), rng.uniform(0, np.pi), rng))
        else:
            other = spectrum(smooth_field(values.shape, rng))
        found[i] = similarity(target, other)
    return Null(name, found)


def phase_shuffled(values: np.ndarray, rng) -> np.ndarray:
    """A real field with the same amplitude spectrum and random phases (those of white noise)."""
    phase = fft.fft2(rng.standard_normal(values.shape))
    transform = np.abs(fft.fft2(values)) * phase / np.abs(phase)
    transform[0, 0] = values.sum()
    return fft.ifft2(transform).real


def gaussian_field(amplitude: np.ndarray, rng) -> np.ndarray:
    """Gaussian noise (ny, nx), not periodic in it, whose expected amplitude spectrum is ``amplitude`` on twice the side.

    The array (2 ny, 2 nx) gives the filter of a field twice as long, of which the first quarter is returned.
    """
    ny, nx = (n // 2 for n in amplitude.shape)
    transform = fft.rfft2(rng.standard_normal(amplitude.shape)) * amplitude[:, : nx + 1]
    return fft.irfft2(transform, s=amplitude.shape)[:ny, :nx]


def _frequency(shape) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (1/pixel) of a field twice as long: rows and columns."""
    ny, nx = shape
    return fft.fftfreq(2 * ny)[:, None], fft.fftfreq(2 * nx)[None, :]


def smoothed_filter(s: Spectrum, width: float = 1.5) -> np.ndarray:
    """The amplitude of a spectrum, its power smoothed by a Gaussian of ``width`` frequencies, as a filter (2 ny, 2 nx)."""
    from scipy import ndimage

    power = fft.fftshift(ndimage.gaussian_filter(s.amplitude**2, width, mode="wrap"))
    fy, fx = (fft.fftfreq(2 * n) * n + n // 2 for n in s.amplitude.shape)
    return np.sqrt(np.maximum(ndimage.map_coordinates(power, np.meshgrid(fy, fx, indexing="ij"), order=1, mode="grid-wrap"), 0.0))


def radial_filter(s: Spectrum) -> np.ndarray:
    """The direction-averaged amplitude of a spectrum as a filter (2 ny, 2 nx) for :func:`gaussian_field`."""
    k, rms, _ = radial_average(s)
    fy, fx = _frequency(s.amplitude.shape)
    per_pixel = s.fx[1] * len(s.fx)  # one over the spacing
    return np.interp(np.hypot(fx, fy) * per_pixel, k, rms, right=0.0)


def wrinkles(shape, wavelength: float, direction: float, rng, bandwidth: float = 0.15, spread: float = 0.25) -> np.ndarray:
    """Gaussian field of wrinkles: wave vectors of one length (sd ``bandwidth`` of it) and direction (sd ``spread``, rad)."""
    fy, fx = _frequency(shape)
    k, turn = np.hypot(fx, fy) * wavelength, np.angle(np.exp(2j * (np.arctan2(fy, fx) - direction))) / 2.0
    return gaussian_field(np.exp(-0.25 * ((k - 1.0) / bandwidth) ** 2 - 0.25 * (turn / spread) ** 2) * (k > 0), rng)


def smooth_field(shape, rng) -> np.ndarray:
    """Gaussian field correlated over a quarter of the smaller side."""
    fy, fx = _frequency(shape)
    return gaussian_field(np.exp(-((np.pi * 0.25 * min(shape)) ** 2) * (fx**2 + fy**2)), rng)
