"""Edges of a drawn garment: where they begin and end, how long they are, how well they fit."""

import numpy as np
import pytest
from pattern_pictures import Flat, draw

from reconstruction.template.boundaries import find_boundaries
from reconstruction.template.neckline import neckline_shape

PIXELS = 400.0


@pytest.fixture(scope="module")
def textile(tmp_path_factory):
    image = draw(tmp_path_factory.mktemp("pictures"), "robe", "textile", Flat(), PIXELS, noise=1.0, seed=4, tilt=0.04)
    lapel = image.points[6] + np.array([(0, 0), (-5, 100), (-12, 480.0)])
    image.curves["lapel"] = lapel
    return image, {b.name: b for b in find_boundaries(image, 1 / PIXELS)}


def test_edges_have_the_lengths_of_the_drawing(textile):
    from scipy.special import ellipe

    g = Flat()
    _, found = textile
    side = np.hypot((g.hem - g.body) / 2, g.length - g.armhole)
    underarm = np.hypot((g.cross - g.body) / 2, g.armhole - g.cuff)
    half, depth = g.neck / 2, g.neck_depth
    expected = {"hem": g.hem, "collar": 2 * depth * ellipe(1 - (half / depth) ** 2)}
    for s in ("left", "right"):
        expected |= {f"{s}_cuff": g.cuff, f"{s}_side": side, f"{s}_underarm": underarm}
    assert set(found) == {*expected, "lapel"}
    for name, length in expected.items():
        assert found[name].curve.length() / PIXELS == pytest.approx(length, abs=0.012), name


def test_fit_errors_are_reported_in_pixels_and_millimetres(textile):
    _, found = textile
    for boundary in found.values():
        row = boundary.to_dict()
        assert row["rms_px"] < 0.5 and row["max_px"] < 2.5
        assert row["rms_mm"] == pytest.approx(row["rms_px"] * 2.5) and row["max_mm"] >= row["rms_mm"]
    assert found["hem"].curve.spans == 1 and found["collar"].curve.spans > 1


def test_the_hem_is_straight_and_in_its_place(textile):
    image, found = textile
    hem = found["hem"].curve(np.linspace(0, 1, 50))
    ends = image.points[[10, 11]]
    normal = np.array([-(ends[1] - ends[0])[1], (ends[1] - ends[0])[0]]) / np.linalg.norm(ends[1] - ends[0])
    assert np.abs((hem - ends[0]) @ normal).max() < 5  # the points themselves are 1 px off


def test_shape_of_the_neckline_is_the_ellipse_that_was_drawn(textile):
    image, found = textile
    shape, rms = neckline_shape(image, list(found.values()))
    assert rms < 0.06
    np.testing.assert_allclose(shape, [(1, 0.5523), (0.5523, 1)], atol=0.12)


def test_a_sleeve_seen_end_on_has_no_cuff(textile):
    from reconstruction.measure.silhouette import contour, read_mask
    from reconstruction.template.boundaries import cuff_corners

    image, _ = textile
    polygon, points = contour(read_mask(image.mask)), image.points.copy()
    assert cuff_corners(points, polygon, "left") is not None
    centre = points[[8, 9]].mean(axis=0)  # shoulder, elbow and wrist in front of the trunk, a few pixels apart, pointing down
    points[[0, 2, 4]] = centre + np.array([(0, 0), (0, 8), (0, 16)])
    assert cuff_corners(points, polygon, "left") is None


def test_a_worn_collar_without_depth_has_no_shape(tmp_path):
    image = draw(tmp_path, "mural", "mural", Flat(), 250, figure="male")
    found = find_boundaries(image, 1 / 250)
    assert {"hem", "left_cuff", "right_cuff", "left_side", "right_side"} <= {b.name for b in found}
    assert neckline_shape(image, found) is None
