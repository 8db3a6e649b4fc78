"""Folds that are known: the same, elsewhere, none."""

import numpy as np
import pytest

pytest.importorskip("embreex")

from mfar_fem.errors import InputError
from reconstruction.metrics.folds import (
    STEP,
    agreement,
    folds,
    height_map,
    null_values,
    shuffled,
    smoothed,
    spectrum_similarity,
)
from reconstruction.surface.triangles import TriangleMesh


def sheet(function, size=0.6, n=120):
    x, z = np.meshgrid(np.linspace(-size / 2, size / 2, n), np.linspace(0, size, n))
    points = np.stack([x, -function(x, z), z], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(n - 1), np.arange(n - 1))
    a = (j * n + i).ravel()
    return TriangleMesh(points, np.concatenate([np.stack([a, a + 1, a + n + 1], -1), np.stack([a, a + n + 1, a + n], -1)]))


def mapped(function):
    return height_map(sheet(function), (-0.3, -0.1, 0.0), (0.3, 0.1, 0.6))


def pleats(wave, phase=0.0):
    return lambda x, z: 0.01 * np.sin(2 * np.pi * x / wave + phase) + 0.05 * x


def test_heights_are_those_of_the_surface():
    heights = mapped(lambda x, z: 0.02 * x + 0.1 * z)
    h, w = heights.shape
    x, z = -0.3 + STEP * np.arange(w), 0.6 - STEP * np.arange(h)
    inside = np.isfinite(heights)
    assert inside.mean() > 0.97
    expected = 0.02 * x[None] + 0.1 * z[:, None]
    error = (heights - expected)[inside]
    assert error.std() < 1e-6  # up to where height is counted from


def test_only_waves_of_the_band_are_folds():
    strength = {wave: folds(mapped(pleats(wave)))[30:-30, 30:-30].std() for wave in (0.015, 0.07, 1.5)}
    assert strength[0.07] > 3 * strength[0.015] and strength[0.07] > 10 * strength[1.5]


def test_the_same_folds_elsewhere_have_the_spectrum_but_do_not_agree():
    here, there, other = mapped(pleats(0.08)), mapped(pleats(0.08, np.pi / 2)), mapped(pleats(0.05))
    assert spectrum_similarity(here, here) == pytest.approx(1.0) and agreement(here, here) == pytest.approx(1.0)
    assert abs(agreement(here, there)) < 0.2
    assert spectrum_similarity(here, there) > 0.8 > spectrum_similarity(here, other) + 0.1


def test_null_values():
    rng = np.random.default_rng(0)
    noise = rng.standard_normal((8, 2))
    truth = mapped(lambda x, z: 0.006 * sum(np.sin(2 * np.pi * (a * x + b * z) / 0.1 + a) for a, b in noise))
    null = null_values(truth, [mapped(pleats(0.05))], rng)
    assert set(null) == {"phases shuffled", "smooth", "unrelated garments"}
    assert abs(np.mean(null["phases shuffled"]["agreement"])) < 0.25 and max(null["phases shuffled"]["agreement"]) < 0.6
    assert np.mean(null["phases shuffled"]["spectrum"]) > max(null["unrelated garments"]["spectrum"])  # it forgets where they are
    again = shuffled(truth, rng)
    assert np.isfinite(again).sum() == np.isfinite(truth).sum() and folds(smoothed(truth)).std() < 0.5 * folds(truth).std()


def test_surfaces_that_do_not_overlap_are_refused():
    here = mapped(pleats(0.08))
    with pytest.raises(InputError, match="at least 400"):
        agreement(here, np.full_like(here, np.nan))
