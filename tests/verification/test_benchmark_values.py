"""Benchmarks on coarse meshes: values and Newton iterations pinned (a broken tangent that still converges shows in the latter)."""

import numpy as np
import pytest

from mfar_fem.benchmarks import BENCHMARKS, benchmark, run
from mfar_fem.benchmarks.case import final, table
from mfar_fem.benchmarks.extensible_elastica import cantilever
from mfar_fem.errors import InputError, UnknownNameError

KEYS = {"values", "reference", "error_percent", "newton_iterations", "assembly_ms_per_iteration", "solve_ms_per_iteration",
        "wall_s", "elements", "unknowns", "residual", "residual_relative", "status"}
# name, order, mesh, values, Newton iterations of the accepted steps (half as many again is allowed: rounding decides on steps)
PINNED = [
    ("cantilever-shear", 2, (8, 1), {"-U": 3.28985970, "W": 6.70014607}, 38),
    ("cantilever-shear", 1, (16, 1), {"-U": 3.30456107, "W": 6.72806142}, 28),
    ("cantilever-moment", 1, (16, 1), {"-U": 12.0, "W": 0.0}, 135),
    ("cantilever-moment", 2, (8, 1), {"-U": 11.842962, "W": 0.006195}, 166),
    ("slit-annulus", 2, (4, 24), {"W inner": 13.727813, "W outer": 17.364982}, 69),
    ("hemisphere", 2, (8, 8), {"outward": 4.0701791, "inward": 8.1035971}, 31),
    ("heavy-elastica", 2, (8, 2), {"chord angle": 41.502883}, 33),
    ("heavy-elastica", 1, (16, 2), {"chord angle": 41.843948}, 23),
    ("scordelis-lo", 2, (8, 8), {"-w": 0.30028547}, 1),
    ("scordelis-lo", 1, (8, 8), {"-w": 0.26075801}, 1),
]


@pytest.mark.parametrize("name, order, mesh, values, iterations", PINNED, ids=lambda v: v if isinstance(v, str) else None)
def test_pinned(name, order, mesh, values, iterations):
    result = run(name, order, mesh)
    assert result["status"] == "converged" and set(result) >= KEYS
    assert result["values"] == pytest.approx(values, rel=2e-7, abs=2e-6)
    assert result["newton_iterations"] <= 1.5 * iterations
    assert result["residual_relative"] < 1e-7


def test_targets_of_the_quick_ones():
    shear = run("cantilever-shear", 2, (8, 1))["error_percent"]
    assert max(abs(e) for e in shear.values()) < 0.01
    annulus = run("slit-annulus", 2, (4, 24))["error_percent"]
    assert max(abs(e) for e in annulus.values()) < 1.3
    assert abs(run("heavy-elastica", 2, (8, 2))["values"]["chord angle"] - 41.5) < 0.01


@pytest.mark.slow
def test_hemisphere_16():
    values = run("hemisphere", 2, (16, 16))["values"]
    assert values == pytest.approx({"outward": 4.072, "inward": 8.135}, rel=1e-3)
    assert values["inward"] == pytest.approx(final("hemisphere", "sze2004-memory")["inward"], rel=6e-3)


@pytest.mark.slow
def test_slit_annulus_12_60():
    errors = run("slit-annulus", 2, (12, 60))["error_percent"]
    assert max(abs(e) for e in errors.values()) < 0.35


@pytest.mark.slow
def test_pinched_cylinder_is_near_the_published_state():
    result = run("pinched-cylinder", 2, (16, 16))
    assert result["converged"]
    assert abs(result["error_percent"]["-W at A"]) < 2.0 and abs(result["error_percent"]["U at B"]) < 6.0


def test_a_run_that_does_not_converge_says_so_and_claims_no_error(monkeypatch):
    from mfar_fem.benchmarks import case
    from mfar_fem.solve import NewtonOptions

    real = case.solve_static
    limits = NewtonOptions(max_iterations=1, plain_iterations=1)
    monkeypatch.setattr(case, "solve_static", lambda p, levels, options, **k: real(p, levels, limits, min_step=0.2, **k))
    result = run("cantilever-shear", 1, (4, 1))
    assert not result["converged"] and result["error_percent"] is None and result["status"] != "converged"
    assert all(np.isfinite(v) for v in result["values"].values())


def test_names_and_references():
    for name in BENCHMARKS:
        assert len(benchmark(name).DEFAULT_MESH) == 2
    with pytest.raises(UnknownNameError, match="known benchmarks: cantilever-shear"):
        benchmark("cantilever")
    with pytest.raises(InputError):
        table("cantilever-shear", "nobody")
    assert final("slit-annulus", "sze2004") == {"W inner": 13.891, "W outer": 17.528}


def test_exact_elastica():
    """Inextensible: the values of Mattiasson 1981 (doi 10.1002/nme.1620170113) at P L²/EI = 4: U/L 0.32894, W/L 0.66996."""
    assert cantilever(4.0, 10.0, 100.0) == pytest.approx((3.28941, 6.69964), abs=2e-5)
    stretched = cantilever(4.0, 10.0, 100.0, 1.2e5)
    assert stretched == pytest.approx((3.2895436, 6.6998889), abs=1e-6)
    assert cantilever(4.0, 10.0, 100.0, 1e12) == pytest.approx(cantilever(4.0, 10.0, 100.0), abs=1e-8)
    small = cantilever(0.01, 10.0, 100.0)  # linear beam
    assert small[1] == pytest.approx(0.01 * 1000 / 300, rel=2e-5)
