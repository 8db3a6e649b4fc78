"""The strip without a mesh: slopes, bounds, units, sensitivities."""

import numpy as np
import pytest

from material_tests.strip import force_curve
from mfar_fem.errors import InputError, NotConvergedError
from mfar_fem.materials import Fabric


@pytest.fixture(scope="module")
def silk():
    return Fabric.load("silk-charmeuse")


@pytest.mark.parametrize("direction", ["warp", "weft", "bias", 0.3])
def test_initial_slope_is_the_tangent_at_rest(silk, direction):
    small = 1e-6
    curve = force_curve(silk, direction, [0.0, small])
    held = force_curve(silk, direction, [0.0, small], "held")
    assert curve.line_force[0] == pytest.approx(0, abs=1e-12)
    tangent = np.asarray(silk.law.tangent_at_rest()) * silk.membrane_scale
    c, s = np.cos(curve.angle), np.sin(curve.angle)
    stress, strain = np.array([c * c, s * s, c * s]), np.array([c * c, s * s, 2 * c * s])
    compliance = stress @ np.linalg.solve(tangent, stress)
    assert curve.line_force[1] / small == pytest.approx(1 / compliance, rel=1e-4)
    assert held.line_force[1] / small == pytest.approx(strain @ tangent @ strain, rel=1e-4)


@pytest.mark.parametrize("name", ["silk-charmeuse", "paper-silk", "faille"])
@pytest.mark.parametrize("direction", ["warp", "bias", 1.0])
def test_held_is_stiffer_than_free(name, direction):
    fabric, strain = Fabric.load(name), np.linspace(0.002, 0.05, 8)
    free, held = (force_curve(fabric, direction, strain, lateral) for lateral in ("free", "held"))
    assert free.converged.all() and held.converged.all()
    assert np.all(held.line_force >= free.line_force)
    assert np.all(free.line_force > 0) and np.all(held.lateral_strain == 0)
    assert np.all(free.lateral_strain < 0)


def test_force_and_sensitivity(silk):
    name = next(iter(silk.law.values))
    strain = np.array([0.01, 0.03])
    curve = force_curve(silk, "bias", strain, width=0.05, sensitivities=[name])
    np.testing.assert_allclose(curve.force, 0.05 * curve.line_force)
    value = silk.law.values[name]
    ends = [
        force_curve(silk.replace(law=silk.law.replace(**{name: value * (1 + k)})), "bias", strain).line_force
        for k in (1e-5, -1e-5)
    ]
    np.testing.assert_allclose(curve.sensitivity[:, 0], (ends[0] - ends[1]) / (2e-5 * value), rtol=1e-5)
    with pytest.raises(InputError, match="width"):
        _ = force_curve(silk, "warp", strain).force


def test_locking_is_reported_not_returned():
    cupro = Fabric.load("cupro-su1098")
    curve = force_curve(cupro, "warp", np.linspace(0, 0.3, 16))
    assert curve.converged[0] and not curve.converged[-1]
    assert np.isfinite(curve.line_force).all()
    with pytest.raises(NotConvergedError):
        force_curve(cupro, "warp", [0.3], strict=True)


@pytest.mark.parametrize(
    "change", [{"lateral": "loose"}, {"width": 0.0}, {"width": -1.0}, {"direction": "up"}, {"strain": [-1.5]}]
)
def test_bad_input(silk, change):
    with pytest.raises(InputError):
        force_curve(silk, **change)
