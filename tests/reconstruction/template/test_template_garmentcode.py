"""GarmentCode specifications: foreign files read and written back, our own with everything, errors by name."""

import copy
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mfar_fem.errors import DataFileError
from reconstruction.template.checks import check
from reconstruction.template.dimensions import GARMENTS, derive
from reconstruction.template.garmentcode import read_garmentcode, specification, write_garmentcode
from reconstruction.template.pipeline import build_pattern
from reconstruction.template.svg import svg

FILES = sorted((Path(__file__).parents[4] / "shared" / "data" / "vision" / "garmentcode").glob("*_specification.json"))


def assert_same(a, b, where=""):
    """Equal JSON: keys, order of lists, strings; numbers within 1e-9."""
    if isinstance(a, dict):
        assert isinstance(b, dict) and a.keys() == b.keys(), (where, a.keys() ^ b.keys())
        for key in a:
            assert_same(a[key], b[key], f"{where}/{key}")
    elif isinstance(a, list):
        assert isinstance(b, list) and len(a) == len(b), where
        for i, (x, y) in enumerate(zip(a, b, strict=True)):
            assert_same(x, y, f"{where}[{i}]")
    elif isinstance(a, int | float) and not isinstance(a, bool):
        assert abs(a - b) < 1e-9, (where, a, b)
    else:
        assert a == b, (where, a, b)


@pytest.mark.skipif(not FILES, reason="the shared specifications are not here")
def test_there_are_three_files():
    assert len(FILES) == 3


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_foreign_files_are_read_drawn_and_written_back(path, tmp_path):
    pattern = read_garmentcode(path)
    write_garmentcode(tmp_path / "out.json", pattern)
    assert_same(json.loads(path.read_text()), json.loads((tmp_path / "out.json").read_text()))
    again = read_garmentcode(tmp_path / "out.json")
    for name, panel in pattern.panels.items():
        np.testing.assert_allclose(again.panels[name].vertices, panel.vertices, atol=1e-12)
    text = svg(pattern)
    assert all(f'id="{name}"' in text for name in pattern.panels)
    assert not [f for f in check(pattern) if f.level == "error" and "crosses" in f.message]


@pytest.mark.parametrize("path", [p for p in FILES if not p.stem.startswith("dress")], ids=lambda p: p.stem)
def test_stitched_edges_of_foreign_files_have_equal_lengths(path):
    """Independent evidence for the curves: their authors made both sides of each stitch of one length."""
    pattern = read_garmentcode(path)
    kinds = {edge.kind for panel in pattern.panels.values() for edge in panel.edges}
    assert {"quadratic", "cubic"} <= kinds
    for seam in pattern.seams:
        a, b = pattern.seam_lengths(seam)
        assert a == pytest.approx(b, abs=1e-3), seam


@pytest.mark.parametrize("garment", GARMENTS)
def test_our_own_patterns_come_back_whole(garment, tmp_path):
    pattern = build_pattern(garment, derive(garment, {})[0])
    write_garmentcode(tmp_path / "p.json", pattern)
    again = read_garmentcode(tmp_path / "p.json")
    assert again.name == garment and again.seams == pattern.seams
    assert json.loads((tmp_path / "p.json").read_text())["properties"]["units_in_meter"] == 100
    for name, panel in pattern.panels.items():
        other = again.panels[name]
        np.testing.assert_allclose(other.vertices, panel.vertices, atol=1e-12)
        np.testing.assert_allclose(other.warp, panel.warp)
        assert [(e.name, e.kind, e.allowance, e.notches) for e in other.edges] == [(e.name, e.kind, e.allowance, e.notches)
                                                                                  for e in panel.edges]
        for i in range(len(panel.edges)):
            assert other.edge_length(i) == pytest.approx(panel.edge_length(i), abs=1e-12)
    assert not [f for f in check(again) if f.level == "error"]
    assert_same(specification(pattern), specification(again))


@given(st.recursive(st.none() | st.booleans() | st.floats(allow_nan=False) | st.text(max_size=3),
                    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(
                        st.sampled_from(["panels", "seams", "garment", "dimensions_m", "a", "b", "warp", "notches", "allowances_m",
                                         "kind", "ease_m"]), inner, max_size=4), max_leaves=12))
def test_any_block_of_our_own_is_read_or_refused_by_name(tmp_path_factory, block):
    path = tmp_path_factory.mktemp("fuzz") / "p.json"
    path.write_text(json.dumps(good() | {"mfar": block}))
    try:
        assert read_garmentcode(path).panels.keys() == {"a", "b"}
    except DataFileError as error:
        assert "p.json" in str(error)


def test_what_was_changed_after_reading_is_what_is_written(tmp_path):
    write_garmentcode(tmp_path / "p.json", build_pattern("half-sleeve", derive("half-sleeve", {})[0]))
    read = read_garmentcode(tmp_path / "p.json")
    name = next(iter(read.panels))
    turned = replace(read, panels=read.panels | {name: replace(read.panels[name], warp=np.array([1.0, 0.0]))})
    write_garmentcode(tmp_path / "q.json", turned)
    np.testing.assert_allclose(read_garmentcode(tmp_path / "q.json").panels[name].warp, [1, 0])
    (tmp_path / "foreign.json").write_text(json.dumps(good()))
    foreign = read_garmentcode(tmp_path / "foreign.json")
    assert "mfar" not in specification(foreign)
    turned = replace(foreign, panels=foreign.panels | {"a": replace(foreign.panels["a"], warp=np.array([1.0, 0.0]))})
    assert specification(turned)["mfar"]["panels"]["a"]["warp"] == [1, 0]


def good():
    edges = [{"endpoints": [0, 1]}, {"endpoints": [1, 2], "curvature": {"type": "quadratic", "params": [[0.5, 0.1]]}},
             {"endpoints": [2, 0], "curvature": [0.5, 0.1]}]
    panel = {"translation": [0, 0, 0], "rotation": [0, 0, 0], "vertices": [[0, 0], [10, 0], [0, 10]], "edges": edges}
    stitches = [[{"panel": "a", "edge": 0}, {"panel": "b", "edge": 2}]]
    return {"pattern": {"panels": {"a": panel, "b": copy.deepcopy(panel)}, "stitches": stitches},
            "properties": {"curvature_coords": "relative", "units_in_meter": 100}}


def test_the_older_form_of_a_curve_is_quadratic(tmp_path):
    (tmp_path / "p.json").write_text(json.dumps(good()))
    edge = read_garmentcode(tmp_path / "p.json").panels["a"].edges[2]
    assert edge.kind == "quadratic" and edge.params == (0.5, 0.1)
    control = edge.control(np.array([0.0, 0.1]), np.array([0.0, 0.0]))
    np.testing.assert_allclose(control[1], [0.01, 0.05])  # half along, a tenth to the left of the way down


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d.pop("pattern"), "'pattern'"),
        (lambda d: d["properties"].update(units_in_meter=0), "units_in_meter"),
        (lambda d: d["properties"].update(curvature_coords="absolute"), "curvature_coords"),
        (lambda d: d["pattern"]["panels"]["a"].pop("vertices"), "panel 'a'"),
        (lambda d: d["pattern"]["panels"]["a"].update(vertices=[[0, 0, 0]]), "panel 'a'"),
        (lambda d: d["pattern"]["panels"]["b"]["edges"][1].update(endpoints=[1, 7]), "panel 'b', edge 1.*0..2"),
        (lambda d: d["pattern"]["panels"]["b"]["edges"][1]["curvature"].update(type="kubic"), "edge 1.*did you mean 'cubic'"),
        (lambda d: d["pattern"]["panels"]["b"]["edges"][1]["curvature"].update(type="cubic"), "edge 1.*shape"),
        (lambda d: d["pattern"]["panels"]["b"]["edges"][1].update(curvature={"type": "circle", "params": [1, 0, 1]}), "span"),
        (lambda d: d["pattern"]["stitches"][0][1].update(panel="c"), "stitch 0"),
        (lambda d: d["pattern"]["stitches"][0][1].update(edge=9), "stitch 0.*0..2"),
        (lambda d: d["pattern"]["stitches"].append([]), "stitch 1"),
        (lambda d: d["pattern"]["panels"]["a"].update(rotation=[0, "x", 0]), "rotation"),
        (lambda d: d.update(mfar=[]), "mfar.*must be an object"),
        (lambda d: d.update(mfar={"panels": []}), r"mfar\.panels"),
        (lambda d: d.update(mfar={"panels": {"a": 3}}), r"mfar\.panels\.a"),
        (lambda d: d.update(mfar={"panels": {"a": {"warp": "up"}}}), "panel 'a', warp"),
        (lambda d: d.update(mfar={"panels": {"a": {"allowances_m": ["x", "y", "z"]}}}), "allowances_m"),
        (lambda d: d.update(mfar={"panels": {"a": {"notches": [1, 2, 3]}}}), r"notches\[0\]"),
        (lambda d: d.update(mfar={"seams": [3]}), r"mfar\.seams\[0\]"),
        (lambda d: d.update(mfar={"seams": [{"kind": "sewn", "ease_m": "much"}]}), "ease_m"),
        (lambda d: d.update(mfar={"garment": 5}), r"mfar\.garment"),
    ],
)
def test_wrong_files_are_refused_with_file_panel_and_edge(tmp_path, change, words):
    data = good()
    change(data)
    (tmp_path / "p.json").write_text(json.dumps(data))
    with pytest.raises(DataFileError, match=words) as caught:
        read_garmentcode(tmp_path / "p.json")
    assert "p.json" in str(caught.value)


def test_files_that_are_no_json(tmp_path):
    (tmp_path / "p.json").write_text('{"a":\n [}')
    with pytest.raises(DataFileError, match="line 2"):
        read_garmentcode(tmp_path / "p.json")
    with pytest.raises(DataFileError, match="no such file"):
        read_garmentcode(tmp_path / "q.json")
    (tmp_path / "p.json").write_text("[1]")
    with pytest.raises(DataFileError, match="pattern"):
        read_garmentcode(tmp_path / "p.json")
