"""Panels of all four types: closed, simple, sewable, of the stated dimensions."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mfar_fem.errors import InputError, UnknownNameError
from reconstruction.measure.silhouette import signed_area
from reconstruction.template.accessories import build_hat, build_ribbon
from reconstruction.template.checks import LENGTH_TOLERANCE, check, cut_line
from reconstruction.template.dimensions import GARMENTS, HatDimensions, RibbonDimensions, derive
from reconstruction.template.geometry import is_simple
from reconstruction.template.panel import Edge, Panel, Pattern, Seam
from reconstruction.template.pipeline import build_pattern
from reconstruction.template.straight_cut import build

FREE = ("hem", "slit", "cuff", "lapel", "end", "top")
ROBE = {"garment_length": 1.38, "cross_sleeve_width": 2.48, "body_width": 0.62, "armhole_depth": 0.34, "cuff_width": 0.22,
        "hem_width": 0.80, "neck_width": 0.18, "neck_depth": 0.10}


def errors(pattern):
    return [f for f in check(pattern) if f.level == "error"]


@pytest.mark.parametrize("garment", GARMENTS)
def test_every_type_passes_its_checks(garment):
    dimensions, assumed = derive(garment, {})
    pattern = build_pattern(garment, dimensions)
    assert errors(pattern) == []
    assert assumed  # nothing measured: everything assumed, and said
    for panel in pattern.panels.values():
        cut = cut_line(panel)
        assert is_simple(cut) and abs(signed_area(cut)) > abs(signed_area(panel.outline()))
        assert np.linalg.norm(panel.warp) == pytest.approx(1)


@settings(max_examples=40)
@given(st.floats(0.5, 1.6), st.floats(0.5, 0.8), st.floats(0.9, 2.0), st.floats(1.4, 4.5), st.floats(0.4, 1.2), st.floats(0, 0.9),
       st.floats(0, 0.4), st.floats(0.2, 0.6))
def test_random_robes_are_sewable(length, body, hem, cross, cuff, overlap, slit, loom):
    dimensions, _ = derive("round-collar-robe", {
        "garment_length": length, "body_width": body, "hem_width": hem * body, "cross_sleeve_width": cross * body,
        "armhole_depth": 0.28, "cuff_width": 0.28 * cuff, "neck_width": 0.18, "neck_depth": 0.09, "overlap_neck": overlap * 0.09,
        "slit": slit * length})
    pattern = build("round-collar-robe", dimensions, max(loom, 0.35))
    assert errors(pattern) == []
    sewn = {end for seam in pattern.seams for end in (seam.first, seam.second)}
    for name, panel in pattern.panels.items():
        assert signed_area(panel.outline()) > 0
        for i, edge in enumerate(panel.edges):
            assert ((name, i) in sewn) != (edge.name in FREE), (name, edge.name)
        if name.startswith("sleeve"):
            assert np.ptp(panel.vertices[:, 0]) <= max(loom, 0.35)


def test_robe_has_the_dimensions_it_was_given():
    dimensions, _ = derive("round-collar-robe", ROBE)
    p = build("round-collar-robe", dimensions).panels
    everything = np.vstack([panel.vertices for name, panel in p.items() if name != "collar"])
    assert np.ptp(everything[:, 0]) == pytest.approx(2.48) and everything[:, 1].min() == pytest.approx(-1.38)
    cuff = p["sleeve_left_2"]
    assert cuff.edge_length(cuff.find("cuff")[0]) == pytest.approx(2 * 0.22)
    left = p["front_left"]
    assert left.edge_length(left.find("armhole")[0]) == pytest.approx(0.34)
    assert left.vertices[left.edges[left.find("neckline")[0]].end].tolist() == pytest.approx([0, -0.10])
    quarter = left.edge_length(left.find("neckline")[0])
    from scipy.special import ellipe
    assert quarter == pytest.approx(0.10 * ellipe(1 - 0.9**2), rel=1e-3)  # a quarter of the ellipse 9 x 10 cm
    neck = sum(p[n].edge_length(i) for n in ("front_left", "front_right", "back_left", "back_right")
               for i, e in enumerate(p[n].edges) if e.name.startswith("neckline"))
    assert np.ptp(p["collar"].vertices[:, 0]) == pytest.approx(neck)


def test_left_and_right_are_mirror_images():
    p = build("r", derive("round-collar-robe", ROBE)[0]).panels
    for name in [n for n in p if "left" in n]:
        other = p[name.replace("left", "right")]
        assert signed_area(other.outline()) == pytest.approx(signed_area(p[name].outline()))
        ours, theirs = (sorted(map(tuple, np.round(v, 9))) for v in (p[name].vertices, other.vertices * (-1, 1)))
        np.testing.assert_allclose(ours, theirs)


def test_folds_have_no_allowance_and_seams_do():
    pattern = build("r", derive("round-collar-robe", ROBE)[0])
    for seam in pattern.seams:
        for name, i in (seam.first, seam.second):
            assert (pattern.panels[name].edges[i].allowance == 0) == (seam.kind == "fold")


def test_wide_hems_get_gores_and_wide_panels_a_warning():
    dimensions, _ = derive("round-collar-robe", ROBE | {"hem_width": 1.3})
    pattern = build("r", dimensions)
    assert sum(name.startswith("gore") for name in pattern.panels) == 4 and errors(pattern) == []
    wide = [f.where for f in check(pattern, loom_width=0.30) if f.level == "warning"]
    assert "back_left" in wide and "front_right" in wide
    assert not [f for f in check(pattern, loom_width=2.0) if f.level == "warning"]


def test_seams_that_do_not_fit_are_found():
    pattern = build("r", derive("round-collar-robe", ROBE)[0])
    panel = pattern.panels["sleeve_left_1"]
    moved = replace(panel, vertices=panel.vertices * (1, 1.01))
    found = errors(replace(pattern, panels=pattern.panels | {"sleeve_left_1": moved}))
    assert any("differ by" in f.message for f in found)
    assert 0.34 * 0.01 > LENGTH_TOLERANCE
    double = replace(pattern, seams=(*pattern.seams, pattern.seams[0]))
    assert any("lies in 2 seams" in f.message for f in errors(double))
    lost = replace(pattern, seams=(*pattern.seams, Seam(("front_left", 99), ("collar", 0))))
    assert any("no such edge" in f.message for f in errors(lost))


def test_bad_outlines_are_found():
    def panel(points, **more):
        n = len(points)
        return Panel("p", np.array(points, float), tuple(Edge(i, (i + 1) % n) for i in range(n)), **more)

    bow = panel([(0, 0), (1, 1), (1, 0), (0, 1)])
    assert ["crosses" in f.message for f in errors(Pattern("x", {"p": bow}))] == [True]
    skewed = panel([(0, 0), (0.1, 0), (0, 0.1)], warp=np.array([1.0, 1.0]))
    assert "unit vector" in errors(Pattern("x", {"p": skewed}))[0].message
    gap = replace(skewed, warp=np.array([0.0, 1.0]), edges=(Edge(0, 1), Edge(2, 0)))
    assert "closed loop" in errors(Pattern("x", {"p": gap}))[0].message
    doubled = panel([(0, 0), (0.1, 0), (0.1, 0), (0, 0.1)])
    assert "no length" in errors(Pattern("x", {"p": doubled}))[0].message
    with pytest.raises(InputError, match="unknown kind of edge"):
        Edge(0, 1, "cubik")
    with pytest.raises(InputError, match="parameters"):
        Edge(0, 1, "cubic", (1.0,))


def test_arcs_have_the_length_and_side_of_their_circle():
    a, b = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    small = Edge(0, 1, "circle", (1.0, 0.0, 1.0))  # a quarter of the unit circle, anticlockwise
    assert small.length(a, b) == pytest.approx(np.pi / 2)
    np.testing.assert_allclose(np.hypot(*small.points(a, b).T), 1, atol=1e-12)
    large = Edge(0, 1, "circle", (1.0, 1.0, 0.0))  # the other three quarters, clockwise
    assert large.length(a, b) == pytest.approx(1.5 * np.pi)
    np.testing.assert_allclose(np.hypot(*large.points(a, b).T), 1, atol=1e-12)
    with pytest.raises(InputError, match="cannot span"):
        Edge(0, 1, "circle", (0.1, 0.0, 1.0)).points(a, b)


@settings(max_examples=30)
@given(st.floats(0.12, 0.25), st.floats(0.05, 0.3), st.floats(0.3, 0.8), st.floats(0, 2.5), st.floats(1, 2))
def test_hats_fit_together(crown, height, brim, gap, gathering):
    assume(brim > crown + 0.02 and (gap == 0 or gap > 0.02))
    pattern = build_hat(HatDimensions(crown, height, brim, 0.5, gap, gathering))
    assert errors(pattern) == []
    base = sum(pattern.panels["crown"].edge_length(i) for i in pattern.panels["crown"].find("base"))
    assert base == pytest.approx(np.pi * crown)
    eased = [s.ease for s in pattern.seams if s.first[0] == "veil"]
    assert sum(eased) == pytest.approx((gathering - 1) * brim / 2 * (2 * np.pi - gap), abs=1e-9)


def test_ribbon_is_a_rectangle_with_its_warp_along_it():
    panel = build_ribbon(RibbonDimensions(2.2, 0.5)).panels["ribbon"]
    assert signed_area(panel.outline()) == pytest.approx(1.1) and panel.warp.tolist() == [1, 0]


def test_dimensions_that_contradict_each_other_are_refused():
    with pytest.raises(InputError, match="narrower than the body"):
        derive("round-collar-robe", ROBE | {"neck_width": 0.7})
    with pytest.raises(InputError, match="must be positive"):
        derive("round-collar-robe", ROBE | {"cuff_width": 0.0})
    with pytest.raises(UnknownNameError, match="did you mean 'half-sleeve'"):
        derive("half-sleve", {})
    with pytest.raises(InputError, match="brim"):
        HatDimensions(0.4, 0.1, 0.3, 0.5)


def test_only_what_is_missing_is_assumed():
    _, assumed = derive("round-collar-robe", ROBE)
    assert set(assumed) == {"back_neck_depth", "overlap_neck", "overlap_hem", "slit", "collar_height"}
