"""Fit, checkpoint, refusal of steps past locking."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from toy_models import FABRIC, LINE, Line, Saturating, experiment, line, line_problem, saturating_problem

from calibration.fit import fit, fit_values
from calibration.forward import Prediction
from calibration.problem import Problem, bending_unknowns, derived_bending_slope, law_unknowns
from mfar_fem.errors import DataFileError, InputError, NotConvergedError, ParameterError


def test_linear_problem_is_solved_exactly():
    p = line_problem()
    f = fit(p)
    e = p.experiments[0]
    slope, offset = np.polyfit(e.x, e.y, 1)
    assert f.converged and f.parameters["law.mu"] == pytest.approx(slope, rel=1e-7)
    assert f.parameters["law.nu"] == pytest.approx(offset, rel=1e-7)
    rmse = 100 * np.sqrt(np.mean((slope * e.x + offset - e.y) ** 2)) / np.ptp(e.y)
    assert f.rmse_percent_of_range == pytest.approx(rmse) == pytest.approx(f.rmse_by_experiment["curve"])
    assert f.ssr == pytest.approx(e.x.size * (rmse / 100) ** 2)
    assert not f.at_bounds()


def test_every_experiment_counts_by_its_weight_not_by_its_readings():
    few, many = np.linspace(0, 1, 5), np.linspace(0, 1, 400)
    a, b = experiment(few, 100 * few, "a"), experiment(many, 200 * many, "b")
    unknown = (replace(LINE[0], initial=120.0),)
    base = FABRIC.replace(law=FABRIC.law.replace(nu=0.4))
    even = fit(Problem(base, unknown, (a, b), line)).parameters["law.mu"]
    heavy = fit(Problem(base, unknown, (replace(a, weight=100.0), b), line)).parameters["law.mu"]
    assert 105 < even < 135  # relative errors: the softer curve pulls more
    assert abs(heavy - 100) < 3


def test_steps_past_locking_are_refused_and_no_nan_arises():
    x = np.linspace(0.05, 5.4, 20)  # the truth locks at 6: many steps from nu = 50 overshoot
    f = fit(saturating_problem(x, start=50.0))
    assert f.parameters["law.nu"] == pytest.approx(2.0, rel=1e-6)
    assert f.parameters["law.mu"] == pytest.approx(100.0, rel=1e-6)
    assert np.isfinite(f.residuals).all() and np.isfinite(f.jacobian).all()


def test_locked_start_is_left_by_drawing_another():
    x = np.linspace(0.05, 5.4, 20)
    f = fit(saturating_problem(x, start=0.5))
    assert f.parameters["law.nu"] == pytest.approx(2.0, rel=1e-6)


class Never:
    def predict(self, fabric, x, names=()):
        return Prediction(np.full(x.size, np.nan), None, np.zeros(x.size, bool), "not converged")


def test_model_that_never_works_is_named():
    p = line_problem().vary(level=lambda e: Never())
    with pytest.raises(NotConvergedError, match="eight-chain-silk") as caught:
        fit(p)
    assert caught.value.exit_code == 3


def test_multistart_is_reproducible_and_not_worse():
    x = np.linspace(0.05, 3.0, 12)
    p = saturating_problem(x, noise=0.5)
    one, two = fit(p, starts=3, seed=1), fit(p, starts=3, seed=1)
    assert one.parameters == two.parameters
    assert one.cost <= fit(p).cost * (1 + 1e-9)


class Interrupted(Exception):
    pass


def test_interrupted_fit_resumes_from_its_last_accepted_iterate(tmp_path):
    path = tmp_path / "state" / "checkpoint.json"
    p = saturating_problem(np.linspace(0.05, 5.4, 20), start=50.0)
    reference = fit(p)

    def stop(count, cost):
        if count >= 4:
            raise Interrupted

    with pytest.raises(Interrupted):
        fit(p, checkpoint=path, progress=stop)
    state = json.loads(path.read_text())["starts"]["0"]
    assert not state["done"] and state["cost"] < 0.5 * np.sum(p.evaluate(p.q0())[0] ** 2)
    costs = []
    f = fit(p, checkpoint=path, progress=lambda count, cost: costs.append(cost))
    assert costs[0] == pytest.approx(state["cost"])
    assert f.parameters["law.nu"] == pytest.approx(reference.parameters["law.nu"], rel=1e-6)
    again = fit(p, checkpoint=path, progress=lambda count, cost: pytest.fail("finished: nothing is left to do"))
    assert again.parameters == f.parameters and again.converged
    assert not list(path.parent.glob("*.part"))


def test_checkpoint_of_another_problem_is_refused(tmp_path):
    path = tmp_path / "c.json"
    fit(line_problem(), checkpoint=path)
    with pytest.raises(InputError, match="--fresh"):
        fit(line_problem(seed=1), checkpoint=path)
    assert fit(line_problem(seed=1), checkpoint=path, resume=False).converged
    path.write_text("{")
    with pytest.raises(DataFileError, match="checkpoint"):
        fit(line_problem(), checkpoint=path)


def test_unknowns_are_checked():
    with pytest.raises(ParameterError, match="mu"):
        law_unknowns(FABRIC.law, ["mew"])
    with pytest.raises(ParameterError, match="twist"):
        bending_unknowns(FABRIC, ["wrap"])
    with pytest.raises(InputError, match="nothing to fit"):
        Problem(FABRIC, (), line_problem().experiments, line)
    with pytest.raises(InputError, match="cannot determine"):
        Problem(FABRIC, LINE, (experiment([0.0, 1.0], [0.0, 1.0]),), line)
    with pytest.raises(ParameterError, match="not an unknown"):
        line_problem().fixed("law.eta", 1.0)


def test_bending_unknowns_move_the_fabric():
    u = bending_unknowns(FABRIC, ["warp", "coupling"])
    p = Problem(FABRIC, (LINE[0], *u), line_problem().experiments, line)
    fabric = p.fabric_at({"law.mu": 70.0, "bending.warp": 3e-6})
    assert fabric.bending.warp == 3e-6 and fabric.bending.weft == 1e-6 and fabric.law.mu == 70.0


@pytest.mark.parametrize("name", ["mu", "nu", "eta"])
def test_derived_bending_slope(name):
    law, h = FABRIC.law, FABRIC.thickness
    from mfar_fem.materials.bending import Bending

    value, step = law.values[name], 1e-5 * law.values[name]
    ends = [Bending.derived(law.replace(**{name: value + s * step}), h) for s in (1, -1)]
    expected = [(getattr(ends[0], k) - getattr(ends[1], k)) / (2 * step) for k in ("warp", "weft", "twist", "coupling")]
    np.testing.assert_allclose(derived_bending_slope(FABRIC, name), expected, rtol=1e-6, atol=1e-18)


def test_given_values_and_fixed_unknowns():
    p = line_problem(noise=0.0)
    f = fit_values(p, {"law.mu": 100.0, "law.nu": 5.0})
    assert f.rmse_percent_of_range < 1e-10 and f.status == "given"
    g = fit(p.fixed("law.nu", 7.0))
    assert list(g.parameters) == ["law.mu"] and g.law.nu == 7.0


def test_jacobians_of_the_toys_are_exact():
    for model in (Line(), Saturating()):
        x, names = np.linspace(0.1, 1, 5), ("law.mu", "law.nu")
        J = model.predict(FABRIC, x, names).jacobian
        for j, name in enumerate(("mu", "nu")):
            h = 1e-5 * FABRIC.law.values[name]
            a, b = (
                model.predict(FABRIC.replace(law=FABRIC.law.replace(**{name: FABRIC.law.values[name] + s * h})), x).y
                for s in (1, -1)
            )
            np.testing.assert_allclose(J[:, j], (a - b) / (2 * h), rtol=1e-6, atol=1e-9)
