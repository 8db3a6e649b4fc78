"""The spectrum test: similarity of two fields beside its null values."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from material_tests.spectrum.field import Field, common_grid, read_field
from material_tests.spectrum.nulls import NULLS, null_distribution
from material_tests.spectrum.radial import dominant, radial_average
from material_tests.spectrum.similarity import similarity, spectrum
from mfar_fem.errors import InputError

VARIANTS: dict[str, dict[str, Any]] = {
    "amplitude, plane removed, windowed": {},
    "same, centred (Pearson)": {"centred": True},
    "power": {"quantity": "power"},
    "log amplitude": {"quantity": "log"},
    "amplitude, nothing removed, no window": {"raw": True},
}


def run(first, second, first_spacing: float | None = None, second_spacing: float | None = None, draws: int = 100,
        seed: int = 0) -> dict:
    """Compare two pictures or height fields.

    Parameters
    ----------
    first, second : path, (ny, nx) array or Field
    first_spacing, second_spacing : float, optional
        Side of a pixel, m (both or neither; ignored where a Field is given).
    draws : int
        Fields drawn a null, at least 20.
    seed : int
        Of the nulls.

    Returns
    -------
    dict
        ``similarity``; ``nulls``: by name mean, sd, low_95, high_95, percentile, z, exceeds_95; ``hardest_null`` (largest mean
        but for the phase-shuffled) and ``z`` against it; ``variants``: other readings of the paper's sentence; ``first``,
        ``second``: dominant wavelength with uncertainty, direction; ``radial``: frequency and amplitudes.

    Raises
    ------
    FieldError, DataFileError, InputError
    """
    if int(draws) != draws or draws < 20:
        raise InputError(f"at least 20 draws a null are needed, not {draws}")
    fields = _field(first, first_spacing, "first"), _field(second, second_spacing, "second")
    a, b, spacing = common_grid(*fields)
    spectra = spectrum(a, spacing), spectrum(b, spacing)
    value, rng = similarity(*spectra), np.random.default_rng(seed)
    peaks = dominant(a, spacing), dominant(b, spacing)
    pixels = peaks[0].wavelength / (spacing or 1.0)
    nulls = {name: null_distribution(name, a, pixels, int(draws), rng).to_dict(value) for name in NULLS}
    hardest = max(NULLS[1:], key=lambda name: nulls[name]["mean"])
    radial = [radial_average(s) for s in spectra]
    return {
        "test": "spectrum",
        "similarity": value,
        "hardest_null": hardest,
        "z": nulls[hardest]["z"],
        "exceeds_nulls": all(nulls[name]["exceeds_95"] for name in NULLS[1:]),
        "nulls": nulls,
        "variants": {name: _variant(a, b, **options) for name, options in VARIANTS.items()},
        "length_unit": "pixel" if spacing is None else "m",
        "spacing": spacing,
        "pixels": list(a.shape[::-1]),
        "seed": seed,
        **{key: {"name": f.name, "wavelength": p.wavelength, "wavelength_uncertainty": p.uncertainty, "bandwidth": p.bandwidth,
                 "wave_direction_deg": float(np.degrees(p.direction)), "coherence": p.coherence, "resolved": p.resolved}
           for key, f, p in zip(("first", "second"), fields, peaks, strict=True)},
        "radial": {"frequency": radial[0][0], "first_amplitude": radial[0][1], "second_amplitude": radial[1][1]},
    }


def _field(given, spacing, name) -> Field:
    if isinstance(given, Field):
        return given
    return read_field(given, spacing) if isinstance(given, str | os.PathLike) else Field(given, spacing, name)


def _variant(a, b, raw: bool = False, **options) -> float:
    first, second = (spectrum(v, window=not raw, remove="none" if raw else "plane") for v in (a, b))
    return similarity(first, second, zero=raw, **options)
