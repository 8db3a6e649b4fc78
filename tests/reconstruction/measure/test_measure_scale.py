"""Scales with their uncertainty."""

import numpy as np
import pytest

from mfar_fem.errors import InputError
from reconstruction.keypoints_file import ImageKeypoints
from reconstruction.landmarks import INDEX
from reconstruction.measure.garment import measure_image, measure_images
from reconstruction.measure.scale import PROPORTION_SPREAD, STATURE_SPREAD, from_marks, image_scale
from reconstruction.measure.skeleton import Skeleton
from reconstruction.measure.spread import model_spread


def figure(points=None, **more):
    points = 200 * Skeleton.canonical(1.65).points[:, [0, 2]] * (1, -1) if points is None else points
    return ImageKeypoints.of("figure.png", "mural", points, **more)


def test_marks_and_their_scatter():
    """The stated standard deviation is the one that noise on the marks makes."""
    marks = np.array([(10.0, 20.0), (10.0, 220.0)])
    scale = from_marks(marks, 0.1, sigma=2.0)
    assert scale.metres_per_pixel == pytest.approx(0.0005)
    rng = np.random.default_rng(0)
    noisy = [from_marks(marks + rng.normal(0, 2, (2, 2)), 0.1).metres_per_pixel for _ in range(3000)]
    assert np.std(noisy) / 0.0005 == pytest.approx(scale.relative_sigma, rel=0.06)


def test_resolution():
    assert image_scale(figure(scale={"dpi": 300.0})).metres_per_pixel == pytest.approx(0.0254 / 300)


@pytest.mark.parametrize(("sex", "stature"), [("male", 1.75), ("female", 1.65)])
def test_stature_of_the_unified_system(sex, stature):
    scale = image_scale(figure(figure=sex, scale={"head": np.array([0.0, 10.0]), "foot": np.array([0.0, 510.0])}))
    assert scale.metres_per_pixel == pytest.approx(stature / 500)
    assert scale.relative_sigma == pytest.approx(STATURE_SPREAD, rel=0.01)


def test_a_height_that_is_known_sets_the_scale_better():
    marked = {"head": np.array([0.0, 10.0]), "foot": np.array([0.0, 510.0])}
    scale = image_scale(figure(figure="male", height=1.80, scale=marked))
    assert scale.metres_per_pixel == pytest.approx(1.80 / 500) and scale.relative_sigma < STATURE_SPREAD / 3
    tall, usual = (image_scale(figure(figure="female", height=h)).metres_per_pixel for h in (1.70, None))
    assert tall / usual == pytest.approx(1.70 / 1.65)


def test_of_several_pictures_one_without_a_scale_is_left_out():
    left_out = {}
    silk = ImageKeypoints.of("silk.png", "textile", figure().points)
    lengths = measure_images([figure(figure="female"), silk], left_out=left_out)
    assert {m.source for m in lengths} == {"figure.png"}
    assert left_out.keys() == {"silk.png"} and "sources.toml" in left_out["silk.png"]


def test_proportions_of_a_cropped_figure():
    whole = figure(figure="female")
    assert image_scale(whole).metres_per_pixel == pytest.approx(1 / 200, rel=1e-12)
    points = whole.points.copy()
    points[[INDEX["left_ankle"], INDEX["right_ankle"]]] = np.nan  # cut off below the waist
    cropped = image_scale(figure(points, figure="female"))
    assert cropped.metres_per_pixel == pytest.approx(1 / 200, rel=1e-12)
    assert cropped.relative_sigma == PROPORTION_SPREAD


def test_what_sets_no_scale_is_said():
    with pytest.raises(InputError, match=r"figure\.png: nothing sets the scale"):
        image_scale(figure())
    with pytest.raises(InputError, match="whose stature"):
        image_scale(figure(scale={"head": np.zeros(2), "foot": np.ones(2)}))
    with pytest.raises(InputError, match="apart"):
        from_marks([(1, 1), (1, 1)], 0.1)
    points = np.full((12, 2), np.nan)
    points[0] = 1
    with pytest.raises(InputError, match="no scale from proportions"):
        image_scale(figure(points, figure="male"))


def test_uncertainty_of_a_width_is_that_of_repeated_measurement():
    """Noise on points and on marks, 2000 times: the scatter of the shoulder width is what one measurement states."""
    base = figure().points
    marks, rng, widths = np.array([(0.0, 0.0), (150.0, 0.0)]), np.random.default_rng(1), []
    for _ in range(2000):
        image = ImageKeypoints.of("t.png", "textile", base + rng.normal(0, 1.5, base.shape), sigma=1.5,
                                  scale={"marks": marks + rng.normal(0, 1.5, (2, 2)), "length": 0.75, "sigma": 1.5})
        (m,) = (m for m in measure_image(image) if m.name == "shoulder_width")
        widths.append((m.value, m.sigma))
    values, sigmas = np.array(widths).T
    assert values.std() == pytest.approx(sigmas.mean(), rel=0.06)
    assert values.mean() == pytest.approx(2 * 0.1295 * 1.65, rel=0.005)


def test_foreshortened_sleeve_lies_between_what_is_seen_and_the_arm():
    skeleton = Skeleton.canonical(1.65)
    arm = skeleton.length("left_upper_arm") + skeleton.length("left_forearm")
    points = figure().points.copy()
    for side in ("left", "right"):  # arms towards the viewer: seen at 60 % of their length
        shoulder = points[INDEX[f"{side}_shoulder"]]
        for part in ("elbow", "wrist"):
            points[INDEX[f"{side}_{part}"]] = shoulder + 0.6 * (points[INDEX[f"{side}_{part}"]] - shoulder)
    scale = {"metres_per_pixel": 1 / 200}
    (m,) = (m for m in measure_image(figure(points, figure="female", scale=scale)) if m.name == "sleeve_length")
    assert m.value == pytest.approx(0.8 * arm)
    assert m.model_sigma == pytest.approx(np.hypot(0.4 * arm / 12**0.5, model_spread("mural", "sleeve_length") * m.value))
    assert m.value < arm < m.value + 2 * m.sigma
    (flat,) = (m for m in measure_image(figure(figure="female", scale=scale)) if m.name == "sleeve_length")
    assert flat.value == pytest.approx(arm) and flat.model_sigma == pytest.approx(0.10 * arm)
