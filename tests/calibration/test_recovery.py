"""A synthetic truth must be found again, with intervals that cover it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from toy_models import FABRIC

from calibration.compare import compare, fit_law, law_problems
from calibration.experiments import Experiment
from calibration.fit import fit
from calibration.homogeneous import line_force, model
from calibration.problem import Problem, law_unknowns
from calibration.profile import profile
from calibration.statistics import linear_statistics
from mfar_fem.errors import InputError
from mfar_fem.materials import get_law
from mfar_fem.materials.bending import Bending

LAW = get_law("eight-chain-silk", mu=87.5e3, nu=5.2)
TRUTH = FABRIC.replace(law=LAW, bending=Bending.derived(LAW, FABRIC.thickness))


def experiments(seed, noise=0.01, top=0.25, cantilever=True):
    rng = np.random.default_rng(seed)
    out = []
    for name, angle in (("warp", 0.0), ("weft", math.pi / 2), ("bias", math.pi / 4)):
        x = np.linspace(0.01, top, 15)
        y = line_force(TRUTH, angle, x).y
        out.append(
            Experiment(name, x, y + noise * np.ptp(y) * rng.standard_normal(15), direction=angle, gauge=0.08, width=0.05)
        )
        if cantilever:
            angles = np.full(4, math.radians(41.5))
            e = Experiment(f"{name} cantilever", angles, np.ones(4), kind="cantilever", direction=angle)
            c = model(e).predict(TRUTH, angles).y
            out.append(
                Experiment(e.name, angles, c * (1 + noise * rng.standard_normal(4)), kind="cantilever", direction=angle)
            )
    return tuple(out)


def problem(seed, **settings):
    start = TRUTH.replace(law=LAW.replace(mu=20e3, nu=2.0))
    return Problem(start, law_unknowns(start.law, ["mu", "nu"]), experiments(seed, **settings), bending_derived=True)


def test_exact_data_give_the_exact_parameters():
    f = fit(problem(0, noise=0.0))
    assert f.parameters["law.mu"] == pytest.approx(87.5e3, rel=1e-6)
    assert f.parameters["law.nu"] == pytest.approx(5.2, rel=1e-5)


def test_intervals_of_mu_cover_the_truth():
    hits, errors = 0, []
    for seed in range(8):
        f = fit(problem(seed))
        low, high = linear_statistics(f).intervals["law.mu"]
        hits += low <= 87.5e3 <= high
        errors.append(abs(f.parameters["law.mu"] / 87.5e3 - 1))
    assert hits >= 6 and np.median(errors) < 0.02


def test_small_strains_leave_nu_open():
    f = fit(problem(1, top=0.04, cantilever=False))
    p = profile(f, "law.nu")
    assert p.high is None
    assert linear_statistics(f).strong_pairs(0.9)


def test_jacobian_through_derived_bending():
    p = problem(0)
    q = p.q0()
    _, J, _ = p.evaluate(q)
    for j in range(2):
        d = np.zeros(2)
        d[j] = 1e-4
        a, b = p.evaluate(q + d, False)[0], p.evaluate(q - d, False)[0]
        np.testing.assert_allclose(J[:, j], (a - b) / 2e-4, rtol=1e-5, atol=1e-8)


def test_comparison_finds_the_law_that_made_the_data():
    data = experiments(3, cantilever=False)
    laws = [get_law("neo-hookean"), get_law("st-venant-kirchhoff"), get_law("eight-chain-silk")]
    results = compare(law_problems(TRUTH, laws, data), starts=1)
    assert results[0].law == "eight-chain-silk" and results[0].stability.stable
    assert results[0].fit.rmse_percent_of_range < 1.5 < results[1].fit.rmse_percent_of_range
    assert [r.aicc for r in results] == sorted(r.aicc for r in results)
    row = results[0].to_dict()
    assert row["n_parameters"] == len(row["parameters"]) and row["stable"]


def test_law_that_cannot_follow_is_reported_not_raised():
    from calibration.forward import Prediction

    class Never:
        def predict(self, fabric, x, names=()):
            return Prediction(np.zeros(x.size), None, np.zeros(x.size, bool), "not converged")

    p = law_problems(TRUTH, [LAW], experiments(0, cantilever=False), level=lambda e: Never())[0]
    result = fit_law(p)
    assert result.fit is None and "none of the starting values" in result.to_dict()["error"]
    with pytest.raises(InputError, match="at least one"):
        law_problems(TRUTH, [], experiments(0))
