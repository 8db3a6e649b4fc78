"""Formula (8): basis functions against scipy and de Boor's rule, fits with known answers."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline, make_lsq_spline

from mfar_fem.errors import InputError
from reconstruction.template.bspline import MAX_SPANS, basis, chord_parameters, clamped_knots, fit
from reconstruction.template.panel import bezier_points

breaks = st.lists(st.floats(0.02, 0.98), max_size=8).map(lambda inner: np.unique(np.round([0.0, *inner, 1.0], 2)))


def de_boor(i, p, t, knots):
    """N_{i,p}(t) by the recursion of Cox and de Boor, 0/0 = 0, closed at the right end."""
    if p == 0:
        last = knots[i + 1] == knots[-1] and t == knots[-1]
        return float(knots[i] <= t < knots[i + 1] or (last and knots[i] < knots[i + 1]))
    total = 0.0
    if knots[i + p] > knots[i]:
        total += (t - knots[i]) / (knots[i + p] - knots[i]) * de_boor(i, p - 1, t, knots)
    if knots[i + p + 1] > knots[i + 1]:
        total += (knots[i + p + 1] - t) / (knots[i + p + 1] - knots[i + 1]) * de_boor(i + 1, p - 1, t, knots)
    return total


@settings(max_examples=40)
@given(breaks, st.floats(0, 1))
def test_basis_is_a_partition_of_unity_and_that_of_de_boor(inner, t):
    knots = clamped_knots(inner)
    values = basis(knots, [t])[0]
    assert (values >= -1e-15).all() and values.sum() == pytest.approx(1, abs=1e-14)
    np.testing.assert_allclose(values, [de_boor(i, 3, t, knots) for i in range(len(values))], atol=1e-12)
    for i in range(len(values)):
        unit = np.eye(len(values))[i]
        assert values[i] == pytest.approx(float(BSpline(knots, unit, 3)(t)), abs=1e-13)


def wave(n=200, noise=0.0, seed=0):
    x = np.linspace(0, 100, n)
    points = np.stack([x, 12 * np.sin(x / 9)], axis=1)
    return points + np.random.default_rng(seed).normal(0, noise, points.shape) if noise else points


def test_a_cubic_is_reproduced_by_one_span():
    control = np.array([(0, 0), (10, 30), (50, -20), (80, 10)], float)
    t = np.linspace(0, 1, 4001)
    dense = bezier_points(control, t)
    s = chord_parameters(dense)
    keep = np.linspace(0, 1, 60)
    points = np.stack([np.interp(keep, s, dense[:, k]) for k in range(2)], axis=1)
    assert fit(points, tolerance=2.0).spans <= 4
    straight = fit(np.array([(0.0, 0.0), (3.0, 4.0)]))
    assert straight.spans == 1 and straight.length() == pytest.approx(5) and straight.rms < 1e-12


def test_ends_are_met_and_more_knots_come_until_the_tolerance():
    coarse, fine = fit(wave(), tolerance=2.0), fit(wave(), tolerance=0.01)
    for curve in (coarse, fine):
        np.testing.assert_allclose(curve([0, 1]), wave()[[0, -1]], atol=1e-12)
    assert fine.spans > coarse.spans and fine.rms <= 0.01 < coarse.rms <= 2
    assert fine.rms <= fine.maximum


def test_noise_is_not_followed():
    """With noise above the tolerance the points bound the number of spans, and the curve is nearer to the truth than they."""
    noisy = wave(200, noise=0.5)
    curve = fit(noisy, tolerance=0.1)
    assert curve.spans <= min(MAX_SPANS, 200 // 6)
    t = chord_parameters(wave(2000))
    distance = np.sqrt(((curve(np.linspace(0.02, 0.98, 300))[:, None] - wave(2000)[None]) ** 2).sum(-1)).min(1)
    assert np.sqrt(np.mean(distance**2)) < 0.4 and len(t) == 2000


def test_fit_is_the_constrained_least_squares_one():
    """At given knots, scipy's free fit can only be closer; ours must be stationary against moves of the inner control points."""
    points = wave(120, noise=0.3)
    curve = fit(points, tolerance=0.3)
    t = chord_parameters(points)
    free = make_lsq_spline(t, points, curve.knots, 3)
    ours, theirs = (np.sum((c(t) - points) ** 2) for c in (curve, free))
    assert theirs <= ours * (1 + 1e-12)
    gradient = basis(curve.knots, t).T @ (curve(t) - points)
    assert np.abs(gradient[1:-1]).max() < 1e-8


def test_closed_curve_is_smooth_at_its_seam():
    angle = np.linspace(0, 2 * np.pi, 150, endpoint=False)
    circle = 30 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    curve = fit(circle, tolerance=0.01, closed=True)
    assert curve.closed and curve.rms <= 0.01
    assert curve.length() == pytest.approx(2 * np.pi * 30, rel=1e-4)
    spline = BSpline(curve.knots, curve.control, 3)
    for order in range(3):
        np.testing.assert_allclose(spline.derivative(order)(0.0) if order else spline(0.0),
                                   spline.derivative(order)(1.0) if order else spline(1.0), rtol=1e-6, atol=1e-4)
    quarter = fit(circle[:38], tolerance=0.01)
    assert not quarter.closed


def test_bezier_pieces_are_the_same_curve_and_length_that_of_a_polyline():
    curve = fit(wave(), tolerance=0.05)
    pieces = curve.bezier()
    knots = np.unique(curve.knots)
    assert len(pieces) == curve.spans
    for piece, a, b in zip(pieces, knots[:-1], knots[1:], strict=True):
        s = np.linspace(0, 1, 7)
        np.testing.assert_allclose(bezier_points(piece, s), curve(a + s * (b - a)), atol=1e-9)
    line = curve(np.linspace(0, 1, 20001))
    assert curve.length() == pytest.approx(np.linalg.norm(np.diff(line, axis=0), axis=1).sum(), rel=1e-6)


@pytest.mark.parametrize("bad", [np.zeros((1, 2)), np.ones((5, 2)), np.full((5, 2), np.nan), np.zeros((4, 3))])
def test_points_that_make_no_curve_are_refused(bad):
    with pytest.raises(InputError):
        fit(bad)
