"""Tension field: closed form, KKT conditions, finite differences, convexity, bounds."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mfar_fem.errors import ParameterError
from mfar_fem.materials import Bending, Fabric, get_law
from mfar_fem.materials.st_venant_kirchhoff import StVenantKirchhoff
from mfar_fem.materials.tension_field import SLACK, TAUT, WRINKLED, TensionField

E, NU = 2.0e6, 0.3
LAWS = {
    "isotropic": StVenantKirchhoff.isotropic(E, NU),
    "orthotropic": get_law("st-venant-kirchhoff", Ew=2e7, Ef=4e6, nu=0.2, G=3e5),
    "neo-hookean": get_law("neo-hookean", mu=1e5),
    "yarn-network": get_law("yarn-network"),
    "eight-chain-silk": get_law("eight-chain-silk"),
}


def strains(n, seed=0, size=0.04):
    rng = np.random.default_rng(seed)
    e = rng.uniform(-size, size, (n, 3))
    return np.stack([1 + 2 * e[:, 0], 1 + 2 * e[:, 1], e[:, 2]], axis=1)


def principal(C):
    """Principal Green strains, larger first."""
    mean, radius = 0.5 * (C[:, 0] + C[:, 1]), np.hypot(0.5 * (C[:, 0] - C[:, 1]), C[:, 2])
    return 0.5 * (mean + radius - 1), 0.5 * (mean - radius - 1)


def test_isotropic_st_venant_kirchhoff_in_closed_form():
    law, C = LAWS["isotropic"], strains(600)
    relaxed = TensionField(law, 0.0)
    e1, e2 = principal(C)
    regime = np.where(e1 <= 0, SLACK, np.where(e2 < -NU * e1, WRINKLED, TAUT))
    assert set(regime) == {SLACK, WRINKLED, TAUT}
    np.testing.assert_array_equal(relaxed.regime(C), regime)
    expected = np.select([regime == SLACK, regime == WRINKLED], [0.0 * e1, 0.5 * E * e1**2], law.energy(C))
    np.testing.assert_allclose(relaxed.energy(C), expected, rtol=1e-11, atol=1e-12 * E)
    wrinkled = regime == WRINKLED
    v = relaxed.wrinkle(C)
    np.testing.assert_allclose(np.sum(v[wrinkled] ** 2, axis=1), -2 * (e2 + NU * e1)[wrinkled], rtol=1e-9)
    S = relaxed.stress(C[wrinkled])
    np.testing.assert_allclose(S[:, 0] + S[:, 1], E * e1[wrinkled], rtol=1e-10)


@pytest.mark.parametrize("name", LAWS)
def test_optimal_wrinkles(name):
    """Stress never negative, none across the wrinkles, and no perturbed wrinkle has less energy."""
    law = LAWS[name]
    size = 0.01 if name in ("yarn-network", "eight-chain-silk") else 0.04
    C = strains(300, 1, size)
    relaxed = TensionField(law, 0.0)
    W, S, _ = relaxed.evaluate(C)
    regime, v = relaxed.regime(C), relaxed.wrinkle(C)
    stiff = np.abs(law.tangent_at_rest()).max()
    low = 0.5 * (S[:, 0] + S[:, 1]) - np.hypot(0.5 * (S[:, 0] - S[:, 1]), S[:, 2])
    assert low.min() > -1e-9 * stiff
    assert (regime == WRINKLED).sum() > 30
    across = np.stack([S[:, 0] * v[:, 0] + S[:, 2] * v[:, 1], S[:, 2] * v[:, 0] + S[:, 1] * v[:, 1]], axis=1)
    assert np.abs(across).max() < 1e-9 * stiff
    assert np.all(W <= law.energy(C) + 1e-12 * stiff)
    rng = np.random.default_rng(0)
    for _ in range(20):
        root = rng.standard_normal((len(C), 2, 2)) * 10.0 ** rng.uniform(-3, 0) * np.sqrt(size)
        A = root @ root.transpose(0, 2, 1) + 0.5 * (v[:, :, None] * v[:, None, :])
        other = law.energy(C + np.stack([A[:, 0, 0], A[:, 1, 1], A[:, 0, 1]], axis=1))
        assert np.all(W <= other + 1e-12 * stiff)


@pytest.mark.parametrize("residual", [0.0, 1e-2])
@pytest.mark.parametrize("name", LAWS)
def test_stress_and_tangent_are_derivatives(name, residual):
    law = LAWS[name]
    relaxed = TensionField(law, residual)
    size = 0.01 if name in ("yarn-network", "eight-chain-silk") else 0.04
    C = strains(60 if name == "eight-chain-silk" else 200, 2, size)
    h = 1e-4 * size
    step = np.array([2.0, 2.0, 1.0])  # dE -> dC
    inside = np.ones(len(C), dtype=bool)  # away from the jumps of the tangent
    for unit in np.eye(3):
        for sign in (-2, 2):
            inside &= relaxed.regime(C + sign * h * unit * step) == relaxed.regime(C)
    C = C[inside]
    assert set(relaxed.regime(C)) == {SLACK, WRINKLED, TAUT}
    _, S, D = relaxed.evaluate(C)
    stiff = np.abs(law.tangent_at_rest()).max()
    for i, unit in enumerate(np.eye(3)):
        plus, minus = C + h * unit * step, C - h * unit * step
        np.testing.assert_allclose((relaxed.energy(plus) - relaxed.energy(minus)) / (2 * h), S[:, i], atol=1e-6 * stiff)
        np.testing.assert_allclose((relaxed.stress(plus) - relaxed.stress(minus)) / (2 * h), D[:, :, i],
                                   rtol=1e-3, atol=2e-5 * np.abs(D).max())
    np.testing.assert_allclose(D, D.transpose(0, 2, 1), atol=1e-9 * stiff)


@pytest.mark.parametrize("name", ["isotropic", "orthotropic", "neo-hookean"])
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_convex_where_the_law_is(name, seed):
    law = LAWS[name]
    relaxed = TensionField(law, 0.0)
    a, b = strains(60, seed), strains(60, seed + 1)
    stiff = np.abs(law.tangent_at_rest()).max()
    middle = relaxed.energy(0.5 * (a + b))
    assert np.all(middle <= 0.5 * (relaxed.energy(a) + relaxed.energy(b)) + 1e-13 * stiff)
    assert np.linalg.eigvalsh(relaxed.tangent(a)).min() > -1e-8 * stiff


def test_continuous_stress_where_wrinkles_begin():
    relaxed = TensionField(LAWS["isotropic"], 0.0)
    e1 = 0.02
    for shift in (1e-6, 1e-9, 1e-12, 0.0, -1e-12, -1e-9, -1e-6):
        S = relaxed.stress(np.array([[1 + 2 * e1, 1 - 2 * NU * e1 + 2 * shift, 0.0]]))[0]
        np.testing.assert_allclose(S, [E * e1, 0.0, 0.0], atol=2.5 * E * abs(shift) + 1e-9 * E)


def test_inadmissible_and_bounds():
    relaxed = TensionField(LAWS["neo-hookean"], 0.1)
    W, S, D = relaxed.evaluate(np.array([[1.0, 1.0, 1.5], [-1.0, 1.0, 0.0], [np.nan, 1.0, 0.0], [1.0, 1.0, 0.0]]))
    assert np.all(np.isinf(W[:3])) and not S[:3].any() and not D[:3].any()
    np.testing.assert_allclose(D[3], LAWS["neo-hookean"].tangent_at_rest(), rtol=1e-12)
    for value in (-0.1, 1.5, np.nan):
        with pytest.raises(ParameterError, match="residual"):
            TensionField(LAWS["isotropic"], value)


def test_the_whole_law_left_in_is_the_law():
    law, C = LAWS["orthotropic"], strains(50)
    for mine, own in zip(TensionField(law, 1.0).evaluate(C), law.evaluate(C), strict=True):
        np.testing.assert_allclose(mine, own, rtol=1e-12, atol=1e-9)


def test_parameter_sensitivities():
    law, C = LAWS["orthotropic"], strains(100, 5)
    relaxed = TensionField(law, 0.05)
    names = ["Ew", "G", "nu", "residual"]
    exact = relaxed.stress_sensitivity(C, names)
    for i, name in enumerate(names):
        h = 1e-4 * relaxed.values[name]
        value = relaxed.values[name]
        difference = (relaxed.replace(**{name: value + h}).stress(C) - relaxed.replace(**{name: value - h}).stress(C)) / (2 * h)
        np.testing.assert_allclose(exact[:, :, i], difference, rtol=1e-4, atol=1e-5 * np.abs(exact[:, :, i]).max())


def test_value_semantics_and_use_in_a_fabric():
    relaxed = TensionField(LAWS["isotropic"], 0.01)
    assert relaxed == TensionField(LAWS["isotropic"], 0.01) != TensionField(LAWS["isotropic"], 0.02)
    assert pickle.loads(pickle.dumps(relaxed)) == relaxed
    assert hash(relaxed) == hash(TensionField(LAWS["isotropic"], 0.01))
    assert relaxed.Ew == E and relaxed.parameter("residual").upper == 1.0
    with pytest.raises(ParameterError, match="no parameter"):
        relaxed.parameter("kappa")
    fabric = Fabric("balloon", relaxed, 1e-4, 0.1, Bending.from_rigidities(1e-6, 1e-6))
    assert fabric.membrane_scale == 1e-4
