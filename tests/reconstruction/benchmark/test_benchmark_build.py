"""A whole small benchmark: files, resume, index, truth, command line."""

import json

import numpy as np
import pytest
import typer
from scipy.spatial import cKDTree
from typer.testing import CliRunner

from mfar_fem.errors import DataFileError, NotConvergedError
from reconstruction.benchmark import build as build_module
from reconstruction.benchmark import load_index, samples, store
from reconstruction.benchmark.build import build
from reconstruction.benchmark.contact_sheet import contact_sheet
from reconstruction.benchmark.identity import shots
from reconstruction.benchmark.index import load_arrays
from reconstruction.landmarks import LANDMARKS

SIZE = 0.045


def one_of_each_style(identity, pictures=0):
    plan = shots(identity)
    return [plan[0], plan[4], plan[7]]


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Two identities with a figurine, a mural and a textile each."""
    pytest.importorskip("embreex")
    folder = tmp_path_factory.mktemp("benchmark")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(store, "shots", one_of_each_style)
        report = build(folder, 1, seed=5, size=SIZE)
    return folder, report


def test_report_and_file_names_carry_the_seeds(small):
    folder, report = small
    assert report["identities"] == 2 and report["images"] == 6 and report["made"] == ["H0000", "I0000"] and not report["failed"]
    assert report["max_penetration"] <= 0.002 and report["mean_stretch"] < 0.03
    for sample in load_index(folder).samples:
        who = load_index(folder).identities[sample.identity]["facts"]["identity"]
        seeds = [f"_{who[k + '_seed']:08x}".replace("_", f"_{k[0]}") for k in ("garment", "body", "texture")]
        assert all(part in sample.path.name for part in [*seeds, "_v", f"_d{sample.damage}"])
        assert sample.truth is not None and sample.truth.name == sample.path.stem + "_truth.npz"


def test_stored_points_are_the_projection_of_the_stored_geometry(small):
    index = load_index(small[0])
    for sample in index.samples:
        arrays = index.geometry(sample.identity)
        points = arrays["flat_keypoints" if sample.style == "textile" else "keypoints"]
        assert np.array_equal(np.isfinite(points).all(axis=1), sample.present)
        assert sample.keypoints.shape == (len(LANDMARKS), 2)
        pixels = sample.camera.project(points[sample.present])[0]
        assert sample.keypoints[sample.present] == pytest.approx(pixels, abs=1e-9)
        assert np.isnan(sample.keypoints[~sample.present]).all()
        assert not (sample.visible & ~sample.present).any()


def test_truth_is_consistent(small):
    index = load_index(small[0])
    for sample in index.samples:
        truth, arrays = sample.load_truth(), index.geometry(sample.identity)
        there = truth["labels"] > 0
        assert sample.image().shape == (512, 384, 3) and truth["depth"].shape == (512, 384)
        assert np.array_equal(there, np.isfinite(truth["depth"]))
        assert np.linalg.norm(truth["normals"][there], axis=1) == pytest.approx(1.0, abs=0.02)
        rows, columns = np.nonzero(truth["labels"] == 2)
        pick = np.random.default_rng(0).choice(len(rows), 300)
        world = sample.camera.unproject(np.stack([columns, rows], axis=1)[pick], truth["depth"][rows, columns][pick])
        if sample.style == "textile":
            assert np.abs(world[:, 2]).max() < 0.004
            assert not (truth["labels"] == 1).any()
        else:  # a point on a triangle with edges of 45 mm is near its vertices
            assert cKDTree(arrays["vertices"]).query(world)[0].max() < 0.06
        for i in np.flatnonzero(sample.visible):  # a visible point is not well behind what is seen there
            x, y = np.round(sample.keypoints[i]).astype(int)
            point = arrays["flat_keypoints" if sample.style == "textile" else "keypoints"][i]
            around = truth["depth"][max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2]  # on an outline depth runs away
            if np.isfinite(around).any():
                assert sample.camera.project(point[None])[1][0] < np.nanmax(around) + 0.08


def test_a_second_run_keeps_what_is_complete_and_remakes_what_is_not(small, monkeypatch):
    folder, _ = small
    monkeypatch.setattr(store, "shots", one_of_each_style)
    victim = load_index(folder).samples[-1]
    bytes_before = {p: p.read_bytes() for p in victim.path.parent.iterdir()}
    kept = load_index(folder).samples[0].path
    stamp = kept.stat().st_mtime_ns
    victim.path.unlink()
    with pytest.raises(DataFileError, match="missing"):
        load_index(folder)
    report = build(folder, 1, seed=5, size=SIZE)
    assert len(report["made"]) == 1 and len(report["kept"]) == 1
    assert kept.stat().st_mtime_ns == stamp
    for path, before in bytes_before.items():  # the same seed makes the same bytes
        if path.suffix == ".npz":
            assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(
                load_arrays(path).values(), _arrays(before).values(), strict=True))
        else:
            assert path.read_bytes() == before
    assert not list(folder.glob(".part-*"))


def _arrays(data):
    import io

    with np.load(io.BytesIO(data)) as stored:
        return {name: stored[name] for name in stored.files}


def test_samples_filter(small):
    index = load_index(small[0])
    assert {s.style for s in samples(index, style="mural")} == {"mural"}
    assert len(list(samples(index, split="train"))) == 3
    assert [s.kind for s in samples(index, kind="veil-hat", style="textile")] == ["veil-hat"]
    assert len(list(samples(index, fold=0))) == 3


def test_contact_sheet(small):
    from PIL import Image

    path = contact_sheet(load_index(small[0]), height=100)
    with Image.open(path) as sheet:
        assert sheet.size == (8 * 75, 200)
        assert np.asarray(sheet).std() > 20


def test_damaged_indices_are_named(tmp_path):
    with pytest.raises(DataFileError, match=r"benchmark\.json.*no such file"):
        load_index(tmp_path)
    (tmp_path / "benchmark.json").write_text("{")
    with pytest.raises(DataFileError, match="JSON"):
        load_index(tmp_path)
    (tmp_path / "benchmark.json").write_text('{"format": "other"}')
    with pytest.raises(DataFileError, match="mfar-benchmark-images"):
        load_index(tmp_path)
    (tmp_path / "x.npz").write_bytes(b"no")
    with pytest.raises(DataFileError, match=r"x\.npz"):
        load_arrays(tmp_path / "x.npz")


def test_a_failed_identity_is_reported_and_the_rest_is_made(small, tmp_path, monkeypatch):
    def fails(root, identity, *rest):
        if identity.name == "I0000":
            raise NotConvergedError("the drape flew apart")
        return make(root, identity, *rest)

    make = store.make
    monkeypatch.setattr(store, "shots", lambda identity, pictures=0: shots(identity)[7:8])
    monkeypatch.setattr(build_module, "make", fails)
    seen = []
    report = build(tmp_path, 1, seed=5, light=True, size=SIZE, progress=lambda *a: seen.append(a))
    assert report["failed"] == {"I0000": "the drape flew apart"} and report["identities"] == 1
    assert seen == [(1, 2, "I0000"), (2, 2, "H0000")]
    sample = load_index(tmp_path).samples[0]
    with pytest.raises(DataFileError, match="--light"):
        sample.load_truth()


def test_command_line_prints_one_json_object(small, monkeypatch):
    from reconstruction import cli_benchmark

    monkeypatch.setattr(store, "shots", one_of_each_style)
    monkeypatch.setattr(build_module.build, "__defaults__", (70, 0, 1, False, SIZE, None, 0, None))
    app = typer.Typer()
    app.command()(cli_benchmark.benchmark_data)
    result = CliRunner().invoke(app, ["--out", str(small[0]), "--identities", "1", "--seed", "5", "--json"])
    assert result.exit_code == 0, result.output
    report = json.loads(result.stdout)
    assert report["kept"] == ["H0000", "I0000"] and report["images"] == 6
    plain = CliRunner().invoke(app, ["--out", str(small[0]), "--identities", "1", "--seed", "5"])
    assert "6 images" in plain.output
