"""sources.toml: everything listed and nothing else, errors with their line, scale from marks."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from mfar_fem.errors import DataFileError
from reconstruction import sources
from reconstruction.images import ImageError

TEXT = """
[[image]]
file = "a.png"
kind = "mural"
licence = "CC0"
figure = "female"
scale = [{ from = [0, 0], to = [30, 40], length = "10 cm" }, { from = [0, 0], to = [50, 0], length = "101 mm" }]
date = "8th c."

[[image]]
file = "b.png"
kind = "textile"
licence = "own photograph"
dpi = 254
camera = "P.txt"
camera_scale = 0.5
"""


@pytest.fixture
def folder(tmp_path):
    for seed, name in enumerate(("a.png", "b.png")):
        Image.fromarray(np.random.default_rng(seed).integers(0, 255, (64, 80, 3), dtype=np.uint8)).save(tmp_path / name)
    np.savetxt(tmp_path / "P.txt", np.eye(3, 4))
    (tmp_path / "sources.toml").write_text(TEXT, encoding="utf-8")
    return tmp_path


def rewrite(folder, old, new):
    text = (folder / "sources.toml").read_text(encoding="utf-8")
    assert old in text
    (folder / "sources.toml").write_text(text.replace(old, new, 1), encoding="utf-8")


def test_a_folder_is_read_with_everything_that_is_known(folder):
    found = sources.read(folder)
    a, b = found.sources
    assert (a.name, a.kind, a.figure, a.stature, a.date, a.line) == ("a.png", "mural", "female", 1.65, "8th c.", 2)
    assert a.metres_per_pixel == pytest.approx(np.sqrt(0.002 * 0.00202)) and a.camera is None
    assert b.metres_per_pixel == pytest.approx(1e-4) and b.stature is None and a.height is None
    assert np.array_equal(b.camera, np.diag([0.5, 0.5, 1]) @ np.eye(3, 4))
    ticks = []
    found.load_each(lambda source, image, mask: ticks.append(source))
    assert ticks == [a, b]
    assert sources.read(folder / "sources.toml").sources[0].name == "a.png"
    assert a.facts()["licence"] == "CC0"


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ('kind = "mural"', 'kind = "murals"', 4, "did you mean 'mural'"),
        ('kind = "mural"', "", 2, "'image\\[1\\].kind' is missing"),
        ('licence = "CC0"', "", 2, "licence' is missing"),
        ('licence = "CC0"', 'licence = "?"', 5, "under which licence"),
        ('figure = "female"', 'figure = "child"', 6, "none of male, female, none"),
        ('figure = "female"', 'height = "180 cm"', 6, "needs a figure"),
        ('figure = "female"', 'figure = "female"\nheight = "18 m"', 7, "not a grown person"),
        ('length = "101 mm"', 'length = "120 mm"', 7, "disagree by 20 %"),
        ('length = "101 mm"', 'length = "120"', 7, "unit"),
        ("to = [30, 40]", "to = [0, 0]", 7, "two different points"),
        ("to = [30, 40]", "to = [30]", 7, "must be"),
        ("dpi = 254", "dpi = 0", 14, "positive"),
        ("dpi = 254", "head = [1, 2]", 14, "needs 'foot' too"),
        ("dpi = 254", "head = [1, 2]\nfoot = [1, 60]", 14, "need a figure"),
        ("dpi = 254", 'figure = "male"\nhead = [1, 2]\nfoot = [1, 2]', 15, "same point"),
        ("dpi = 254", "box = [10, 10, 5, 60]", 14, "left < right"),
        ("dpi = 254", "dots = 3", 14, "unknown key 'dots'"),
        ('camera = "P.txt"', 'camera = "Q.txt"', 15, "no camera file"),
        ('file = "b.png"', 'file = "c.png"', 11, "no file 'c.png'"),
        ('file = "b.png"', 'file = "./a.png"', 10, "listed twice, first in line 2"),
    ],
)
def test_what_is_wrong_is_said_with_file_and_line(folder, old, new, line, says):
    rewrite(folder, old, new)
    with pytest.raises(DataFileError, match=says) as caught:
        sources.read(folder)
    assert caught.value.line == line and str(folder / "sources.toml") in str(caught.value)


def test_a_picture_that_is_not_listed_is_an_error_unless_it_is_ignored(folder):
    (folder / "sub").mkdir()
    shutil.copy(folder / "a.png", folder / "sub" / "Extra.PNG")
    with pytest.raises(DataFileError, match=r"does not list 'sub/Extra.PNG'"):
        sources.read(folder)
    rewrite(folder, "\n[[image]]", 'ignore = ["sub/Extra.PNG"]\n[[image]]')
    assert len(sources.read(folder).sources) == 2
    rewrite(folder, "sub/Extra.PNG", "b.png")
    with pytest.raises(DataFileError, match="both listed and ignored"):
        sources.read(folder)
    rewrite(folder, '"b.png"]', '"d.png"]')
    with pytest.raises(DataFileError, match="no such file"):
        sources.read(folder)


def test_the_same_picture_under_two_names_is_found_on_loading(folder):
    shutil.copy(folder / "a.png", folder / "b.png")
    with pytest.raises(DataFileError, match="same picture") as caught:
        sources.read(folder).load_each()
    assert caught.value.line == 10


def test_a_mark_outside_the_picture_is_found_on_loading(folder):
    rewrite(folder, "to = [50, 0]", "to = [50, 90]")
    rewrite(folder, "101 mm", "206 mm")
    with pytest.raises(DataFileError, match="outside the picture of 80 x 64"):
        sources.read(folder).load_each()


def test_a_damaged_picture_names_its_line(folder):
    whole = (folder / "b.png").read_bytes()
    (folder / "b.png").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ImageError, match=r"b\.png: ends too early.*listed in .*sources\.toml, line 10"):
        sources.read(folder).load_each()


def test_no_folder_no_file_no_pictures(tmp_path):
    with pytest.raises(DataFileError, match="no such folder"):
        sources.read(tmp_path / "none")
    with pytest.raises(DataFileError, match="--template"):
        sources.read(tmp_path)
    with pytest.raises(DataFileError, match="holds no picture"):
        sources.write_template(tmp_path)
    (tmp_path / "sources.toml").write_text("", encoding="utf-8")
    with pytest.raises(DataFileError, match="lists no picture"):
        sources.read(tmp_path)
    with pytest.raises(DataFileError, match="not overwritten"):
        sources.write_template(tmp_path)


def test_the_template_lists_everything_and_must_be_filled_in(folder):
    (folder / "sources.toml").unlink()
    (folder / 'o"dd ☯.png').write_bytes((folder / "a.png").read_bytes()[:-1])
    text = sources.write_template(folder).read_text(encoding="utf-8")
    with pytest.raises(DataFileError, match="'\\?' is none of"):
        sources.read(folder)
    filled = text.replace('kind = "?"', 'kind = "mural"').replace('licence = "?"', 'licence = "CC0"')
    (folder / "sources.toml").write_text(filled, encoding="utf-8")
    assert [s.name for s in sources.read(folder).sources] == ["a.png", "b.png", 'o"dd ☯.png']


@given(st.text(max_size=200))
def test_any_text_is_refused_by_name_or_read(tmp_path_factory, text):
    folder = tmp_path_factory.getbasetemp() / "any"
    folder.mkdir(exist_ok=True)
    (folder / "sources.toml").write_bytes(text.encode("utf-8", "surrogatepass"))
    with pytest.raises(DataFileError):  # the folder holds no picture: nothing can be right
        sources.read(folder)


def test_a_mask_is_listed_by_its_picture_and_must_have_its_size(folder):
    from reconstruction.sources import SourcesError

    Image.fromarray(np.pad(np.full((30, 30), 255, np.uint8), ((10, 24), (20, 30)))).save(folder / "m.png")
    rewrite(folder, 'figure = "female"', 'figure = "female"\nmask = "m.png"')
    a, b = sources.read(folder).sources
    assert a.mask == folder / "m.png" and b.mask is None
    sources.read(folder).load_each()
    Image.fromarray(np.eye(40, dtype=np.uint8) * 255).save(folder / "m.png")
    with pytest.raises(SourcesError, match=r"line 2: the mask of .*m\.png: is a mask of 40 x 40 px; its picture has 80 x 64"):
        sources.read(folder).load_each()
    (folder / "m.png").write_bytes(b"no picture")
    with pytest.raises(SourcesError, match=r"line 2: the mask of 'a.png' .*cannot be read as an image"):
        sources.read(folder).load_each()
    transparent = np.zeros((64, 80, 4), np.uint8)
    transparent[10:40, 20:50, 3] = 255  # cut out in a drawing program: black on nothing
    Image.fromarray(transparent).save(folder / "m.png")
    seen = {}
    sources.read(folder).load_each(lambda source, image, mask: seen.update({source.name: mask}))
    assert seen["a.png"].sum() == 900 and seen["b.png"] is None
    rewrite(folder, 'mask = "m.png"', 'mask = "n.png"')
    with pytest.raises(DataFileError, match=r"no mask 'n\.png'"):
        sources.read(folder)


def test_scale_as_a_file_of_keypoints_takes_it(folder):
    a, b = sources.read(folder).sources
    assert b.scale_entry() == {"dpi": 254}
    several = a.scale_entry()
    assert several["metres_per_pixel"] == a.metres_per_pixel and several["relative_sigma"] == pytest.approx(np.log(1.01) / 2)
    rewrite(folder, ', { from = [0, 0], to = [50, 0], length = "101 mm" }]', "]")
    one = sources.read(folder).sources[0].scale_entry()
    assert one["length"] == 0.1 and np.array_equal(one["marks"], [[0, 0], [30, 40]])


def test_crown_and_sole_own_height_and_box_are_handed_on(folder):
    rewrite(folder, "dpi = 254", 'figure = "male"\nheight = "1.8 m"\nhead = [40, 3]\nfoot = [41, 60]\nbox = [10, 0, 70, 64]')
    b = sources.read(folder).sources[1]
    assert {key: list(value) for key, value in b.scale_entry().items()} == {"head": [40, 3], "foot": [41, 60]}
    assert (b.height, b.stature, b.box) == (1.8, 1.8, (10, 0, 70, 64))
    sources.read(folder).load_each()
    rewrite(folder, "foot = [41, 60]", "foot = [41, 600]")
    with pytest.raises(DataFileError, match=r"foot \(41, 600\) of 'b.png' lies outside"):
        sources.read(folder).load_each()
    rewrite(folder, "foot = [41, 600]", "foot = [41, 60]")
    rewrite(folder, "box = [10, 0, 70, 64]", "box = [100, 0, 170, 64]")
    with pytest.raises(DataFileError, match=r"box .* of 'b.png' lies outside"):
        sources.read(folder).load_each()
