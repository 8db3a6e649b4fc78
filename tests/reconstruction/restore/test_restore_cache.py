"""Stages are kept by content: what changed and what depends on it is repeated, and a killed stage leaves nothing half done."""

import json

import pytest

from mfar_fem.errors import InputError
from reconstruction.restore.cache import RECORD, Stages


class Count:
    """Two stages that count how often they are computed."""

    def __init__(self, folder, source, fresh=False):
        self.stages, self.source, self.calls = Stages(folder, fresh), source, []

    def run(self, factor=2, fail=False):
        def first(folder):
            self.calls.append("first")
            (folder / "number.txt").write_text(str(int(self.source.read_text()) // 10 * factor))
            return {"factor": factor}

        def second(folder):
            self.calls.append("second")
            (folder / "half.txt").write_text("half")
            if fail:
                raise KeyboardInterrupt
            (folder / "all.txt").write_text((self.stages.done["first"].folder / "number.txt").read_text())
            return {}

        with self.stages:
            self.stages.run("first", 1, first, files=[self.source], options={"factor": factor})
            return self.stages.run("second", 1, second, after=["first"])


@pytest.fixture
def source(tmp_path):
    path = tmp_path / "source.txt"
    path.write_text("20")
    return path


def test_what_has_not_changed_is_kept(tmp_path, source):
    a = Count(tmp_path / "out", source)
    done = a.run()
    assert a.calls == ["first", "second"] and not done.cached and (done.folder / "all.txt").read_text() == "4"
    b = Count(tmp_path / "out", source)
    again = b.run()
    assert b.calls == [] and again.cached and again.seconds == done.seconds and again.digest == done.digest
    assert b.stages.done["first"].facts == {"factor": 2}


def test_a_change_repeats_what_depends_on_it_only_if_the_files_differ(tmp_path, source):
    Count(tmp_path / "out", source).run()
    source.write_text("21")  # another input, the same output
    b = Count(tmp_path / "out", source)
    b.run()
    assert b.calls == ["first"]
    c = Count(tmp_path / "out", source)
    assert (c.run(factor=3).folder / "all.txt").read_text() == "6" and c.calls == ["first", "second"]


def test_a_damaged_file_is_made_again(tmp_path, source):
    Count(tmp_path / "out", source).run()
    (tmp_path / "out" / "second" / "all.txt").write_text("5")
    b = Count(tmp_path / "out", source)
    assert (b.run().folder / "all.txt").read_text() == "4" and b.calls == ["second"]


def test_a_killed_stage_leaves_nothing_and_the_run_goes_on_after_the_last_finished_one(tmp_path, source):
    a = Count(tmp_path / "out", source)
    with pytest.raises(KeyboardInterrupt):
        a.run(fail=True)
    assert not (tmp_path / "out" / "second").exists()
    b = Count(tmp_path / "out", source)
    b.run()
    assert b.calls == ["second"] and not list((tmp_path / "out").glob(".part*"))
    assert set(json.loads((tmp_path / "out" / "second" / RECORD).read_text())["files"]) == {"all.txt", "half.txt"}


def test_fresh_computes_all_again_and_the_order_is_checked(tmp_path, source):
    Count(tmp_path / "out", source).run()
    b = Count(tmp_path / "out", source, fresh=True)
    b.run()
    assert b.calls == ["first", "second"]
    with pytest.raises(InputError, match="comes after 'nothing'"):
        b.stages.run("third", 1, lambda folder: {}, after=["nothing"])


def test_a_resumable_stage_gets_its_unfinished_folder_back(tmp_path):
    seen = []

    def work(folder):
        seen.append((folder / "so_far.txt").exists())
        (folder / "so_far.txt").write_text("some")
        if len(seen) == 1:
            raise KeyboardInterrupt
        return {}

    def run(version):
        with Stages(tmp_path) as stages:
            stages.run("long", version, work, resumable=True)

    with pytest.raises(KeyboardInterrupt):
        run(1)
    run(1)
    assert seen == [False, True]
    run(2)
    assert seen == [False, True, False]  # another version begins anew
