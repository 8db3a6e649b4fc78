"""Outside comparison: BlazePose, a network for photographs of people, on the same images.

Bazarevsky et al.: BlazePose: on-device real-time body pose tracking. CV4ARVRW at CVPR 2020, arXiv:2006.10204. The user gives
the file ``pose_landmark_full.tflite`` (Apache-2.0, from the mediapipe package); nothing of it is shipped. Only eight of the
twelve points have a counterpart: shoulders, elbows, wrists and ankles. Its hips are not the garment's waist and it has no
neckline. The body's joints and the garment's points are not the same thing either (a shoulder seam lies outside the joint), so
a constant offset is to be expected: :func:`debiased` takes it out with the help of training samples.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from mfar_fem.errors import DataFileError, MissingDependencyError
from reconstruction.keypoints.baselines import similarity
from reconstruction.keypoints.crops import apply, crop_matrix, image_box, invert, read_image, warp
from reconstruction.keypoints.data import Sample
from reconstruction.landmarks import INDEX, LANDMARKS

COUNTERPARTS = {
    "left_shoulder": 11, "right_shoulder": 12, "left_elbow": 13, "right_elbow": 14, "left_wrist": 15, "right_wrist": 16,
    "left_ankle": 27, "right_ankle": 28,
}
"""Index among BlazePose's 33 landmarks (left and right are the person's there too)."""
COUNT, FIELDS = 39, 5
MARGIN = 0.25
"""The network was trained on squares a quarter larger than the person."""


class BlazePose:
    """The landmark network, run with LiteRT.

    Parameters
    ----------
    path : path-like
        ``pose_landmark_full.tflite`` (or lite, heavy).

    Raises
    ------
    MissingDependencyError
        ai-edge-litert is not installed.
    DataFileError
        There is no such file, or its outputs are not those of a BlazePose landmark network.
    """

    def __init__(self, path: str | Path):
        try:
            from ai_edge_litert.interpreter import Interpreter
        except ImportError as error:
            raise MissingDependencyError("BlazePose needs ai-edge-litert: pip install ai-edge-litert") from error
        if not Path(path).is_file():
            raise DataFileError("there is no such file", path=path)
        try:
            self._interpreter = Interpreter(model_path=str(path), num_threads=1)
            self._interpreter.allocate_tensors()
        except (ValueError, RuntimeError) as error:
            raise DataFileError(f"is no model that LiteRT can run: {error}", path=path) from error
        self._input = self._interpreter.get_input_details()[0]
        outputs = {int(np.prod(d["shape"])): d["index"] for d in self._interpreter.get_output_details()}
        if COUNT * FIELDS not in outputs or 1 not in outputs:
            raise DataFileError(f"has no output of {COUNT} landmarks × {FIELDS} numbers; not a landmark model", path=path)
        self._landmarks, self._flag = outputs[COUNT * FIELDS], outputs[1]

    def landmarks(self, image: np.ndarray, box=None) -> tuple[np.ndarray, np.ndarray, float]:
        """All 33 landmarks of an image (h, w, 3): points (33, 2) in image pixels, visibility (33,) and the score of a person,
        in [0, 1]."""
        height, width = self._input["shape"][1:3]
        size = (int(height), int(width))
        matrix = crop_matrix(box if box is not None else image_box(image.shape), MARGIN, size)
        crop = warp(image, matrix, size).astype(np.float32) / 255.0
        self._interpreter.set_tensor(self._input["index"], crop[None])
        self._interpreter.invoke()
        values = self._interpreter.get_tensor(self._landmarks).reshape(COUNT, FIELDS)[:33]
        visibility = 1.0 / (1.0 + np.exp(-np.clip(values[:, 3].astype(float), -50, 50)))
        # its pixels count from the corner, ours from the centre of the first one
        points = apply(invert(matrix), values[:, :2].astype(float) - 0.5)
        return points, visibility, float(self._interpreter.get_tensor(self._flag).ravel()[0])

    def predict(self, samples: Sequence[Sample], progress: Callable[..., None] | None = None) -> np.ndarray:
        """Points (n, 12, 2) in image pixels; NaN where there is no counterpart."""
        out = np.full((len(samples), len(LANDMARKS), 2), np.nan)
        for i, sample in enumerate(samples):
            found, _, _ = self.landmarks(read_image(sample.image_path), sample.box)
            for name, index in COUNTERPARTS.items():
                out[i, INDEX[name]] = found[index]
            if progress is not None:
                progress(1)
        return out


def debiased(predicted: np.ndarray, training_predicted: np.ndarray, training: Sequence[Sample]) -> np.ndarray:
    """Predictions (n, 12, 2) with the mean offset from joint to garment point added.

    The offset of every point is the mean over the training samples in the frame of the predicted figure (a similarity of its
    points to their Procrustes mean), so that it turns and grows with the figure.
    """
    from reconstruction.keypoints.baselines import procrustes_mean

    columns = [INDEX[name] for name in COUNTERPARTS]
    shapes = training_predicted[:, columns]
    mean = procrustes_mean(shapes, np.ones(shapes.shape[:2], bool))
    total, count = np.zeros((len(columns), 2)), np.zeros(len(columns))
    for sample, shape in zip(training, shapes, strict=True):
        frame = similarity(shape, mean)
        here = sample.present[columns]
        difference = np.where(here[:, None], sample.keypoints[columns], shape) - shape
        total += difference @ frame[:, :2].T
        count += here
    offset = total / np.maximum(count, 1)[:, None]
    out = predicted.copy()
    for i, shape in enumerate(predicted[:, columns]):
        back = invert(similarity(shape, mean))
        out[i, columns] = shape + offset @ back[:, :2].T
    return out
