"""Hats and ribbons: sewn as their panels are, put on where their landmarks are."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mfar_fem.errors import InputError
from reconstruction.landmarks import INDEX
from reconstruction.shape.landmarks3d import SpacePoints
from reconstruction.shape.sewn_hat import BRIM, CROWN, VEIL, in_space, sew_hat
from reconstruction.shape.wearing import put_on
from reconstruction.surface.connectivity import boundary_loops
from reconstruction.surface.triangles import TriangleMesh
from reconstruction.template.dimensions import HatDimensions, RibbonDimensions

HAT = HatDimensions(0.2, 0.2, 0.46, 0.5, np.pi / 3, 1.2)


def areas(flat):
    a, b = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
    return 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def space(**half):
    """Left places of parts; the right ones mirrored."""
    points = np.full((12, 3), np.nan)
    for part, place in half.items():
        points[INDEX[f"left_{part}"]] = place
        points[INDEX[f"right_{part}"]] = np.array(place) * (-1, 1, 1)
    return SpacePoints(points, np.full(12, 0.005), np.full(12, 3))


@settings(max_examples=15, deadline=None)
@given(st.floats(0.17, 0.24), st.floats(0.1, 0.25), st.floats(0.36, 0.54), st.floats(0.3, 0.9), st.floats(0.3, 2.0),
       st.floats(1.0, 1.3))  # fmt: skip
@example(0.1875, 0.25, 0.388671875, 0.5, 1.3125, 1.0)
def test_a_hat_is_one_oriented_surface_with_the_area_of_its_panels(crown, height, brim, veil, gap, gathering):
    d = HatDimensions(crown, height, brim, veil, gap, gathering)
    sewn = sew_hat(d, 0.025)
    x = in_space(sewn, d)
    mesh = TriangleMesh(x, sewn.faces)
    assert len(boundary_loops(sewn.faces)) == 1
    assert len(x) - len(mesh.edges) + len(sewn.faces) == 1  # a disc
    found = [areas(sewn.flat[sewn.panel == k]).sum() for k in (CROWN, BRIM, VEIL)]
    r, q = crown / 2, brim / 2
    assert found[0] == pytest.approx(np.pi * r * np.hypot(r, height), rel=0.02)
    assert found[1] == pytest.approx(np.pi * (q**2 - r**2), rel=0.02)
    columns = sewn.uv[sewn.openings["hem"], 0] / q
    assert found[2] == pytest.approx(gathering * q * np.ptp(columns) * veil, rel=1e-9)
    step = np.diff(np.sort(columns)).max()  # whole columns: a little more or less than the edge asked for
    assert abs(step * q / 0.025 - 1) < 0.1 and abs(np.ptp(columns) - (2 * np.pi - gap)) < 2 * step
    outer = np.einsum("fi,fi->f", mesh.face_normals, x[sewn.faces].mean(axis=1) - (0, 0, -0.5))
    assert (outer[sewn.panel != VEIL] > 0).all()
    side = np.einsum("fi,fi->f", mesh.face_normals[:, :2], x[sewn.faces].mean(axis=1)[:, :2])
    assert (side[sewn.panel == VEIL] > 0).all()


def test_crown_and_brim_are_developed_without_stretch():
    sewn = sew_hat(HAT, 0.02)
    x = in_space(sewn, HAT)
    stiff = sewn.panel != VEIL
    at, flat = x[sewn.faces[stiff]], sewn.flat[stiff]
    for i, j in ((0, 1), (1, 2), (2, 0)):
        there, here = np.linalg.norm(at[:, i] - at[:, j], axis=1), np.linalg.norm(flat[:, i] - flat[:, j], axis=1)
        np.testing.assert_allclose(there, here, rtol=0.06)  # chords of arcs: a fan about the tip is the coarsest


def test_a_hat_is_put_where_its_landmarks_are():
    points = space(neckline=(0.1, 0.0, 1.6), shoulder=(0.23, 0.0, 1.6), ankle=(0.23, 0.0, 1.1))
    worn = put_on("veil-hat", HatDimensions(0.19, 0.2, 0.40, 0.6), points, 1.65, 0.025)
    world = worn.frame.to_world(worn.start)
    brim = worn.sewn.openings["face"]
    assert world[brim, 2] == pytest.approx(1.6, abs=1e-9)
    assert np.linalg.norm(world[brim, :2], axis=1) == pytest.approx(0.23, rel=1e-9)  # the landmarks', not the template's
    assert world[worn.sewn.openings["hem"], 2] == pytest.approx(1.1, abs=1e-9)
    assert len(worn.known) == 2 and np.isin(worn.sewn.openings["face"], worn.stiff).all()
    vague = SpacePoints(points.points, np.full(12, 0.1), points.views)
    loose = put_on("veil-hat", HatDimensions(0.19, 0.2, 0.40, 0.6), vague, 1.65, 0.025)
    assert np.linalg.norm(loose.start[loose.sewn.openings["face"], :2], axis=1) == pytest.approx(0.20, rel=1e-9)


def test_a_ribbon_runs_along_its_landmarks_and_hangs_from_the_hands():
    half = {"neckline": (0.07, 0.05, 1.4), "shoulder": (0.2, 0.03, 1.38), "elbow": (0.4, 0.0, 1.25), "wrist": (0.6, 0.0, 1.1),
            "ankle": (0.55, 0.0, 0.5)}  # fmt: skip
    worn = put_on("flying-ribbon", RibbonDimensions(2.4, 0.4), space(**half), 1.65, 0.03)
    world = worn.frame.to_world(worn.start)
    for vertex, place, _ in worn.known:
        if place[2] > worn.frame.to_body((0, 0, 1.0))[2]:  # not the free tips
            assert np.linalg.norm(worn.start[vertex] - place) < 0.05
    assert len(worn.known) == 10 and len(worn.pinned) == 4
    tips = np.abs(worn.sewn.uv[:, 0]) > 1.19
    assert world[tips, 2].max() < 0.75  # what is left hangs down
    assert np.abs(world[np.abs(worn.sewn.uv[:, 0]) < 0.02][:, 0]).max() < 0.05
    assert worn.body.distance(worn.start).min() > -0.01


def test_what_cannot_be_sewn_is_named():
    with pytest.raises(InputError, match="too long for a part of"):
        sew_hat(HAT, 0.2)
    with pytest.raises(InputError, match="covers nothing"):
        sew_hat(HatDimensions(0.2, 0.2, 0.46, 0.5, 6.2, 1.2), 0.02)
