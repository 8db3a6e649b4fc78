"""Independent runs: order, errors, and a worker that is killed."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from calibration import runs
from calibration.runs import Failed, Workers, run_all
from mfar_fem.errors import InputError


def square(x):
    if x == 3:
        raise ValueError("three")
    return x * x


def kill_first_time(item):
    """The first call for the item that has a marker file kills its own process."""
    number, marker = item
    if marker is not None and not Path(marker).exists():
        Path(marker).write_text("was here")
        os.kill(os.getpid(), signal.SIGKILL)
    return number, os.environ.get("OMP_NUM_THREADS")


def test_serial_order_progress_and_errors():
    seen = []
    assert run_all(square, [1, 2, 4], progress=lambda a, b: seen.append((a, b))) == [1, 4, 16]
    assert seen == [(1, 3), (2, 3), (3, 3)]
    kept = run_all(square, [2, 3, 4], on_error="keep")
    assert kept[0] == 4 and kept[2] == 16 and isinstance(kept[1], Failed) and not kept[1]
    with pytest.raises(ValueError, match="three"):
        run_all(square, [2, 3])


def test_bad_settings():
    with pytest.raises(InputError, match="at least 1"):
        Workers(0)


def test_killed_worker_costs_its_run_alone_which_is_repeated(tmp_path):
    pytest.importorskip("distributed")
    marker = tmp_path / "marker"
    items = [(i, str(marker) if i == 1 else None) for i in range(4)]
    seen = []
    results = run_all(kill_first_time, items, Workers(2), progress=lambda a, b: seen.append(a))
    assert [r[0] for r in results] == [0, 1, 2, 3]
    assert {r[1] for r in results} == {"1"}
    assert marker.exists() and seen == [1, 2, 3, 4]


def test_no_scheduler_there(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(runs, "CONNECT_TIMEOUT", 0.3)
    with pytest.raises(InputError, match="no Dask scheduler"):
        run_all(square, [1], Workers(scheduler="tcp://127.0.0.1:1"))
