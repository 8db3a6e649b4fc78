"""The swing of a swatch: rigid plate with quadratic drag, finite elements, recovery of the drag coefficient."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import jn_zeros

from material_tests.swing import Pendulum, added_mass, drag_coefficient, euler_drag, per_area, per_vertex, run, swing
from material_tests.swing.compare import read_swing
from material_tests.swing.fe import EnergyGainedError, Level, Specimen
from material_tests.swing.fit import fit_fe, fit_plate, noisy
from material_tests.swing.plots import render, save
from mfar_fem.errors import InputError, NotConvergedError, ParameterError, UnknownNameError
from mfar_fem.materials import Fabric

SHARED = Path(__file__).parents[3] / "shared" / "data" / "verification" / "dynamics_and_friction_closed_forms.csv"
LENGTH, DENSITY, GAMMA = 0.15, 0.083, 0.6
PLATE = Pendulum.plate(LENGTH, DENSITY, GAMMA)
QUICK = Level(1, 6, 2, 60)


@pytest.fixture(scope="module")
def charmeuse() -> Fabric:
    return Fabric.load("silk-charmeuse")


def stiffened(fabric: Fabric, factor: float) -> Fabric:
    b = fabric.bending
    return fabric.replace(bending=type(b)(factor * b.warp, factor * b.weft, factor * b.twist, factor * b.coupling))


# -- rigid plate -------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("degrees, factor", [(5, 1.00047617), (30, 1.01740880), (60, 1.07318201), (170, 2.43936272)])
def test_period_of_the_plate_without_drag(degrees, factor):
    plate = Pendulum.plate(LENGTH, DENSITY, 0.0)
    assert plate.period() == pytest.approx(2 * math.pi * math.sqrt(2 * LENGTH / (3 * 9.80665)), rel=1e-14)
    assert plate.period(math.radians(degrees)) / plate.period() == pytest.approx(factor, abs=1e-8)
    times = np.linspace(0.0, 2.6 * plate.period(math.radians(degrees)), 4001)
    motion = read_swing(times, plate.trajectory(math.radians(degrees), times))
    assert motion["period_s"] == pytest.approx(factor * plate.period(), rel=1e-5)
    assert motion["amplitudes_deg"] == pytest.approx(degrees, rel=1e-5)


@pytest.mark.skipif(not SHARED.exists(), reason="reference data not at hand")
def test_pendulum_factors_of_the_reference_file():
    with SHARED.open(encoding="utf-8") as stream:
        rows = [r for r in csv.reader(stream) if r[0] == "pendulum T/T0"]
    assert len(rows) == 8
    plate = Pendulum.plate(0.3, 1.0, 0.0)
    for _, degrees, value, _ in rows:
        assert plate.period(math.radians(float(degrees))) / plate.period() == pytest.approx(float(value), abs=1e-8)


@given(st.floats(0.01, 20.0), st.floats(0.05, 3.0))
@settings(max_examples=25, deadline=None)
def test_closed_form_of_a_half_swing_balances_the_energy(c, start):
    plate = Pendulum(98.0, c)
    end = plate.next_amplitude(start)
    assert 0 < end < start
    assert float(plate.speed(-end, start)) == pytest.approx(0.0, abs=1e-4)
    lost, _ = quad(lambda q: c * float(plate.speed(q, start)) ** 2, -end, start, epsabs=1e-11, limit=200)
    assert lost == pytest.approx(plate.k * (math.cos(end) - math.cos(start)), rel=1e-7)


@pytest.mark.parametrize("degrees", [20, 60, 150])
def test_closed_form_against_the_integrated_motion(degrees):
    start = math.radians(degrees)
    times = np.linspace(0.0, 3.2 * PLATE.period(start), 6001)
    found = read_swing(times, PLATE.trajectory(start, times))["amplitudes_deg"]
    assert len(found) >= 6
    assert found == pytest.approx(np.degrees(PLATE.amplitudes(start, len(found) - 1)), rel=1e-5)


def test_limits_of_small_drag_and_small_angles():
    plate = Pendulum(98.0, 1e-4)
    for start in (0.5, 2.0):
        lost = plate.k * (math.cos(plate.next_amplitude(start)) - math.cos(start))
        assert lost == pytest.approx(plate.first_order_loss(start), rel=1e-3)
    amplitudes = PLATE.amplitudes(0.01, 40)
    assert np.diff(1 / amplitudes) == pytest.approx(GAMMA * LENGTH / DENSITY, rel=0.01)
    assert Pendulum(98.0, 0.0).next_amplitude(1.2) == 1.2


def test_implicit_eulers_own_dissipation_as_drag():
    """The method itself on a small linear swing, against the drag that is said to take as much."""
    dt, amplitude = 1e-3, 0.02
    omega = math.sqrt(PLATE.k)
    loss = 1 - (1 + (omega * dt) ** 2) ** (-0.5 * math.pi / (omega * dt))
    gamma = euler_drag(LENGTH, DENSITY, dt, amplitude)
    assert gamma * LENGTH * amplitude / DENSITY == pytest.approx(loss, rel=0.01)


def test_meanings_of_the_papers_coefficient():
    assert per_area(0.15, 0.015) == pytest.approx(10.0)
    assert drag_coefficient(10.0) == pytest.approx(16.6, abs=0.05)
    assert per_vertex(0.15, 0.015, 16) == pytest.approx(160.0)
    radius = math.sqrt(0.015 / math.pi)
    assert added_mass(0.15, 0.10) * 0.015 == pytest.approx(8 / 3 * 1.204 * radius**3)


def test_wrong_plates_are_refused():
    with pytest.raises(ParameterError, match="length and areal density"):
        Pendulum.plate(0.0, DENSITY, GAMMA)
    with pytest.raises(ParameterError, match="k > 0"):
        Pendulum(-1.0, 0.0)
    with pytest.raises(ParameterError, match="half turn"):
        PLATE.next_amplitude(4.0)


# -- recovery by the plate -------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_plate_recovers_the_drag_within_its_interval(charmeuse, seed):
    specimen, times = Specimen(charmeuse), np.arange(1, 160) / 100
    truth, sd = 0.45, math.radians(0.5)
    record = noisy(times, specimen.plate(truth, 1.03).trajectory(specimen.angle, times), sd, seed)
    found = fit_plate(specimen, times, record, free_frequency=True)
    assert found.contains(truth)
    assert found.high - found.low < 0.03 * truth
    assert found.frequency == pytest.approx(1.03, abs=2e-3)
    assert found.residual == pytest.approx(sd, rel=0.15)


def test_interval_covers_as_often_as_it_says(charmeuse):
    specimen, times = Specimen(charmeuse), np.arange(1, 40) / 25
    clean = specimen.plate(GAMMA).trajectory(specimen.angle, times)
    hits = sum(fit_plate(specimen, times, noisy(times, clean, 0.02, seed)).contains(GAMMA) for seed in range(20))
    assert hits >= 17  # 95 %: fewer of 20 has a probability of 1.6 %


def test_wrong_records_are_refused(charmeuse):
    specimen, times = Specimen(charmeuse), np.arange(1, 20) / 10
    with pytest.raises(InputError, match="8 or more"):
        fit_plate(specimen, times[:5], times[:5])
    with pytest.raises(InputError, match="increase"):
        fit_plate(specimen, times[::-1], times)


# -- finite elements -------------------------------------------------------------------------------------------------------------
def test_stiff_swatch_is_the_rigid_plate(charmeuse):
    """Bending a thousand times that of the silk: within 1 % of the first angle, the integrator within 0.5 % of the energy."""
    specimen = Specimen(stiffened(charmeuse, 1e3))
    motion = swing(specimen, GAMMA, 0.75, Level(2, 2, 2, 120))
    plate = specimen.plate(GAMMA).trajectory(specimen.angle, motion.time)
    assert np.abs(motion.angle - plate).max() < 0.01 * specimen.angle
    assert motion.bow.max() < 1e-3
    assert abs(motion.defect) < 5e-3
    assert motion.dissipated + motion.defect == pytest.approx(1 - _energy_left(motion, specimen), abs=1e-6)


def _energy_left(motion, specimen) -> float:
    """Kinetic and height energy of the last state, from positions and velocities alone (bending is next to nothing here)."""
    last = motion.result.records[-1]
    shell, state = motion.dynamics.problem.shell, motion.result.state
    mass = motion.dynamics.inertia.mass(np.ones((len(shell.surface.nodes), 3)))
    height = (mass[:, 2] @ shell.positions(state)[:, 2]) * 9.80665
    rest = -0.5 * specimen.length * specimen.fabric.areal_density * specimen.length * specimen.width * 9.80665
    return (last.kinetic + last.membrane + last.bending + height - rest) / specimen.height_energy


def test_swing_without_drag_keeps_its_energy_and_period(charmeuse):
    specimen = Specimen(stiffened(charmeuse, 1e3), angle=math.radians(30.0), tangential=0.0)
    motion = swing(specimen, 0.0, 1.0, Level(1, 3, 2, 100))
    read = read_swing(motion.time, motion.angle)
    assert read["period_s"] == pytest.approx(specimen.plate(0.0).period(specimen.angle), rel=2e-3)
    assert read["amplitudes_deg"] == pytest.approx(30.0, rel=5e-3)
    assert abs(motion.defect) < 5e-3
    assert motion.dissipated == 0.0


def test_finite_elements_recover_the_drag_of_a_limp_swatch(charmeuse):
    """Record of a finer mesh and step, with noise; the rigid plate is biased by the flexibility, the finite elements are not."""
    payload = run(charmeuse, duration=0.6, fidelity=QUICK, seed=3)
    assert payload["truth_in_interval"]
    assert abs(payload["bias_percent"]) < 3.0
    fe, plate = payload["estimates"]["fe"], payload["estimates"]["plate"]
    assert fe["runs"] <= 5
    assert fe["residual_deg"] == pytest.approx(0.5, rel=0.3)
    assert plate["residual_deg"] > 2 * fe["residual_deg"]
    assert payload["largest_bow"] > 0.02
    assert abs(payload["defect_share"]) < 0.01


def test_payload_tables_and_files(charmeuse, tmp_path):
    payload = run(charmeuse, angle=0.5, hang="long", duration=0.45, fidelity=QUICK, recover="plate")
    assert (payload["length_m"], payload["width_m"]) == (0.10, 0.15)
    assert payload["paper"]["per_area_N_s2_per_m4"] == pytest.approx(10.0)
    assert len(payload["curve"]["time_s"]) == len(payload["curve"]["plate_deg"])
    assert payload["amplitudes_deg"][0] == pytest.approx(math.degrees(0.5))
    files = save(tmp_path, payload)
    assert all(Path(f).stat().st_size > 100 for f in files) and len(files) == 3
    with (tmp_path / "swing.csv").open() as stream:
        rows = list(csv.reader(stream))
    assert len(rows) == len(payload["curve"]["time_s"]) + 1
    table, *lines = render(payload | {"files": files})
    assert table.row_count == max(len(payload["amplitudes_deg"]), len(payload["plate_amplitudes_deg"]))
    assert any("16.6" in str(line) for line in lines)


def test_energy_gain_of_the_integrator_is_a_named_failure(charmeuse):
    with pytest.raises(EnergyGainedError, match="shorter steps"):
        swing(Specimen(charmeuse), GAMMA, 1.6, Level(1, 10, 2, 100), rho=0.9)


def test_fit_that_cannot_settle_is_a_named_failure(charmeuse):
    specimen, times = Specimen(charmeuse), np.arange(1, 20) / 100
    record = specimen.plate(GAMMA).trajectory(specimen.angle, times)
    with pytest.raises(NotConvergedError, match="2 runs"):
        fit_fe(specimen, times, record, QUICK, start=20.0, max_runs=2)


def test_wrong_input_is_refused(charmeuse):
    with pytest.raises(InputError, match="'short' or"):
        run(charmeuse, hang="diagonal")
    with pytest.raises(InputError, match="unknown way"):
        run(charmeuse, recover="magic")
    with pytest.raises(InputError, match="gamma > 0"):
        run(charmeuse, gamma=0.0)
    with pytest.raises(UnknownNameError, match="draft"):
        run(charmeuse, fidelity="best")
    with pytest.raises(InputError, match="half turn"):
        Specimen(charmeuse, angle=0.0)


def test_targets_agree_with_the_model():
    with (Path(__file__).parents[2] / "material_tests" / "swing" / "targets.csv").open(encoding="utf-8") as stream:
        rows = {(r["quantity"], r["specimen"]): r for r in csv.DictReader(line for line in stream if not line.startswith("#"))}
    plate = Pendulum.plate(LENGTH, DENSITY, 0.0)
    for degrees in (30, 60):
        row = rows[f"period over that of small swings from {degrees} deg", "rigid plate without drag"]
        assert float(row["value"]) == pytest.approx(plate.period(math.radians(degrees)) / plate.period(), abs=1e-8)
    limp = rows["period over that of small swings", "limp strip hung by its edge"]
    assert float(limp["value"]) == pytest.approx(math.sqrt(1.5) / (0.5 * jn_zeros(0, 1)[0]), abs=1e-5)
    paper = rows["drag coefficient of that gamma as the total of a swatch", "0.15 m x 0.10 m"]
    assert float(paper["value"]) == pytest.approx(drag_coefficient(per_area(0.15, 0.015)), abs=0.05)
