"""What one gets without looking: mean poses. A detector that does not beat them has learned the prior only.

The first two know nothing of the picture but its frame or the garment's box; those called *oracle* know the truth, and bound
what any prior of that kind could reach.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mfar_fem.errors import ParameterError
from reconstruction.keypoints.crops import apply, crop_matrix, image_box, invert, read_image
from reconstruction.keypoints.data import Sample
from reconstruction.landmarks import LANDMARKS


def _masked_mean(points: np.ndarray, present: np.ndarray) -> np.ndarray:
    """Mean (12, 2) over the samples that have the point; a point that none has lies at the mean of the others."""
    count = present.sum(axis=0)
    if not count.any():
        raise ParameterError("no sample has a point that is present; a mean pose needs some")
    mean = np.where(present[..., None], points, 0.0).sum(axis=0) / np.maximum(count, 1)[:, None]
    mean[count == 0] = mean[count > 0].mean(axis=0)
    return mean


def sample_matrix(sample: Sample, margin: float = 0.0) -> np.ndarray:
    """Map from image to input pixels of a sample, as a network with this margin sees it."""
    return crop_matrix(sample.box if sample.box else image_box(read_image(sample.image_path).shape), margin)


def mean_pose(training: Sequence[Sample], samples: Sequence[Sample]) -> np.ndarray:
    """The mean of the training points in the crop, put back into every image; (n, 12, 2)."""
    there = np.array([apply(sample_matrix(s), np.where(s.present[:, None], s.keypoints, 0.0)) for s in training])
    mean = _masked_mean(there, np.array([s.present for s in training]))
    return np.array([apply(invert(sample_matrix(s)), mean) for s in samples])


def mask_box(mask: np.ndarray) -> tuple[float, float, float, float]:
    """x0, y0, x1, y1 of the non-zero pixels of a mask (h, w), from edge to edge."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        raise ParameterError("the mask is empty; it needs a pixel that is not zero")
    return (float(columns[0]) - 0.5, float(rows[0]) - 0.5, float(columns[-1]) + 0.5, float(rows[-1]) + 0.5)


def box_template(training: Sequence[Sample], training_boxes, samples: Sequence[Sample], boxes) -> np.ndarray:
    """The mean shape in the garment's box, stretched to every box (of masks: :func:`mask_box`); (n, 12, 2)."""
    def unit(points, box):
        return (points - np.array(box[:2])) / (np.array(box[2:]) - np.array(box[:2]))

    pairs = zip(training, training_boxes, strict=True)
    there = np.array([unit(np.where(s.present[:, None], s.keypoints, 0.0), box) for s, box in pairs])
    mean = _masked_mean(there, np.array([s.present for s in training]))
    return np.array([np.array(b[:2]) + mean * (np.array(b[2:]) - np.array(b[:2])) for _, b in zip(samples, boxes, strict=True)])


def similarity(source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Least-squares rotation, scale and shift of points (n, 2) onto others, without reflection; an affine map (2, 3)."""
    a, b = source - source.mean(axis=0), target - target.mean(axis=0)
    z, w = a[:, 0] + 1j * a[:, 1], b[:, 0] + 1j * b[:, 1]
    energy = float(np.sum(np.abs(z) ** 2))
    if energy == 0:
        raise ParameterError("all points of the shape coincide; a similarity needs two different ones")
    factor = np.sum(np.conj(z) * w) / energy
    linear = np.array([[factor.real, -factor.imag], [factor.imag, factor.real]])
    return np.column_stack([linear, target.mean(axis=0) - linear @ source.mean(axis=0)])


def procrustes_mean(shapes: np.ndarray, present: np.ndarray, rounds: int = 10) -> np.ndarray:
    """Generalised Procrustes mean (12, 2), rms size 1, of shapes (n, 12, 2) with absent points (Gower 1975,
    doi:10.1007/BF02291478)."""
    mean = _masked_mean(shapes, present)
    for _ in range(rounds):
        mean = (mean - mean.mean(axis=0)) / np.sqrt(np.mean(np.sum((mean - mean.mean(axis=0)) ** 2, axis=1)))
        moved, used = shapes.copy(), present.copy()
        for i, (shape, here) in enumerate(zip(shapes, present, strict=True)):
            if here.sum() >= 2 and np.ptp(shape[here], axis=0).any():
                moved[i] = apply(similarity(shape[here], mean[here]), shape)
            else:
                used[i] = False
        mean = _masked_mean(moved, used)
    return mean


def oracle_procrustes(training: Sequence[Sample], samples: Sequence[Sample]) -> np.ndarray:
    """Oracle: the mean shape with the *true* position, size and rotation of every figure; (n, 12, 2)."""
    present = np.array([s.present for s in training])
    mean = procrustes_mean(np.where(present[..., None], np.array([s.keypoints for s in training]), 0.0), present)
    out = np.full((len(samples), len(LANDMARKS), 2), np.nan)
    for i, s in enumerate(samples):
        if s.present.sum() >= 2:
            out[i] = apply(similarity(mean[s.present], s.keypoints[s.present]), mean)
        elif s.present.any():
            out[i] = s.keypoints[s.present].mean(axis=0)
    return out
