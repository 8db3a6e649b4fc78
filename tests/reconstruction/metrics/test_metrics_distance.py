"""Distances of surfaces whose distance is known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("igl")

from reconstruction.metrics.distance import distances, nearest_samples
from reconstruction.surface.triangles import TriangleMesh


def tube(radius=0.2, height=0.6, low=0.0, n=96, m=30):
    v, t = np.meshgrid(2 * np.pi * np.arange(n) / n, np.linspace(0, 1, m + 1))
    x = np.stack([radius * np.cos(v), radius * np.sin(v), low + t * height], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(n), np.arange(m))
    a, b = j * n + i, j * n + (i + 1) % n
    faces = np.concatenate([np.stack([a, b, b + n], -1).reshape(-1, 3), np.stack([a, b + n, a + n], -1).reshape(-1, 3)])
    return TriangleMesh(x, faces)


def test_tubes_of_two_radii_are_their_difference_apart():
    d = distances(tube(0.2), tube(0.21))
    assert d["mean"] == pytest.approx(10.0, abs=0.1) and d["largest"] < 10.4
    assert d["off_mean"] == pytest.approx(d["missing_mean"], rel=0.02)
    assert d["rim_mean"] == pytest.approx(10.0, rel=0.05) and d["normals"] < 2.5
    assert d["nearest_samples"] > d["mean"]  # samples are never nearer than the surface


def test_a_surface_has_no_distance_from_itself_but_its_samples_have():
    d = distances(tube(), tube())
    assert d["mean"] < 1e-6 and d["largest"] < 1e-5 and d["rim_mean"] < 1e-6
    assert d["nearest_samples"] == pytest.approx(d["floor"], rel=0.05) and d["floor"] > 1.0
    # random points on a plane: mean distance of the nearest of n points on an area A is 0.5 sqrt(A / n)
    assert d["floor"] == pytest.approx(1e3 * 0.5 * np.sqrt(2 * np.pi * 0.2 * 0.6 / 20_000), rel=0.05)


def test_a_missing_half_counts_in_one_direction_only():
    d = distances(tube(height=0.3), tube())
    assert d["off_mean"] < 1e-6 and d["missing_mean"] == pytest.approx(75.0, rel=0.05)  # half of it 0 to 300 mm away


@settings(max_examples=20, deadline=None)
@given(st.integers(2, 60), st.integers(2, 60), st.integers(0, 10**6))
def test_formula_18_is_the_pooled_mean(n, m, seed):
    rng = np.random.default_rng(seed)
    p, q = rng.random((n, 3)), rng.random((m, 3))
    table = np.linalg.norm(p[:, None] - q[None], axis=2)
    assert nearest_samples(p, q) == pytest.approx((table.min(axis=1).sum() + table.min(axis=0).sum()) / (n + m))
    assert nearest_samples(p, q) == pytest.approx(nearest_samples(q, p))


