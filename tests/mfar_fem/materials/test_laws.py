"""Every law: derivatives against automatic differentiation, rest state, inadmissible states, values, parameters."""

from __future__ import annotations

import copy
import pickle

import autograd.numpy as anp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mfar_fem.errors import InputError, ParameterError, UnknownNameError
from mfar_fem.materials import Law, get_law, law_from_energy, law_names
from mfar_fem.materials.check import check_law, sample_states

REST = np.array([[1.0, 1.0, 0.0]])


# Energies written down a second time, from the docstrings, for automatic differentiation.


def _i1(C11, C22, C12):
    return C11 + C22 + 1.0 / (C11 * C22 - C12**2)


def _chain(i, mu, nu, d=0.0):
    phi = 1.0 + d - i / (3.0 * nu)
    return mu * (i / phi + anp.log(phi))


def literal(C11, C22, C12, mu, nu, detH):
    return _chain(_i1(C11, C22, C12) - 3.0, mu, nu, detH) - mu * anp.log(1.0 + detH)


def silk(C11, C22, C12, mu, nu, eta, omega1, omega2):
    yarns = omega1 * (C11 - 1.0 - anp.log(C11)) + omega2 * (C22 - 1.0 - anp.log(C22))
    return _chain(_i1(C11, C22, C12) - 3.0 + eta * yarns, mu, nu)


def neo(C11, C22, C12, mu):
    return 0.5 * mu * (_i1(C11, C22, C12) - 3.0)


def stvk(C11, C22, C12, Ew, Ef, nu, G):
    a, b = 0.5 * (C11 - 1.0), 0.5 * (C22 - 1.0)
    quadratic = 0.5 * Ew * a**2 + 0.5 * Ef * b**2 + nu * anp.sqrt(Ew * Ef) * a * b
    return quadratic / (1.0 - nu**2) + 2.0 * G * (0.5 * C12) ** 2


def fung(C11, C22, C12, c, A1, A2, A3, nu):
    a, b = 0.5 * (C11 - 1.0), 0.5 * (C22 - 1.0)
    return 0.5 * c * (anp.exp(A1 * a**2 + A2 * b**2 + 2.0 * nu * anp.sqrt(A1 * A2) * a * b + A3 * C12**2) - 1.0)


def goh(C11, C22, C12, mu, k1w, k2w, k1f, k2f, kappa):
    i1 = _i1(C11, C22, C12)
    psi = 0.5 * mu * (i1 - 3.0)
    for i4, k1, k2 in ((C11, k1w, k2w), (C22, k1f, k2f)):
        e = kappa * (i1 - 3.0) + (1.0 - 3.0 * kappa) * (i4 - 1.0)
        psi = psi + anp.where(e > 0.0, k1 / (2.0 * k2) * (anp.exp(k2 * e**2) - 1.0), 0.0)
    return psi


def yarns(C11, C22, C12, Kw, Lw, Kf, Lf, G, Ls, nu, delta, r):
    psi, taut = G * Ls**2 / 6.0 * ((1.0 - C12**2 / Ls**2) ** -3 - 1.0), []
    for i4, K, L in ((C11, Kw, Lw), (C22, Kf, Lf)):
        e = 0.5 * (i4 - 1.0)
        p = 0.5 * (e + anp.sqrt(e**2 + delta**2))
        p0 = 0.5 * delta
        c = 0.5 * p0 / (1.0 - p0 / L)
        rest = -(L**2) * (p0 / L + anp.log(1.0 - p0 / L))
        psi = psi + K * (0.5 * r * e**2 - L**2 * (p / L + anp.log(1.0 - p / L)) - c * e - rest)
        taut.append((e, p))
    (ew, pw), (ef, pf) = taut
    return psi + nu * anp.sqrt(Kw * Kf) * (pw * pf - 0.25 * delta * (ew + ef) - 0.25 * delta**2)


ORACLES = {
    "eight-chain-literal": (literal, {"detH": 0.3}),
    "eight-chain-silk": (silk, {}),
    "neo-hookean": (neo, {}),
    "st-venant-kirchhoff": (stvk, {"Ew": 3e7, "nu": 0.25}),
    "fung": (fung, {}),
    "gasser-ogden-holzapfel": (goh, {"kappa": 0.1}),
    "yarn-network": (yarns, {"nu": 0.6}),
}


@pytest.mark.parametrize("name", ORACLES)
def test_stress_tangent_and_sensitivities_equal_automatic_differentiation(name):
    func, values = ORACLES[name]
    law = get_law(name, **values)
    oracle = law_from_energy(func, law.parameters, law.basis, "oracle", **values)
    C, _ = sample_states(law, 30, np.random.default_rng(1))
    names = [p.name for p in law.parameters]
    for got, expected in zip(law.evaluate(C), oracle.evaluate(C), strict=True):
        np.testing.assert_allclose(got, expected, rtol=1e-8, atol=1e-10 * np.abs(expected).max())
    got, expected = law.stress_sensitivity(C, names), oracle.stress_sensitivity(C, names)
    for j, parameter in enumerate(names):
        scale = np.abs(expected[..., j]).max()
        np.testing.assert_allclose(got[..., j], expected[..., j], rtol=1e-8, atol=1e-9 * scale, err_msg=parameter)


@pytest.mark.parametrize("name", law_names())
def test_every_law_passes_its_own_checks(name):
    failed = [f"{c.name}: {c.value:.3g} > {c.tolerance:.3g}" for c in check_law(get_law(name)) if not c.passed]
    assert not failed


@pytest.mark.parametrize("name", law_names())
def test_rest_state_and_orders(name):
    law = get_law(name)
    energy, stress, tangent = law.evaluate(REST)
    assert abs(energy[0]) < 1e-10 * np.abs(tangent).max()
    assert np.abs(stress).max() < 1e-10 * np.abs(tangent).max()
    assert np.linalg.eigvalsh(tangent[0])[0] > 0.0
    assert law.evaluate(REST, 0)[1:] == (None, None)
    assert law.evaluate(REST, 1)[2] is None


@pytest.mark.parametrize("name", law_names())
def test_inadmissible_states_are_infinite_and_leave_their_neighbours_alone(name):
    law = get_law(name)
    bad = [[1.0, 1.0, 1.0], [-1.0, -1.0, 0.0], [np.nan, 1.0, 0.0], [np.inf, 1.0, 0.0], [0.0, 0.0, 0.0]]
    C = np.array([[1.01, 0.99, 0.01], *bad, [1.01, 0.99, 0.01]])
    with np.errstate(all="raise"):
        energy, stress, tangent = law.evaluate(C)
    assert (energy[1:-1] == np.inf).all() and not stress[1:-1].any() and not tangent[1:-1].any()
    alone = law.evaluate(C[:1])
    for got, expected in zip((energy, stress, tangent), alone, strict=True):
        np.testing.assert_array_equal(got[[0, -1]], np.concatenate([expected, expected]))


@settings(max_examples=40, deadline=None)
@given(
    name=st.sampled_from(sorted(ORACLES)),
    strain=st.tuples(*[st.floats(-0.02, 0.02)] * 3),
    angle=st.floats(-3.0, 3.0),
)
def test_energy_is_frame_indifferent_and_orthotropic(name, strain, angle):
    law = get_law(name)
    F = np.eye(2) + np.array([[strain[0], strain[2]], [0.5 * strain[2], strain[1]]])
    R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    def energy(F):
        c = F.T @ F
        return law.energy(np.array([[c[0, 0], c[1, 1], c[0, 1]]]))[0]

    mirror = np.diag([1.0, -1.0])
    rounding = 1e-14 * np.abs(law.tangent_at_rest()).max()
    assert abs(energy(R @ F) - energy(F)) <= 1e-9 * energy(F) + rounding
    assert abs(energy(F @ mirror) - energy(F)) <= 1e-9 * energy(F) + rounding


@settings(max_examples=30, deadline=None)
@given(nu=st.floats(0.34, 100.0), eta=st.floats(0.0, 20.0), omega=st.floats(0.0, 1.0))
def test_silk_is_positive_definite_at_rest_above_one_third(nu, eta, omega):
    law = get_law("eight-chain-silk", nu=nu, eta=eta, omega1=omega, omega2=1.0 - omega)
    T = law.tangent_at_rest()
    assert np.linalg.eigvalsh(T)[0] > 0.0
    assert T[2, 2] == pytest.approx(2.0 * law.mu * (1.0 - 1.0 / (3.0 * nu)), rel=1e-12)


@pytest.mark.parametrize("name", ["eight-chain-silk", "eight-chain-literal"])
@pytest.mark.parametrize("nu", [1.0 / 3.0, 0.3, -1.0, 0.0])
def test_nu_at_or_below_one_third_is_refused(name, nu):
    with pytest.raises(ParameterError, match="nu"):
        get_law(name, nu=nu)


@settings(max_examples=40, deadline=None)
@given(
    nu=st.floats(0.0, 0.95),
    delta=st.floats(1e-3, 0.05),
    ratio=st.floats(0.2, 5.0),
    strain=st.tuples(st.floats(-0.3, 0.03), st.floats(-0.3, 0.03), st.floats(-0.6, 0.6)),
)
def test_yarn_network_is_convex_in_the_green_strain(nu, delta, ratio, strain):
    law = get_law("yarn-network", nu=nu, delta=delta, Kf=930.0 * ratio, Lw=0.07, Lf=0.07)
    T = law.tangent([[1.0 + 2.0 * strain[0], 1.0 + 2.0 * strain[1], strain[2]]])[0]
    if not T.any():  # det C <= 0 or locked
        assert np.isinf(law.energy([[1.0 + 2.0 * strain[0], 1.0 + 2.0 * strain[1], strain[2]]])[0])
        return
    assert np.linalg.eigvalsh(T)[0] > 0.0


def test_yarn_network_locks_and_goes_slack():
    law = get_law("yarn-network")
    taut = law.Lw * (1.0 - 1e-3)
    near = taut - law.delta**2 / (4.0 * taut)  # p(near) = taut
    C = np.array([[1.0 + 2.0 * law.Lw * 1.01, 1.0, 0.0], [1.0, 1.0, law.Ls], [1.0 + 2.0 * near, 1.0, 0.0]])
    energy, stress, _ = law.evaluate(C)
    assert np.isinf(energy[:2]).all() and stress[2, 0] > 100.0 * law.Kw * law.Lw
    slack = law.stress([[0.8, 1.0, 0.0]])[0, 0]
    assert -law.Kw * (law.delta / 3.0 + law.r * 0.1) < slack < 0.0
    with pytest.raises(ParameterError, match="locked at rest"):
        get_law("yarn-network", delta=0.15, Lw=0.07)


def test_chain_energy_grows_without_bound_towards_locking():
    law = get_law("eight-chain-silk", eta=0.0)
    gap = np.array([1e-2, 1e-4, 1e-6])  # phi
    target = 3.0 + 3.0 * law.nu * (1.0 - gap)
    stretch2 = np.array([np.max(np.roots([2.0, -t, 0.0, 1.0]).real) for t in target])  # 2 a + 1/a^2 = I1
    energy = law.energy(np.stack([stretch2, stretch2, 0.0 * stretch2], axis=1))
    assert np.isfinite(energy).all() and energy[2] > 50.0 * energy[1] > 2500.0 * energy[0]
    assert law.energy([[stretch2[2] + 1e-3, stretch2[2] + 1e-3, 0.0]])[0] == np.inf


def test_silk_equals_literal_without_anisotropy():
    C = np.array([[1.2, 0.9, 0.1], [0.8, 1.4, -0.2]])
    silk_law, literal_law = get_law("eight-chain-silk", eta=0.0), get_law("eight-chain-literal")
    for a, b in zip(silk_law.evaluate(C), literal_law.evaluate(C), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-13)


def test_isotropic_limits():
    iso = type(get_law("st-venant-kirchhoff")).isotropic(2e6, 0.3)
    expected = 2e6 / (1 - 0.09) * np.array([[1.0, 0.3, 0.0], [0.3, 1.0, 0.0], [0.0, 0.0, 0.35]])
    np.testing.assert_allclose(iso.tangent_at_rest(), expected, rtol=1e-13)
    cube, chains = get_law("bischoff", a=2.0, b=2.0, c=2.0), get_law("arruda-boyce", mu=1e5, N=3.0)
    C = np.array([[1.3, 0.8, 0.0], [0.9, 1.1, 0.0]])
    for got, expected in zip(cube.evaluate(C, 1)[:2], chains.evaluate(C, 1)[:2], strict=True):
        np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-6)
    gauss = get_law("arruda-boyce", mu=1e5, N=1e6)
    np.testing.assert_allclose(gauss.tangent_at_rest(), get_law("neo-hookean", mu=1e5).tangent_at_rest(), rtol=1e-5)


# -- parameters and values ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("values", [{"mu": -1.0}, {"mu": np.nan}, {"mu": np.inf}, {"mu": "soft"}, {"modulus": 1.0}])
def test_bad_parameters_are_refused_by_name(values):
    with pytest.raises(ParameterError, match=next(iter(values))):
        get_law("neo-hookean", **values)


@pytest.mark.parametrize("values", [{"N": 1.0}, {"a": 0.5, "b": 0.5, "c": 0.5}])
def test_chains_locked_at_rest_are_refused(values):
    with pytest.raises(ParameterError, match="rest"):
        get_law("arruda-boyce" if "N" in values else "bischoff", **values)


def test_unknown_law_lists_the_known_ones():
    with pytest.raises(UnknownNameError, match="yarn-network"):
        get_law("no-such-law")


def test_wrong_shape_of_C_is_an_input_error():
    with pytest.raises(InputError, match=r"\(n, 3\)"):
        get_law("neo-hookean").energy([1.0, 1.0, 0.0])


@pytest.mark.parametrize("name", law_names())
def test_laws_are_values(name):
    law = get_law(name)
    assert law == copy.deepcopy(law) == pickle.loads(pickle.dumps(law)) and hash(law) == hash(copy.copy(law))
    first = law.parameters[0]
    other = law.replace(**{first.name: first.default * 1.5})
    assert other != law and other.values[first.name] == first.default * 1.5 and law.values[first.name] == first.default
    with pytest.raises(AttributeError):
        law.mu = 1.0
    with pytest.raises(TypeError):
        law.values[first.name] = 1.0


@pytest.mark.parametrize("name", law_names())
def test_parameter_tables_are_complete(name):
    law = get_law(name)
    assert isinstance(law, Law) and law.basis in ("volume", "area")
    assert "doi" in type(law).__doc__
    for p in law.parameters:
        assert p.lower <= p.default <= p.upper and p.scale in ("log", "linear") and p.description and p.source
        assert p.scale == "linear" or p.lower > 0.0
