"""Spectrum similarity: known wavelengths, invariances, null values, named errors."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from material_tests.spectrum import Field, common_grid, read_field, run, similarity, spectrum
from material_tests.spectrum.field import (
    ConstantFieldError,
    FieldError,
    NotFiniteError,
    ScaleMismatchError,
    TooSmallError,
    without_plane,
)
from material_tests.spectrum.nulls import gaussian_field, phase_shuffled, smooth_field, wrinkles
from material_tests.spectrum.plots import save_pictures
from material_tests.spectrum.radial import dominant
from material_tests.spectrum.similarity import of_prepared, prepared
from mfar_fem.errors import DataFileError, InputError

N = 128
Y, X = np.mgrid[:N, :N].astype(float)


def wave(wavelength, angle=0.0, phase=0.3):
    return np.sin(2 * np.pi * (X * np.cos(angle) + Y * np.sin(angle)) / wavelength + phase)


@settings(max_examples=20, deadline=None)
@given(st.floats(5.0, 30.0), st.floats(0.0, 3.1), st.floats(0.0, 6.0))
def test_dominant_wavelength_of_a_sine(wavelength, angle, phase):
    d = dominant(wave(wavelength, angle, phase))
    assert d.wavelength == pytest.approx(wavelength, rel=0.015)
    assert abs(d.wavelength - wavelength) < 2.0 * d.uncertainty
    turn = (d.direction - angle + 0.5 * np.pi) % np.pi - 0.5 * np.pi
    assert abs(turn) < 0.03
    assert d.resolved and d.coherence > 0.9


def test_dominant_wavelength_of_noisy_wrinkles_has_an_honest_uncertainty():
    rng = np.random.default_rng(3)
    found = [dominant(wrinkles((N, N), 12.0, 0.4, rng, bandwidth=0.05)) for _ in range(20)]
    mean = np.mean([d.wavelength for d in found])
    assert mean == pytest.approx(12.0, rel=0.02)
    misses = [abs(d.wavelength - 12.0) > 2 * d.uncertainty for d in found]
    assert sum(misses) <= 4


def test_parseval_and_physical_units():
    s = spectrum(wave(10.0), 1e-3)
    assert np.sum(s.amplitude**2) == pytest.approx(1.0, rel=1e-12)
    assert dominant(wave(10.0), 1e-3).wavelength == pytest.approx(0.010, rel=0.01)


def test_plane_and_affine_changes_of_brightness_do_not_count():
    field = wrinkles((N, N), 12.0, 0.4, np.random.default_rng(0))
    changed = 120.0 - 7.0 * field + 0.3 * X - 0.1 * Y
    assert similarity(spectrum(field), spectrum(changed)) == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(without_plane(2.0 + 0.5 * X - 3.0 * Y), 0.0, atol=1e-9)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, N - 1), st.integers(0, N - 1), st.integers(0, 100))
def test_translation_of_a_periodic_field_does_not_count(dx, dy, seed):
    field = np.random.default_rng(seed).standard_normal((N, N))
    a, b = (spectrum(v, window=False, remove="mean") for v in (field, np.roll(field, (dy, dx), (0, 1))))
    assert similarity(a, b) == pytest.approx(1.0, abs=1e-12)


def test_translation_of_wrinkles_under_the_window():
    a, b = (spectrum(wave(9.0, 0.3, phase)) for phase in (0.0, 2.0))
    assert similarity(a, b) > 0.999


def test_similarity_falls_with_the_mismatch_of_the_wavelength():
    ratios = [1.0, 1.02, 1.05, 1.1, 1.2]
    values = [similarity(spectrum(wave(10.0)), spectrum(wave(10.0 * r))) for r in ratios]
    assert all(np.diff(values) < 0)
    assert values[-1] < 0.2


def test_rotation_by_ninety_degrees_is_seen():
    assert similarity(spectrum(wave(10.0)), spectrum(wave(10.0, np.pi / 2))) < 0.01


def test_blind_to_phase():
    field = prepared(wrinkles((N, N), 12.0, 0.4, np.random.default_rng(0)) + 3.0 * ((X - 40) ** 2 + (Y - 90) ** 2 < 200))
    other = phase_shuffled(field, np.random.default_rng(1))
    assert similarity(of_prepared(field), of_prepared(other)) == pytest.approx(1.0, abs=1e-12)
    assert abs(np.corrcoef(field.ravel(), other.ravel())[0, 1]) < 0.2
    assert np.isrealobj(other)


@pytest.mark.parametrize("quantity, expected", [("amplitude", math.pi / 4), ("power", 0.5)])
def test_independent_noise_has_rayleigh_amplitudes(quantity, expected):
    rng = np.random.default_rng(5)
    a, b = (spectrum(rng.standard_normal((256, 256)), window=False) for _ in range(2))
    assert similarity(a, b, quantity) == pytest.approx(expected, abs=0.01)


def test_two_specimens_of_one_cloth_give_pi_over_four():
    rng = np.random.default_rng(2)
    s = [spectrum(wrinkles((N, N), 8.0, 0.4, rng)) for _ in range(12)]
    values = [similarity(s[i], s[j]) for i in range(12) for j in range(i)]
    assert np.mean(values) == pytest.approx(math.pi / 4, abs=0.04)


def test_brightness_left_in_makes_everything_similar():
    rng = np.random.default_rng(4)
    a, b = 120 + 20 * wave(9.0), 120 + 20 * smooth_field((N, N), rng) / 0.05
    b = 120 + 20 * (b - b.mean()) / b.std()
    raw = run(a, b, draws=20)
    assert raw["similarity"] < 0.05
    assert raw["variants"]["amplitude, nothing removed, no window"] > 0.95


def test_gaussian_field_has_the_spectrum_asked_for():
    rng, shape = np.random.default_rng(6), (2 * 64, 2 * 64)
    flat = [gaussian_field(np.ones(shape), rng) for _ in range(30)]
    assert np.std(flat) == pytest.approx(1.0, rel=0.02)
    smooth = np.mean([np.sum(spectrum(smooth_field((64, 64), rng)).amplitude[:5, :5] ** 2) for _ in range(10)])
    assert smooth > 0.1


def test_run_puts_null_values_beside_the_number(tmp_path):
    rng = np.random.default_rng(7)
    field = wrinkles((N, N), 10.0, 0.5, rng)
    payload = run(field, field + 0.2 * field.std() * rng.standard_normal((N, N)), 1e-3, 1e-3, draws=30)
    nulls = payload["nulls"]
    assert nulls["phase-shuffled"]["mean"] == pytest.approx(1.0, abs=1e-12)
    assert nulls["phase-shuffled"]["z"] is None
    assert nulls["another-specimen"]["mean"] == pytest.approx(math.pi / 4, abs=0.04)
    assert payload["hardest_null"] == "another-specimen"
    assert 0.7 > nulls["same-radial-spectrum"]["mean"] > nulls["unrelated-wrinkles"]["mean"] > nulls["smooth"]["mean"]
    assert payload["similarity"] > 0.9 and payload["z"] > 2 and payload["exceeds_nulls"]
    assert payload["first"]["wavelength"] == pytest.approx(0.010, rel=0.1)
    assert payload["length_unit"] == "m"
    unrelated = run(field, wrinkles((N, N), 10.0, 0.5, rng), 1e-3, 1e-3, draws=30)
    assert not unrelated["exceeds_nulls"] and unrelated["nulls"]["smooth"]["exceeds_95"]
    again = run(field, wrinkles((N, N), 10.0, 0.5, np.random.default_rng(1)), draws=20, seed=3)
    assert again["nulls"] == run(field, wrinkles((N, N), 10.0, 0.5, np.random.default_rng(1)), draws=20, seed=3)["nulls"]
    assert Path(save_pictures(tmp_path, payload)[0]).stat().st_size > 10_000


def test_one_scale_for_both():
    fine, coarse = Field(wave(16.0), 1e-3), Field(wave(8.0)[:60, :64], 2e-3)
    a, b, spacing = common_grid(fine, coarse)
    assert a.shape == b.shape == (60, 64) and spacing == 2e-3
    assert similarity(spectrum(a), spectrum(b)) > 0.99
    assert dominant(a, spacing).wavelength == pytest.approx(0.016, rel=0.02)
    np.testing.assert_array_equal(common_grid(fine, fine)[0], fine.values)


def test_pictures_and_tables_are_read(tmp_path):
    from PIL import Image

    brightness = np.round(127 + 100 * wave(10.0)).astype(np.uint8)
    for name in ("a.png", "a.jpg"):
        Image.fromarray(brightness).save(tmp_path / name)
    np.save(tmp_path / "a.npy", brightness)
    np.savetxt(tmp_path / "a.csv", brightness, delimiter=",")
    fields = [read_field(tmp_path / name, 1e-3) for name in ("a.png", "a.npy", "a.csv", "a.jpg")]
    for f in fields[:3]:
        np.testing.assert_array_equal(f.values, brightness)
    assert np.abs(fields[3].values - brightness).max() < 30
    assert run(tmp_path / "a.png", tmp_path / "a.jpg", draws=20)["similarity"] > 0.99
    (tmp_path / "b.png").write_text("no picture")
    for name in ("b.png", "missing.png"):
        with pytest.raises(DataFileError, match=name):
            read_field(tmp_path / name)


def test_unusable_fields_are_named_errors():
    with pytest.raises(TooSmallError, match="8 x 128"):
        Field(wave(9.0)[:, :8])
    with pytest.raises(ConstantFieldError):
        Field(3.0 + 0.1 * X)
    with pytest.raises(ConstantFieldError):
        Field(np.zeros((32, 32)))
    holes = wave(9.0)
    holes[3, 4] = np.nan
    with pytest.raises(NotFiniteError, match="1 values"):
        Field(holes)
    with pytest.raises(FieldError, match="spacing"):
        Field(wave(9.0), -1.0)
    with pytest.raises(FieldError, match="array"):
        Field(np.zeros((4, 4, 3)))
    with pytest.raises(ScaleMismatchError, match="give both"):
        run(Field(wave(9.0), 1e-3), wave(9.0))
    with pytest.raises(ScaleMismatchError, match="without a scale"):
        run(wave(9.0), wave(9.0)[:100])
    with pytest.raises(TooSmallError, match="share"):
        run(Field(wave(9.0), 1e-3), Field(wave(9.0), 1e-1))
    with pytest.raises(InputError, match="20 draws"):
        run(wave(9.0), wave(9.0), draws=3)
    with pytest.raises(InputError, match="common_grid"):
        similarity(spectrum(wave(9.0)), spectrum(wave(9.0)[:64]))
    with pytest.raises(InputError, match="quantity"):
        similarity(spectrum(wave(9.0)), spectrum(wave(9.0)), "phase")


def test_targets_have_sources():
    path = Path(__file__).parents[2] / "material_tests" / "spectrum" / "targets.csv"
    rows = list(csv.DictReader(line for line in path.open(encoding="utf-8") if not line.startswith("#")))
    assert rows and all(row["source"] for row in rows)
