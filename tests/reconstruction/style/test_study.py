"""The study tells help from harm: methods whose effect is known come out as they must."""

import numpy as np
import pytest

pytest.importorskip("cv2")

from reconstruction.style import study
from reconstruction.style.match_rate import MatchScore, transform


@pytest.fixture(scope="module")
def pairs():
    return study.pairs(2, size=96, kinds=("mural", "textile"))


def test_pairs_are_held_out_and_registered(pairs):
    assert [(p.scene, p.like_kind, p.image_kind) for p in pairs] == [
        (0, "mural", "textile"), (0, "textile", "mural"), (1, "mural", "textile"), (1, "textile", "mural")]
    assert np.array_equal(pairs[0].homography, pairs[1].homography) and not np.array_equal(pairs[0].homography, np.eye(3))
    assert not np.array_equal(pairs[0].oracle, pairs[0].image)


def test_known_methods_come_out_as_they_must(pairs):
    """"copy" returns A: perfect look, nothing left of B. "grey" wipes B out. "none" keeps B exactly."""
    methods = {"copy": lambda image, like: like, "grey": lambda image, like: np.full_like(image, 128)}
    done = []
    records = study.evaluate(methods, pairs, progress=lambda k, name: done.append(name))
    assert len(records) == len(done) == 4 * len(pairs)
    table = study.summary(records)
    value = lambda method, name: table[method][name]["value"]  # noqa: E731
    assert value("none", "ssim") == pytest.approx(1.0) and value("none", "edge") == 1.0
    assert value("copy", "colour") == value("copy", "texture") == 0.0
    assert value("copy", "ssim") < 0.8 and value("copy", "edge") < 0.9
    assert value("grey", "matches") == value("grey", "correct") == value("grey", "registered") == 0.0
    # a copy matches A very well, at the wrong places: consistent, not correct
    assert value("copy", "consistent") > 10 and value("copy", "registered") == 0.0
    assert value("copy", "consistent_right") < 0.3
    assert np.isnan(value("none", "network"))
    assert value("none", "correct_gain") == 0.0


def test_gain_is_paired_and_ratios_are_pooled():
    """Right matches rise by 2 in every scene: the gain is 2 without any spread, though the numbers themselves spread."""
    records = []
    for scene, (correct, proposed) in enumerate([(1, 4), (2, 4), (9, 12)]):
        for method, more in (("none", 0), ("better", 2)):
            match = MatchScore(proposed + more, correct + more, 4, correct // 3, 3.0 if scene else 30.0)
            records.append(study.Record(method, scene, "mural", "textile", 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, match))
    better = study.summary(records)["better"]
    assert better["correct_gain"] == {"value": 2.0, "low": 2.0, "high": 2.0}
    assert better["correct"]["value"] == pytest.approx(6.0) and better["correct"]["low"] < 6.0 < better["correct"]["high"]
    assert better["precision"]["value"] == pytest.approx(18 / 26)
    assert better["consistent_right"]["value"] == pytest.approx(3 / 12)
    assert better["registered"]["value"] == pytest.approx(2 / 3)


def test_a_perfect_matcher_scores_full_for_every_method(pairs):
    points = np.random.default_rng(0).uniform(20, 70, (12, 2))
    moved = transform(pairs[0].homography, points)
    rows = study.by_kinds(study.evaluate({}, pairs[:1], matcher=lambda a, b: (points, moved)))
    assert {r["method"] for r in rows} == {"none", "oracle kind"}
    assert all(r["precision"] == 1.0 and r["correct"] == 12 and r["registered"] == 1.0 for r in rows)


def test_verdict_follows_the_interval():
    def row(low, value, high):
        entry = {"value": 0.5, "low": 0.4, "high": 0.6}
        return {"correct_gain": {"value": value, "low": low, "high": high}, "ssim": entry, "texture": entry}

    words = study.verdict({"none": row(0, 0, 0), "good": row(1, 2, 3), "bad": row(-3, -2, -1), "idle": row(-1, 0, 1)})
    assert [w.split(":")[0] for w in words] == ["good helps", "bad harms", "idle makes no significant difference"]
