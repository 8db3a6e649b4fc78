"""Strip test by finite elements: sanity, quarter, sensitivities, warm starts, failures."""

from __future__ import annotations

import math

import numpy as np
import pytest

from material_tests.strip import force_curve
from material_tests.strip.compare import run, shortcut_error
from material_tests.strip.fe import StripTest, strip_cells
from mfar_fem.errors import InputError, UnknownNameError
from mfar_fem.materials import Bending, Fabric, get_law
from mfar_fem.solve import NewtonOptions

BENDING = Bending.from_rigidities(1e-5, 1e-5)
BIAS, WEFT = math.pi / 4, math.pi / 2
LAWS = {
    "yarn-network": (0.03, get_law("yarn-network", nu=0.2)),
    "eight-chain-silk": (0.05, get_law("eight-chain-silk")),
    "st-venant-kirchhoff": (0.02, get_law("st-venant-kirchhoff", Ew=1e7, Ef=4e7, nu=0.3, G=2e5)),
}


def fabric(law):
    return Fabric("test", law, 1e-4, 0.1, BENDING)


def test_linear_strip_with_free_width_is_uniaxial():
    law = get_law("st-venant-kirchhoff", Ew=2e7, Ef=1e7, nu=0.0, G=3e6)
    result = StripTest(0.08, 0.05).run(fabric(law), [0.01, 0.02])
    stretch = 1.0 + result.strain
    exact = 1e-4 * 2e7 * 0.5 * (stretch**2 - 1.0) * stretch  # E e11 lambda h
    np.testing.assert_allclose(result.line_force, exact, rtol=1e-9)
    np.testing.assert_allclose(result.force, 0.05 * exact, rtol=1e-9)
    np.testing.assert_allclose(result.lateral_strain(), 0.0, atol=1e-12)
    field = result.field()
    np.testing.assert_allclose(field.green[..., 0], 0.5 * (1.02**2 - 1.0), rtol=1e-9)
    np.testing.assert_allclose(field.engineering[..., 0], 0.02, rtol=1e-9)
    np.testing.assert_allclose(field.logarithmic[..., 0], math.log(1.02), rtol=1e-9)
    np.testing.assert_allclose(field.longitudinal, 0.02, rtol=1e-9)
    np.testing.assert_allclose(field.weights.sum(), 0.25 * 0.08 * 0.05, rtol=1e-12)


def test_grips_hold_the_width():
    law = get_law("st-venant-kirchhoff", Ew=1e7, Ef=1e7, nu=0.4, G=1e7 / 2.8)
    result = StripTest(0.08, 0.05).run(fabric(law), [0.01])
    free, held = (force_curve(fabric(law), 0.0, [0.01], lateral).line_force[0] for lateral in ("free", "held"))
    assert free < result.line_force[0] < held
    assert -0.0046 < result.lateral_strain()[0] < -0.002
    longer = StripTest(0.8, 0.05, fidelity="standard").run(fabric(law), [0.01])
    assert abs(longer.line_force[0] / free - 1) < 0.2 * abs(result.line_force[0] / free - 1)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("angle", [0.0, WEFT])
def test_quarter_equals_the_whole_strip(name, angle):
    strain, law = LAWS[name]
    # 12 x 8 cells: the quarter of the alternating diagonals is the mesh of the whole one
    results = [StripTest(0.08, 0.05, angle, cells=(12, 8), quarter=q).run(fabric(law), [0.3 * strain, strain], [f"law.{p}"])
               for q in (True, False) for p in list(law.values)[:1]]
    np.testing.assert_allclose(results[0].line_force, results[1].line_force, rtol=1e-8)
    np.testing.assert_allclose(results[0].sensitivity, results[1].sensitivity, rtol=1e-6)
    np.testing.assert_allclose(results[0].lateral_strain(), results[1].lateral_strain(), rtol=1e-6, atol=1e-10)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("angle", [0.0, BIAS])
def test_sensitivities_against_central_differences(name, angle):
    strain, law = LAWS[name]
    strain *= 3.0 if angle else 1.0
    names = [p.name for p in law.parameters if p.fit]
    test = StripTest(0.08, 0.05, angle, "draft", options=NewtonOptions(rtol=1e-13, atol=0.0))
    exact = test.run(fabric(law), [0.5 * strain, strain], [f"law.{n}" for n in names])
    assert exact.converged
    for column, n in enumerate(names):
        h = 5e-4 * max(abs(law.values[n]), 1e-3)
        f = [test.run(fabric(law.replace(**{n: law.values[n] + k * h})), exact.strain).line_force for k in (1, -1, 2, -2)]
        difference = (8 * (f[0] - f[1]) - (f[2] - f[3])) / (12 * h)  # central, fourth order
        # a force that hardly depends on a parameter is compared with the force itself
        floor = 1e-11 * np.abs(exact.line_force) / h
        np.testing.assert_allclose(exact.sensitivity[:, column], difference, rtol=1e-5, atol=floor.max())


def test_result_does_not_depend_on_the_load_steps():
    _, law = LAWS["yarn-network"]
    names = [f"law.{p.name}" for p in law.parameters if p.fit]
    one, many = (StripTest(0.08, 0.05, BIAS, "draft").run(fabric(law), levels, names)
                 for levels in ([0.1], np.linspace(0.0125, 0.1, 8)))
    np.testing.assert_allclose(one.line_force[-1], many.line_force[-1], rtol=1e-9)
    np.testing.assert_allclose(one.sensitivity[-1], many.sensitivity[-1], rtol=1e-6, atol=1e-9 * np.abs(one.sensitivity).max())


def test_warm_start_gives_the_same_and_is_cheaper():
    _, law = LAWS["yarn-network"]
    strain, names = np.linspace(0.02, 0.12, 6), ["law.Kw", "law.G", "law.Ls"]
    warm, cold = (StripTest(0.08, 0.05, BIAS, "draft") for _ in range(2))
    warm.run(fabric(law), strain, names)
    moved = fabric(law.replace(Kw=1.02 * law.Kw, G=1.05 * law.G, Ls=0.99 * law.Ls))
    a, b = warm.run(moved, strain, names), cold.run(moved, strain, names)
    np.testing.assert_allclose(a.line_force, b.line_force, rtol=1e-7)
    np.testing.assert_allclose(a.sensitivity, b.sensitivity, rtol=1e-5, atol=1e-9 * np.abs(b.sensitivity).max())
    assert a.iterations < b.iterations


def test_locking_returns_what_was_reached():
    law = get_law("yarn-network", Lw=0.03)
    result = StripTest(0.08, 0.05).run(fabric(law), [0.01, 0.02, 0.2], ["law.Kw"])
    assert not result.converged and result.status == "LockingReached"
    assert result.reached.tolist() == [True, True, False]
    assert np.isfinite(result.line_force[:2]).all() and np.isnan(result.line_force[2])
    assert np.isfinite(result.sensitivity).all() and len(result.states) == 2
    assert result.field().strain == 0.02
    # and the next, softer fabric is not spoilt by it
    assert StripTest(0.08, 0.05).run(fabric(get_law("yarn-network", Lw=0.5)), [0.01, 0.02, 0.2]).converged


def test_shortcut_is_far_off_on_the_bias_only():
    _, law = LAWS["yarn-network"]
    along = StripTest(0.08, 0.05).run(fabric(law), [0.01, 0.02])
    oblique = StripTest(0.08, 0.05, BIAS).run(fabric(law), [0.05, 0.1])
    assert abs(shortcut_error(along, fabric(law))["at_end_percent"]) < 5
    assert shortcut_error(oblique, fabric(law))["force_ratio"] < 0.5
    assert shortcut_error(oblique, fabric(law), "held")["force_ratio"] > 10


def test_meshes():
    assert strip_cells(0.08, 0.05, 60, 2) == (10, 6)
    nx, ny = strip_cells(0.02, 0.05, 40)
    assert abs((0.02 / nx) / (0.05 / ny) - 1) < 0.2
    assert StripTest(0.08, 0.05, BIAS).pattern == "criss"  # its edges follow the yarns
    assert all(StripTest(0.08, 0.05, angle).mesh_note() == "" for angle in (0.0, BIAS, WEFT))
    assert "too stiff" in StripTest(0.08, 0.05, 0.5).mesh_note()


def test_mesh_that_follows_the_yarns_does_not_lock():
    """On the bias the standard mesh is near a fine one; one diagonal a cell is far too stiff."""
    law = get_law("yarn-network", Kw=957.0, Lw=0.0675, Kf=4237.0, Lf=0.0977, G=0.0618, Ls=0.761, nu=0.0, delta=0.0114)
    strain = [0.1, 0.16]
    standard = StripTest(0.0818, 0.05, BIAS).run(fabric(law), strain).line_force
    fine = StripTest(0.0818, 0.05, BIAS, cells=(16, 10)).run(fabric(law), strain).line_force
    right = StripTest(0.0818, 0.05, BIAS, cells=(16, 10))
    right.pattern = "right"
    locked = right.run(fabric(law), strain).line_force
    np.testing.assert_allclose(standard, fine, rtol=0.02, atol=0.1)
    assert (locked > 1.2 * fine).all()


def test_payload_of_the_command():
    _, law = LAWS["eight-chain-silk"]
    payload = run(fabric(law), 0.075, 0.025, BIAS, np.linspace(0, 0.1, 4), "draft")
    assert payload["converged"] and payload["status"] == "converged"
    assert set(payload["curves"]) == {"fe", "free", "held"}
    assert payload["curves"]["fe"]["line_force_N_per_m"][0] == pytest.approx(0.0, abs=1e-9)
    free, fe, held = (payload["curves"][k]["line_force_N_per_m"][-1] for k in ("free", "fe", "held"))
    assert free < fe < held
    assert len(payload["field"]["shear_angle_rad"]) == payload["elements"]


def test_pictures(tmp_path):
    from material_tests.strip.plots import save_pictures

    payload = run(fabric(LAWS["eight-chain-silk"][1]), 0.075, 0.025, BIAS, [0.05], "draft")
    for path in save_pictures(tmp_path, payload):
        assert (tmp_path / path).stat().st_size > 10_000


@pytest.mark.parametrize("strain", [[0.02, 0.01], [-0.01, 0.02], [math.nan]])
def test_strains_are_checked(strain):
    with pytest.raises(InputError, match="strictly increasing"):
        StripTest(0.08, 0.05).run(fabric(LAWS["yarn-network"][1]), strain)


def test_specimen_is_checked():
    with pytest.raises(InputError, match="gauge"):
        StripTest(-0.08, 0.05)
    with pytest.raises(UnknownNameError, match="fidelity"):
        StripTest(0.08, 0.05, fidelity="best")
    with pytest.raises(InputError, match="mirror"):
        StripTest(0.08, 0.05, 0.3, quarter=True)
    with pytest.raises(InputError, match="even"):
        StripTest(0.08, 0.05, 0.0, cells=(5, 3), quarter=True)


def test_command(tmp_path, capsys):
    import json

    from mfar_fem.cli.main import main

    args = ["test", "strip", "cupro-su1098", "--level", "fe", "--fidelity", "draft", "--angle", "bias", "--points", "3", "--json"]
    assert main([*args, "--out", str(tmp_path)]) == 0
    payload = json.loads(capsys.readouterr().out)
    assert payload["shortcut_error"]["held"]["force_ratio"] > 10
    assert (tmp_path / "strip_field.png").exists() and (tmp_path / "strip.csv").exists()
    assert main([*args, "--angle", "warp", "--strain", "0.2"]) == 3
    assert json.loads(capsys.readouterr().out)["status"] == "LockingReached"
