"""The words must name what the data do not determine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from toy_models import LINE, line_problem, saturating_problem

from calibration.bootstrap import bootstrap
from calibration.fit import fit
from calibration.profile import profiles
from calibration.statistics import linear_statistics
from calibration.words import all_words, number, parameter_words


def words_of(f, with_profiles=True):
    return all_words(f, linear_statistics(f), profiles(f) if with_profiles else None)


def test_determined_parameters_get_plain_intervals():
    w = words_of(fit(line_problem(noise=0.5)))
    assert "95 % interval" in w["parameters"]["law.mu"] and "profile" in w["parameters"]["law.mu"]
    assert not w["warnings"]


def test_no_upper_bound_is_said():
    f = fit(saturating_problem(np.linspace(0.02, 0.3, 25), noise=1.0, nu=300.0))
    assert "no upper bound: the data do not determine it" in words_of(f)["parameters"]["law.nu"]


def test_interval_that_contains_zero_and_one_that_reaches_past_a_bound():
    f = fit(line_problem(noise=0.5))
    linear = replace(linear_statistics(f), intervals={"law.mu": (90.0, 110.0), "law.nu": (-1.0, 11.0)})
    sentence = parameter_words(f, "law.nu", linear)
    assert "contains zero" in sentence and "past a bound" in sentence
    assert "Warning" not in parameter_words(f, "law.mu", linear)
    singular = replace(linear, intervals={"law.mu": (-np.inf, np.inf), "law.nu": (1.0, 2.0)})
    assert "do not determine" in parameter_words(f, "law.mu", singular)


def test_bound_correlation_and_misfit_are_named():
    p = line_problem(noise=0.5, unknowns=(replace(LINE[0], upper=90.0), LINE[1]))
    f = fit(p)
    assert "upper bound 90" in words_of(f, False)["parameters"]["law.mu"]
    e = p.experiments[0]
    far = line_problem(noise=0.1).vary(experiments=(replace(e, x=e.x + 30, y=100 * (e.x + 30) + 5 + e.x**3),))
    warnings = " ".join(words_of(fit(far), False)["warnings"])
    assert "strongly correlated" in warnings and "misfit" in warnings


def test_unconverged_fit_and_bootstrap_failures_are_said():
    f = replace(fit(line_problem(noise=0.5)), converged=False, status="stopped after 3 evaluations")
    b = replace(bootstrap(f, 4), failed=2, intervals={"law.mu": (-1e3, 1e3), "law.nu": (4.9, 5.1)})
    w = all_words(f, linear_statistics(f), None, b)["warnings"]
    assert any("did not converge" in x for x in w) and any("2 bootstrap" in x for x in w)
    assert any("twice as wide" in x for x in w)


@pytest.mark.parametrize(("value", "text"), [(1234.56, "1235 Pa"), (np.inf, "infinite Pa")])
def test_numbers(value, text):
    assert number(value, "Pa") == text
