"""``mfar restore``: order, caching, going on after a kill, the report; the first three stages are given."""

import json
import shutil

import numpy as np
import pytest
from PIL import Image
from shape_scene import dimensions, scene

from mfar_fem.errors import InputError, UnknownNameError
from mfar_fem.surface.mesh import Surface
from reconstruction.keypoints_file import ImageKeypoints, KeypointsFile, write_keypoints
from reconstruction.restore import drape, pipeline
from reconstruction.restore.pipeline import ORDER, RestoreSettings, read_dimensions, restore
from reconstruction.shape.evidence import Caster
from reconstruction.shape.points import PointSet
from reconstruction.stereo.view import View
from reconstruction.template.dimensions import to_dict

pytest.importorskip("embreex")
pytest.importorskip("igl")


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    """Pictures of a patterned garment from four sides, twice the size of the scene's."""
    folder = tmp_path_factory.mktemp("sources")
    mesh, _, views, _, _ = scene()
    caster, lines = Caster(mesh), []
    for i, view in enumerate(views):
        camera = np.diag([2.0, 2.0, 1.0]) @ view.camera
        blank = View.of(view.name, np.zeros((2 * view.size[0], 2 * view.size[1], 3), dtype=np.float32), camera)
        _, depth, facing = caster.cast(blank, 1)
        seen = np.isfinite(depth) & (facing < 0)
        p = np.nan_to_num(blank.points(np.where(seen, depth, 1.0)))
        waves = [np.sin(p @ (90 * d) + k) for k, d in enumerate(np.random.default_rng(0).normal(size=(6, 3)))]
        colour = 0.5 + 0.2 * np.stack([waves[c] + waves[c + 3] for c in range(3)], axis=-1)
        picture = np.where(seen[..., None], colour, 0.35)
        Image.fromarray((255 * picture.clip(0, 1)).astype(np.uint8)).save(folder / f"{i}.png")
        Image.fromarray((255 * seen).astype(np.uint8)).save(folder / f"mask{i}.png")
        np.savetxt(folder / f"{i}.txt", camera)
        lines += ["[[image]]", f'file = "{i}.png"', 'kind = "figurine"', 'licence = "made by a test"', 'figure = "female"',
                  f'mask = "mask{i}.png"', f'camera = "{i}.txt"', ""]  # fmt: skip
    (folder / "sources.toml").write_text("\n".join(lines))
    return folder


@pytest.fixture()
def quick(monkeypatch):
    """The first three stages from the truth, a coarse mesh and a short drape; counts what is computed."""
    ran = []

    def given(name, work):
        def stage(*args):
            ran.append(name)
            return work(*args)

        return stage

    def keypoints(sources, at, settings):
        points = scene()[4]
        found = []
        for source in sources.sources:
            pixels = View.of("v", np.zeros((4, 4, 3), dtype=np.float32), source.camera).project(points.points)[0]
            found.append(ImageKeypoints.of(source.path, source.kind, pixels, sigma=2.0, mask=source.mask))
        write_keypoints(at / "keypoints.json", KeypointsFile(tuple(found)))
        return {"within_px_of_256x192": 2.0, "points": {s.name: 12 for s in sources.sources}}

    def template(points_file, at, settings):
        d = to_dict(dimensions())
        (at / "dimensions.json").write_text(json.dumps({"garment": settings.garment, "dimensions": d}))
        return {"dimensions": d, "assumed": {"slit": "none"}, "votes": {}, "conflicts": [], "findings": []}

    monkeypatch.setattr(pipeline, "_fuse", given("fusion", lambda *a: {"pictures": 4, "statuses": {"matched": 6}, "by_kinds": []}))
    monkeypatch.setattr(pipeline, "_keypoints", given("keypoints", keypoints))
    monkeypatch.setattr(pipeline, "_template", given("template", template))
    for name in ("_points", "_surface", "_drape"):
        monkeypatch.setattr(pipeline, name, given(name[1:], getattr(pipeline, name)))
    monkeypatch.setitem(drape.EFFORT, "draft", drape.Effort(0.05, 0.04, 0.02))
    return ran


SETTINGS = RestoreSettings(garment="half-sleeve", fidelity="draft")


def test_from_pictures_to_a_report_and_nothing_twice(sources, tmp_path, quick):
    told = []
    done = restore(sources, tmp_path, SETTINGS, progress=told.append)
    assert tuple(told) == (*ORDER, "done") and [row["stage"] for row in done["stages"]] == list(ORDER)
    assert quick == list(ORDER[:-1])
    points = PointSet.read(tmp_path / "points" / "points.npz")
    assert done["facts"]["points"]["points"] == len(points.points) and done["facts"]["points"]["shares"]["stereo"] > 0.2
    with np.load(tmp_path / "surface" / "mesh.npz") as mesh, np.load(tmp_path / "drape" / "settled.npz") as settled:
        Surface(mesh["vertices"], mesh["faces"], 1, mesh["warp"])
        assert len(settled["nodes"]) >= len(mesh["vertices"])
    page = (tmp_path / "report" / "report.html").read_text(encoding="utf-8")
    for words in ("Restored half sleeve", "Sources and matches", "What supports what", "Time beside the paper", "Settled"):
        assert words in page, words
    for name in ("points/outlines.png", "points/support.png", "surface/warp.png"):
        assert Image.open(tmp_path / name).size[0] > 300

    quick.clear()
    again = restore(sources, tmp_path, SETTINGS)
    assert quick == [] and all(row["cached"] for row in again["stages"])

    # killed while the mesh was made: its folder is not there, that of the points is
    shutil.rmtree(tmp_path / "surface")
    (tmp_path / ".part-surface").mkdir()
    restore(sources, tmp_path, SETTINGS)
    assert quick == ["surface"]  # it gave the same mesh: what follows is kept

    quick.clear()
    restore(sources, tmp_path, RestoreSettings(garment="half-sleeve", fidelity="draft", drape=False))
    assert quick == []

    folder = tmp_path / "moved"  # the same contents elsewhere are the same sources; another mask is another result
    shutil.copytree(sources, folder)
    restore(folder, tmp_path, RestoreSettings(garment="half-sleeve", fidelity="draft", drape=False))
    assert quick == []
    mask = np.asarray(Image.open(folder / "mask3.png")).copy()
    mask[:100] = 0
    Image.fromarray(mask).save(folder / "mask3.png")
    restore(folder, tmp_path, RestoreSettings(garment="half-sleeve", fidelity="draft", drape=False))
    assert quick == ["fusion", "keypoints", "template", "points", "surface"]


def test_what_cannot_be_restored_is_said_at_once(sources, tmp_path, quick):
    folder = tmp_path / "two"
    folder.mkdir()
    for name in ("0.png", "1.png", "mask0.png", "0.txt"):
        (folder / name).write_bytes((sources / name).read_bytes())
    (folder / "sources.toml").write_text(
        '[[image]]\nfile = "0.png"\nkind = "figurine"\nlicence = "x"\nmask = "mask0.png"\ncamera = "0.txt"\n'
        '[[image]]\nfile = "1.png"\nkind = "figurine"\nlicence = "x"\n'
    )
    with pytest.raises(InputError, match=r"sources.toml.*two pictures at least that have both 'camera' and 'mask'; 1 of 2"):
        restore(folder, tmp_path / "out", SETTINGS)
    assert quick == []
    with pytest.raises(UnknownNameError, match="silk-charmeus"):
        restore(sources, tmp_path / "out", RestoreSettings(garment="half-sleeve", fabric="silk-charmeus"))
    with pytest.raises(UnknownNameError, match="half-sleev"):
        RestoreSettings(garment="half-sleev")
    with pytest.raises(InputError, match="by poisson"):
        RestoreSettings(surface="marching cubes")
    with pytest.raises(InputError, match="draft, standard, reference"):
        RestoreSettings(fidelity="best")
    with pytest.raises(UnknownNameError, match=r"unknown weighting 'precison'.*did you mean 'precision'"):
        RestoreSettings(vote="precison")
    with pytest.raises(InputError, match=r"there is no detector 'none\.pt'"):
        RestoreSettings(weights="none.pt")


def test_dimensions_come_back(tmp_path):
    d = dimensions()
    (tmp_path / "dimensions.json").write_text(json.dumps({"garment": "half-sleeve", "dimensions": to_dict(d)}))
    assert read_dimensions(tmp_path / "dimensions.json") == ("half-sleeve", d)
