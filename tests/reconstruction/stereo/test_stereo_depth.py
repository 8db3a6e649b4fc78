"""Depths of a slanted plane and a ball by three cameras, against the intersections of rays that drew them."""

import numpy as np
import pytest
from stereo_scene import RADIUS, SIZE, camera, pattern

from mfar_fem.errors import InputError
from reconstruction.stereo.sweep import NOISE, Compared, correlation, planes, sweep
from reconstruction.stereo.view import View

pytest.importorskip("cv2")
AZIMUTHS = (0, 18, -22)
NORMAL = np.array([0.35, -1.0, 0.25]) / np.linalg.norm([0.35, -1.0, 0.25])
SHIELD = 0.12
"""Half width of the square before the plane that hides part of it."""


def plane_depth(view):
    """A plane through the origin that is slanted both ways."""
    return -(view.centre @ NORMAL) / (view.grid_rays() @ NORMAL)


def ball_depth(view):
    rays, c = view.grid_rays(), view.centre
    a, b, q = (rays**2).sum(-1), rays @ c, c @ c - RADIUS**2
    root = b**2 - a * q
    return np.where(root > 0, (-b - np.sqrt(np.maximum(root, 0))) / a, np.nan)


def shield_depth(view):
    """A square 0.5 m before the origin, across the y axis, in the left half of the first picture."""
    depth = (-0.5 - view.centre[1]) / view.grid_rays()[..., 1]
    x, _, z = np.moveaxis(view.points(depth), -1, 0)
    return np.where((np.abs(x + 0.1) < SHIELD) & (np.abs(z) < SHIELD), depth, np.nan)


def shoot(azimuth, depth_of, before=None):
    """View, depths of the surface (NaN: none), and whether it is hidden."""
    blank = View.of(f"at {azimuth}", np.zeros((*SIZE, 3)), camera(azimuth))
    depth = depth_of(blank)
    seen = np.isfinite(depth)
    image = np.where(seen[..., None], pattern(blank.points(np.nan_to_num(depth, nan=1.0))), 0.1)
    hidden = np.zeros(SIZE, dtype=bool)
    if before is not None:
        near = before(blank)
        hidden = near < depth
        image = np.where(hidden[..., None], pattern(3 + 0.9 * blank.points(np.nan_to_num(near, nan=1.0))), image)
    return View(blank.name, image.astype(np.float32), blank.camera, seen & ~hidden), np.where(hidden, np.nan, depth), hidden


def swept(depth_of, box, before=None):
    shots = [shoot(a, depth_of, before) for a in AZIMUTHS]
    views = [s[0] for s in shots]
    return sweep(views[0], views[1:], *planes(views[0], box, views[1:])), shots, views


@pytest.fixture(scope="module")
def wall():
    first = shoot(0, plane_depth)[0]
    corners = first.points(plane_depth(first))[:: SIZE[0] - 1, :: SIZE[1] - 1].reshape(-1, 3)
    return *swept(plane_depth, corners), corners


def test_a_slanted_plane(wall):
    found, shots, views, _ = wall
    pixel = 1.0 / max(views[0].parallax(o, 2.0) for o in views[1:])
    inner = (slice(8, -8), slice(8, -8))
    error = (found.depth - shots[0][1])[inner]
    shared = np.isfinite(error)
    assert shared.mean() > 0.7
    assert np.nanmedian(np.abs(error)) < 0.15 * pixel  # 0.15 px; depth to 0.1 %
    assert np.nanmedian(np.abs(error) / shots[0][1][inner]) < 1.5e-3
    assert abs(np.nanmedian(error)) < 0.05 * pixel  # no bias
    assert (np.abs(error[shared]) < 0.02 * 2.0).mean() > 0.99


def test_a_plane_is_measured_from_every_view(wall):
    """From the sides it is slanted by up to 50 degrees, which windows across the axis bear less well."""
    _, shots, views, corners = wall
    for i in (1, 2):
        others = [v for v in views if v is not views[i]]
        found = sweep(views[i], others, *planes(views[i], corners, others))
        pixel = 1.0 / max(views[i].parallax(o, 2.0) for o in others)
        assert np.nanmedian(np.abs(found.depth - shots[i][1])) < 0.35 * pixel


def test_a_ball():
    box = RADIUS * np.array([(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
    found, shots, views = swept(ball_depth, box)
    truth = shots[0][1]
    error = np.abs(found.depth - truth)
    assert np.isfinite(error).sum() > 0.5 * np.isfinite(truth).sum()
    assert np.nanmedian(error / truth) < 2e-3
    assert np.isnan(found.depth[~views[0].mask]).all() and np.isnan(found.sigma[np.isnan(found.depth)]).all()
    assert found.score[np.isfinite(found.depth)].min() >= 0.5 and (found.sigma[np.isfinite(found.depth)] > 0).all()


def test_what_stands_before_leaves_a_hole(wall):
    found, shots, views = swept(plane_depth, wall[-1], shield_depth)
    truth, hidden = shots[0][1:]
    assert hidden.sum() > 200 and np.isnan(found.depth[hidden]).all()
    points = views[0].points(np.nan_to_num(truth, nan=2.0))
    behind = np.zeros(SIZE, dtype=bool)  # seen by the first view, hidden from one of the two others
    for view, (_, _, covered) in zip(views[1:], shots[1:], strict=True):
        x, y = np.moveaxis(np.rint(view.project(points)[0]).astype(int), -1, 0)
        inside = (x >= 0) & (y >= 0) & (x < SIZE[1]) & (y < SIZE[0])
        behind |= inside & covered[y.clip(0, SIZE[0] - 1), x.clip(0, SIZE[1] - 1)] & ~hidden
    assert behind.sum() > 100
    error = np.abs(found.depth - truth)
    assert (error[behind] < 0.01).mean() < 0.1  # two of two must see it
    clear = ~behind & np.isfinite(truth)
    assert np.nanmedian(error[clear]) < 2e-3


def test_one_of_three_others_may_be_blind(wall):
    """The two most alike count: a third that shows something else changes hardly anything."""
    found, shots, views, corners = wall
    noise = np.random.default_rng(0).random((*SIZE, 3)).astype(np.float32)
    blind = View("blind", noise, camera(8), np.ones(SIZE, dtype=bool))
    again = sweep(views[0], [*views[1:], blind], *planes(views[0], corners, views[1:]))
    both = np.isfinite(found.depth) & np.isfinite(again.depth)
    assert both.sum() > 0.95 * np.isfinite(found.depth).sum()
    assert np.median(np.abs(again.depth - shots[0][1])[both]) < 2e-3


def test_light_does_not_change_depths(wall):
    found, _, views, corners = wall
    darker = [View(v.name, (0.6 * v.image + 0.05 * (i + 1)), v.camera, v.mask) for i, v in enumerate(views[1:])]
    again = sweep(views[0], darker, *planes(views[0], corners, darker))
    both = np.isfinite(found.depth) & np.isfinite(again.depth)
    assert both.sum() > 0.98 * np.isfinite(found.depth).sum()
    assert np.median(np.abs(found.depth - again.depth)[both]) < 2e-4


def test_nothing_is_found_without_a_mask_or_an_expectation(wall):
    _, _, views, _ = wall
    nowhere = View("n", views[0].image, views[0].camera, np.zeros(SIZE, dtype=bool))
    for view, base in ((nowhere, 2.0), (views[0], np.full(SIZE, np.nan))):
        found = sweep(view, views[1:], base, [-0.1, 0.0, 0.1])
        assert np.isnan(found.depth).all() and np.isnan(found.sigma).all()


def test_planes_go_through_the_box(wall):
    _, _, views, corners = wall
    base, offsets = planes(views[0], corners, views[1:], margin=0.1, pixels=0.5)
    depth = views[0].project(corners)[1]
    reach = 0.1 * np.ptp(depth)
    assert base + offsets[0] <= depth.min() - reach and base + offsets[-1] >= depth.max() + reach
    np.testing.assert_allclose(np.diff(offsets), offsets[1] - offsets[0])
    assert max(views[0].parallax(o, base) for o in views[1:]) * (offsets[1] - offsets[0]) == pytest.approx(0.5)


def test_planes_that_cannot_be_are_named(wall):
    _, _, views, corners = wall
    with pytest.raises(InputError, match="no other view"):
        planes(views[0], corners, [])
    with pytest.raises(InputError, match="same place"):
        planes(views[0], corners, [views[0]])
    with pytest.raises(InputError, match="behind"):
        planes(views[0], np.array([views[0].centre - views[0].axis]), views[1:])
    with pytest.raises(InputError, match="mask"):
        planes(View("n", views[0].image, views[0].camera, np.zeros(SIZE, dtype=bool)), corners, views[1:])
    with pytest.raises(InputError, match=r"three depths at least; there are 2 and 2"):
        sweep(views[0], views[1:], 2.0, [0.0, 0.1])


@pytest.mark.parametrize("gain, shift", [(1.0, 0.0), (0.5, 0.2), (1.3, -0.2), (-0.7, 0.9)])
def test_correlation_of_a_change_of_brightness_is_one_but_for_the_damping(gain, shift):
    a = np.random.default_rng(4).random((20, 24, 3)).astype(np.float32)
    inner = slice(4, -4)
    windows = np.lib.stride_tricks.sliding_window_view(a.astype(float), (9, 9), axis=(0, 1))
    variance = windows.var(axis=(3, 4)).sum(axis=2)
    exact = gain * variance / np.sqrt((variance + NOISE) * (gain**2 * variance + NOISE))
    found = correlation(a, gain * a + shift)[inner, inner]
    np.testing.assert_allclose(found, exact, atol=1e-4)
    np.testing.assert_allclose(found, np.sign(gain), atol=5e-3)


def test_correlation_lies_between_its_bounds_and_is_symmetric():
    rng = np.random.default_rng(5)
    a, b = rng.random((2, 20, 24, 3)).astype(np.float32)
    np.testing.assert_allclose(correlation(a, b), correlation(b, a), atol=1e-5)
    assert np.abs(correlation(a, b)).max() <= 1.0 and np.abs(correlation(a, b)).mean() < 0.2
    np.testing.assert_array_equal(Compared(a).with_(b), correlation(a, b))


def test_flat_windows_resemble_nothing():
    flat, a = np.full((20, 24, 3), 0.4, dtype=np.float32), np.random.default_rng(6).random((20, 24, 3)).astype(np.float32)
    for x, y in ((flat, a), (a, flat), (flat, flat)):
        assert np.abs(correlation(x, y)).max() < 0.02
