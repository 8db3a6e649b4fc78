"""Consistency and fusion of depth maps of a ball; what a good expectation is worth to the sweep."""

import numpy as np
import pytest
from stereo_scene import RADIUS, ball, plane

from mfar_fem.errors import InputError
from reconstruction.stereo.consistency import consistent, fuse
from reconstruction.stereo.sweep import DepthMap, planes, sweep

pytest.importorskip("cv2")
BOX = RADIUS * np.array([(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])


def maps(azimuths=(0, 25, -25)):
    views = [ball(a)[0] for a in azimuths]
    return [sweep(v, [o for o in views if o is not v], *planes(v, BOX, [o for o in views if o is not v])) for v in views]


@pytest.fixture(scope="module")
def balls():
    return maps()


def test_depth_of_a_slanted_plane_is_better_where_it_is_expected():
    views, truth = [plane(a)[0] for a in (0, 25)], plane(0)[1]
    step = 0.5 / views[0].parallax(views[1], 2.0)
    inner = (slice(12, -12), slice(30, -30))
    flat = sweep(views[0], views[1:], 2.0, step * np.arange(-60, 61))
    known = sweep(views[0], views[1:], truth + 0.013, step * np.arange(-10, 11))
    errors = [np.nanmedian(np.abs(m.depth - truth)[inner]) for m in (flat, known)]
    assert errors[1] < 0.1 * step and errors[1] < errors[0]


def test_too_few_maps_are_named(balls):
    with pytest.raises(InputError, match="2 depth maps at least"):
        consistent(balls[:1])


def test_from_the_same_place_nothing_is_confirmed_at_any_distance(balls):
    """A pixel of parallax between two views from one place is any depth."""
    one = balls[0]
    twin = DepthMap(one.view, one.depth + 0.3, one.score, one.sigma)
    assert np.isnan(consistent([one, twin])[0].depth).all()


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


def test_a_cropped_view_sees_the_same():
    view = ball(25)[0]
    part = view.cropped((slice(10, 60), slice(20, 70)))
    np.testing.assert_allclose(part.rays([[5.0, 7.0]]), view.rays([[25.0, 17.0]]), atol=1e-12)
