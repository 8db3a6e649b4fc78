"""Files that are whole or not there, and calls side by side."""

import os
import time

import pytest

from mfar_fem.files import replace_bytes, replace_file
from mfar_fem.processes import THREADS, side_by_side


def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "new" / "a.txt"
    replace_bytes(path, b"old")

    def fail(partial):
        partial.write_bytes(b"half")
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        replace_file(path, fail)
    assert path.read_bytes() == b"old" and list(path.parent.iterdir()) == [path]
    replace_bytes(path, b"new")
    assert path.read_bytes() == b"new" and list(path.parent.iterdir()) == [path]


def square_and_threads(x):
    return x * x, [os.environ.get(name) for name in THREADS]


def fail_at_once_or_wait(x, folder):
    if x == 0:
        raise ValueError("the first")
    time.sleep(0.2)
    (folder / str(x)).touch()


@pytest.mark.parametrize("workers", [1, 2])
def test_every_call_comes_back_with_its_key(workers):
    before = [os.environ.get(name) for name in THREADS]
    found = dict(side_by_side(square_and_threads, {f"k{i}": (i,) for i in range(5)}, workers))
    assert {k: v[0] for k, v in found.items()} == {f"k{i}": i * i for i in range(5)}
    assert all(v[1] == (before if workers == 1 else ["1"] * len(THREADS)) for v in found.values())
    assert [os.environ.get(name) for name in THREADS] == before
    assert list(side_by_side(square_and_threads, {}, workers)) == []


def test_an_error_drops_the_calls_that_wait(tmp_path):
    with pytest.raises(ValueError, match="the first"):
        list(side_by_side(fail_at_once_or_wait, {i: (i, tmp_path) for i in range(40)}, 2))
    assert len(list(tmp_path.iterdir())) < 10
