"""Each named extreme, alone: solved, and its residual verified by formulas the solver does not share; or a named failure.

`mfar_fem.stress` says what independent means. A case that cannot converge for a reason is listed with its failure.
"""

from dataclasses import replace

import numpy as np
import pytest

from mfar_fem.materials import EightChainSilk
from mfar_fem.stress import Case, draw, run_case
from mfar_fem.stress.cases import locking_strain

orders = pytest.mark.parametrize("order", [1, 2])
SHEET = Case(cells=(5, 3), size=(0.15, 0.09))
SWING = replace(SHEET, kind="dynamics", steps=2)
REST = replace(SHEET, kind="rest")


def converges(case):
    """Run a case; it must converge, verified, without a warning."""
    out = run_case(case)
    assert out.outcome == "converged", f"{out.outcome}: {out.message}"
    assert not out.warnings
    assert np.all(np.isfinite(out.state.u))
    return out


@orders
@pytest.mark.parametrize("method", ["implicit-euler", "bdf2", "generalized-alpha"])
@pytest.mark.parametrize("dt", [1e-4, 1e-2, 1.0])
def test_time_step(order, method, dt):
    out = converges(replace(SWING, order=order, method=method, dt=dt))
    assert out.reached == pytest.approx(1.0)


@orders
@pytest.mark.parametrize("base", [SHEET, SWING, REST], ids=lambda c: c.kind)
@pytest.mark.parametrize("stiffness", [1e1, 1e7])
def test_membrane_stiffness(order, base, stiffness):
    converges(replace(base, order=order, stiffness=stiffness, bending=1e-4))


@orders
@pytest.mark.parametrize("base", [SWING, REST], ids=lambda c: c.kind)
@pytest.mark.parametrize("bending", [1e-9, 1e-2])
def test_bending(order, base, bending):
    converges(replace(base, order=order, bending=bending))


@orders
@pytest.mark.parametrize("base", [SWING, REST], ids=lambda c: c.kind)
@pytest.mark.parametrize("thickness", [1e-6, 5e-3])
def test_thickness(order, base, thickness):
    converges(replace(base, order=order, thickness=thickness, bending=1e-5))


@orders
@pytest.mark.parametrize("nu", [0.34, 1e3])
@pytest.mark.parametrize("stretch", [0.5, 0.9])
def test_locking_parameter_of_the_chain(order, nu, stretch):
    converges(replace(SHEET, order=order, law="eight-chain-silk", shape={"nu": nu}, support="pulled", stretch=stretch))


@orders
@pytest.mark.parametrize("kind", ["statics", "rest", "dynamics"])
def test_stretch_to_99_percent_of_locking(order, kind):
    case = replace(SHEET, kind=kind, order=order, law="eight-chain-silk", shape={"nu": 0.6}, support="pulled", stretch=0.99)
    limit = locking_strain(EightChainSilk(nu=0.6))
    out = converges(case)
    x = out.state.u[: 3 * len(case.surface().nodes)].reshape(-1, 3)
    assert np.ptp(x[:, 0]) == pytest.approx(0.15 * (1 + 0.99 * limit), rel=1e-9)


@orders
def test_load_in_one_step(order):
    """A pull of half the stiffness on the free edge, at once."""
    converges(replace(SHEET, order=order, law="eight-chain-silk", shape={"nu": 2.0}, pull=500.0))
    converges(replace(SWING, order=order, law="eight-chain-silk", shape={"nu": 2.0}, pull=500.0))


@orders
@pytest.mark.parametrize("base", [SWING, REST], ids=lambda c: c.kind)
@pytest.mark.parametrize("sliver", ["column", "graded", "needles"])
def test_slivers_of_one_to_a_thousand(order, base, sliver):
    stiffness = 100.0 if sliver == "needles" else 1e3  # in needles the rounding of stiffer strains would hide the weight
    out = converges(replace(base, order=order, sliver=sliver, aspect=1000.0, bending=1e-5, stiffness=stiffness))
    assert out.aspect > 900


@orders
@pytest.mark.parametrize("sliver", ["column", "graded", "needles"])
def test_slivers_in_statics(order, sliver):
    """Load steps from the flat sheet do not always carry slivers of 1:1000 (relaxation does): then the failure has a name."""
    out = run_case(replace(SHEET, order=order, sliver=sliver, aspect=1000.0, bending=1e-3))
    assert out.outcome in {"converged", "failure"}, out.message
    assert out.outcome == "converged" or order == 2, out.message
    assert not out.warnings


@orders
@pytest.mark.parametrize("base", [SWING, REST], ids=lambda c: c.kind)
def test_gravity_times_a_hundred(order, base):
    converges(replace(base, order=order, weight=100.0))


@orders
@pytest.mark.parametrize("base", [SHEET, SWING, REST], ids=lambda c: c.kind)
def test_start_compressed_by_20_percent(order, base):
    converges(replace(base, order=order, compression=0.2, bending=1e-5))


@orders
@pytest.mark.parametrize("kind", ["statics", "rest"])
def test_ends_brought_together_by_20_percent(order, kind):
    converges(replace(SHEET, kind=kind, order=order, support="pulled", stretch=-0.2, compression=0.2, bending=1e-5))


def test_what_cannot_be_is_a_named_failure_with_its_last_state():
    """Beyond locking there is no equilibrium: the failure has a name and an admissible state on the way."""
    case = replace(SHEET, law="eight-chain-silk", shape={"nu": 0.6}, support="pulled", stretch=1.3)
    out = run_case(case)
    assert out.outcome == "failure" and out.status in {"LockingReached", "StepTooSmall", "Diverged"}
    assert 0.7 < out.reached < 1.0 and out.status in out.message and np.all(np.isfinite(out.state.u)) and not out.warnings


@pytest.mark.parametrize("index", [361, 615])
def test_cloth_that_has_passed_through_itself_at_a_fold(index):
    """Elements beyond half a turn from their director: the rotation taken over must not jump by a turn."""
    converges(draw(1, index))
