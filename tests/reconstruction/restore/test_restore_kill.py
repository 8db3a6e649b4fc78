"""Kills in the middle of a stage, and two runs in one folder."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import reconstruction
from mfar_fem.errors import InputError
from reconstruction.restore.cache import RECORD, Stages
from reconstruction.restore.lock import NAME, alone

ROOT = Path(reconstruction.__file__).parents[1]

STAGES = """
import os, signal, sys, time
from pathlib import Path
from mfar_fem.files import replace_bytes
from reconstruction.restore.cache import Stages

out, deadly = Path(sys.argv[1]), sys.argv[2]

def die(name):
    if name == deadly:
        os.kill(os.getpid(), signal.SIGKILL)

def log(text):
    with (out.parent / "log.txt").open("a") as stream:
        stream.write(text + "\\n")

def plain(folder):
    log("plain")
    (folder / "one.txt").write_text("1")
    die("plain")
    (folder / "two.txt").write_text("2")
    return {"n": 2}

def long(folder):
    for i in range(4):
        path = folder / f"{i}.txt"
        if not path.exists():
            log(f"long {i}")
            if i == 2:
                (folder / f".{i}.txt.part{os.getpid()}.txt").write_text("half a fi")  # as replace_file leaves it
                die("long")
                (folder / f".{i}.txt.part{os.getpid()}.txt").unlink()
            replace_bytes(path, str(i).encode())
    return {"n": 4}

with Stages(out) as stages:
    stages.run("first", 1, lambda folder: log("first") or (folder / "a.txt").write_text("a") and {})
    stages.run("long", 1, long, after=["first"], resumable=True)
    stages.run("plain", 1, plain, after=["first", "long"])
    print({name: done.digest for name, done in stages.done.items()})
"""


def python(code, *args):
    return subprocess.run([sys.executable, "-c", code, *map(str, args)], cwd=ROOT, timeout=100, capture_output=True, text=True)


@pytest.mark.parametrize(("deadly", "kept", "again"), [
    ("long", ["first"], ["long 2", "long 3", "plain"]),
    ("plain", ["first", "long"], ["plain"]),
])  # fmt: skip
def test_a_killed_process_loses_the_stage_it_was_in_or_less(tmp_path, deadly, kept, again):
    (tmp_path / "whole").mkdir()
    whole = python(STAGES, tmp_path / "whole" / "out", "")
    assert whole.returncode == 0, whole.stderr
    out = tmp_path / "killed" / "out"
    out.parent.mkdir()
    assert python(STAGES, out, deadly).returncode == -signal.SIGKILL
    assert sorted(p.name for p in out.iterdir() if not p.name.startswith(".") and "unfinished" not in p.name) == kept
    (out.parent / "log.txt").unlink()
    resumed = python(STAGES, out, "")
    assert resumed.returncode == 0, resumed.stderr
    assert (out.parent / "log.txt").read_text().split("\n")[:-1] == again
    assert resumed.stdout == whole.stdout  # the same files with the same contents
    assert sorted(p.name for p in out.iterdir()) == [NAME, "first", "long", "plain"]


HOLD = """
import sys, time
from reconstruction.restore.cache import Stages
with Stages(sys.argv[1]):
    print("held", flush=True)
    time.sleep(100)
"""


def test_two_runs_in_one_folder_are_refused_and_a_dead_one_blocks_nobody(tmp_path):
    process = subprocess.Popen([sys.executable, "-c", HOLD, str(tmp_path)], cwd=ROOT, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout.readline() == "held\n"
        with pytest.raises(InputError, match=rf"another run \(process {process.pid}\) is at work in '{tmp_path}'.*--out"):
            Stages(tmp_path).__enter__()
        process.send_signal(signal.SIGKILL)
        process.wait(timeout=60)
        assert (tmp_path / NAME).read_text() == f"{process.pid}\n"  # left behind
        with Stages(tmp_path) as stages:
            stages.run("first", 1, lambda folder: {})
            assert (tmp_path / NAME).read_text() == f"{os.getpid()}\n"
    finally:
        process.kill()
        process.stdout.close()
        process.wait()
    with Stages(tmp_path) as stages:  # given back at the end of the block
        assert stages.run("first", 1, lambda folder: {}).cached


def test_a_folder_that_cannot_be_written_is_said(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot write into"), alone(tmp_path / "file"):
        pass


FUSION = """
import os, signal, sys
from reconstruction.restore import pipeline
from reconstruction.restore.pipeline import RestoreSettings, restore

def tell(name, share):
    if name == "fusion" and share > 0.6:
        os.kill(os.getpid(), signal.SIGKILL)

pipeline.check_libraries = lambda *settings: None
restore(sys.argv[1], sys.argv[2], RestoreSettings(garment="half-sleeve", fidelity="draft"), progress=tell)
"""


class StopHere(Exception):
    pass


def test_a_restoration_that_is_killed_while_it_matches_goes_on_with_the_pair_it_was_at(tmp_path, monkeypatch, pattern_sources):
    pytest.importorskip("cv2")
    from reconstruction.matching import fusion
    from reconstruction.restore import pipeline

    def stop(*args):
        raise StopHere

    monkeypatch.setattr(pipeline, "_keypoints", stop)
    monkeypatch.setattr(pipeline, "check_libraries", lambda *settings: None)
    settings = pipeline.RestoreSettings(garment="half-sleeve", fidelity="draft")

    def run(out):
        with pytest.raises(StopHere):
            pipeline.restore(pattern_sources, out, settings)

    run(tmp_path / "whole")
    killed = tmp_path / "killed"
    ended = subprocess.run([sys.executable, "-c", FUSION, str(pattern_sources), str(killed)], cwd=ROOT, timeout=100,
                           env=os.environ | {"MFAR_THREADS": "1"})  # fmt: skip
    assert ended.returncode == -signal.SIGKILL and (killed / "fusion.unfinished").is_dir() and not (killed / "fusion").exists()
    calls = []
    true = fusion.match_pair
    monkeypatch.setattr(fusion, "match_pair", lambda a, b, s, names, cams: calls.append(names) or true(a, b, s, names, cams))
    monkeypatch.setattr(fusion, "detect", lambda *args: pytest.fail("features computed again"))
    run(killed)
    assert len(calls) < 3

    def files(out):
        return {p.relative_to(out).as_posix(): p.read_bytes().replace(str(out).encode(), b"OUT")
                for p in (out / "fusion").rglob("*") if p.is_file() and p.name != RECORD}  # fmt: skip

    assert files(killed) == files(tmp_path / "whole") and "fusion/fusion.json" in files(killed)


@pytest.fixture
def pattern_sources(tmp_path):
    """Three pictures of one patterned plane, with masks and cameras."""
    import numpy as np
    from PIL import Image

    folder = tmp_path / "sources"
    folder.mkdir()
    rng = np.random.default_rng(0)
    wide = np.kron(rng.uniform(0, 255, (30, 60)), np.ones((10, 10))) + rng.uniform(-20, 20, (300, 600))
    lines = []
    for i in range(3):
        picture = wide[:280, 20 * i : 20 * i + 300].clip(0, 255).astype(np.uint8)
        Image.fromarray(np.repeat(picture[..., None], 3, axis=2)).save(folder / f"{i}.png")
        Image.fromarray(np.full(picture.shape, 255, dtype=np.uint8)).save(folder / f"mask{i}.png")
        camera = np.array([[300.0, 0, 150, 300 - 6.0 * i], [0, 0, 140, 280], [0, 0, 1, 2]])
        camera[1, 1] = -300.0
        np.savetxt(folder / f"{i}.txt", camera)
        lines += ["[[image]]", f'file = "{i}.png"', 'kind = "figurine"', 'licence = "made by a test"', 'figure = "female"',
                  f'mask = "mask{i}.png"', f'camera = "{i}.txt"', ""]  # fmt: skip
    (folder / "sources.toml").write_text("\n".join(lines))
    return folder
