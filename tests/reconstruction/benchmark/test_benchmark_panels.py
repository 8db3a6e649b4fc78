"""The cut: lengths against parameters, grain, seams."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mfar_fem.errors import ParameterError, UnknownNameError
from reconstruction.benchmark.body import draw_body
from reconstruction.benchmark.cutting import KINDS, RANGES, Cut, draw_cut
from reconstruction.benchmark.panel_mesh import inside, mesh_panel
from reconstruction.benchmark.panels import Edge, Panel
from reconstruction.benchmark.wearing import cut_for

SEEDS = st.integers(0, 2**32 - 1)


def garment(kind, seed):
    cut = draw_cut(kind, seed)
    return cut, cut_for(cut, draw_body(seed, kind))


@given(st.sampled_from(KINDS[:2]), SEEDS)
@settings(max_examples=40)
def test_tunic_panels_measure_what_the_cut_says(kind, seed):
    cut, made = garment(kind, seed)
    pieced = any(p.name == "left_sleeve" for p in made.panels)
    outer = made.panel("left_sleeve" if pieced else "left_body")
    body = made.panel("left_body")
    assert outer.edge("cuff_front").length == pytest.approx(cut["cuff_width"])
    assert body.edge("hem_front").length == pytest.approx(cut["hem_width"] / 2)
    assert np.abs(body.polygon[:, 1]).max() == pytest.approx(cut["length"])
    assert 2 * outer.polygon[:, 0].max() == pytest.approx(cut["cross_sleeve"])
    assert max(abs(p.polygon[:, 0]).max() for p in made.panels if p.name.endswith("body")) <= cut["loom_width"] + 0.05 + 1e-9
    for left in [p for p in made.panels if p.name.startswith("left")]:  # the right half mirrors the left
        assert made.panel(left.name.replace("left", "right")).area == pytest.approx(left.area)


@given(st.sampled_from(KINDS), SEEDS)
@settings(max_examples=60)
def test_seams_join_edges_of_equal_length_unless_eased(kind, seed):
    cut, made = garment(kind, seed)
    for seam in made.seams:
        first, second = (made.panel(p).edge(e).length for p, e in (seam.first, seam.second))
        if seam.eased:
            assert first / second == pytest.approx(cut["fullness"], rel=0.01)
        else:
            assert first == pytest.approx(second, rel=2e-3), seam.name  # arcs of crown and brim are polylines


def test_warp_is_orthonormal_to_weft():
    for kind in KINDS:
        for panel in garment(kind, 3)[1].panels:
            frame = np.stack([panel.weft, panel.warp])
            assert frame @ frame.T == pytest.approx(np.eye(2))


@pytest.mark.parametrize("kind", KINDS)
def test_drawn_parameters_lie_in_their_documented_ranges(kind):
    for seed in range(30):
        for name, value in draw_cut(kind, seed).values.items():
            assert RANGES[kind][name].low <= value <= RANGES[kind][name].high
            assert RANGES[kind][name].source


def test_wrong_cuts_are_refused():
    with pytest.raises(UnknownNameError, match=r"toga.*round-collar-robe"):
        draw_cut("toga", 0)
    values = draw_cut("round-collar-robe", 0).values
    with pytest.raises(ParameterError, match="collar_radius"):
        Cut("round-collar-robe", {k: v for k, v in values.items() if k != "collar_radius"})
    with pytest.raises(ParameterError, match="length"):
        Cut("round-collar-robe", values | {"length": float("nan")})
    with pytest.raises(ParameterError, match="too small"):
        cut_for(Cut("round-collar-robe", values | {"length": 0.2}), draw_body(0))


def test_an_open_outline_is_refused():
    points = np.array([[0.0, 0.0], [1.0, 0.0]])
    with pytest.raises(ParameterError, match="must start where"):
        Panel("p", (Edge("a", points), Edge("b", points)))


def test_inside_a_square_with_a_notch():
    polygon = [(0, 0), (2, 0), (2, 2), (1, 1), (0, 2)]
    assert inside(polygon, [(1, 0.5), (1, 1.5), (0.2, 1.5), (3, 1)]).tolist() == [True, False, True, False]


@given(st.sampled_from(KINDS), SEEDS, st.sampled_from([0.02, 0.03, 0.045]))
@settings(max_examples=25)
def test_the_mesh_fills_the_panel(kind, seed, size):
    for panel in garment(kind, seed)[1].panels:
        mesh = mesh_panel(panel, size, {e.name: max(1, round(e.length / size)) for e in panel.edges})
        a, b, c = (mesh.uv[mesh.faces[:, k]] for k in range(3))
        d, e = b - a, c - a
        area = 0.5 * (d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0])
        assert (area > 0).all()
        assert area.sum() == pytest.approx(panel.area, rel=0.02)  # arcs are cut by chords
