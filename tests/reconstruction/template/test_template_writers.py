"""SVG and DXF read back by other programs' libraries: true lengths in millimetres."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from mfar_fem.errors import MissingDependencyError
from reconstruction.measure.silhouette import signed_area
from reconstruction.template.checks import cut_line
from reconstruction.template.dimensions import GARMENTS, derive
from reconstruction.template.dxf import LAYERS, write_dxf
from reconstruction.template.layout import NOTCH, arrange
from reconstruction.template.pipeline import build_pattern
from reconstruction.template.svg import write_svg

SVG = "{http://www.w3.org/2000/svg}"


def pattern_of(garment):
    return build_pattern(garment, derive(garment, {})[0])


def numbers(path):
    return np.array([float(v) for v in path.attrib["d"].translate(str.maketrans("MLZ", "   ")).split()]).reshape(-1, 2)


@pytest.mark.parametrize("garment", GARMENTS)
def test_svg_is_at_true_scale(garment, tmp_path):
    pattern = pattern_of(garment)
    write_svg(tmp_path / "t.svg", pattern)
    root = ET.parse(tmp_path / "t.svg").getroot()
    width, height = (float(root.attrib[key].removesuffix("mm")) for key in ("width", "height"))
    assert root.attrib["width"].endswith("mm")
    assert [float(v) for v in root.attrib["viewBox"].split()] == [0, 0, width, height]  # one unit is one millimetre
    bar = numbers(next(p for p in root.iter(f"{SVG}path") if p.attrib.get("id") == "scale-bar"))
    assert np.linalg.norm(bar[1] - bar[0]) == pytest.approx(100, abs=1e-6)
    groups = {g.attrib["id"]: g for g in root.iter(f"{SVG}g")}
    assert groups.keys() == pattern.panels.keys()
    for name, panel in pattern.panels.items():
        paths = {p.attrib["class"]: p for p in groups[name].iter(f"{SVG}path")}
        sew, cut = numbers(paths["sew"]), numbers(paths["cut"])
        length = np.linalg.norm(np.roll(sew, -1, axis=0) - sew, axis=1).sum()
        assert length == pytest.approx(1000 * sum(panel.edge_length(i) for i in range(len(panel.edges))), rel=1e-3)
        assert abs(signed_area(cut)) == pytest.approx(1e6 * abs(signed_area(cut_line(panel))), rel=1e-5)
        assert (cut >= 0).all() and (cut <= (width, height)).all()
        grain = numbers(paths["grain"])
        along = (grain[1] - grain[0]) / np.linalg.norm(grain[1] - grain[0]) * (1, -1)
        np.testing.assert_allclose(along, panel.warp, atol=1e-4)
        assert [t.text for t in groups[name].iter(f"{SVG}text")] == [name]


def test_svg_agrees_with_svgpathtools(tmp_path):
    tools = pytest.importorskip("svgpathtools")
    pattern = pattern_of("veil-hat")
    write_svg(tmp_path / "t.svg", pattern)
    paths, attributes = tools.svg2paths(str(tmp_path / "t.svg"))
    lengths = sorted(p.length() for p, a in zip(paths, attributes, strict=True) if a["class"] == "sew")
    expected = sorted(1000 * sum(panel.edge_length(i) for i in range(len(panel.edges))) for panel in pattern.panels.values())
    assert lengths == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("garment", GARMENTS)
def test_dxf_is_in_millimetres_on_its_layers(garment, tmp_path):
    ezdxf = pytest.importorskip("ezdxf")
    pattern = pattern_of(garment)
    write_dxf(tmp_path / "t.dxf", pattern)
    document = ezdxf.readfile(tmp_path / "t.dxf")
    assert document.header["$INSUNITS"] == 4 and not document.audit().has_errors
    space = document.modelspace()
    assert {entity.dxf.layer for entity in space} <= LAYERS.keys()
    assert {text.dxf.text for text in space.query("TEXT")} == pattern.panels.keys()
    for layer, outline in (("SEW", lambda p: p.outline()), ("CUT", cut_line)):
        drawn = [np.array(line.get_points("xy")) for line in space.query(f'LWPOLYLINE[layer=="{layer}"]')]
        assert all(line.closed for line in space.query(f'LWPOLYLINE[layer=="{layer}"]'))
        areas = [signed_area(line) / 1e6 for line in drawn]
        assert areas == pytest.approx([signed_area(outline(p)) for p in pattern.panels.values()], rel=1e-9)
    notches = space.query("LINE")
    assert len(notches) == sum(len(edge.notches) for panel in pattern.panels.values() for edge in panel.edges)
    assert all((n.dxf.end - n.dxf.start).magnitude == pytest.approx(1000 * NOTCH) for n in notches)
    back = [p for p in arrange(pattern)]
    assert len(space.query('LWPOLYLINE[layer=="GRAIN"]')) == len(back)


def test_panels_do_not_overlap_on_the_sheet_and_labels_lie_on_them():
    placed = arrange(pattern_of("round-collar-robe"))
    boxes = [(p.cut.min(axis=0), p.cut.max(axis=0)) for p in placed]
    for i, (low, high) in enumerate(boxes):
        for other_low, other_high in boxes[i + 1 :]:
            assert (low >= other_high).any() or (high <= other_low).any()
        assert (placed[i].text > low).all() and (placed[i].text < high).all()
        assert (placed[i].grain > low).all() and (placed[i].grain < high).all()


def test_notches_point_outwards_half_way():
    p = next(p for p in arrange(pattern_of("round-collar-robe")) if p.panel.name == "back_left")
    from matplotlib.path import Path

    for (foot, tip) in p.notches:
        assert not Path(p.sew).contains_point(tip) and Path(p.cut).contains_point((foot + tip) / 2)


def test_without_ezdxf_the_message_says_how_to_install_it(tmp_path, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "ezdxf", None)
    with pytest.raises(MissingDependencyError, match=r"mfar-fem\[recon\]"):
        write_dxf(tmp_path / "t.dxf", pattern_of("flying-ribbon"))
