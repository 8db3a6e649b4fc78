"""Scores, intervals, baselines and calibration against values known by construction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mfar_fem.errors import ParameterError
from reconstruction.keypoints import baselines
from reconstruction.keypoints.calibration import Isotonic, Logistic, choose, fit_isotonic, fit_logistic, reliability
from reconstruction.keypoints.crops import apply
from reconstruction.keypoints.data import Sample
from reconstruction.keypoints.evaluate import errors, join, paired_difference, summary, table, torso
from reconstruction.landmarks import INDEX

BOX = (-0.5, -0.5, 143.5, 191.5)


def figures(n, seed=0, per_identity=2, present=None):
    rng = np.random.default_rng(seed)
    made = []
    for i in range(n):
        points = rng.uniform(20, 120, (12, 2))
        points[[INDEX["left_shoulder"], INDEX["right_shoulder"]], 1] = 40.0
        points[[INDEX["left_waist"], INDEX["right_waist"]], 1] = 90.0
        here = np.ones(12, bool) if present is None else present.copy()
        style = "mural" if i % 2 else "figurine"
        made.append(Sample(Path(f"{i}.png"), points, here, here, style, i % 2, "test", str(i // per_identity), BOX))
    return made


def truth(samples):
    return np.array([s.keypoints for s in samples])


def test_a_constant_offset_gives_its_length_everywhere():
    samples = figures(10)
    e = errors(truth(samples) + np.array([3.0, 4.0]), samples)
    s = summary([e])
    assert s["rmse_px"] == pytest.approx(5.0) and s["median_px"] == pytest.approx(5.0)
    assert s["rmse_px_low"] == pytest.approx(5.0) and s["rmse_px_high"] == pytest.approx(5.0)
    assert (s["rmse_input_px"], s["median_input_px"]) == pytest.approx((5.0 * 256 / 192,) * 2)
    assert s["n"] == 120 and s["within"] == 1.0
    t = torso(samples[0])
    assert s["pck@0.05"] == pytest.approx(np.mean([5 / torso(x) <= 0.05 for x in samples])) and t > 0


def test_torso_and_what_stands_in_for_it():
    (sample,) = figures(1)
    p = sample.keypoints
    expected = np.linalg.norm(p[0] + p[1] - p[8] - p[9]) / 2
    assert torso(sample) == pytest.approx(expected)
    here = np.ones(12, bool)
    here[8] = False
    assert torso(Sample(Path("x"), p, here, here)) == pytest.approx(np.linalg.norm(p[0] - p[1]))
    few = np.zeros(12, bool)
    few[[2, 5]] = True
    assert torso(Sample(Path("x"), p, few, few)) == pytest.approx(np.linalg.norm(p[2] - p[5]) / 2)


def test_absent_points_do_not_count_and_groups_select():
    present = np.ones(12, bool)
    present[3] = False
    samples = figures(8, present=present)
    predicted = truth(samples)
    predicted[:, 3] += 1000
    predicted[1::2] += [6.0, 8.0]  # murals
    predicted[:, 5] += [0.0, 1.0]
    rows = {(r["group"], r["value"]): r for r in table([errors(predicted, samples)], replicates=50)}
    assert rows["all", "all"]["n"] == 88
    assert rows["style", "figurine"]["rmse_px"] == pytest.approx(np.sqrt(1 / 11))
    assert rows["style", "mural"]["rmse_px"] == pytest.approx(np.sqrt((10 * 100 + 36 + 81) / 11))
    assert rows["point", "right_wrist"]["n"] == 8 and rows["point", "right_elbow"]["n"] == 0
    assert rows["seen", "hidden"]["n"] == 0 and np.isnan(rows["seen", "hidden"]["rmse_px"])


def test_intervals_cover_and_are_wider_for_few_identities():
    rng = np.random.default_rng(0)
    covered, widths = 0, {}
    for trial in range(60):
        samples = figures(30, seed=trial, per_identity=3)
        own = np.repeat(rng.normal(0, 3, (10, 1, 2)), 3, axis=0)  # what an identity's pictures share
        e = errors(truth(samples) + own + rng.normal(0, 2, (30, 12, 2)), samples)
        s = summary([e], replicates=300, seed=trial)
        covered += s["rmse_px_low"] <= np.sqrt(2 * 13) <= s["rmse_px_high"]
        widths.setdefault("clustered", []).append(s["rmse_px_high"] - s["rmse_px_low"])
        alone = errors(truth(samples) + own, [replace(x, identity=str(i)) for i, x in enumerate(samples)])
        together = errors(truth(samples) + own, samples)
        a, b = (summary([v], replicates=200) for v in (alone, together))
        widths.setdefault("alone", []).append(a["rmse_px_high"] - a["rmse_px_low"])
        widths.setdefault("together", []).append(b["rmse_px_high"] - b["rmse_px_low"])
    assert covered >= 46  # a percentile bootstrap of ten clusters covers some 85 to 90 %
    assert np.mean(widths["together"]) > 1.4 * np.mean(widths["alone"])


def test_paired_differences_see_what_unpaired_intervals_do_not():
    rng = np.random.default_rng(1)
    samples = figures(40)
    noise = rng.normal(0, 5, (40, 12, 2)) * rng.uniform(0.3, 3, (40, 1, 1))
    a, b = errors(truth(samples) + noise, samples), errors(truth(samples) + 1.03 * noise, samples)
    d = paired_difference([a], [b])
    assert d["difference"] < 0 and d["high"] < 0 and d["share_below_zero"] == 1.0
    assert summary([a])["rmse_input_px_high"] > summary([b])["rmse_input_px_low"]
    same = paired_difference([a, a], [a, a])
    assert same["difference"] == 0 and same["low"] == 0 == same["high"]
    with pytest.raises(ParameterError, match="not paired"):
        paired_difference([a], [a, a])
    assert len(join([a, b]).pixels) == 80
    with pytest.raises(ParameterError, match="need"):
        errors(np.zeros((3, 12, 2)), samples)


def test_mean_pose_is_the_best_constant():
    samples = figures(60)
    scores = {}
    for name, points in (("mean", baselines.mean_pose(samples, samples)), ("other", baselines.mean_pose(samples[:3], samples))):
        scores[name] = summary([errors(points, samples)], replicates=0)["rmse_px"]
    spread = np.sqrt(np.mean(np.sum((truth(samples) - truth(samples).mean(axis=0)) ** 2, axis=2)))
    assert scores["mean"] == pytest.approx(spread)
    assert scores["other"] > scores["mean"]


def test_box_template_follows_the_box():
    samples = figures(1)
    template = baselines.box_template(samples, [(0, 0, 100, 200)], samples, [(50, 10, 100, 410)])
    assert template[0] == pytest.approx(samples[0].keypoints * [0.5, 2.0] + [50, 10])
    mask = np.zeros((20, 30))
    mask[4:8, 5:25] = 1
    assert baselines.mask_box(mask) == (4.5, 3.5, 24.5, 7.5)
    with pytest.raises(ParameterError, match="empty"):
        baselines.mask_box(np.zeros((3, 3)))


@settings(max_examples=30)
@given(st.floats(-3.1, 3.1), st.floats(0.1, 9), st.floats(-90, 90))
def test_similarity_and_procrustes_undo_similarities(angle, scale, shift):
    shape = np.random.default_rng(0).normal(size=(12, 2))
    c, s = scale * np.cos(angle), scale * np.sin(angle)
    matrix = np.array([[c, -s, shift], [s, c, -shift]])
    assert baselines.similarity(shape, apply(matrix, shape)) == pytest.approx(matrix, abs=1e-6)
    every = np.ones(12, bool)
    copies = [Sample(Path("x"), apply(matrix, shape), every, every), Sample(Path("y"), shape, every, every)]
    assert baselines.oracle_procrustes(copies, copies) == pytest.approx(truth(copies), abs=1e-5)


def test_isotonic_is_monotone_and_finds_the_curve():
    rng = np.random.default_rng(0)
    score = rng.uniform(0, 1, 4000)
    curve = score**3
    fitted = fit_isotonic(score, rng.random(4000) < curve)
    grid = np.linspace(0.1, 0.9, 9)
    assert fitted(grid) == pytest.approx(grid**3, abs=0.08)
    assert np.all(np.diff(fitted(np.linspace(-1, 2, 99))) >= 0)
    before, after = reliability(score, rng.random(4000) < curve), reliability(fitted(score), rng.random(4000) < curve)
    assert before.error == pytest.approx(0.25, abs=0.03) and after.error < 0.03


@example([(0.2065620255358241, False)] * 3 + [(0.2065620255358241, True)])  # the mean of three equal numbers is not that number
@given(st.lists(st.tuples(st.floats(0, 1), st.booleans()), min_size=1, max_size=60))
def test_isotonic_of_anything_is_monotone_within_zero_and_one(pairs):
    score, right = zip(*pairs, strict=True)
    fitted = fit_isotonic(score, right)
    assert all(a <= b for a, b in zip(fitted.x, fitted.x[1:], strict=False))
    assert all(0 < a <= b < 1 for a, b in zip(fitted.y, fitted.y[1:] or fitted.y, strict=False))


def test_pooling_adjacent_violators_by_hand():
    assert fit_isotonic([1, 2, 3, 4], [0, 1, 0, 1], prior=0) == Isotonic((1.0, 2.5, 4.0), (0.0, 0.5, 1.0))


def test_logistic_finds_its_parameters_and_stays_finite():
    rng = np.random.default_rng(0)
    score = rng.normal(size=8000)
    fitted = fit_logistic(score, rng.random(8000) < 1 / (1 + np.exp(-(2 * score - 1))))
    assert (fitted.slope, fitted.offset) == pytest.approx((2, -1), abs=0.12)
    assert np.isfinite(fit_logistic([0.0, 1.0], [0, 1]).slope)
    with pytest.raises(ParameterError, match="as many"):
        fit_logistic([1.0], [1, 0])


def test_the_map_is_chosen_by_groups_left_out():
    rng = np.random.default_rng(0)
    few, many = rng.normal(size=60), rng.uniform(-3, 3, 6000)
    assert isinstance(choose(few, rng.random(60) < 1 / (1 + np.exp(-2 * few)), np.arange(60) // 6), Logistic)
    step = np.where(many > 1, 0.95, np.where(many > -2.5, 0.5, 0.02))  # what no logistic curve can follow
    assert isinstance(choose(many, rng.random(6000) < step, np.arange(6000) // 60), Isotonic)
    assert isinstance(choose([0.1, 0.9], [0, 1], ["a", "a"]), Logistic)


def test_expected_calibration_error_by_hand():
    r = reliability([0.1, 0.1, 0.9, 0.9], [0, 1, 1, 1])
    assert r.error == pytest.approx((2 * 0.4 + 2 * 0.1) / 4)
    assert r.count.tolist() == [2, 2]
    with pytest.raises(ParameterError, match="outside"):
        reliability([1.5], [1])


def test_a_paired_difference_looks_only_where_it_is_told():
    samples = figures(10)
    mural = np.array([s.style == "mural" for s in samples])[:, None, None]
    a, b = (errors(truth(samples) + np.where(mural, far, near), samples) for near, far in ((3.0, 30.0), (4.0, 3.0)))

    def figurines(e):
        return np.broadcast_to((e.style == "figurine")[:, None], e.pixels.shape)

    scale = 256 / 192 * np.sqrt(2)
    assert paired_difference([a], [b], figurines)["difference"] == pytest.approx(-scale)
    assert paired_difference([a], [b])["difference"] > 10
