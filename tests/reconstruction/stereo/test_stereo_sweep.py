"""Plane sweep, semi-global smoothing, consistency and fusion on surfaces that are known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stereo_scene import RADIUS, SIZE, ball, camera, plane

from mfar_fem.errors import InputError
from reconstruction.stereo.consistency import consistent, fuse
from reconstruction.stereo.semiglobal import smooth
from reconstruction.stereo.sweep import Compared, DepthMap, correlation, planes, sweep
from reconstruction.stereo.view import View

pytest.importorskip("cv2")
BOX = RADIUS * np.array([(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])


def maps(azimuths=(0, 25, -25)):
    views = [ball(a)[0] for a in azimuths]
    return [sweep(v, [o for o in views if o is not v], *planes(v, BOX, [o for o in views if o is not v])) for v in views]


@pytest.fixture(scope="module")
def balls():
    return maps()


def test_depth_of_a_ball(balls):
    truth = ball(0)[1]
    found = balls[0]
    error = np.abs(found.depth - truth)
    there = np.isfinite(error)
    assert there.sum() > 0.6 * np.isfinite(truth).sum()
    pixel = 1.0 / found.view.parallax(balls[1].view, 2.0 - RADIUS)
    assert np.median(error[there]) < 0.35 * pixel
    assert (error[there] < 2 * found.sigma[there]).mean() > 0.8
    assert np.isnan(found.depth[~found.view.mask]).all()


def test_depth_of_a_slanted_plane_is_better_where_it_is_expected():
    views, truth = [plane(a)[0] for a in (0, 25)], plane(0)[1]
    step = 0.5 / views[0].parallax(views[1], 2.0)
    inner = (slice(12, -12), slice(30, -30))
    flat = sweep(views[0], views[1:], 2.0, step * np.arange(-60, 61))
    known = sweep(views[0], views[1:], truth + 0.013, step * np.arange(-10, 11))
    errors = [np.nanmedian(np.abs(m.depth - truth)[inner]) for m in (flat, known)]
    assert errors[1] < 0.1 * step and errors[1] < errors[0]


def test_what_others_do_not_see_has_no_depth():
    views, truth = [ball(a)[0] for a in (0, 25)], ball(0)[1]
    half = views[1].mask.copy()
    half[: SIZE[0] // 2] = False
    hidden = View(views[1].name, views[1].image, views[1].camera, half)
    found = sweep(views[0], [hidden], *planes(views[0], BOX, [hidden]))
    assert np.isfinite(found.depth[: SIZE[0] // 2 - 12]).sum() < 0.05 * np.isfinite(truth[: SIZE[0] // 2 - 12]).sum()


def test_mistakes_are_named():
    view = ball(0)[0]
    with pytest.raises(InputError, match="there are 0"):
        sweep(view, [], 2.0, [0, 1, 2])
    with pytest.raises(InputError, match=r"'v': the mask is 3x4|\(4, 3\)|mask is"):
        View.of("v", np.zeros((10, 12, 3)), camera(0), np.ones((4, 3)))
    with pytest.raises(InputError, match="3x4 matrix"):
        View.of("v", np.zeros((10, 12, 3)), np.eye(3))
    with pytest.raises(InputError, match="2 depth maps at least"):
        consistent(maps((0, 25))[:1])


def test_correlation_does_not_mind_the_light():
    a = ball(0)[0].image
    np.testing.assert_allclose(correlation(a, 0.6 * a + 0.1)[20:-20, 30:-30], 1.0, atol=0.02)
    np.testing.assert_allclose(correlation(a, 1 - a)[40:50, 50:60], -1.0, atol=0.02)
    np.testing.assert_array_equal(Compared(a).with_(a), correlation(a, a))


def test_smoothing_of_one_row_is_the_cheapest_path():
    """Along one row the smoothed cost of the two horizontal directions is the exact minimum over paths from either side."""
    rng = np.random.default_rng(1)
    cost = rng.random((1, 7, 4)).astype(np.float32)
    small, large = 0.1, 0.4

    def cheapest(c):
        out = [c[0]]
        for now in c[1:]:
            step = [[0 if i == k else small if abs(i - k) == 1 else large for i in range(4)] for k in range(4)]
            before = out[-1]
            out.append(np.array([now[k] + min(before[i] + step[k][i] for i in range(4)) for k in range(4)]) - before.min())
        return np.array(out)

    there, back = cheapest(cost[0].astype(float)), cheapest(cost[0][::-1].astype(float))[::-1]
    exact = (there + back + 6 * cost[0]) / 8  # the other six directions begin at every pixel
    np.testing.assert_allclose(smooth(cost, small, large, np.ones((1, 7), dtype=bool))[0], exact, atol=1e-5)


def test_a_spoilt_map_is_not_believed(balls):
    spoilt = [DepthMap(m.view, m.depth + (0.08 if i == 0 else 0.0), m.score, m.sigma) for i, m in enumerate(balls)]
    kept, good = consistent(spoilt), consistent(balls)
    count = lambda m: np.isfinite(m.depth).sum()  # noqa: E731
    assert count(good[0]) > 0.6 * count(balls[0])
    assert count(kept[0]) < 0.15 * count(balls[0])


def test_fused_points_lie_on_the_ball_and_look_outwards(balls):
    points, normals, sigma = fuse(consistent(balls), 0.01)
    off = np.linalg.norm(points, axis=1) - RADIUS
    assert len(points) > 300 and np.median(np.abs(off)) < 0.006
    assert (np.abs(off) < 2 * sigma).mean() > 0.75
    assert np.median(np.einsum("ni,ni->n", normals, points) / np.linalg.norm(points, axis=1)) > 0.9
    nothing = [DepthMap(m.view, np.full_like(m.depth, np.nan), m.score, m.sigma) for m in balls]
    with pytest.raises(InputError, match="no depth is left"):
        fuse(nothing, 0.01)


@settings(max_examples=25, deadline=None)
@given(st.floats(-3.0, 3.0).filter(lambda s: abs(s) > 0.05), st.floats(-60, 60), st.floats(0.5, 3.0))
def test_any_scale_and_sign_of_a_camera(scale, azimuth, depth):
    view = View.of("v", np.zeros((*SIZE, 3)), scale * camera(azimuth))
    np.testing.assert_allclose(view.camera, camera(azimuth), atol=1e-9)
    pixels = np.array([[3.0, 5.0], [80.0, 60.0]])
    back, depths = view.project(view.centre + depth * view.rays(pixels))
    np.testing.assert_allclose(back, pixels, atol=1e-7)
    np.testing.assert_allclose(depths, depth, atol=1e-9)


def test_a_cropped_view_sees_the_same():
    view = ball(25)[0]
    part = view.cropped((slice(10, 60), slice(20, 70)))
    np.testing.assert_allclose(part.rays([[5.0, 7.0]]), view.rays([[25.0, 17.0]]), atol=1e-12)
