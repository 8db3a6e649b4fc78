"""Pictures that show more than the figure: the detector looks at what its training pictures would show."""

import numpy as np
import pytest

from reconstruction.keypoints.framing import BY_TYPE, FIGURE, frame

SIZE = (384, 512)
GARMENT = (100.0, 100.0, 284.0, 380.0)


@pytest.mark.parametrize("kind", ["mural", "figurine"])
def test_a_picture_framed_on_the_figure_is_looked_at_whole(kind):
    assert frame(kind, SIZE, GARMENT) is None
    assert frame(kind, SIZE, (100.0, 60.0, 300.0, 200.0)) is None  # a short garment on a whole figure
    assert frame(kind, SIZE) is None


def test_a_drawn_box_is_taken_as_it_is():
    assert frame("mural", SIZE, GARMENT, (5.0, 6.0, 50.0, 60.0)) == (5.0, 6.0, 50.0, 60.0)


@pytest.mark.parametrize("room", [0, 1000])
@pytest.mark.parametrize("worn", [None, *BY_TYPE])
def test_a_wide_picture_is_cut_about_the_garment(room, worn):
    moved = tuple(v + room for v in GARMENT)
    box = frame("mural", (384 + 2 * room + 1500, 512 + 2 * room), moved, worn=worn)
    how = BY_TYPE.get(worn, FIGURE)
    height = box[3] - box[1]
    assert height == pytest.approx(how.room * 280) and height / (box[2] - box[0]) == pytest.approx(256 / 192)
    assert (box[0] + box[2]) / 2 == pytest.approx(192 + room)
    assert (240 + room - (box[1] + box[3]) / 2) / height == pytest.approx(how.low)
    assert frame("mural", (round(box[2] - box[0]), round(height)), (0, 0, 184, 280), worn=worn) is None  # as it is framed there


def test_textiles_fill_their_pictures():
    assert frame("textile", SIZE, (20.0, 20.0, 364.0, 492.0)) is None
    assert frame("textile", SIZE, GARMENT) is not None


@pytest.mark.parametrize("margin", [0.5, 1.5])
def test_points_stay_where_they_are_when_a_picture_shows_more(tmp_path, margin):
    pytest.importorskip("torch")
    pytest.importorskip("embreex")
    from PIL import Image

    from reconstruction.benchmark.case import make_case
    from reconstruction.keypoints.locate import locate
    from reconstruction.keypoints_file import read_keypoints
    from reconstruction.sources import read

    case = tmp_path / "case"
    make_case(case, "half-sleeve", 3, size=0.03)
    figures = [s for s in read(case).sources if s.kind != "textile"][:3]
    truth = {i.path.name: i.points for i in read_keypoints(case / "truth" / "keypoints.json").images}
    apart = {}
    for name, margins in (("whole", 0.0), ("wide", margin)):
        folder, lines = tmp_path / name, []
        folder.mkdir()
        for s in figures:
            picture = np.array(Image.open(s.path).convert("RGB"))
            by = [round(margins * side) for side in picture.shape[:2]]
            pad = ((by[0], by[0]), (by[1], by[1]))
            Image.fromarray(np.pad(picture, (*pad, (0, 0)), mode="edge")).save(folder / f"{s.path.stem}.png")
            Image.fromarray(np.pad(np.array(Image.open(s.mask).convert("L")), pad)).save(folder / f"mask_{s.path.stem}.png")
            lines.append(f'[[image]]\nfile = "{s.path.stem}.png"\nkind = "{s.kind}"\nlicence = "own"\n'
                         f'mask = "mask_{s.path.stem}.png"\n')
        (folder / "sources.toml").write_text("\n".join(lines), encoding="utf-8")
        found = locate([folder], tmp_path / f"points-{name}", garment="half-sleeve")
        distances = [np.linalg.norm(image["points"] - [by[1], by[0]] - truth[s.path.name], axis=1)
                     for image, s in zip(found["images"], figures, strict=True)]
        apart[name] = np.nanmedian(distances)
    assert apart["whole"] < 8  # image pixels, of 384 x 512
    assert apart["wide"] < apart["whole"] + 3
