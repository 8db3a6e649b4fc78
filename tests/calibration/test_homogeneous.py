"""The homogeneous level: closed forms, sensitivities, locking, cantilever."""

from __future__ import annotations

import math

import numpy as np
import pytest
from toy_models import FABRIC

from calibration.experiments import Experiment
from calibration.forward import ForwardModel, level, level_names, register
from calibration.homogeneous import line_force, model, path
from calibration.stability import stability
from mfar_fem.errors import MissingDependencyError, UnknownNameError
from mfar_fem.materials import get_law, law_names

STRAIN = np.array([0.05, 0.10, 0.15, 0.20, 0.25])


def with_law(name, thickness=1.0, **values):
    return FABRIC.replace(law=get_law(name, **values), thickness=thickness)


def test_literal_law_gives_the_reference_nominal_stress():
    p = line_force(with_law("eight-chain-literal", mu=87.5e3, nu=5.2), 0.3, STRAIN)
    expected = [23438.568, 44971.069, 65036.917, 83984.280, 102094.217]  # closed form, incompressible uniaxial
    np.testing.assert_allclose(p.y, expected, rtol=1e-7)


def test_silk_law_is_stiffer_along_the_warp():
    f = with_law("eight-chain-silk", mu=87.5e3, nu=5.2)
    assert line_force(f, 0.0, STRAIN[1:2]).y[0] == pytest.approx(90141, abs=1)
    assert line_force(f, math.pi / 2, STRAIN[1:2]).y[0] == pytest.approx(64522, abs=1)


def test_orthotropic_linear_law_off_axis_compliance():
    """1/E(angle) = c⁴/Ew + s⁴/Ef + c²s²(1/G - 2 nu/Ew), with free shear."""
    f = with_law("st-venant-kirchhoff")
    v, a, e = f.law.values, 0.6, 1e-6
    nu = f.law.tangent_at_rest()
    compliance = np.linalg.inv(nu)
    c, s = math.cos(a), math.sin(a)
    m = np.array([c * c, s * s, c * s])
    assert line_force(f, a, [e]).y[0] == pytest.approx(e / (m @ compliance @ m), rel=1e-5)
    assert v["Ew"] > 0


def test_free_stresses_vanish():
    law = get_law("bischoff")
    C, ok = path(law, 0.4, STRAIN)
    c, s = math.cos(0.4), math.sin(0.4)
    S = law.stress(C)
    Q = np.array([[c, -s], [s, c]])
    own = np.einsum("ia,nij,jb->nab", Q, np.stack([S[:, [0, 2]], S[:, [2, 1]]], axis=1), Q)
    assert ok.all() and np.abs(own[:, 1]).max() < 1e-8 * own[:, 0, 0].max()
    F = np.einsum("ia,nij,jb->nab", Q, np.stack([C[:, [0, 2]], C[:, [2, 1]]], axis=1), Q)
    np.testing.assert_allclose(F[:, 0, 0], (1 + STRAIN) ** 2)


@pytest.mark.parametrize("name", sorted(set(law_names())))
@pytest.mark.parametrize("angle", [0.0, math.pi / 4])
def test_sensitivities_against_central_differences(name, angle):
    stiffer = {"G": 20.0} if name == "yarn-network" else {}  # its default shear force is near the rounding of the yarns'
    f = with_law(name, thickness=1e-4, **stiffer)
    x = np.linspace(0.002, 0.03, 6)
    table = [p for p in f.law.parameters if p.lower < f.law.values[p.name] < p.upper]
    p = line_force(f, angle, x, [f"law.{q.name}" for q in table])
    assert p.complete
    for j, q in enumerate(table):
        value = f.law.values[q.name]
        h = min(1e-4 * (abs(value) or 1.0), 0.4 * (q.upper - value), 0.4 * (value - q.lower))
        y = [line_force(f.replace(law=f.law.replace(**{q.name: value + k * h})), angle, x).y for k in (2, 1, -1, -2)]
        slope = (-y[0] + 8 * y[1] - 8 * y[2] + y[3]) / (12 * h)
        scale = max(np.abs(slope).max(), 1e-4 * np.abs(p.y).max() / (abs(value) or 1.0))
        np.testing.assert_allclose(p.jacobian[:, j], slope, atol=2e-5 * scale, err_msg=f"{name}.{q.name}")


def test_locking_is_reported_not_nan_in_reached():
    f = with_law("yarn-network")
    p = line_force(f, 0.0, np.linspace(0.0, 0.2, 11), ["law.Kw"])
    assert p.reached[0] and not p.reached[-1] and p.status != "ok" and not p.complete
    assert np.isfinite(p.y[p.reached]).all() and np.isfinite(p.jacobian).all()
    assert (np.diff(p.y[p.reached]) > 0).all()


def cantilever(direction):
    return Experiment("c", np.full(3, math.radians(41.5)), [0.03, 0.031, 0.032], kind="cantilever", direction=direction)


def test_cantilever_overhang_is_twice_the_bending_length_at_41_5_degrees():
    for angle in (0.0, 0.7, math.pi / 2):
        p = model(cantilever(angle)).predict(FABRIC, cantilever(angle).x, ["bending.warp", "bending.twist", "law.mu"])
        c = (FABRIC.bending.along(angle) / (FABRIC.areal_density * 9.80665)) ** (1 / 3)
        np.testing.assert_allclose(p.y, 2 * c, rtol=3e-4)
        assert p.jacobian.shape == (3, 3) and (p.jacobian[:, 2] == 0).all()


def test_cantilever_sensitivities():
    from dataclasses import replace

    names = ["bending.warp", "bending.weft", "bending.twist", "bending.coupling"]
    m = model(cantilever(0.6))
    f = FABRIC.replace(bending=replace(FABRIC.bending, coupling=2e-7))
    J = m.predict(f, cantilever(0.6).x, names).jacobian[0]
    for j, name in enumerate(n[8:] for n in names):
        h = 1e-5 * getattr(f.bending, name)
        a, b = (
            m.predict(f.replace(bending=replace(f.bending, **{name: getattr(f.bending, name) + s * h})), [0.7243]).y[0]
            for s in (1, -1)
        )
        assert J[j] == pytest.approx((a - b) / (2 * h), rel=1e-3)


def test_levels():
    assert "homogeneous" in level_names()
    assert isinstance(level("homogeneous")(cantilever(0.0)), ForwardModel)
    with pytest.raises(UnknownNameError, match="homogeneous"):
        level("fem")
    register("nowhere", "calibration.nowhere:model")
    with pytest.raises(MissingDependencyError, match="nowhere"):
        level("nowhere")


def test_stability_finds_the_softening_of_the_literal_law():
    e = Experiment("e", STRAIN, STRAIN * 1e3, gauge=0.1, width=0.05)
    good = stability(get_law("eight-chain-silk"), [e])
    assert good.stable and good.least > 0 and good.states == 25
    bad = stability(get_law("st-venant-kirchhoff", nu=0.3), [e])
    assert bad.stable  # constant tangent

    class Softening(type(get_law("st-venant-kirchhoff"))):
        def evaluate(self, C, order=2):
            energy, S, A = super().evaluate(C, order)
            return energy, S, (None if A is None else A * (1.1 - np.asarray(C)[:, :1, None]))

    assert not stability(Softening(), [e]).stable
