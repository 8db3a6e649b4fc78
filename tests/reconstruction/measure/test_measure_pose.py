"""Pose of the skeleton: projection round trips on synthetic figures, with foreshortened arms."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mfar_fem.errors import DataFileError, InputError
from reconstruction.landmarks import INDEX
from reconstruction.measure.pose import fit_pose
from reconstruction.measure.skeleton import LIMBS, TORSO, Skeleton

BODIES = Path(__file__).parents[4] / "shared" / "data" / "vision" / "bodies"
SCALE = 250.0


def posed(skeleton, rng, forwards=None):
    """Landmarks in space: a turned torso, limbs in random directions."""
    points = skeleton.points - skeleton.points[list(TORSO)].mean(axis=0)
    points = Rotation.from_rotvec(rng.normal(0, 0.15, 3)).apply(points)
    for name, a, b in LIMBS:
        flat = rng.normal(0, 1, 3) * (0.5, 0.7, 0.5) + ((0, 0, -2) if name.endswith("leg") else (np.sign(points[a, 0]), 0, -0.7))
        if forwards is not None:
            flat[1] = -forwards
        points[b] = points[a] + skeleton.length(name) * flat / np.linalg.norm(flat)
    return points


def project(points):
    return SCALE * points[:, [0, 2]] * (1, -1) + (300.0, 200.0)


@pytest.mark.parametrize("seed", range(8))
def test_round_trip_one_of_the_alternatives_is_the_truth(seed):
    skeleton = Skeleton.canonical(1.65)
    truth = posed(skeleton, np.random.default_rng(seed))
    fit = fit_pose(project(truth), skeleton, sigma=0.05, pixels_per_metre=SCALE, scale_sigma=1e-3)
    assert fit.residual < 0.1
    assert fit.pixels_per_metre == pytest.approx(SCALE, rel=2e-3)
    errors = []
    for other in fit.alternatives():
        np.testing.assert_allclose(other.project(), fit.project(), atol=1e-9)  # the picture cannot tell them apart
        shift = truth[list(TORSO)].mean(axis=0) - other.points[list(TORSO)].mean(axis=0)
        errors.append(np.abs(other.points + shift - truth).max())
    assert len(errors) == 2 ** len(fit.ambiguous)
    assert min(errors) < 0.05  # m, on limbs whose depth goes with the root of what they lack in the picture
    lengths = [np.linalg.norm(fit.points[b] - fit.points[a]) for _, a, b in LIMBS]
    np.testing.assert_allclose(lengths, [skeleton.length(name) for name, _, _ in LIMBS], rtol=1e-9)


def test_foreshortened_arms_are_given_their_depth_towards_the_viewer():
    skeleton = Skeleton.canonical()
    truth = posed(skeleton, np.random.default_rng(3), forwards=1.5)
    fit = fit_pose(project(truth), skeleton, sigma=0.05, pixels_per_metre=SCALE, scale_sigma=1e-3)
    arms = {f"{side}_{part}" for side in ("left", "right") for part in ("upper_arm", "forearm")}
    assert arms <= set(fit.ambiguous)
    for name, a, b in LIMBS:
        if name in arms:
            assert fit.points[b, 1] - fit.points[a, 1] == pytest.approx(truth[b, 1] - truth[a, 1], abs=0.02)


def test_frontal_figure_gives_its_own_scale_and_no_ambiguity():
    skeleton = Skeleton.canonical()
    fit = fit_pose(project(skeleton.points), skeleton, sigma=0.5)
    assert fit.pixels_per_metre == pytest.approx(SCALE, rel=0.01)
    assert np.linalg.norm(fit.rotation) < 0.1
    assert fit.residual < 0.5


def test_arm_longer_than_it_can_be_is_reported():
    skeleton = Skeleton.canonical()
    points = project(skeleton.points)
    i, j = INDEX["left_elbow"], INDEX["left_wrist"]
    points[j] = points[i] + 1.5 * (points[j] - points[i])
    fit = fit_pose(points, skeleton, sigma=1.0, pixels_per_metre=SCALE, scale_sigma=1e-3)
    assert fit.stretched.keys() == {"left_forearm"}
    assert fit.stretched["left_forearm"] == pytest.approx(1.5, rel=0.02)


def test_absent_landmarks_stay_absent_and_a_torso_is_needed():
    skeleton = Skeleton.canonical()
    points = project(skeleton.points)
    points[INDEX["right_wrist"]] = np.nan
    fit = fit_pose(points, skeleton)
    assert np.isnan(fit.points[INDEX["right_wrist"]]).all() and np.isfinite(fit.points[INDEX["right_elbow"]]).all()
    points[list(TORSO)[2:]] = np.nan
    with pytest.raises(InputError, match="three points of the torso"):
        fit_pose(points, skeleton)


@pytest.mark.skipif(not BODIES.exists(), reason="the shared bodies are not here")
def test_skeleton_of_a_body():
    skeleton = Skeleton.from_body(BODIES / "anny_female_rest.obj", BODIES / "coco23_keypoints.json", "anny_female_rest")
    assert 1.5 < skeleton.stature < 1.9
    z = {part: skeleton.points[INDEX[f"left_{part}"], 2] for part in ("neckline", "shoulder", "waist", "ankle")}
    assert z["neckline"] > z["shoulder"] > z["waist"] > z["ankle"] > 0
    assert skeleton.points[INDEX["left_wrist"], 0] > 0
    canonical = Skeleton.canonical(skeleton.stature)
    for name in ("left_upper_arm", "left_forearm", "left_leg"):
        assert skeleton.length(name) == pytest.approx(canonical.length(name), rel=0.2)
    fit = fit_pose(project(skeleton.points), skeleton, sigma=0.5)
    assert fit.residual < 1
    with pytest.raises(DataFileError, match="anny_female_rest"):
        Skeleton.from_body(BODIES / "anny_female_rest.obj", BODIES / "coco23_keypoints.json", "anny_femal_rest")


def test_bad_body_files_are_named(tmp_path):
    (tmp_path / "k.json").write_text("{")
    with pytest.raises(DataFileError, match=r"k\.json"):
        Skeleton.from_body(tmp_path / "b.obj", tmp_path / "k.json", "x")
