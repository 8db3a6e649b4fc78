"""Finite-element level of the calibration: Jacobian, warm starts, failures, synthetic truth, and the cupro fit (slow)."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest

from calibration import datasets
from calibration.compare import compare, law_problems
from calibration.experiments import Experiment
from calibration.finite_element import FiniteElementStrip, model, refine
from calibration.fit import fit
from calibration.forward import ForwardModel, level
from calibration.problem import Problem, law_unknowns
from calibration.study import template_fabric
from mfar_fem.materials import Bending, Fabric, get_law

DIRECTIONS = {"warp": 0.0, "weft": math.pi / 2, "bias": math.pi / 4}
TOP = {"warp": 0.03, "weft": 0.018, "bias": 0.15}
FABRIC = Fabric("synthetic", get_law("yarn-network", nu=0.1), 1e-4, 0.1, Bending.from_rigidities(1e-5, 1e-5))


def strip(direction, points=5, top=None):
    top = TOP[direction] if top is None else top
    x = np.linspace(top / points, top, points)
    return Experiment(direction, x, np.linspace(0.0, 50.0, points), direction=DIRECTIONS[direction], gauge=0.08, width=0.05)


def synthetic(fidelity="fe-draft"):
    out = []
    for name in DIRECTIONS:
        e = strip(name)
        out.append(Experiment(name, e.x, level(fidelity)(e).predict(FABRIC, e.x).y, direction=e.direction, gauge=0.08, width=0.05))
    return tuple(out)


def test_levels():
    for name, total in (("fe-draft", 60), ("fe", 160)):
        forward = level(name)(strip("bias"))
        assert isinstance(forward, ForwardModel)
        problem = forward.test.problem(FABRIC)
        assert 0.7 * total <= len(problem.surface.triangles) <= 1.3 * total
        assert pickle.loads(pickle.dumps(level(name)))(strip("warp"))
    cantilever = Experiment("c", [math.radians(41.5)], [0.04], kind="cantilever")
    y = model(cantilever).predict(FABRIC, cantilever.x, ["bending.warp"])
    assert y.jacobian[0, 0] == pytest.approx(y.y[0] / 3 / 1e-5)


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_jacobian_of_the_problem_against_central_differences(direction):
    """In the fit's own coordinate (ln theta), residuals over the force range; warm starts in between."""
    problem = Problem(FABRIC, law_unknowns(FABRIC.law), (strip(direction, 9),), "fe-draft")
    q = problem.q0()
    _, J, predictions = problem.evaluate(q)
    assert predictions[0].complete
    for k in range(len(q)):
        h = 1e-4 * np.eye(len(q))[k]
        difference = (problem.evaluate(q + h)[0] - problem.evaluate(q - h)[0]) / 2e-4
        np.testing.assert_allclose(J[:, k], difference, rtol=1e-5, atol=1e-6 * np.abs(J).max())


def test_bending_has_no_part_in_a_strip():
    p = FiniteElementStrip(strip("warp"), "draft").predict(FABRIC, strip("warp").x, ["law.Kw", "bending.warp"])
    assert (p.jacobian[:, 0] > 0).all() and (p.jacobian[:, 1] == 0).all()


def test_what_is_not_reached_is_said():
    short = FABRIC.replace(law=FABRIC.law.replace(Lw=0.025))
    e = strip("warp")
    p = FiniteElementStrip(e, "draft").predict(short, e.x, ["law.Kw"])
    assert p.reached[0] and not p.reached[-1] and not p.complete
    assert "LockingReached" in p.status and np.isfinite(p.jacobian).all()
    below = FiniteElementStrip(e, "draft").predict(FABRIC, np.array([-0.01, 0.01]), ["law.Kw"])
    assert below.reached.tolist() == [False, True]
    # the problem gives infinite residuals there and the fit walks away from it
    problem = Problem(short, law_unknowns(short.law, ["Lw"]), (e,), "fe-draft")
    r, J, _ = problem.evaluate(problem.q0())
    assert np.isinf(r[-1]) and (J[-1] == 0).all()


def test_fit_finds_the_truth_and_equals_a_cold_evaluation():
    problem = Problem(FABRIC.replace(law=FABRIC.law.replace(Kw=500.0, G=0.5, Ls=0.9)),
                      law_unknowns(FABRIC.law.replace(Kw=500.0, G=0.5, Ls=0.9), ["Kw", "G", "Ls"]), synthetic(), "fe-draft")
    f = fit(problem, max_evaluations=60)
    assert f.converged and f.rmse_percent_of_range < 1e-3
    for name in ("Kw", "G", "Ls"):
        assert f.parameters[f"law.{name}"] == pytest.approx(FABRIC.law.values[name], rel=1e-3)
    cold = [level("fe-draft")(e).predict(f.fabric, e.x) for e in problem.experiments]
    for a, b in zip(f.predictions, cold, strict=True):
        np.testing.assert_allclose(a.y, b.y, rtol=1e-6)


def test_refine_starts_twice_and_keeps_the_better(tmp_path):
    law = get_law("st-venant-kirchhoff")
    problems = law_problems(FABRIC, [law], synthetic())
    first = compare(problems, starts=1)
    results = refine(problems, first, "fe-draft", folder=tmp_path, max_evaluations=6)
    assert [r.law for r in results] == [law.name] and results[0].fit.cost < first[0].fit.cost
    assert results[0].fit.problem.level == "fe-draft"
    assert len(list(tmp_path.glob("fe-draft-*.json"))) == 2
    again = refine(problems, first, "fe-draft", folder=tmp_path, max_evaluations=6)
    assert again[0].fit.n_evaluations <= results[0].fit.n_evaluations  # resumed, nothing done twice
    assert again[0].fit.cost == pytest.approx(results[0].fit.cost, rel=1e-8)  # the tolerance of the equilibrium


@pytest.mark.slow
@pytest.mark.parametrize("variant", ["preconditioned", "virgin"])
def test_cupro_by_yarn_network(variant):
    """Warp, weft and bias at once: 2 % of the force range over all, 3 % in each direction."""
    data = datasets.load("cupro-su1098", variant)
    law = get_law("yarn-network")
    problems = law_problems(template_fabric(data, law), [law], data.select(role="fit"))
    result = refine(problems, compare(problems, starts=3), "fe")[0]
    assert result.fit.rmse_percent_of_range < 2.0
    assert max(result.fit.rmse_by_experiment.values()) < 3.0
    assert result.stability.stable
