"""The whole run on a small folder: what it writes, that it goes on after a kill, and where later parts hook in."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import gaussian_filter

from mfar_fem.errors import InputError
from reconstruction.matching import MatchSettings, cache, fusion
from reconstruction.matching.features import Features

SIZE = (200, 160)


def texture(seed):
    """Noise at several scales, (h, w) in 0..255."""
    rng = np.random.default_rng(seed)
    noise = sum(gaussian_filter(rng.standard_normal((SIZE[1], SIZE[0])), s) * s for s in (1, 2, 5))
    return np.clip(128 + 50 * noise / noise.std(), 0, 255)


def fill(folder):
    """Three pictures: one, the same flat thing seen from elsewhere and unevenly lit, another; two textiles and a mural."""
    import cv2

    folder.mkdir(exist_ok=True)
    flat = texture(0)
    w, h = SIZE
    corners = np.float32([[0, 0], [w, 0], [w, h], [0, h]])
    moved = cv2.getPerspectiveTransform(corners, np.float32([[8, 5], [w - 14, 0], [w - 2, h - 9], [0, h - 14]]))
    other = cv2.warpPerspective(flat, moved, SIZE, borderValue=90.0) * np.linspace(0.5, 1, w)
    for name, grey in (("a.png", flat), ("b.png", other), ("c.png", texture(7))):
        Image.fromarray(np.repeat(np.rint(grey).astype(np.uint8)[..., None], 3, axis=2)).save(folder / name)
    kinds = {"a": "textile", "b": "textile", "c": "mural"}
    tables = [f'[[image]]\nfile = "{n}.png"\nkind = "{k}"\nlicence = "made up"\n' for n, k in kinds.items()]
    (folder / "sources.toml").write_text("\n".join(tables), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return fill(tmp_path_factory.mktemp("run") / "sources")


@pytest.fixture
def quick(monkeypatch, done):
    """Nothing is drawn."""
    for name in ("match_lines", "graph_drawing", "matrix"):
        monkeypatch.setattr(fusion.pictures, name, lambda path, *rest: path)


@pytest.fixture(scope="module")
def done(folder):
    out = folder.parent / "out"
    labels = []
    result = fusion.fuse(folder, out, progress=labels.append)
    return result, out, labels


def test_everything_is_written_and_said(done, folder):
    result, out, labels = done
    assert [r.status.split(":")[0] for r in result.graph.results] == ["degenerate", "failed", "failed"]
    assert result.graph.results[0].status == "degenerate: planar"
    assert len(labels) == fusion.steps(3) == 12
    read = json.loads((out / "fusion.json").read_text(encoding="utf-8"))
    assert [s["name"] for s in read["sources"]] == ["a.png", "b.png", "c.png"] and read["stages"] == {}
    assert all((out / name).is_file() for name in read["files"]) and len(read["files"]) == 3 + 2 + 3
    lit = read["sources"][1]
    assert lit["nonuniformity_after"] < 0.6 * lit["nonuniformity_before"]
    assert Image.open(out / lit["corrected"]).size == SIZE
    assert {row["kinds"] for row in read["by_kinds"]} == {"textile - textile", "textile - mural"}


def test_a_second_run_computes_nothing_and_gives_the_same(done, folder, monkeypatch):
    _, out, _ = done
    before = (out / "fusion.json").read_bytes()
    for name in ("match_pair", "detect", "correct", "pictures.match_lines"):
        monkeypatch.setattr(f"reconstruction.matching.fusion.{name}", lambda *args, **options: pytest.fail("computed again"))
    fusion.fuse(folder, out)
    assert (out / "fusion.json").read_bytes() == before


def test_threads_change_nothing(done, folder, tmp_path, monkeypatch, quick):
    files = []
    for number in ("1", "3"):
        monkeypatch.setenv("MFAR_THREADS", number)
        fusion.fuse(folder, tmp_path / number)
        files.append((tmp_path / number / "fusion.json").read_text())
    assert files[0] == files[1]


def test_another_setting_or_picture_is_computed_again_and_the_rest_is_not(folder, tmp_path, monkeypatch, quick):
    copy = fill(tmp_path / "copy")
    fusion.fuse(copy, tmp_path / "out")
    calls = []
    true = fusion.match_pair
    monkeypatch.setattr(fusion, "match_pair", lambda a, b, s, names, cams: calls.append(names) or true(a, b, s, names, cams))
    fusion.fuse(copy, tmp_path / "out", MatchSettings(threshold=3.0))
    assert len(calls) == 3
    calls.clear()
    Image.fromarray(np.repeat(texture(9).astype(np.uint8)[..., None], 3, axis=2)).save(copy / "c.png")
    fusion.fuse(copy, tmp_path / "out")
    assert calls == [("a.png", "c.png"), ("b.png", "c.png")]


def test_damaged_leftovers_are_computed_again(done, folder, caplog, quick):
    _, out, _ = done
    before = (out / "fusion.json").read_bytes()
    for path in [*(out / "cache").glob("pair_*.npz"), *(out / "cache").glob("features_*.npz"), *(out / "corrected").glob("*.png")]:
        path.write_bytes(path.read_bytes()[:100])
    fusion.fuse(folder, out)
    assert (out / "fusion.json").read_bytes() == before and "is damaged" in caplog.text


KILLED = """
import os, signal, sys
from reconstruction.matching import fusion
seen = []
def report(label):
    seen.append(label)
    if sum(text.startswith("matched") for text in seen) == 2:
        os.kill(os.getpid(), signal.SIGKILL)
fusion.fuse(sys.argv[1], sys.argv[2], progress=report)
"""


def test_a_killed_run_goes_on_with_the_pair_it_was_at(folder, tmp_path, monkeypatch, quick):
    root = Path(fusion.__file__).parents[2]
    alone = os.environ | {"MFAR_THREADS": "1"}  # several threads may have finished further pairs
    process = subprocess.run([sys.executable, "-c", KILLED, str(folder), str(tmp_path / "out")], cwd=root, timeout=120, env=alone)
    assert process.returncode == -signal.SIGKILL and not (tmp_path / "out" / "fusion.json").exists()
    calls = []
    true = fusion.match_pair
    monkeypatch.setattr(fusion, "match_pair", lambda a, b, s, names, cams: calls.append(names) or true(a, b, s, names, cams))
    monkeypatch.setattr(fusion, "detect", lambda *args: pytest.fail("features computed again"))
    fusion.fuse(folder, tmp_path / "out")
    assert calls == [("b.png", "c.png")]


def test_later_stages_get_the_fusion_and_what_came_before(folder, tmp_path, quick):
    stages = {"measure": lambda f: {"n": len(f.pictures)}, "vote": lambda f: {"of": f.stages["measure"]["n"]}}
    result = fusion.fuse(folder, tmp_path, stages=stages)
    assert result.stages == {"measure": {"n": 3}, "vote": {"of": 3}}
    assert json.loads((tmp_path / "fusion.json").read_text(encoding="utf-8"))["stages"] == result.stages


def test_a_stage_that_fails_leaves_the_matches_written(folder, tmp_path, quick):
    def fails(fused):
        raise InputError("no scale")

    (tmp_path / "pairs").mkdir()
    (tmp_path / "pairs" / "mine.png").write_bytes(b"not of this program")
    with pytest.raises(InputError, match="no scale"):
        fusion.fuse(folder, tmp_path, stages={"measure": fails})
    assert len(json.loads((tmp_path / "fusion.json").read_text(encoding="utf-8"))["pairs"]) == 3
    assert (tmp_path / "pairs" / "mine.png").exists()


def test_large_pictures_are_matched_at_a_smaller_size(folder, tmp_path, quick):
    result = fusion.fuse(folder, tmp_path, longest=100)
    assert [p.reduction for p in result.pictures] == [0.5] * 3 and result.pictures[0].size == SIZE
    assert result.graph.results[0].points.max() < 100


def test_wrong_places_are_refused_before_anything_is_computed(folder, tmp_path):
    with pytest.raises(InputError, match="lies in the folder of the sources"):
        fusion.fuse(folder, folder / "out")
    with pytest.raises(InputError, match="32 pixels or more"):
        fusion.fuse(folder, tmp_path, longest=10)
    with pytest.raises(InputError, match=r"weights 'none\.pth' cannot be read"):
        fusion.fuse(folder, tmp_path, MatchSettings(detector="aliked", weights="none.pth"))


def test_features_survive_the_disk(tmp_path):
    features = Features(np.random.default_rng(0).uniform(0, 9, (4, 2)), np.ones((4, 128), np.float32), (9, 8))
    cache.save_features(tmp_path / "f.npz", features)
    back = cache.load_features(tmp_path / "f.npz")
    assert np.array_equal(back.points, features.points) and back.size == (9, 8) and back.descriptors.dtype == np.float32
    assert cache.load_features(tmp_path / "none.npz") is None
