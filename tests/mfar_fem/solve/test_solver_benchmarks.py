"""The benchmarks of solvers and sizes measure what they say."""

import numpy as np
import pytest

from mfar_fem.benchmarks.linear_solvers import crossovers, render_linear_solvers, run_linear_solvers, save_linear_solvers
from mfar_fem.benchmarks.scaling import render_scaling, run_scaling, save_scaling
from mfar_fem.errors import InputError


def test_linear_solvers_of_a_small_square(tmp_path):
    payload = run_linear_solvers(cells={1: (6, 18)}, repeats=1)
    assert {row["unknowns"] for row in payload["rows"]} == {3 * 49 - 6 + 120, 3 * 361 - 6 + 1008}
    for row in payload["rows"]:
        assert row["started"] and not row["note"] and row["residual"] < (2e-2 if row["method"] == "amg" else 1e-9)
    iterations = {r["dt_s"]: r["iterations"] for r in payload["rows"] if r["method"] == "amg" and r["unknowns"] > 500}
    assert iterations[0.5e-3] < iterations[20e-3]
    assert render_linear_solvers(payload)
    save_linear_solvers(tmp_path, payload)
    assert all((tmp_path / name).stat().st_size > 0 for name in ("linear_solvers.csv", "linear_solvers.png"))


def test_a_crossover_needs_all_larger_sizes():
    rows = [{"order": 1, "dt_s": 1.0, "method": m, "unknowns": n, "again_s": t}
            for m, times in (("superlu", (2, 2, 2, 2)), ("amg", (1, 3, 1, 1))) for n, t in zip((1, 2, 3, 4), times, strict=True)]
    assert crossovers(rows)[0]["amg_faster_from"] == 3
    rows[-1]["again_s"] = 5
    assert crossovers(rows)[0]["amg_faster_from"] is None


def test_scaling_runs_each_size_in_its_own_process(tmp_path):
    payload = run_scaling((50, 200))
    assert payload["converged"] and [row["triangles"] for row in payload["rows"]] == [50, 200]
    assert 0.05 < payload["peak_rss_gb"] < 2.0 and np.isfinite(payload["slope_step"])
    assert render_scaling(payload) and len(save_scaling(tmp_path, payload)) == 2
    with pytest.raises(InputError, match="two sizes"):
        run_scaling((100,))
