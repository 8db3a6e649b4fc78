"""The stress test: reproducible cases, honest counts, hangs that are killed, failures that keep a usable state."""

import json
import time

import numpy as np
import pytest

from mfar_fem.errors import InputError
from mfar_fem.shell import State
from mfar_fem.stress import Case, Outcome, draw, run_case, run_stress_test, solve, summary
from mfar_fem.stress.cases import KINDS, RANGES, SLIVERS, locking_strain
from mfar_fem.stress.failure_map import failure_map

KEYS = {"cases", "converged", "named_failures", "nan", "hangs", "unverified", "rows"}
SEED = 2024


def accounted(payload):
    return (payload["converged"] + sum(payload["named_failures"].values()) + payload["nan"] + payload["hangs"]
            + payload["unverified"] + payload["crashes"])


def test_a_case_follows_from_its_seed_and_index():
    assert draw(3, 5) == draw(3, 5) != draw(3, 6) != draw(4, 6)
    with pytest.raises(InputError, match="negative"):
        draw(-1, 0)


def test_the_space_is_filled():
    cases = [draw(1, i) for i in range(400)]
    for name, attribute in (("dt", "dt"), ("stiffness", "stiffness"), ("bending", "bending"), ("thickness", "thickness"),
                            ("aspect", "aspect"), ("gravity", "weight")):
        low, high = RANGES[name]
        logs = np.log([getattr(c, attribute) for c in cases])
        assert logs.min() < np.log(low) + 0.05 * np.log(high / low) and logs.max() > np.log(high) - 0.05 * np.log(high / low)
    nu = [c.shape["nu"] for c in cases if c.law.startswith("eight-chain")]
    assert min(nu) < 0.5 and max(nu) > 300
    assert max(c.stretch for c in cases) > 0.97 and max(c.compression for c in cases) > 0.19
    assert {c.kind for c in cases} == set(KINDS) and {c.order for c in cases} == {1, 2}


@pytest.mark.parametrize("sliver", SLIVERS)
def test_slivers_are_as_thin_as_they_say(sliver):
    surface = Case(sliver=sliver, aspect=1000.0, order=2).surface()
    assert 900 < solve.aspect_ratio(surface) < 2100


def test_the_fabric_has_the_stiffness_asked_for():
    for index in range(40):
        case = draw(7, index)
        fabric = case.fabric()
        stiffness = fabric.membrane_scale * np.diag(fabric.law.tangent_at_rest())[:2].max()
        assert stiffness == pytest.approx(case.stiffness, rel=1e-9)


def test_locking_strain_of_the_chain():
    """With the weft held I = x² + 1 + 1/x² - 3, which is 3 ν at locking (isotropic)."""
    from mfar_fem.materials import EightChainSilk

    x = 1.0 + locking_strain(EightChainSilk(nu=2.0, eta=0.0))
    assert x**2 + x**-2 - 2 == pytest.approx(6.0, rel=1e-3)  # the tension there is 1e8 stiffnesses


def test_a_few_cases_through_the_workers(tmp_path):
    seen = []
    payload = run_stress_test(6, SEED, workers=2, out=tmp_path, progress=lambda done, row: seen.append((done, row["index"])))
    assert payload.keys() >= KEYS and payload["cases"] == len(payload["rows"]) == 6 == accounted(payload)
    assert payload["nan"] == payload["hangs"] == payload["unverified"] == payload["crashes"] == payload["warnings"] == 0
    assert sorted(index for _, index in seen) == list(range(6)) and [done for done, _ in seen] == list(range(1, 7))
    assert json.loads((tmp_path / "stress.json").read_text())["cases"] == 6
    assert (tmp_path / "failure_map.png").stat().st_size > 10_000
    lines = (tmp_path / "failure_map.csv").read_text().splitlines()
    assert len(lines) == 1 + 4 * 4 * 3 + 4 * 3
    assert sum(cell["cases"] for cell in failure_map(payload["rows"])) == 6


def test_a_case_that_does_not_end_is_killed_and_named():
    """A large stiff sheet takes minutes to come to rest and has half a second; the run goes on with the next case."""
    long = Case(index=3, kind="rest", order=2, cells=(50, 40), stiffness=1e7, bending=1e-4)
    begin = time.perf_counter()
    payload = run_stress_test(seed=SEED, workers=1, time_limit_per_case=0.5, cases=[long, Case(index=4, cells=(2, 1))])
    assert payload["hangs"] == 1 and payload["converged"] == 1 and payload["not_converged"] == {"hang": [3]}
    assert "only=3" in payload["rows"][0]["message"]
    assert time.perf_counter() - begin < 120


def test_an_exception_is_a_crash_and_the_run_goes_on():
    bad = Case(index=0, law="no-such-law")
    payload = run_stress_test(workers=1, cases=[bad, Case(index=1, cells=(2, 1))])
    assert payload["crashes"] == 1 and payload["converged"] == 1
    assert payload["rows"][0]["status"] == "UnknownNameError"


def test_nan_and_false_claims_are_counted():
    """What a broken solver would return is not taken for convergence."""
    case = Case(cells=(2, 1))
    state = run_case(case).state

    class Good:
        sheet = type("sheet", (), {"energy": staticmethod(lambda u, d: (0.0, 0.0))})

    broken = State(np.full_like(state.u, np.nan), state.directors)
    for given, converged, verdicts, expected in ((broken, True, [], "nan"), (state, True, [solve.Verdict(False, 1, 1, 0, "no")],
                                                 "unverified"), (state, False, [], "failure"), (state, True, [], "converged")):
        out = Outcome(case, status="Diverged", message="Diverged: …", state=given)
        solve._conclude(out, Good, converged, [0.0], verdicts)
        assert out.outcome == expected
    assert summary([out])["converged"] == 1


@pytest.mark.slow
def test_forty_random_combinations():
    payload = run_stress_test(40, SEED)
    assert payload["nan"] == payload["hangs"] == payload["unverified"] == payload["crashes"] == payload["warnings"] == 0, payload
    assert payload["converged"] >= 34


@pytest.mark.slow
def test_a_thousand_random_combinations(tmp_path):
    payload = run_stress_test(1000, 1, out=tmp_path)
    assert payload["nan"] == payload["hangs"] == payload["crashes"] == payload["warnings"] == 0, (
        {k: v for k, v in payload.items() if k != "rows"})
    blind = [row for row in payload["rows"] if row["outcome"] == "unverified"]
    assert all("hides the residual" in row["message"] for row in blind) and len(blind) <= 10, blind  # rounding, no disagreement
    assert payload["converged"] >= 850
    assert (tmp_path / "failure_map.csv").exists() and (tmp_path / "failure_map.png").exists()


def test_a_law_that_finds_no_thickness_turns_the_solver_away_instead_of_ending_it():
    """Steps of 0.12 s throw this sheet to where plane stress has no root."""
    assert run_case(draw(1, 469)).outcome == "converged"
