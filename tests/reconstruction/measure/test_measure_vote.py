"""The vote: exact weights, averaging within a kind, conflicts at known z."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mfar_fem.errors import InputError
from reconstruction.measure.quantity import Measurement
from reconstruction.measure.vote import WEIGHTS, vote


def measurement(kind, value, sigma=0.01, source=None, name="hem_width"):
    return Measurement(name, value, sigma, 0.0, 0.0, source or kind, kind, "test")


def test_weights_of_the_paper():
    votes, conflicts = vote([measurement("textile", 1.0), measurement("figurine", 1.01), measurement("mural", 0.99)])
    assert votes["hem_width"].value == pytest.approx(0.5 * 1.0 + 0.3 * 1.01 + 0.2 * 0.99, abs=1e-15)
    assert votes["hem_width"].sigma == pytest.approx(0.01 * math.sqrt(0.25 + 0.09 + 0.04), abs=1e-15)
    assert conflicts == []


@pytest.mark.parametrize(
    ("kinds", "expected"),
    [
        (("textile", "mural"), {"textile": 5 / 7, "mural": 2 / 7}),
        (("figurine", "mural"), {"figurine": 0.6, "mural": 0.4}),
        (("textile", "figurine"), {"textile": 0.625, "figurine": 0.375}),
        (("mural",), {"mural": 1.0}),
    ],
)
def test_weights_are_renormalised_over_the_kinds_present(kinds, expected):
    votes, _ = vote([measurement(kind, 1.0) for kind in kinds])
    assert votes["hem_width"].weights == pytest.approx(expected, abs=1e-15)


def test_images_of_one_kind_are_averaged_first():
    murals = [measurement("mural", v, source=f"m{i}") for i, v in enumerate((1.0, 1.02, 1.01, 0.99))]
    votes, _ = vote([*murals, measurement("textile", 1.1)])
    v = votes["hem_width"]
    assert v.values["mural"] == pytest.approx((1.005, 0.005), abs=1e-15)
    assert v.value == pytest.approx((0.2 * 1.005 + 0.5 * 1.1) / 0.7, abs=1e-15)


@pytest.mark.parametrize(("z", "found"), [(1.99, False), (2.01, True), (-2.01, True), (5.0, True)])
def test_conflict_at_known_z(z, found):
    a, b = 0.03, 0.04  # combined 0.05
    _, conflicts = vote([measurement("textile", 1.0 + 0.05 * z, a), measurement("mural", 1.0, b)])
    assert bool(conflicts) == found
    if found:
        c = conflicts[0]
        assert (c.first, c.second, c.level) == ("textile", "mural", "kind")
        assert c.z == pytest.approx(z, abs=1e-9) and c.combined_sigma == pytest.approx(0.05)


def test_what_images_of_a_kind_get_wrong_together_is_not_averaged_away():
    murals = [Measurement("hem_width", 1.0, 0.03, 0.04, 0.2, str(i), "mural", "test") for i in range(25)]
    votes, _ = vote(murals)
    assert votes["hem_width"].sigma == pytest.approx(math.hypot(0.05 / 5, 0.2))


def test_inverse_variances_as_the_other_weighting():
    votes, _ = vote([measurement("textile", 1.0, 0.01), measurement("mural", 1.3, 0.02)], weighting="precision")
    assert votes["hem_width"].weights == pytest.approx({"textile": 0.8, "mural": 0.2})
    assert votes["hem_width"].value == pytest.approx(1.06)
    assert votes["hem_width"].sigma == pytest.approx((1e4 + 2500) ** -0.5)
    with pytest.raises(InputError, match="did you mean 'paper'"):
        vote([measurement("mural", 1.0)], weighting="papr")


def test_chi_square_against_the_two_source_formula():
    votes, _ = vote([measurement("textile", 1.1, 0.03), measurement("mural", 1.0, 0.04)])
    v = votes["hem_width"]
    assert v.chi_square == pytest.approx(4.0)  # z = 2
    assert v.p_value == pytest.approx(math.erfc(2 / math.sqrt(2)))


def test_conflict_inside_one_kind_is_listed_too():
    _, conflicts = vote([measurement("mural", 1.0, source="a"), measurement("mural", 1.1, source="b")])
    assert [(c.level, c.first, c.second) for c in conflicts] == [("image", "a", "b")]


def test_exact_sources_that_disagree_conflict_without_end():
    _, conflicts = vote([measurement("mural", 1.0, 0.0), measurement("textile", 1.1, 0.0)])
    assert math.isinf(conflicts[0].z)
    assert vote([measurement("mural", 1.0, 0.0), measurement("textile", 1.0, 0.0)])[1] == []


@given(st.lists(st.tuples(st.sampled_from(list(WEIGHTS)), st.floats(0.1, 3), st.floats(1e-3, 0.1)), min_size=1, max_size=8))
def test_vote_lies_between_the_kinds_and_weights_sum_to_one(rows):
    votes, conflicts = vote([measurement(k, v, s, source=str(i)) for i, (k, v, s) in enumerate(rows)])
    v = votes["hem_width"]
    means = [value for value, _ in v.values.values()]
    assert min(means) - 1e-12 <= v.value <= max(means) + 1e-12
    assert sum(v.weights.values()) == pytest.approx(1)
    assert all(abs(c.z) > 2 for c in conflicts)
    assert np.all(np.diff([-abs(c.z) for c in conflicts]) >= 0)


def test_false_alarms_come_at_the_rate_of_the_normal_law():
    rng = np.random.default_rng(5)
    alarms = 0
    for _ in range(2000):
        pair = [measurement(kind, 1 + rng.normal(0, sigma), sigma) for kind, sigma in (("textile", 0.02), ("mural", 0.05))]
        alarms += bool(vote(pair)[1])
    assert alarms / 2000 == pytest.approx(0.0455, abs=0.015)


@pytest.mark.parametrize("bad", [measurement("fresco", 1.0), measurement("mural", math.nan)])
def test_bad_measurements_are_refused(bad):
    with pytest.raises(InputError):
        vote([bad])
