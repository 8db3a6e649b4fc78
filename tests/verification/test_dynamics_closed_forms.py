"""Dynamics against the closed forms of ``dynamics_and_friction_closed_forms.csv``, which lies beside the repository."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from mfar_fem.benchmarks.drag_study import coast, free_sheet, mean_velocity
from mfar_fem.benchmarks.free_vibration import CASES, DENSITY, G, frequencies, pendulum
from mfar_fem.benchmarks.time_integration import amplitude
from mfar_fem.drag import AirDrag

TABLE = Path(__file__).resolve().parents[3] / "shared/data/verification/dynamics_and_friction_closed_forms.csv"


@pytest.fixture(scope="module")
def table():
    """``{start of the quantity: {parameter: value}}`` of the file."""
    if not TABLE.exists():
        pytest.skip(f"{TABLE.name} is not there")
    with TABLE.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))

    def values(start):
        found = {row["parameter"]: float(row["value"]) for row in rows if row["quantity"].startswith(start)}
        assert found, start
        return found

    return values


@pytest.mark.parametrize(("method", "rows", "z"), [
    *[("implicit-euler", "implicit Euler SHO", z) for z in (0.1, 0.5, 2.0)],
    *[("generalized-alpha", "trapezoidal", z) for z in (0.1, 0.5, 2.0)],
    *[("bdf2", "BDF2 SHO", z) for z in (0.1, 0.5)]])  # at 2 nothing is left above rounding once its second root has died away
def test_amplitude_and_phase_per_step_of_a_mode(table, method, rows, z):
    row, key = amplitude(method, z), f"{z:g}"
    exact = 1.0 if method == "generalized-alpha" else table(f"{rows} amplitude")[key]
    assert row["amplitude"] == pytest.approx(exact, abs=1e-7)
    if method != "bdf2":
        phase = table("trapezoidal" if method == "generalized-alpha" else f"{rows} phase")[key]
        assert row["phase"] == pytest.approx(phase, abs=1e-6)


@pytest.mark.parametrize("degrees", [30, 90])
def test_period_of_a_pendulum(table, degrees):
    row = pendulum(float(degrees), steps=100)
    assert row["exact"] == pytest.approx(table("pendulum T/T0")[str(degrees)], abs=1e-8)
    assert row["period_ratio"] == pytest.approx(row["exact"], rel=2e-3)


@pytest.mark.parametrize(("name", "rows", "order", "n"), [
    ("cantilever", "cantilever strip", 2, 8), ("cantilever", "cantilever strip", 1, 32), ("plate", "simply supported", 2, 6),
    ("plate", "simply supported", 1, 20), ("membrane", "square membrane", 2, 6), ("membrane", "square membrane", 1, 24),
    ("hanging-strip", "hanging chain", 2, 12), ("hanging-strip", "hanging chain", 1, 32)])
def test_frequencies_by_eigenvalues_and_the_first_in_time(table, name, rows, order, n):
    row = frequencies(name, order, n, integrate=order == 2)
    exact = list(table(rows).values())
    assert row["exact"][:2] == pytest.approx(exact[:2], rel=1e-6)
    assert abs(row["error_percent"][0]) < 0.5
    assert np.abs(row["error_percent"]).max() < (0.5 if order == 2 else 1.5)
    if order == 2:
        assert abs(row["integrated_error_percent"]) < 0.1


def test_every_case_is_checked_above():
    assert set(CASES) == {"cantilever", "plate", "membrane", "hanging-strip"}


def test_fall_and_coast_with_quadratic_drag(table):
    gamma = 0.6
    terminal = np.sqrt(DENSITY * G / gamma)
    dynamics, drops = free_sheet(AirDrag(gamma), "generalized-alpha", 0.02 * terminal / G), table("quadratic drag fall y")
    for at, speed in table("quadratic drag fall v").items():
        assert dynamics.run(float(at) * terminal / G).converged
        assert -mean_velocity(dynamics)[2] / terminal == pytest.approx(speed, abs=1e-4)
        drop = -(dynamics.inertia.mass(dynamics.motion.kinematics.x.reshape(-1, 3)).sum(axis=0) / dynamics.inertia.mass.total)[2]
        assert drop * G / terminal**2 == pytest.approx(drops[at], abs=2e-4)
    for factor, ratio in table("quadratic drag coast").items():
        if float(factor) < 50:
            assert coast(factor=float(factor), steps=100)["ratio"] == pytest.approx(ratio, rel=1e-3)
