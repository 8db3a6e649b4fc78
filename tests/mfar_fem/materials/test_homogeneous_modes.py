"""Homogeneous deformations: published values, closed forms, exact sensitivities, limits, plane stress."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from mfar_fem.errors import InputError, NotConvergedError, ParameterError
from mfar_fem.materials import get_law, law_names
from mfar_fem.materials.homogeneous import equibiaxial, planar, respond, simple_shear, uniaxial
from mfar_fem.materials.plane_stress import solve_thickness

CLOSED_FORMS = (
    Path(__file__).parents[4] / "shared/data/verification/hyperelastic_incompressible_nominal_stress.csv"
)


def test_nominal_stress_of_the_literal_law():
    r = uniaxial(get_law("eight-chain-literal"), "warp", 1.0 + np.array([0.05, 0.10, 0.15, 0.20, 0.25]))
    np.testing.assert_allclose(r.stress, [23438.568, 44971.069, 65036.917, 83984.280, 102094.217], rtol=0, atol=6e-4)
    np.testing.assert_allclose(r.lateral, r.stretch**-0.5, rtol=1e-10)
    assert r.unit == "Pa"


@pytest.mark.parametrize(("detH", "kilopascal"), [(0.0, 45.0), (0.3, 34.6), (1.0, 22.4)])
def test_a_positive_determinant_softens_the_literal_law(detH, kilopascal):
    stress = uniaxial(get_law("eight-chain-literal", detH=detH), "warp", [1.1]).stress[0]
    assert stress / 1e3 == pytest.approx(kilopascal, abs=0.05)


@pytest.mark.parametrize(("nu", "kilopascal"), [(5.2, 102.1), (10.4, 104.4), (52.0, 106.3)])
def test_tension_hardly_depends_on_nu(nu, kilopascal):
    stress = uniaxial(get_law("eight-chain-literal", nu=nu), "warp", [1.25]).stress[0]
    assert stress / 1e3 == pytest.approx(kilopascal, abs=0.05)


def test_nominal_stress_of_the_silk_law_along_warp_and_weft():
    law = get_law("eight-chain-silk")
    assert uniaxial(law, "warp", [1.1]).stress[0] == pytest.approx(90141.0, abs=0.5)
    assert uniaxial(law, "weft", [1.1]).stress[0] == pytest.approx(64522.0, abs=0.5)


def test_neo_hookean_closed_forms():
    mu, x = 2e5, np.array([0.6, 0.9, 1.1, 2.0, 3.0])
    law = get_law("neo-hookean", mu=mu)
    np.testing.assert_allclose(uniaxial(law, 0.4, x).stress, mu * (x - x**-2), rtol=1e-9)
    np.testing.assert_allclose(equibiaxial(law, 0.4, x).stress, mu * (x - x**-5), rtol=1e-12)
    np.testing.assert_allclose(planar(law, 0.4, x).stress, mu * (x - x**-3), rtol=1e-12)
    np.testing.assert_allclose(simple_shear(law, 0.4, x).stress, mu * x, rtol=1e-12)


@pytest.mark.skipif(not CLOSED_FORMS.exists(), reason="table of closed forms not beside the checkout")
def test_neo_hookean_against_the_table():
    with CLOSED_FORMS.open() as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    x = np.array([float(r["stretch"]) for r in rows])
    law = get_law("neo-hookean", mu=1.0)
    for mode, column in (("uniaxial", "nh_uni"), ("equibiaxial", "nh_equi"), ("planar", "nh_ps")):
        table = [float(r[column]) for r in rows]
        np.testing.assert_allclose(respond(law, mode, "warp", x).stress, table, atol=1e-6)


def test_arruda_boyce_series_at_moderate_stretch():
    mu, n, x = 3e5, 30.0, np.array([1.2, 1.6, 2.0])
    i1 = x**2 + 2.0 / x
    # first five terms of the series, from the 1993 paper
    c = [1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750]
    slope = sum((k + 1) * ck / n**k * i1**k for k, ck in enumerate(c))
    expected = 2.0 * mu * slope * (x - x**-2)
    np.testing.assert_allclose(uniaxial(get_law("arruda-boyce", mu=mu, N=n), "warp", x).stress, expected, rtol=1e-4)


def test_compressible_law_reaches_the_incompressible_limit_at_first_order():
    x = np.array([0.8, 1.1, 1.5, 2.0])
    exact = uniaxial(get_law("neo-hookean", mu=1e5), "warp", x).stress
    errors = []
    for ratio in (1e3, 1e5):
        r = uniaxial(get_law("neo-hookean-compressible", mu=1e5, kappa=1e5 * ratio), "warp", x)
        errors.append(np.abs(r.stress / exact - 1.0).max())
    assert errors[1] < 2e-5 and errors[0] / errors[1] == pytest.approx(100.0, rel=0.05)


def test_small_strain_of_the_compressible_law():
    mu, kappa = 1e5, 2e5
    young, poisson = 9 * kappa * mu / (3 * kappa + mu), (3 * kappa - 2 * mu) / (2 * (3 * kappa + mu))
    r = uniaxial(get_law("neo-hookean-compressible", mu=mu, kappa=kappa), "bias", [1.0 + 1e-5])
    assert r.stress[0] / 1e-5 == pytest.approx(young, rel=1e-4)
    assert (1.0 - r.lateral[0]) / 1e-5 == pytest.approx(poisson, rel=1e-4)


def test_thickness_solver_refuses_what_has_no_root():
    with pytest.raises(NotConvergedError, match="volumetric stiffness"):
        solve_thickness(lambda c: (-np.ones_like(c), np.zeros_like(c)), np.ones(3))


@pytest.mark.parametrize("angle", [0.2, 0.7, 1.3])
def test_off_axis_tension_of_st_venant_kirchhoff_at_small_strain(angle):
    Ew, Ef, nu, G = 4e7, 1e7, 0.2, 1e6
    c, s = np.cos(angle), np.sin(angle)
    compliance = c**4 / Ew + s**4 / Ef + c**2 * s**2 * (1 / G - 2 * nu / np.sqrt(Ew * Ef))
    r = uniaxial(get_law("st-venant-kirchhoff", Ew=Ew, Ef=Ef, nu=nu, G=G), angle, [1.0 + 1e-6])
    assert r.stress[0] / 1e-6 == pytest.approx(1.0 / compliance, rel=1e-4)


@pytest.mark.parametrize("name", law_names())
@pytest.mark.parametrize(("mode", "direction"), [("uniaxial", "warp"), ("uniaxial", 0.5), ("planar", "weft"),
                                                 ("equibiaxial", "warp"), ("simple-shear", 0.3)])
def test_sensitivities_equal_differences(name, mode, direction):
    law = get_law(name)
    x = np.array([0.005, 0.02]) + (mode != "simple-shear")
    names = [p.name for p in law.parameters]
    r = respond(law, mode, direction, x, names)
    stiffness = np.abs(r.stress).max()
    for j, p in enumerate(law.parameters):
        value = law.values[p.name]
        h = 1e-4 * max(abs(value), 1e-2)
        if value - h < p.lower or value + h > p.upper:
            continue
        up, down = (respond(law.replace(**{p.name: value + k}), mode, direction, x).stress for k in (h, -h))
        scale = stiffness / max(abs(value), 1e-2)
        np.testing.assert_allclose(r.sensitivity[:, j], (up - down) / (2 * h), rtol=2e-5, atol=1e-5 * scale)


def test_free_directions_are_free_of_stress_and_the_path_does_not_matter():
    law = get_law("yarn-network", nu=0.5)
    x = np.linspace(1.0, 1.3, 7)
    r = uniaxial(law, 0.6, x)
    n, t = np.array([np.cos(0.6), np.sin(0.6)]), np.array([-np.sin(0.6), np.cos(0.6)])
    S = law.stress(r.C)
    full = np.stack([S[:, 0], S[:, 2], S[:, 2], S[:, 1]], axis=1).reshape(-1, 2, 2)
    size = np.abs(full).max(axis=(1, 2)) + 1e-9
    assert (np.abs(full @ t) / size[:, None] < 1e-6).all()
    np.testing.assert_allclose(r.stress, r.stretch * (n @ full @ n), rtol=1e-9, atol=1e-12)
    alone = uniaxial(law, 0.6, x[::-1])
    np.testing.assert_allclose(alone.stress[::-1], r.stress, rtol=1e-6, atol=1e-9)


def test_states_beyond_locking_are_named_or_flagged():
    law = get_law("yarn-network")
    with pytest.raises(NotConvergedError, match=r"yarn-network.*1\.1"):
        uniaxial(law, "warp", [1.01, 1.1])
    r = uniaxial(law, "warp", [1.01, 1.1], strict=False)
    assert list(r.converged) == [True, False] and np.isfinite(r.stress).all()
    with pytest.raises(NotConvergedError):
        equibiaxial(law, "warp", [1.2])


@pytest.mark.parametrize(
    ("mode", "direction", "stretch", "words"),
    [
        ("bending", "warp", [1.1], "unknown deformation mode"),
        ("uniaxial", "north", [1.1], "direction"),
        ("uniaxial", np.nan, [1.1], "finite"),
        ("uniaxial", "warp", [-0.1], "positive"),
        ("uniaxial", "warp", [np.nan], "finite"),
    ],
)
def test_bad_input(mode, direction, stretch, words):
    with pytest.raises(InputError, match=words):
        respond(get_law("neo-hookean"), mode, direction, stretch)


def test_unknown_sensitivity():
    with pytest.raises(ParameterError, match="kappa"):
        uniaxial(get_law("neo-hookean"), "warp", [1.1], ["kappa"])
