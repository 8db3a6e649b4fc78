"""The study's numbers against what is known: spheres, rims, paired differences; which rows are kept."""

import json
import types

import numpy as np
import pytest

from mfar_fem.errors import MissingDependencyError, SurfaceError
from reconstruction import cli_restore
from reconstruction.restore import study
from reconstruction.surface.triangles import TriangleMesh

trimesh = pytest.importorskip("trimesh")
pytest.importorskip("igl")


def ball(radius, part=False):
    mesh = trimesh.creation.icosphere(4, radius)
    faces = mesh.faces[mesh.vertices[mesh.faces].min(axis=1)[:, 2] > 0] if part else mesh.faces
    used, inverse = np.unique(faces, return_inverse=True)
    return TriangleMesh(mesh.vertices[used], inverse.reshape(-1, 3))


def test_concentric_spheres_are_their_radii_apart():
    row = study.distances(ball(0.31), ball(0.30))
    for name in ("mean", "off_mean", "off_median", "missing_mean", "missing_95", "largest"):
        assert row[name] == pytest.approx(10.0, abs=0.8), name
    assert "rim_mean" not in row
    assert study.distances(ball(0.3), ball(0.3))["largest"] < 1e-6 < row["floor"] < 10


def test_a_missing_half_counts_in_one_direction_only():
    row = study.distances(ball(0.3, part=True), ball(0.3))
    assert row["off_mean"] < 1e-6 and row["missing_mean"] > 40
    assert row["mean"] == pytest.approx(0.5 * row["missing_mean"])
    assert study.distances(ball(0.3, part=True), ball(0.3, part=True))["rim_mean"] == 0.0


def row(seed, method, mean, why=""):
    values = dict.fromkeys(("off_mean", "off_median", "missing_mean", "missing_95", "largest", "floor", "seconds"), mean)
    return {"garment": "half-sleeve", "seed": seed, "method": method, "why": why} | ({} if why else {"mean": mean} | values)


def test_differences_are_paired_by_garment():
    rows = [row(s, "restored", 10.0 * s) for s in (1, 2, 3)] + [row(s, "MVS", 10.0 * s + 5) for s in (1, 2, 3)]
    found = {r["method"]: r for r in study.summary([*rows, row(4, "MVS", 0.0, "too few points")])}
    mvs = found["MVS"]
    assert (mvs["worse_by"], mvs["worse_by_low"], mvs["worse_by_high"]) == pytest.approx((5.0, 5.0, 5.0))
    assert mvs["cases"] == 4 and mvs["failed"] == 1 and "worse_by" not in found["restored"]
    assert found["restored"]["mean_low"] < 20.0 == found["restored"]["mean"] < found["restored"]["mean_high"]


def test_a_method_that_fails_is_a_row_that_says_why():
    (only,) = study.summary([row(1, "poisson", 0.0, str(SurfaceError("no surface")))])
    assert only["failed"] == 1 and "mean" not in only


def test_no_interval_over_fewer_than_three_garments():
    rows = [row(s, "restored", 10.0 * s) for s in (1, 2, 3)] + [row(s, "MVS", 10.0 * s + 4) for s in (1, 2)]
    found = {r["method"]: r for r in study.summary([*rows, row(3, "MVS", 0.0, "too few points")])}
    mvs = found["MVS"]
    assert (mvs["n"], mvs["cases"], mvs["paired"], mvs["worse_by"]) == (2, 3, 2, pytest.approx(4.0))
    assert mvs["mean"] < found["restored"]["mean"]  # of the easier garments
    assert [mvs[k] for k in ("mean_low", "mean_high", "worse_by_low", "worse_by_high")] == [None] * 4
    assert found["restored"]["mean_low"] is not None and found["restored"]["n"] == 3


def shown(items, width=240):
    from rich.console import Console

    console = Console(width=width)
    with console.capture() as text:
        for item in items:
            console.print(item)
    return text.get()


def test_the_table_says_of_how_many_garments_a_mean_is():
    rows = [row(s, m, 10.0 * s) for s, m in ((1, "restored"), (2, "restored"), (3, "restored"), (1, "MVS"))]
    text = shown(cli_restore._show_study({"summary": study.summary([*rows, row(2, "MVS", 0.0, "x")]), "out": "out"}))
    line = next(line for line in text.splitlines() if "MVS" in line)
    assert "1/3" in line and "10.0 (-)" in line and "+0.0 (-)" in line and "compare by the paired differences" in text


@pytest.fixture
def made(tmp_path, monkeypatch):
    """A study whose methods only note that they were run."""
    from reconstruction.benchmark import case
    from reconstruction.keypoints import locate

    weights = tmp_path / "weights.pt"
    weights.write_bytes(b"first")
    log = types.SimpleNamespace(runs=[], fail={}, detected=0, told=[])

    def make_case(folder, garment, seed, around=0):
        (folder / "truth").mkdir(parents=True)
        for name in ("sources.toml", "truth/geometry.npz"):
            (folder / name).write_text(garment + name, encoding="utf-8")

    def detect(paths, folder, weights, garment=None):
        log.detected += 1
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "keypoints.json").write_text("{}", encoding="utf-8")

    def compare(folder, detected, garment, edge, methods, meshes, progress):
        for method in methods:
            progress(method)
            log.runs.append(method)
            if isinstance(log.fail.get(method), Exception):
                raise log.fail[method]
            why = log.fail.get(method, "")
            meshes.mkdir(parents=True, exist_ok=True)
            (meshes / f"{method.replace(' ', '-')}.ply").write_text("mesh", encoding="utf-8")
            yield {"garment": garment, "method": method, "seconds": 1.0, "why": why} | ({} if why else {"mean": 5.0})

    monkeypatch.setattr(case, "make_case", make_case)
    monkeypatch.setattr(locate, "locate", detect)
    monkeypatch.setattr(study, "compare", compare)

    def run(methods, **more):
        log.runs.clear()
        tell = lambda done, text: log.told.append((done, text))  # noqa: E731
        return study.study(tmp_path, ["half-sleeve"], [1], 0.03, methods, tell, weights=str(weights), **more)["rows"]

    file = tmp_path / "rows" / "half-sleeve-1-30mm.json"
    return types.SimpleNamespace(run=run, log=log, weights=weights, file=file, out=tmp_path)


METHODS = ["restored", "poisson", "true points", "MVS", "Pix2Vex", "Pix2Vex from template"]


def test_another_detector_computes_again_what_it_enters_and_nothing_else(made):
    made.log.fail["poisson"] = "no surface"
    first = made.run(METHODS)
    assert made.log.runs == METHODS and made.log.detected == 1 and first[1]["why"] == "no surface"
    assert made.run(METHODS) == first and made.log.runs == [] and made.log.detected == 1  # failures too are kept
    made.weights.write_bytes(b"second")
    assert [r["method"] for r in made.run(METHODS)] == METHODS
    assert made.log.runs == ["restored", "poisson", "Pix2Vex from template"] and made.log.detected == 2
    made.run(["MVS"], fresh=True)
    assert made.log.runs == ["MVS"] and len(json.loads(made.file.read_text(encoding="utf-8"))) == len(METHODS)


def test_other_code_other_settings_and_rows_without_a_key_are_computed_again(made, monkeypatch):
    made.run(["restored", "MVS"])
    kept = json.loads(made.file.read_text(encoding="utf-8"))
    made.file.write_text(json.dumps([{k: v for k, v in r.items() if k != "key"} for r in kept]), encoding="utf-8")
    made.run(["restored", "MVS"])
    assert made.log.runs == ["restored", "MVS"] and made.log.detected == 1
    monkeypatch.setattr(study, "VERSION", study.VERSION + 1)
    made.run(["restored", "MVS"])
    assert made.log.runs == ["restored", "MVS"] and made.log.detected == 2
    (made.out / "cases" / "half-sleeve-1" / "sources.toml").write_text("other boxes", encoding="utf-8")
    made.run(["restored", "MVS"])
    assert made.log.runs == ["restored", "MVS"] and made.log.detected == 3
    keys = {study.row_key("MVS", "c", "w", edge, around) for edge in (0.02, 0.03) for around in (0, 8)}
    assert len(keys) == 4


def test_points_without_a_record_of_their_detector_are_found_again(made):
    points = made.out / "keypoints" / "half-sleeve-1" / "keypoints.json"
    points.parent.mkdir(parents=True)
    points.write_text("of an earlier detector", encoding="utf-8")
    made.run(["MVS"])
    assert made.log.detected == 0  # no method asks
    (only,) = made.run(["restored"])
    assert made.log.detected == 1 and only["keypoints_s"] >= 0


def test_rows_are_written_after_every_method(made):
    made.log.fail["MVS"] = MissingDependencyError("no library")
    with pytest.raises(MissingDependencyError):
        made.run(["restored", "MVS"])
    assert [r["method"] for r in json.loads(made.file.read_text(encoding="utf-8"))] == ["restored"]
    made.log.fail.clear()
    made.run(["restored", "MVS"])
    assert made.log.runs == ["MVS"]
    assert [p.name for p in made.file.parent.iterdir()] == [made.file.name]


@pytest.mark.parametrize("text", ['[{"method": "MVS", ', "{}", '[{"a": 1}]', "\udcff"])
def test_a_damaged_file_of_rows_is_computed_again_with_a_warning(made, caplog, text):
    made.run(["restored", "MVS"])
    made.file.write_bytes(text.encode("utf-8", "surrogateescape"))
    made.run(["restored", "MVS"])
    assert made.log.runs == ["restored", "MVS"] and f"{made.file.name} is damaged" in caplog.text
    assert made.run(["restored", "MVS"]) and made.log.runs == []


def test_a_lost_mesh_is_made_again(made):
    made.run(["restored", "MVS"])
    (made.out / "meshes" / "half-sleeve-1-30mm" / "MVS.ply").unlink()
    made.run(["restored", "MVS"])
    assert made.log.runs == ["MVS"]


def test_progress_counts_methods_and_names_them(made):
    made.run(["restored"])
    made.log.told.clear()
    made.run(["restored", "MVS", "Pix2Vex"])
    assert sum(done for done, _ in made.log.told) == 3
    assert [t for t in made.log.told if "MVS" in t[1]] == [(0, "half-sleeve-1: MVS"), (1, "half-sleeve-1: MVS")]


def test_adaptive_and_uniform_subdivision_have_as_many_triangles(tmp_path, monkeypatch):
    from reconstruction.surface.study_refinement import base_mesh
    from reconstruction.surface.subdivision import adaptive_loop, uniform_loop

    base = base_mesh(0.03)
    sewn = types.SimpleNamespace(mesh=lambda x: base)
    shape = types.SimpleNamespace(vertices=base.vertices, sigma=np.full(len(base.vertices), 0.01), sewn=sewn)

    def poisson(shape, edge, settings):
        if settings.adaptive:
            return adaptive_loop(base, angle=settings.angle).mesh
        return uniform_loop(base, settings.uniform) if settings.uniform else base

    def failing(path):
        assert path.parent.name == "truth"
        return None

    (tmp_path / "truth").mkdir()
    np.savez(tmp_path / "truth" / "geometry.npz", vertices=base.vertices, faces=base.faces, keypoints=np.zeros((12, 3)))
    for name, stub in {"read": lambda f: None, "read_keypoints": lambda f: None, "calibrated_views": lambda s, p: ([], [], []),
                       "make_template": lambda *a, **k: types.SimpleNamespace(dimensions=None), "triangulate": lambda *a: None,
                       "stature": lambda s: 1.6, "fit_shape": lambda *a, **k: shape, "_poisson": poisson,
                       "mvs": lambda v: types.SimpleNamespace(mesh=base)}.items():  # fmt: skip
        monkeypatch.setattr(study, name, stub)
    rows = {r["method"]: r for r in study.compare(tmp_path, tmp_path / "k.json", "half-sleeve", 0.03,
                                                  ["poisson adaptive", "poisson uniform", "restored"], tmp_path / "m")}  # fmt: skip
    assert rows["restored"]["within_2_sigma"] == 1.0
    assert rows["poisson uniform"]["faces"] == 4 * len(base.faces) == 4 * rows["restored"]["faces"]
    assert rows["poisson adaptive"]["faces"] == pytest.approx(rows["poisson uniform"]["faces"], rel=0.03)
    assert len(adaptive_loop(base).mesh.faces) != pytest.approx(4 * len(base.faces), rel=0.03)
    assert (tmp_path / "m" / "poisson-adaptive.ply").exists()
    monkeypatch.setattr(study, "read_keypoints", failing)  # the detected points are not read for these
    (row,) = study.compare(tmp_path, tmp_path / "k.json", "half-sleeve", 0.03, ["MVS"])
    assert row["why"] == "" and set(study.WITHOUT_DETECTOR) <= set(study.METHODS)


def test_help_names_every_method_and_what_it_costs():
    from typing import get_type_hints

    option = get_type_hints(cli_restore.study_restore, include_extras=True)["methods"].__metadata__[0]
    assert all(method in option.help for method in study.METHODS) and "32 to 119 s" in option.help


def test_the_draped_garment_is_that_of_the_fit_and_hangs_lower():
    pytest.importorskip("igl")
    pytest.importorskip("embreex")
    from shape_scene import STATURE, dimensions, scene

    from reconstruction.shape.fit import FitSettings, fit_shape

    _, _, views, given, points = scene()
    settings = FitSettings(edge=0.04, hang=8, outline=4, depth=4)
    shape = fit_shape("half-sleeve", dimensions(), points, views, STATURE, settings, given=given)
    mesh = study.draped(shape, 0.04, fidelity="draft")
    assert np.array_equal(mesh.faces, shape.sewn.faces)
    moved = mesh.vertices - shape.vertices
    assert -0.08 < moved[:, 2].mean() < 0.0 and np.linalg.norm(moved, axis=1).max() < 0.3
