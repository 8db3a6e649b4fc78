"""The cost of commands: time and memory of processes, and what a failing one said."""

import pytest

from mfar_fem.errors import NotConvergedError
from reconstruction.stages import measure, stages


def test_each_command_is_timed_with_its_own_peak():
    seen = []
    found = measure([("list", ["materials"]), ("again", ["fabrics"])], progress=lambda: seen.append(1))
    assert [r["stage"] for r in found["rows"]] == ["list", "again"] and len(seen) == 2
    assert all(r["seconds"] > 0 and 20 < r["peak_MB"] < 5000 for r in found["rows"])
    assert found["seconds"] == pytest.approx(sum(r["seconds"] for r in found["rows"]))


def test_a_failing_command_is_named_with_what_it_said(tmp_path):
    with pytest.raises(NotConvergedError, match=r"mfar fuse .* ended with code 2: .*no such folder"):
        measure(stages(tmp_path / "none", tmp_path)[:1])
