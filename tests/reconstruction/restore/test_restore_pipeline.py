"""``mfar restore``: order, progress, caching, going on after a kill, the report; the first three stages are given."""

import json
import shutil

import numpy as np
import pytest
from PIL import Image
from shape_scene import dimensions, scene

from mfar_fem.cli.main import main
from mfar_fem.errors import InputError, NotConvergedError, SurfaceError, UnknownNameError
from mfar_fem.surface.mesh import Surface
from reconstruction.keypoints_file import ImageKeypoints, KeypointsFile, write_keypoints
from reconstruction.restore import drape, pipeline
from reconstruction.restore.pipeline import ORDER, RestoreSettings, read_dimensions, restore, stages_of
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

    def keypoints(sources, at, settings, share):
        _, _, views, _, points = scene()
        found = []
        for source in sources.sources:  # the true camera, whatever its file says
            pixels = 2.0 * views[int(source.path.stem)].project(points.points)[0]
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
    monkeypatch.setattr(pipeline, "check_libraries", lambda *settings: None)  # torch is not needed here
    monkeypatch.setitem(drape.EFFORT, "draft", drape.Effort(0.05, 0.04, 0.02))
    return ran


SETTINGS = RestoreSettings(garment="half-sleeve", fidelity="draft")


def test_from_pictures_to_a_report_and_nothing_twice(sources, tmp_path, quick):
    told = []
    done = restore(sources, tmp_path, SETTINGS, progress=lambda name, share: told.append((name, share)))
    assert tuple(dict.fromkeys(name for name, _ in told)) == ORDER and [row["stage"] for row in done["stages"]] == list(ORDER)
    for name in ORDER:
        shares = [share for stage, share in told if stage == name]
        assert shares == sorted(shares) and (shares[0], shares[-1]) == (0.0, 1.0)
        assert (len(shares) > 2) == (name in ("points", "drape")), name  # the others are given, or have no steps
    assert quick == list(ORDER[:-1])
    points = PointSet.read(tmp_path / "points" / "points.npz")
    assert done["facts"]["points"]["points"] == len(points.points) and done["facts"]["points"]["shares"]["stereo"] > 0.2
    with np.load(tmp_path / "surface" / "mesh.npz") as mesh, np.load(tmp_path / "drape" / "settled.npz") as settled:
        Surface(mesh["vertices"], mesh["faces"], 1, mesh["warp"])
        assert len(settled["nodes"]) >= len(mesh["vertices"])
    page = (tmp_path / "report" / "report.html").read_text(encoding="utf-8")
    for words in ("Restored half sleeve", "Sources and matches", "What supports what", "Time beside the paper", "Settled"):
        assert words in page, words
    assert "What does not match is not used" not in page and "nothing that follows is computed from them" in page
    assert page.count("there is no mesh between") == 2 and "What failed" not in page
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
    told.clear()
    settings = RestoreSettings(garment="half-sleeve", fidelity="draft", drape=False)
    restore(sources, tmp_path, settings, progress=lambda name, share: told.append((name, share)))
    assert quick == [] and stages_of(settings) == tuple(dict.fromkeys(name for name, _ in told))
    assert len(stages_of(settings)) == 6 and told[-1] == ("report", 1.0)

    folder = tmp_path / "moved"  # the same contents elsewhere are the same sources; another mask is another result
    shutil.copytree(sources, folder)
    restore(folder, tmp_path, RestoreSettings(garment="half-sleeve", fidelity="draft", drape=False))
    assert quick == []
    mask = np.asarray(Image.open(folder / "mask3.png")).copy()
    mask[:100] = 0
    Image.fromarray(mask).save(folder / "mask3.png")
    restore(folder, tmp_path, RestoreSettings(garment="half-sleeve", fidelity="draft", drape=False))
    assert quick == ["fusion", "keypoints", "template", "points", "surface"]


def refuse(error):
    def stage(*args):
        raise error

    return stage


def test_a_failed_drape_is_reported_and_the_exit_code_is_3(sources, tmp_path, quick, monkeypatch, capsys):
    reason = "the drape ended with not_converged at 0.02 s"
    with monkeypatch.context() as failing:
        failing.setattr(pipeline, "_drape", refuse(NotConvergedError(reason)))
        code = main(["restore", str(sources), "--out", str(tmp_path), "--type", "half-sleeve", "--fidelity", "draft", "--json"])
    said = capsys.readouterr()
    assert code == 3
    assert f"the stage 'drape' failed: {reason}. Try --no-drape" in said.err and "report.html" in said.err
    payload = json.loads(said.out)
    assert payload["failure"]["stage"] == "drape" and payload["failure"]["reason"] == reason
    assert [row["stage"] for row in payload["stages"]] == [name for name in ORDER if name != "drape"]
    page = (tmp_path / "report" / "report.html").read_text(encoding="utf-8")
    for words in ("Unfinished restoration of a half sleeve", "What failed", reason[1:], "--no-drape", "Mesh and warp"):
        assert words in page, words
    quick.clear()
    assert restore(sources, tmp_path, SETTINGS)["failure"] is None and quick == ["drape"]
    assert "What failed" not in (tmp_path / "report" / "report.html").read_text(encoding="utf-8")

    # the surface: what follows is not begun
    failing = RestoreSettings(garment="half-sleeve", fidelity="draft", surface="poisson")
    quick.clear()
    monkeypatch.setattr(pipeline, "_surface", refuse(SurfaceError("3 openings, expected 4")))
    said = "'surface' failed: 3 openings, expected 4. Try --surface template, the default"
    with pytest.raises(NotConvergedError, match=said) as raised:
        restore(sources, tmp_path, failing)
    assert quick == [] and raised.value.result["failure"].stage == "surface"
    page = (tmp_path / "report" / "report.html").read_text(encoding="utf-8")
    assert "--surface template" in page and "What supports what" in page and "Mesh and warp" not in page and "Settled" not in page


def test_cameras_in_millimetres_and_without_neighbours(sources, tmp_path, quick):
    folder = tmp_path / "mm"
    shutil.copytree(sources, folder)
    for i in range(4):
        np.savetxt(folder / f"{i}.txt", np.loadtxt(folder / f"{i}.txt") @ np.diag([1e-3, 1e-3, 1e-3, 1.0]))
    with pytest.raises(InputError, match=r"times too large for a figure of 1.65 m: .* not in metres but in millimetres"):
        restore(folder, tmp_path / "out", SETTINGS)

    text = (sources / "sources.toml").read_text()
    apart = tmp_path / "apart"  # one from the front and one from the back have depths of nothing
    shutil.copytree(sources, apart)
    images = text.split("[[image]]")
    for i in (1, 2):
        (apart / f"{i}.png").unlink()
        (apart / f"mask{i}.png").unlink()
    (apart / "sources.toml").write_text("[[image]]".join([images[0], images[1], images[4]]))
    done = restore(apart, tmp_path / "apart-out", RestoreSettings(garment="half-sleeve", fidelity="draft", drape=False))
    assert "within 60°" in done["facts"]["points"]["findings"][0]
    assert "No two pictures with cameras look within 60°" in done["report"].read_text(encoding="utf-8")


def test_what_cannot_be_restored_is_said_at_once(sources, tmp_path, quick):
    folder = tmp_path / "two"
    folder.mkdir()
    for name in ("0.png", "1.png", "mask0.png", "0.txt"):
        (folder / name).write_bytes((sources / name).read_bytes())
    (folder / "sources.toml").write_text(
        '[[image]]\nfile = "0.png"\nkind = "figurine"\nlicence = "x"\nmask = "mask0.png"\ncamera = "0.txt"\n'
        '[[image]]\nfile = "1.png"\nkind = "figurine"\nlicence = "x"\n'
    )
    missing = r"sources.toml.*two pictures at least that have both 'camera' and 'mask'; 1 of 2 has: '1.png' lacks camera and mask"
    with pytest.raises(InputError, match=missing):
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
