"""Pictures that show more than the figure: the detector looks at what its training pictures would show."""

import numpy as np
import pytest

from reconstruction.keypoints.framing import frame

SIZE = (384, 512)
GARMENT = (100.0, 100.0, 284.0, 380.0)


@pytest.mark.parametrize("kind", ["mural", "figurine"])
def test_a_picture_framed_on_the_figure_is_looked_at_whole(kind):
    assert frame(kind, SIZE, GARMENT) is None
    assert frame(kind, SIZE) is None


def test_a_drawn_box_is_taken_as_it_is():
    assert frame("mural", SIZE, GARMENT, (5.0, 6.0, 50.0, 60.0)) == (5.0, 6.0, 50.0, 60.0)


@pytest.mark.parametrize("room", [0, 1000])
def test_a_wide_picture_is_cut_about_the_garment(room):
    moved = tuple(v + room for v in GARMENT)
    box = frame("mural", (384 + 2 * room + 900, 512 + 2 * room), moved)
    middle = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
    assert middle == pytest.approx(((moved[0] + moved[2]) / 2, (moved[1] + moved[3]) / 2))
    assert 1.3 < (box[3] - box[1]) / 280 < 1.6


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
        found = locate([folder], tmp_path / f"points-{name}")
        distances = [np.linalg.norm(image["points"] - [by[1], by[0]] - truth[s.path.name], axis=1)
                     for image, s in zip(found["images"], figures, strict=True)]
        apart[name] = np.nanmedian(distances)
    assert apart["whole"] < 8  # image pixels, of 384 x 512
    assert apart["wide"] < apart["whole"] + 3
