"""What is measured of structure: known values, invariances, and an order that a person would give too."""

import numpy as np
import pytest
from scipy import ndimage

from mfar_fem.errors import ParameterError
from reconstruction.style.scenes import draw_scene, view
from reconstruction.style.structure import edge_score, edges, gradient_correlation, ssim

SCENE = draw_scene(np.random.default_rng(3))
IMAGE = view(SCENE, "mural", np.random.default_rng(0), 128)
OTHER = view(draw_scene(np.random.default_rng(1)), "figurine", np.random.default_rng(1), 128)


def test_ssim_of_equal_inverted_and_unrelated_pictures():
    assert ssim(IMAGE, IMAGE) == pytest.approx(1.0)
    assert ssim(IMAGE, 255 - IMAGE) < 0
    assert abs(ssim(IMAGE, OTHER)) < 0.3


def test_ssim_agrees_with_another_implementation():
    metrics = pytest.importorskip("skimage.metrics")
    from reconstruction.style.colour import luminance

    noisy = np.clip(IMAGE + np.random.default_rng(0).normal(0, 20, IMAGE.shape), 0, 255).astype(np.uint8)
    theirs = metrics.structural_similarity(luminance(IMAGE), luminance(noisy), data_range=1.0, gaussian_weights=True, sigma=1.5,
                                           use_sample_covariance=False)
    assert ssim(IMAGE, noisy) == pytest.approx(theirs, abs=1e-6)


def test_the_more_blur_the_less_structure():
    for measure in (ssim, gradient_correlation):
        values = [measure(IMAGE, ndimage.gaussian_filter(IMAGE, (s, s, 0))) for s in (0.5, 1.5, 3.0)]
        assert values[0] > values[1] > values[2]


def test_contours_do_not_mind_contrast_but_mind_place():
    pytest.importorskip("cv2")
    pale = np.rint(90 + 0.35 * IMAGE).astype(np.uint8)
    assert edge_score(IMAGE, pale) > 0.93
    assert gradient_correlation(IMAGE, pale) > 0.95
    assert edge_score(IMAGE, np.roll(IMAGE, 1, axis=1)) > 0.9 > 0.75 > edge_score(IMAGE, np.roll(IMAGE, 9, axis=1))
    assert edge_score(IMAGE, IMAGE) == 1.0


def test_contour_of_a_square_is_its_border():
    pytest.importorskip("cv2")
    image = np.full((64, 64, 3), 30, dtype=np.uint8)
    image[20:44, 20:44] = 200
    rows, columns = np.nonzero(edges(image))
    outside = np.maximum(np.abs(rows - 31.5), np.abs(columns - 31.5))
    assert len(rows) > 80 and np.abs(outside - 12).max() <= 2.0
    flat = np.full((64, 64, 3), 30, dtype=np.uint8)
    assert not edges(flat).any() and edge_score(image, flat) == 0.0 and edge_score(flat, flat) == 1.0


def test_sizes_must_agree():
    with pytest.raises(ParameterError, match="one size"):
        ssim(IMAGE, IMAGE[:-1])
