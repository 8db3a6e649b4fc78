"""Time integration of a sheet: order, momenta, damping, bookkeeping, adaptive steps, failures with a name."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mfar_fem.benchmarks.free_vibration import DENSITY, SIZE, sheet
from mfar_fem.benchmarks.time_integration import (
    INTEGRATORS,
    adaptive,
    damping,
    energy_drift,
    momenta,
    momentum,
    order_in_time,
    rms,
    rotated,
    soft_swing,
    spinning_sheet,
    varying_steps,
)
from mfar_fem.drag import AirDrag
from mfar_fem.errors import InputError
from mfar_fem.loads import gravity
from mfar_fem.materials import Fabric
from mfar_fem.shell.shell import Viscosity
from mfar_fem.solve.dynamics import Dynamics, DynamicsOptions
from mfar_fem.supports import Hinge
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import strip

RATES = {"implicit-euler": 1, "bdf2": 2, "generalized-alpha": 2}


@pytest.mark.parametrize("order", [1, 2])
def test_order_in_time(order):
    found = order_in_time(order, (30, 60), 360, 0.04, cells=(3, 1) if order == 1 else (2, 1))
    for name, row in found["integrators"].items():
        assert row["rates"][0] == pytest.approx(RATES[name.split()[0]], abs=0.2), name


def test_bdf2_keeps_its_order_with_varying_steps():
    assert varying_steps(levels=(10, 20), reference_steps=320)["rates"][0] == pytest.approx(2, abs=0.25)


@pytest.mark.parametrize(("method", "rho"), INTEGRATORS)
@pytest.mark.parametrize("kind", ["consistent", "lumped"])
def test_momentum_of_a_free_sheet(method, rho, kind):
    row = momentum(method, rho, kind, order=2 if kind == "consistent" else 1, steps=15)
    assert row["linear"] < 1e-12
    if method == "implicit-euler":
        assert row["identity"] < 1e-12
        assert row["angular"] > 1e-3  # it does lose angular momentum, by just the amount the identity says
    else:
        assert row["angular"] < 5e-3


@pytest.mark.parametrize("order", [1, 2])
def test_viscosity_sees_no_rigid_motion(order):
    dynamics = spinning_sheet("implicit-euler", 5e-4, order=order, stiffness_damping=1e-3)
    assert not isinstance(dynamics.step(5e-4), str)
    shell, state = dynamics.problem.shell, dynamics.motion.state
    turned = rotated(state, Rotation.from_rotvec([0.3, 2.0, -1.0]).as_matrix(), shell.alpha_offset)
    shell.viscosity = None
    elastic = shell.energy(state)
    shell.viscosity = Viscosity(50.0, shell.green_strain(state), *shell.curvature_samples(state))
    assert shell.energy(state) == pytest.approx(elastic, rel=1e-12)
    assert shell.energy(turned) == pytest.approx(elastic, rel=1e-9)
    g = np.zeros(shell.n)
    shell.gradient(turned, g)
    moment = np.cross(shell.positions(turned), g[: shell.alpha_offset].reshape(-1, 3)).sum(axis=0)
    assert np.linalg.norm(moment) < 1e-6 * np.abs(g).max() * SIZE * len(g)


def test_a_spinning_sheet_is_not_slowed_by_stiffness_damping():
    """Five turns about an axis in the sheet; mass damping of the same rate would take nearly all of it."""
    spins = []
    for damped in (0.0, 2e-3):
        dynamics = spinning_sheet("generalized-alpha", 1e-3, spin=(0.0, 0.0, 30.0), shake=0.0, rtol=1e-9, stiffness_damping=damped)
        assert dynamics.run(0.2).converged
        spins.append(momenta(dynamics)[1][2] - np.cross(*(a.reshape(-1, 3).mean(axis=0) for a in (
            dynamics.motion.kinematics.x, dynamics.motion.kinematics.v)))[2] * dynamics.inertia.mass.total)
    assert spins[1] == pytest.approx(spins[0], rel=3e-3)


@pytest.mark.parametrize(("method", "options"), [("bdf2", {"mass_damping": 0.05}), ("bdf2", {"stiffness_share": 0.05}),
                                                 ("generalized-alpha", {"mass_damping": 0.05}),
                                                 ("generalized-alpha", {"stiffness_share": 0.05})])
def test_decay_of_a_mode(method, options):
    assert abs(damping(method, **options)["error_percent"]) < 0.3


@pytest.mark.parametrize(("method", "rho"), [("bdf2", 1.0), ("generalized-alpha", 1.0), ("generalized-alpha", 0.8)])
def test_defect_vanishes_with_the_step(method, rho):
    """Energy that neither drag nor damping nor the supports account for: second order (viscosity of GA: first)."""
    defects = []
    for n in (40, 80):
        surface = Surface.from_pattern(strip(SIZE, 0.5 * SIZE, 3, 1), 1)
        dynamics = Dynamics(surface, sheet(10.0, 1e-6, 0.3), [Hinge("left", displacement=(0.0, 0.0, 0.02))], [gravity(DENSITY)],
                            [AirDrag(2.0, 0.5, (0.0, 0.0, 1.0))], schedule=lambda t: np.sin(20 * t) ** 2,
                            options=DynamicsOptions(method=method, rho=rho, dt=0.08 / n, mass_damping=2.0, rtol=1e-9))
        result = dynamics.run(0.08)
        assert result.converged
        defects.append(abs(result.records[-1].defect) / abs(result.records[-1].dissipated))
    assert defects[1] < 0.02
    assert defects[1] < 0.6 * defects[0]


@pytest.mark.parametrize("method", RATES)
def test_free_fall_loses_what_the_method_takes(method):
    """Free fall: implicit Euler takes m g² t Δt / 2, the others nothing but their start."""
    surface = Surface.from_pattern(strip(SIZE, SIZE, 1, 1), 1)
    dynamics = Dynamics(surface, sheet(1e3, 1e-5), loads=[gravity(DENSITY)],
                        options=DynamicsOptions(method=method, dt=0.01, rho=1.0))
    record = dynamics.run(0.1).records[-1]
    loss = DENSITY * SIZE**2 * 9.80665**2 * 0.1 * 0.01 / 2
    if method == "implicit-euler":
        assert record.defect == pytest.approx(loss, rel=1e-6)
    else:
        assert abs(record.defect) < (0.2 * loss if method == "bdf2" else 1e-9 * loss)  # BDF2 starts with one Euler step


def test_energy_over_five_periods_of_a_nonlinear_vibration():
    assert energy_drift("generalized-alpha", 0.8, 5)["largest"] < 1e-2


def test_adaptive_steps_pay():
    row = adaptive("bdf2", 3e-5, reference_steps=400)
    assert row["error"] < 0.5 * row["fixed_error"]
    assert row["largest_step"] > 5 * row["smallest_step"]
    assert row["largest_local_error"] <= 4 * 3e-5


def test_times_are_hit_and_a_run_in_pieces_goes_on():
    times = []
    dynamics = soft_swing(1, "bdf2", 1e-3)
    result = dynamics.run(0.01037, lambda r: times.append(r.time), stops=(0.0021, 0.00211, 0.007))
    assert result.converged
    for stop in (0.0021, 0.00211, 0.007, 0.01037):
        assert np.abs(np.array(times) - stop).min() < 1e-15
    whole, parts = soft_swing(1, "generalized-alpha", 1e-3), soft_swing(1, "generalized-alpha", 1e-3)
    whole.run(0.02)
    parts.run(0.01)
    parts.run(0.02)
    assert rms(whole.motion.kinematics.x, parts.motion.kinematics.x) < 1e-13  # the lengths of the steps round differently


@pytest.mark.parametrize("method", RATES)
def test_a_resumed_run_is_the_run_itself(method):
    options = {"stiffness_damping": 1e-3, "mass_damping": 1.0}
    whole, first, second = (soft_swing(2, method, 2e-3, **options) for _ in range(3))
    whole.run(0.02)
    first.run(0.01)
    second.motion = first.motion
    second.run(0.02)
    assert rms(second.motion.kinematics.x, whole.motion.kinematics.x) < 1e-12


def locking_strip(schedule, **options):
    """Sheet that locks at a moderate stretch, pulled along at one end."""
    fabric = Fabric.load("paper-silk")
    surface = Surface.from_pattern(strip(SIZE, 0.3 * SIZE, 4, 1), 1)
    return Dynamics(surface, fabric, [Hinge("left", displacement=(-1.0, 0.0, 0.0))], schedule=schedule,
                    options=DynamicsOptions(**({"dt": 0.05, "rtol": 1e-6} | options)))


def test_steps_are_halved_where_the_sheet_would_lock_and_grow_again():
    dynamics = locking_strip(lambda t: 8.0 * min(t, 0.02))
    result = dynamics.run(0.3)
    assert result.converged and result.halvings > 0
    assert result.records[0].dt < 0.05 and result.records[-1].dt > 4 * min(r.dt for r in result.records)
    assert np.all(np.isfinite(result.state.u))


def test_an_impossible_motion_ends_with_its_name_and_the_last_state():
    dynamics = locking_strip(lambda t: 0.0 if t < 0.1 else 1.0, min_dt=1e-3)
    result = dynamics.run(0.3)
    assert not result.converged and result.status in ("LockingReached", "Diverged", "StepTooSmall")
    assert result.status in result.message and "last accepted state" in result.message
    assert 0.05 <= result.motion.time < 0.1 and np.all(np.isfinite(result.state.u))
    assert result.records[-1].time == result.motion.time


@pytest.mark.parametrize(("options", "message"), [
    ({"method": "leapfrog"}, "unknown time integrator"), ({"dt": 0.0}, "dt must be positive"), ({"rtol": np.nan}, "rtol"),
    ({"mass_damping": -1.0}, "mass_damping"),
    ({"iteration_error": -0.1}, "iteration_error"), ({"tolerance": 0.0}, "tolerance"), ({"min_dt": np.inf}, "min_dt")])
def test_wrong_options_are_named(options, message):
    with pytest.raises(InputError, match=message):
        DynamicsOptions(**options)


def test_wrong_velocity_is_named():
    surface = Surface.from_pattern(strip(SIZE, SIZE, 1, 1), 1)
    with pytest.raises(InputError, match="initial velocity"):
        Dynamics(surface, sheet(1e3, 1e-5), velocity=np.zeros((3, 3)))


def test_the_error_left_in_steps_is_small_beside_that_of_the_steps():
    """κ = 0.5 takes fewer iterations than the residual and moves the end far less than half the step does."""
    ends, iterations = {}, {}
    for name, options in {"solved": {}, "loose": {"iteration_error": 0.5}, "half": {"dt": 1e-3}}.items():
        dynamics = soft_swing(1, "implicit-euler", **({"dt": 2e-3} | options))
        result = dynamics.run(0.2)
        assert result.converged
        ends[name], iterations[name] = dynamics.motion.kinematics.x, result.newton_iterations
        assert (result.inexact_steps > 90) == (name == "loose")
    assert iterations["loose"] < 0.7 * iterations["solved"]
    assert rms(ends["loose"], ends["solved"]) < 0.05 * rms(ends["half"], ends["solved"])


def test_the_residual_of_a_step_accepted_by_its_error_is_that_of_its_state():
    dynamics = soft_swing(1, "implicit-euler", 2e-3, iteration_error=10.0)
    record = dynamics.run(0.02).records[-1]
    problem = dynamics.problem
    free = problem.gradient(dynamics.motion.state, 1.0)
    free[problem.fixed] = 0.0
    assert record.iterations == 1 and record.residual == pytest.approx(problem.norm(free), rel=1e-9)
