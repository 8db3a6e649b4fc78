"""The whole fit on a garment whose shape is known, and what it says of its points."""

import functools

import numpy as np
import pytest
from shape_scene import STATURE, dimensions, scene

from mfar_fem.errors import InputError
from reconstruction.shape.fit import FitSettings, fit_shape
from reconstruction.shape.points import SOURCES, PointSet, sample
from reconstruction.shape.wearing import gathering
from reconstruction.surface.analytic import mesh_distance
from reconstruction.template.dimensions import RibbonDimensions

pytest.importorskip("embreex")
EDGE = 0.045


@functools.cache
def fitted(outlines, depths):
    mesh, _, views, given, points = scene()
    settings = FitSettings(edge=EDGE, hang=12, outline=8, depth=14, outlines=outlines, depths=depths)
    return fit_shape("half-sleeve", dimensions(), points, views, STATURE, settings, given=given), mesh


def error(shape, mesh):
    theirs = sample_of(mesh)
    ours = shape.sewn.mesh(shape.vertices)
    return 0.5 * (mesh_distance(sample_of(ours), mesh).mean() + mesh_distance(theirs, ours).mean())


def sample_of(mesh):
    return np.concatenate([mesh.vertices, mesh.vertices[mesh.faces].mean(axis=1)])


def test_every_kind_of_evidence_brings_it_nearer_to_the_truth():
    template, outlines, everything = (error(*fitted(*which)) for which in ((False, False), (True, False), (True, True)))
    assert everything < outlines < template
    assert everything < 0.009 and everything < 0.6 * template


def test_points_say_where_they_come_from_and_how_sure_they_are():
    shape, mesh = fitted(True, True)
    found = sample(shape)
    off = mesh_distance(found.points, mesh)
    shares = found.shares()
    assert shares["stereo"] > 0.3 and shares["template"] > 0.2 and sum(shares.values()) == pytest.approx(1.0)
    by_source = {name: off[found.source == i] for i, name in enumerate(SOURCES)}
    assert np.median(by_source["stereo"]) < 0.006 < 0.03 < found.sigma[found.source == SOURCES.index("template")].min() + 0.005
    assert (off < 2 * found.sigma).mean() > 0.85
    behind = found.points[:, 1] > shape.frame.to_world(np.zeros(3))[1] + 0.05
    assert (found.source[behind] != SOURCES.index("stereo")).mean() > 0.9  # nothing saw depth from behind
    assert len(found.openings) == 4
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=1), 1.0, atol=1e-9)
    front = found.points[:, 1] < -0.1
    assert (found.normals[front, 1] < 0).mean() > 0.95


def test_points_are_written_and_read(tmp_path):
    found = sample(fitted(True, True)[0])
    found.write(tmp_path)
    again = PointSet.read(tmp_path / "points.npz")
    np.testing.assert_array_equal(again.points, found.points)
    assert len(again.openings) == 4 and (tmp_path / "points.vtu").stat().st_size > 1000
    (tmp_path / "points.npz").write_bytes(b"nothing")
    with pytest.raises(Exception, match=r"no point set"):
        PointSet.read(tmp_path / "points.npz")


def test_a_fit_without_evidence_is_named_template():
    shape, _ = fitted(False, False)
    assert set(np.unique(shape.source)) <= {"template", "landmark"}


def test_gathering():
    """Waist 0.3 m wide: an ellipse 0.3 x 0.225 has a girth of 0.8280 m; the cut has 2 x 0.51."""
    d = dimensions()
    places = np.zeros((12, 3))
    places[8], places[9] = (0.15, 0, -0.42), (-0.15, 0, -0.42)
    assert gathering(d, places) == pytest.approx(0.8280 / (2 * 0.51), abs=1e-3)
    places[8], places[9] = (0.3, 0, -0.42), (-0.3, 0, -0.42)
    assert gathering(d, places) == 1.0


def test_a_ribbon_that_does_not_reach_is_refused_by_name():
    _, _, views, _, points = scene()
    with pytest.raises(InputError, match=r"0\.80 m long does not reach"):
        fit_shape("flying-ribbon", RibbonDimensions(0.8, 0.4), points, views, STATURE)
