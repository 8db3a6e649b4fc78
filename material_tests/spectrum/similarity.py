r"""Amplitude spectra and their normalised correlation.

.. math:: s = \frac{\sum_k A(k)\,B(k)}{\sqrt{\sum_k A(k)^2 \sum_k B(k)^2}}

over all frequencies but zero up to the Nyquist circle; A, B are the amplitudes of the windowed fields without their planes.
Two *independent* Gaussian fields with the same expected spectrum have Rayleigh-distributed amplitudes, so that s is near
:math:`\langle A\rangle^2/\langle A^2\rangle = \pi/4 = 0.785`, whatever that spectrum is (1/2 for powers A²).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import fft

from material_tests.spectrum.field import without_plane
from mfar_fem.errors import InputError

QUANTITIES = ("amplitude", "power", "log")


@dataclass(frozen=True, eq=False)
class Spectrum:
    """A 2-D amplitude spectrum.

    Attributes
    ----------
    amplitude : (ny, nx) array
        Of the normalised field: the sum of squares over all pixels is 1 (Parseval). Zero frequency first.
    fx, fy : (nx,), (ny,) arrays
        Frequencies, 1/m (1/pixel without a scale).
    """

    amplitude: np.ndarray
    fx: np.ndarray
    fy: np.ndarray

    @property
    def frequency(self) -> np.ndarray:
        """Magnitude of the frequency, (ny, nx)."""
        return np.hypot(self.fx[None, :], self.fy[:, None])

    @property
    def inside(self) -> np.ndarray:
        """Frequencies that count: not zero, inside the Nyquist circle; (ny, nx) bool."""
        k = self.frequency
        return (k > 0) & (k <= min(np.abs(self.fx).max(), np.abs(self.fy).max()) * (1 + 1e-12))

    @property
    def resolution(self) -> float:
        """One over the smaller side of the field."""
        return float(max(self.fx[1], self.fy[1]))


def prepared(values: np.ndarray, window: bool = True, remove: str = "plane") -> np.ndarray:
    """The field (ny, nx) less its plane (``remove``: plane, mean or none), times a Hann window, with unit sum of squares."""
    if remove not in ("plane", "mean", "none"):
        raise InputError(f"remove must be plane, mean or none, not '{remove}'")
    rest = without_plane(values) if remove == "plane" else values - (values.mean() if remove == "mean" else 0.0)
    if window:
        ny, nx = values.shape
        rest = rest * np.sin(np.pi * (np.arange(nx) + 0.5) / nx) ** 2 * (np.sin(np.pi * (np.arange(ny) + 0.5) / ny) ** 2)[:, None]
        if remove != "none":
            rest = rest - rest.mean()
    return rest / np.sqrt(np.sum(rest * rest))


def spectrum(values: np.ndarray, spacing: float | None = None, window: bool = True, remove: str = "plane") -> Spectrum:
    """Amplitude spectrum of a field (ny, nx) with pixels of ``spacing`` (m)."""
    return of_prepared(prepared(values, window, remove), spacing)


def of_prepared(values: np.ndarray, spacing: float | None = None) -> Spectrum:
    """Spectrum of a field that :func:`prepared` returned (no further window)."""
    ny, nx = values.shape
    d = 1.0 if spacing is None else spacing
    return Spectrum(np.abs(fft.fft2(values, norm="ortho")), fft.fftfreq(nx, d), fft.fftfreq(ny, d))


def similarity(first: Spectrum, second: Spectrum, quantity: str = "amplitude", centred: bool = False, zero: bool = False) -> float:
    """Normalised correlation of two spectra on the same frequencies.

    Parameters
    ----------
    first, second : Spectrum
    quantity : {'amplitude', 'power', 'log'}
        What is correlated; ``log`` is log(1 + A/mean A), a habit of picture viewers.
    centred : bool
        Subtract the means first (Pearson) instead of the plain cosine.
    zero : bool
        Count the zero frequency too: with brightness whose mean was not removed it decides everything.

    Returns
    -------
    float
        1 for equal spectra.

    Raises
    ------
    InputError
        Different grids, or an unknown quantity.
    """
    if first.amplitude.shape != second.amplitude.shape or not np.allclose(first.fx, second.fx, rtol=1e-9):
        raise InputError("the two spectra lie on different frequencies: bring the fields to one grid first (common_grid)")
    if quantity not in QUANTITIES:
        raise InputError(f"quantity must be one of {', '.join(QUANTITIES)}, not '{quantity}'")
    inside = first.inside
    inside[0, 0] = zero
    a, b = (s.amplitude[inside] for s in (first, second))
    if quantity == "power":
        a, b = a * a, b * b
    elif quantity == "log":
        a, b = np.log1p(a / a.mean()), np.log1p(b / b.mean())
    if centred:
        a, b = a - a.mean(), b - b.mean()
    return float(np.sum(a * b) / np.sqrt(np.sum(a * a) * np.sum(b * b)))  # no BLAS: its threads cost more than these sums
