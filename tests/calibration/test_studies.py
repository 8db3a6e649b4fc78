"""The studies behind ``mfar study``: small versions here, the full ones with their thresholds marked slow."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from calibration.experiments import Experiment
from calibration.fit import fit_values
from calibration.problem import Problem, law_unknowns
from calibration.runs import Workers
from calibration.studies import cupro, kept, mesh, reasons, round_trip, round_trip_words, sensitivities
from mfar_fem.cli.main import main
from mfar_fem.errors import InputError
from mfar_fem.materials import get_law, law_names
from mfar_fem.materials.fabric import Fabric

QUICK = round_trip.Settings(readings=5, overhangs=2, truth="standard", fitted="draft")


def stdout_json(capsys) -> dict:
    return json.loads(capsys.readouterr().out)


# -- kept runs -------------------------------------------------------------------------------------------------------------
CALLS = []


def squared(x):
    CALLS.append(x)
    return {"square": x * x}


def test_kept_runs_are_not_repeated_unless_settings_change(tmp_path):
    CALLS.clear()
    seen = []
    first = kept.run_kept(squared, [1, 2], ["a", "b"], tmp_path, progress=lambda *n: seen.append(n))
    assert first == [{"square": 1}, {"square": 4}] and CALLS == [1, 2] and seen[-1] == (2, 2)
    assert kept.run_kept(squared, [1, 3], ["a", "b"], tmp_path) == [{"square": 1}, {"square": 9}] and CALLS == [1, 2, 3]
    (tmp_path / "a.json").write_text("{ torn")
    assert kept.run_kept(squared, [1, 3], ["a", "b"], tmp_path)[0] == {"square": 1} and CALLS == [1, 2, 3, 1]
    kept.run_kept(squared, [1, 3], ["a", "b"], tmp_path, resume=False)
    assert CALLS[4:] == [1, 3] and not list(tmp_path.glob("*.part"))


# -- round trip ------------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def trip(tmp_path_factory):
    folder = tmp_path_factory.mktemp("trip")
    return round_trip.run(2, QUICK, with_profile=False, folder=folder), folder


def test_round_trip_finds_mu_and_says_what_nu_is_worth(trip):
    found, _ = trip
    assert found["seeds"] == 2 and len(found["per_seed"]) == 2
    assert found["median_error_percent"] < 6 and found["covered_linear"] >= 1 and found["covered_profile"] >= 1
    assert abs(found["mesh_bias"]["law_percent"]["mu"]) < 0.5 and found["mesh_bias"]["rmse_percent_of_range"] < 0.2
    assert set(found["mesh_bias"]["bending_percent"]) == {"warp", "weft", "twist"}
    assert found["nu"]["median_correlation_mu_nu"] < -0.8
    text = " ".join(found["words"])
    assert "mu: the 95 % interval" in text and "upper bound" in text and "far from locking" in text


def test_round_trip_resumes(trip, monkeypatch):
    first, folder = trip
    monkeypatch.setattr(round_trip, "fitted", lambda *a: pytest.fail("fitted again"))
    monkeypatch.setattr("material_tests.strip.fe.StripTest.run", lambda *a: pytest.fail("data made again"))
    again = round_trip.run(2, QUICK, with_profile=False, folder=folder)
    assert again["per_seed"] == json.loads(json.dumps(first["per_seed"]))


def test_coverage_by_the_profile_is_the_cost_of_holding_the_truth():
    s = round_trip.Settings(readings=6, overhangs=0, truth="draft", fitted="draft")
    f = round_trip.fitted(round_trip.clean_data(s), s, 5)
    assert f.problem.names == ("law.mu", "law.nu")
    assert round_trip.cost_at(f, "law.mu", f.parameters["law.mu"]) == pytest.approx(0.0, abs=1e-5)
    costs = [round_trip.cost_at(f, "law.mu", f.parameters["law.mu"] * k) for k in (1.02, 1.05, 1.1)]
    assert 0 < costs[0] < costs[1] < costs[2]


def test_small_strains_are_expected_to_leave_nu_open():
    s = round_trip.Settings()
    rows = {(e["top"], len(e["unknown"])): e for e in round_trip.expected_precision(s, (0.05, 0.25))}
    assert math.isinf(rows[0.05, 2]["nu_factor"]) and 1.5 < rows[0.25, 2]["nu_factor"] < rows[0.25, 4]["nu_factor"] < 4
    assert rows[0.25, 2]["mu_factor"] < 1.05 < rows[0.05, 2]["mu_factor"]
    words = round_trip_words.precision_words(s, list(rows.values()))[0]
    assert "5 %: unbounded" in words and "25 %: 2.0" in words


def test_words_about_an_open_nu():
    row = {"error_percent": {"mu": 0.5, "nu": 50.0}, "interval": {"mu": [1, 2], "nu": [1.0, 60.0]}, "correlation_mu_nu": -0.97,
           "covered_linear": {"mu": True, "nu": True}, "covered_profile": {"mu": True, "nu": True},
           "parameters": {"law.nu": 8.0}, "nu_without_upper_bound": True}
    bias = {"law_percent": {"mu": 0.1, "nu": -2.0}, "bending_percent": {}}
    found = round_trip_words.summary(QUICK, [row, row], bias, {})
    assert found["nu"]["without_upper_bound"] == 2 and found["passed"]
    assert "No seed excludes" in found["words"][-1] and "no upper bound" in found["words"][-1]
    missed = row | {"covered_profile": {"mu": False, "nu": True}}
    assert not round_trip_words.summary(QUICK, [row, missed], bias, {})["passed"]


@pytest.mark.parametrize("wrong", [{"noise": 0.0}, {"noise": 2.0}, {"top": -0.1}])
def test_round_trip_refuses_settings(wrong):
    with pytest.raises(InputError):
        round_trip.Settings(**wrong)


@pytest.mark.slow
def test_round_trip_of_twenty_seeds(tmp_path):
    found = round_trip.run(20, folder=tmp_path, where=Workers(1))
    assert found["covered_linear"] >= 17 and found["covered_profile"] >= 17
    assert found["median_error_percent"] <= 2.0 and found["passed"]
    assert abs(found["mesh_bias"]["law_percent"]["mu"]) < 0.2


# -- cupro -----------------------------------------------------------------------------------------------------------------
def test_cupro_without_a_mesh_gives_rows_and_reasons(tmp_path, capsys):
    code = main(["study", "cupro", "--level", "homogeneous", "--law", "neo-hookean", "--law", "st-venant-kirchhoff", "--variant",
                 "virgin", "--starts", "1", "--out", str(tmp_path), "--json"])
    assert code == 0
    found = stdout_json(capsys)
    assert json.loads((tmp_path / "cupro.json").read_text())["words"] == found["words"]
    rows = {r["law"]: r for r in found["variants"]["virgin"]["laws"]}
    assert found["variants"]["virgin"]["best_law"] == "st-venant-kirchhoff"
    assert rows["neo-hookean"]["n_parameters"] == 1 and rows["neo-hookean"]["delta_aicc"] > 0
    assert not rows["neo-hookean"]["reaches_target"] and rows["neo-hookean"]["evaluation_s"] > 0
    assert any("isotropic" in text for text in rows["neo-hookean"]["why_not"])
    assert any("no toe" in text for text in rows["st-venant-kirchhoff"]["why_not"])
    assert any("warp curve steepens" in text or "weft curve" in text or "bias curve" in text for r in rows.values()
               for text in r["why_not"]) and "reached by no law" in found["words"][0]


def test_second_starts_are_tried_and_failures_kept():
    _, first, final = cupro.fit_all("virgin", [get_law("bischoff")], "homogeneous", starts=1, max_evaluations=6)
    assert first is final and [r.law for r in final] == ["bischoff"] and final[0].fit is not None
    failed = type(final[0])("stuck", None, error="no start")
    assert cupro.row(failed, None, 0.0)["why_not"] == ["It could not be fitted: no start."]


@pytest.mark.parametrize("name", law_names())
def test_isotropy_is_seen(name):
    same = {"neo-hookean", "neo-hookean-compressible", "arruda-boyce", "eight-chain-literal"}
    assert reasons.isotropic(get_law(name)) == (name in same)


def test_hardening_and_compression_are_read_off():
    x = np.linspace(0, 0.1, 30)
    assert reasons.hardening(x, 5 * x) == pytest.approx(1.0)
    assert reasons.hardening(x, x**3) > 5
    assert math.isnan(reasons.hardening(x[:2], x[:2]))
    assert reasons.compression_ratio(get_law("st-venant-kirchhoff")) == pytest.approx(1.0)
    assert reasons.compression_ratio(get_law("yarn-network")) < 0.1


def test_a_law_on_target_needs_no_reason():
    fabric = Fabric.load("cupro-su1098").replace(law=get_law("st-venant-kirchhoff"))
    unknowns = law_unknowns(fabric.law)
    x = np.linspace(0.01, 0.05, 9)
    flat = [Experiment("warp", x, x, gauge=0.08, width=0.05)]
    y = Problem(fabric, unknowns, flat).predict({u.name: u.initial for u in unknowns}, False)[0].y
    problem = Problem(fabric, unknowns, [Experiment("warp", x, y, gauge=0.08, width=0.05)])
    f = fit_values(problem, {u.name: u.initial for u in unknowns})
    assert reasons.reasons(f) == []


@pytest.mark.slow
@pytest.mark.parametrize("variant", cupro.VARIANTS)
def test_yarn_network_reaches_its_target_on_cupro(tmp_path, variant):
    found = cupro.run([get_law("yarn-network"), get_law("st-venant-kirchhoff")], [variant], folder=tmp_path)["variants"][variant]
    row = found["laws"][0]
    assert row["law"] == "yarn-network" and row["reaches_target"], row
    assert row["rmse_percent_of_range"] <= 2.0 and row["largest_rmse_percent_of_range"] <= 3.0


# -- sensitivities ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("case", [("eight-chain-silk", "warp", 0.2), ("yarn-network", "bias", 0.1)])
def test_sensitivities_of_one_strip(case):
    row = sensitivities.run_case(sensitivities.strip_case(*case), load_steps=(1, 5))
    assert row["max_relative_deviation"] <= sensitivities.TOLERANCE and row["max_load_step_deviation"] <= 1e-7
    assert len(row["parameters"]) == len(get_law(case[0]).parameters)
    main_one = row["parameters"][0]
    assert main_one["relative_deviation"] is not None and main_one["exact"] > 0


def test_sensitivity_of_the_drooping_strip_and_a_broken_one_is_seen():
    from dataclasses import replace

    case = sensitivities.cantilever_case()
    assert sensitivities.run_case(case, load_steps=(1,))["max_relative_deviation"] <= sensitivities.TOLERANCE
    broken = replace(case, slope=lambda problem, s: 1.001 * case.slope(problem, s))
    assert sensitivities.run_case(broken, load_steps=(1,))["max_relative_deviation"] > 1e-4


@pytest.mark.slow
def test_all_sensitivities(tmp_path, capsys):
    assert main(["study", "sensitivities", "--out", str(tmp_path), "--json"]) == 0
    found = stdout_json(capsys)
    assert found["passed"] and found["max_relative_deviation"] <= 1e-5 and found["max_load_step_deviation"] <= 1e-7
    assert found["load_steps"] == [1, 5, 20] and len(found["cases"]) == 7


# -- meshes ----------------------------------------------------------------------------------------------------------------
def test_grading_maps_the_strip_onto_itself():
    t = np.linspace(0, 1, 101)
    g = mesh.graded(t, 0.7)
    assert g[0] == 0 and g[-1] == pytest.approx(1) and (np.diff(g) > 0).all()
    assert g[1] / 0.01 == pytest.approx(0.3, abs=0.01) and np.diff(g).max() / 0.01 == pytest.approx(1.7, abs=0.01)
    with pytest.raises(InputError):
        mesh.Mesh("too steep", 100, grading=0.99)


def test_jobs_travel_to_other_processes():
    import pickle

    one = mesh.Mesh("coarse", 60)
    for job in ((mesh.forces, (one, 0.08, 0.05, 0.7, (0.01,))), (round_trip.one_seed, (QUICK, "[]", 0))):
        assert pickle.loads(pickle.dumps(job)) == job


def test_mesh_study_shows_the_locking_of_one_diagonal(tmp_path):
    few = (mesh.Mesh("coarse", 60), mesh.Mesh("graded", 60, grading=0.5), mesh.Mesh("one diagonal", 60, "union"))
    found = mesh.run(strain=(0.05, 0.1), meshes=few, finest=mesh.Mesh("finest", 400), refitted=(), folder=tmp_path)
    error = {r["mesh"]: r["error_percent"] for r in found["forces"]}
    assert error["finest"] == [0.0, 0.0] and 0 < error["coarse"][1] < error["one diagonal"][1]
    assert len({r["line_force_N_per_m"][1] for r in found["forces"]}) == 4
    assert "one diagonal" in found["words"][0] and len(list(tmp_path.glob("force-*.json"))) == 4
    with pytest.raises(InputError, match="no mesh 'other'"):
        mesh.run(meshes=few, refitted=("other",))


@pytest.mark.slow
def test_parameters_belong_to_the_mesh(tmp_path, capsys):
    assert main(["study", "mesh", "--out", str(tmp_path), "--json"]) == 0
    found = stdout_json(capsys)
    by_mesh = {r["mesh"]: r for r in found["refits"]}
    assert set(by_mesh) == set(mesh.REFITTED) and all(r["rmse_percent_of_range"] < 3 for r in by_mesh.values())
    aligned, locked = by_mesh["standard"]["parameters"], by_mesh["one diagonal"]["parameters"]
    assert abs(locked["Ls"] / aligned["Ls"] - 1) > 0.02 or abs(locked["G"] / aligned["G"] - 1) > 0.1
    assert any("belong to the mesh" in text for text in found["words"])
