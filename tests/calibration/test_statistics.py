"""Covariance, profile and bootstrap against problems whose answer is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import f as fisher
from scipy.stats import t as student
from toy_models import LINE, experiment, line_problem, saturating_problem

from calibration.bootstrap import bootstrap, resample
from calibration.fit import fit
from calibration.profile import profile, profiles
from calibration.statistics import autocorrelation, fit_criteria, information_criteria, linear_statistics
from mfar_fem.errors import InputError


@pytest.fixture(scope="module")
def line_fit():
    return fit(line_problem(n=25, noise=1.0, seed=3))


def test_covariance_of_a_line_is_the_textbook_one(line_fit):
    e = line_fit.problem.experiments[0]
    A = np.stack([e.x, np.ones_like(e.x)], axis=1)
    theta, ssr = np.linalg.lstsq(A, e.y, rcond=None)[:2]
    cov = ssr[0] / (len(e) - 2) * np.linalg.inv(A.T @ A)
    s = linear_statistics(line_fit)
    np.testing.assert_allclose(s.covariance, cov, rtol=1e-8)
    rho = cov[0, 1] / np.sqrt(cov[0, 0] * cov[1, 1])
    assert s.correlation[0, 1] == pytest.approx(rho)
    half = student.ppf(0.975, len(e) - 2) * np.sqrt(cov[0, 0])
    assert s.intervals["law.mu"] == pytest.approx((theta[0] - half, theta[0] + half))
    scaled = A / np.linalg.norm(A, axis=0)
    assert s.condition == pytest.approx(np.linalg.cond(scaled)) and s.rank == 2
    assert s.strong_pairs(0.8)[0][:2] == ("law.nu", "law.mu") and not s.strong_pairs(0.99)


def test_rank_deficient_jacobian_is_said_not_inverted(line_fit):
    s = linear_statistics(replace(line_fit, jacobian=line_fit.jacobian[:, [0, 0]]))
    assert s.rank == 1 and s.condition == np.inf and s.intervals["law.mu"] == (-np.inf, np.inf)


def test_profile_of_a_linear_model_is_the_exact_parabola(line_fit):
    e = line_fit.problem.experiments[0]
    s = linear_statistics(line_fit)
    for k, (name, p) in enumerate(profiles(line_fit).items()):
        sd = np.sqrt(s.covariance[k, k])
        np.testing.assert_allclose(p.delta, ((p.values - p.best) / sd) ** 2, rtol=1e-4, atol=1e-6)
        half = np.sqrt(fisher.ppf(0.95, 1, len(e) - 2)) * sd
        assert p.low == pytest.approx(p.best - half, abs=0.004 * half)
        assert p.high == pytest.approx(p.best + half, abs=0.004 * half)
        assert p.interval == pytest.approx(s.intervals[name], abs=0.01 * half)
        assert p.improved is None and (np.diff(p.values) > 0).all()


def test_profile_says_no_upper_bound_where_the_data_do_not_determine():
    f = fit(saturating_problem(np.linspace(0.02, 0.3, 25), noise=1.0, nu=300.0))  # far below locking
    p = profile(f, "law.nu")
    assert p.high is None and p.upper_limit == 1e3
    assert p.values[-1] == pytest.approx(1e3) and p.delta[-1] < p.threshold
    sharp = profile(fit(saturating_problem(np.linspace(0.05, 5.4, 25), noise=1.0)), "law.nu")
    assert sharp.low < 2.0 < sharp.high and sharp.high - sharp.low < 0.05


def test_profile_of_a_single_unknown_needs_no_refit():
    p = line_problem(noise=1.0).fixed("law.nu", 5.0)
    f = fit(p)
    got = profile(f, "law.mu")
    assert got.interval == pytest.approx(linear_statistics(f).intervals["law.mu"], rel=1e-3)


def test_profile_notices_a_better_minimum(line_fit):
    from calibration.fit import fit_values

    bad = fit_values(line_fit.problem, {**line_fit.parameters, "law.mu": line_fit.parameters["law.mu"] * 1.3})
    assert profile(bad, "law.nu").improved < 0.5 * bad.ssr


def test_coverage_of_the_linear_interval():
    hits = 0
    for seed in range(40):
        low, high = linear_statistics(fit(line_problem(n=12, noise=2.0, seed=seed))).intervals["law.mu"]
        hits += low <= 100.0 <= high
    assert hits >= 34  # binomial(40, 0.95) is below 34 with probability 0.3 %


@pytest.mark.parametrize("method", ["residual", "case", "block"])
def test_bootstrap_agrees_with_the_linear_interval_of_a_line(line_fit, method):
    b = bootstrap(line_fit, 120, method=method, seed=1)
    s = linear_statistics(line_fit)
    width = [high - low for low, high in (b.intervals["law.mu"], s.intervals["law.mu"])]
    assert 0.6 < width[0] / width[1] < 1.5
    assert abs(b.median["law.mu"] - line_fit.parameters["law.mu"]) < 0.2 * width[1]
    assert b.values.shape == (120, 2) and b.failed == 0
    again = bootstrap(line_fit, 120, method=method, seed=1)
    np.testing.assert_array_equal(b.values, again.values)


def test_bootstrap_over_specimens_sees_their_scatter():
    x = np.linspace(0.1, 1, 8)
    specimens = tuple(
        experiment(x, m * x, f"specimen {i}", specimen=str(i)) for i, m in enumerate([90.0, 95.0, 100.0, 105.0, 110.0])
    )
    base = line_problem()
    law = base.fabric.law.replace(nu=0.4)
    problem = base.vary(experiments=specimens, unknowns=LINE[:1], fabric=base.fabric.replace(law=law))
    b = bootstrap(fit(problem), 80, method="specimen", seed=2)
    sd = b.values[:, 0].std()
    assert 0.5 * 7.07 / np.sqrt(5) < sd < 1.5 * 7.07 / np.sqrt(5)


def test_bootstrap_refuses_what_it_cannot_do(line_fit):
    with pytest.raises(InputError, match="two specimens"):
        bootstrap(line_fit, 5, method="specimen")
    with pytest.raises(InputError, match="known"):
        bootstrap(line_fit, 5, method="boots")
    with pytest.raises(InputError, match="at least 2"):
        bootstrap(line_fit, 1)


def test_case_resampling_keeps_the_number_of_readings(line_fit):
    p = resample(line_fit, "case", np.random.default_rng(0))
    assert p.multiplicity[0].sum() == 25 and (p.multiplicity[0] == 0).any()
    r, J, _ = p.evaluate(line_fit.q)
    assert (r[p.multiplicity[0] == 0] == 0).all() and (J[p.multiplicity[0] == 0] == 0).all()


def test_autocorrelation_tells_noise_from_misfit(line_fit):
    assert abs(autocorrelation(line_fit.problem, line_fit.residuals)["curve"]) < 0.4
    curved = line_problem(noise=0.0)
    e = curved.experiments[0]
    f = fit(curved.vary(experiments=(replace(e, y=e.y + 20 * e.x**3),)))
    assert autocorrelation(f.problem, f.residuals)["curve"] > 0.7


def test_information_criteria():
    c = information_criteria(2.0, 30, 3)
    assert c["aic"] == pytest.approx(30 * np.log(2 / 30) + 8)
    assert c["aicc"] == pytest.approx(c["aic"] + 2 * 4 * 5 / 25)
    assert c["bic"] == pytest.approx(30 * np.log(2 / 30) + 4 * np.log(30))
    assert information_criteria(1.0, 4, 3)["aicc"] == np.inf


def test_superfluous_parameter_is_punished():
    p = line_problem(n=30, noise=1.0, seed=5, nu=0.4)
    small = p.fixed("law.nu", 0.4)
    assert fit_criteria(fit(small))["aicc"] < fit_criteria(fit(p))["aicc"]
