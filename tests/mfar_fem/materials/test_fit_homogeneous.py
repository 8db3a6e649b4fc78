"""Fits to homogeneous curves: Treloar's rubber, recovery of known parameters, cupro."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from mfar_fem.errors import InputError, ParameterError
from mfar_fem.materials import get_law
from mfar_fem.materials.fit import Curve, Scaling, fit_curves
from mfar_fem.materials.homogeneous import respond, uniaxial
from mfar_fem.materials.treloar import refit, treloar_curves

CUPRO = Path(__file__).parents[4] / "shared/data/tensile/u3m_fab_cupro_SU-1098_raw.csv"


def test_treloar_refit():
    out = refit()
    assert out["mu_MPa"] == pytest.approx(0.294, rel=0.01)
    assert out["N"] == pytest.approx(26.3, rel=0.01)
    assert out["rmse_MPa"] == pytest.approx(0.123, rel=0.01)
    assert out["success"] and out["points"] == 56


def test_treloar_uniaxial_alone():
    curves, _ = treloar_curves()
    fit = fit_curves(get_law("arruda-boyce"), curves[:1])
    assert fit.law.mu == pytest.approx(0.2745e6, rel=0.01) and fit.law.N == pytest.approx(25.53, rel=0.01)


def test_every_row_of_the_table_is_cited():
    from importlib import resources

    text = resources.files("mfar_fem.materials").joinpath("data/treloar1944.csv").read_text()
    rows = list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))
    assert rows and all("doi" in r["source"] for r in rows)


TRUE = {
    "eight-chain-silk": {"mu": 70e3, "nu": 2.0, "omega1": 0.9, "omega2": 0.4},
    "st-venant-kirchhoff": {"Ew": 2e7, "Ef": 5e7, "nu": 0.2, "G": 4e5},
    "fung": {"c": 2e4, "A1": 500.0, "A2": 900.0, "A3": 30.0, "nu": 0.2},
    "yarn-network": {"Kw": 800.0, "Lw": 0.08, "Kf": 3000.0, "Lf": 0.07, "G": 0.3, "Ls": 0.8, "nu": 0.4, "delta": 0.01},
}


@pytest.mark.parametrize("name", TRUE)
def test_parameters_are_recovered_from_exact_curves(name):
    truth = get_law(name, **TRUE[name])
    large = name == "eight-chain-silk"
    cases = [("uniaxial", "warp", 0.9 if large else 0.05), ("uniaxial", "weft", 0.9 if large else 0.05),
             ("uniaxial", "bias", 0.9 if large else 0.2), ("equibiaxial", "weft", 0.4 if large else 0.04)]
    curves = []
    for mode, direction, end in cases:
        x = 1.0 + np.linspace(0.1 * end, end, 12)
        curves.append(Curve(mode, direction, x, respond(truth, mode, direction, x).stress))
    fit = fit_curves(get_law(name), curves, list(TRUE[name]), relative=True)
    assert fit.success and fit.unreached == 0 and not fit.at_bound
    for key, value in TRUE[name].items():
        assert fit.law.values[key] == pytest.approx(value, rel=1e-4), key
    assert fit.rmse_percent_of_range["all"] < 1e-4


def test_jacobian_is_the_derivative_of_the_residuals():
    x = 1.0 + np.linspace(0.01, 0.2, 6)
    data = Curve("uniaxial", "bias", x, 1e5 * (x - 1.0), weight=2.0, name="line")
    law = get_law("eight-chain-silk")
    fit = fit_curves(law, [data], ["mu", "omega1"], relative=True)
    h = 1e-3 * fit.law.mu
    up, down = (uniaxial(fit.law.replace(mu=fit.law.mu + k), "bias", x).stress for k in (h, -h))
    expected = 2.0 * (up - down) / (2 * h) / data.stress.max()
    np.testing.assert_allclose(fit.jacobian[:, 0], expected, rtol=1e-5)
    np.testing.assert_allclose(
        fit.residuals, 2.0 * (uniaxial(fit.law, "bias", x).stress - data.stress) / data.stress.max(), rtol=1e-9
    )
    assert set(fit.rmse_by_curve) == {"line"}


def test_scaling_round_trip_keeps_bounds():
    law = get_law("yarn-network")
    scaling = Scaling(law, ["Kw", "nu"])
    values = np.array([123.0, 0.4])
    np.testing.assert_allclose(scaling.to_values(scaling.to_scaled(values)), values, rtol=1e-14)
    assert scaling.law(scaling.bounds[1]).values["nu"] == 0.95


def test_bad_fits_are_refused():
    curve = Curve("uniaxial", "warp", [1.1], [1e4])
    with pytest.raises(InputError, match="cannot determine"):
        fit_curves(get_law("eight-chain-silk"), [curve])
    with pytest.raises(ParameterError, match="colour"):
        fit_curves(get_law("neo-hookean"), [curve], ["colour"])
    with pytest.raises(InputError, match="no curve"):
        fit_curves(get_law("neo-hookean"), [], [])
    with pytest.raises(InputError, match="same length"):
        Curve("uniaxial", "warp", [1.1, 1.2], [1e4])
    with pytest.raises(InputError, match="not finite"):
        Curve("uniaxial", "warp", [1.1], [np.nan])


@pytest.mark.skipif(not CUPRO.exists(), reason="measured cupro curves not beside the checkout")
def test_yarn_network_catches_the_j_of_cupro_in_three_directions():
    with CUPRO.open() as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    curves = []
    for axis, direction in (("L", "warp"), ("W", "weft"), ("B", "bias")):
        own = [r for r in rows if (r["axis"], r["test"], r["cycle"], r["branch"]) == (axis, "S2", "4", "load")]
        strain = np.array([float(r["strain_vs_nominal"]) for r in own])
        force = np.array([float(r["force_N_per_m"]) for r in own])
        keep = strain > 0.0
        force = force - np.median(force[strain < -0.004])
        grid = np.linspace(strain[keep].min(), strain[keep].max(), 25)
        curves.append(Curve("uniaxial", direction, 1.0 + grid, np.interp(grid, strain, force), name=direction))
    fit = fit_curves(get_law("yarn-network"), curves, relative=True)
    assert fit.unreached == 0
    assert fit.rmse_percent_of_range["all"] < 1.5
    assert max(fit.rmse_percent_of_range.values()) < 2.0
