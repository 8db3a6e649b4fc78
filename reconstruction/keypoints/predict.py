"""The detector: images in, twelve points with calibrated confidence out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import DataFileError, InputError, ParameterError
from reconstruction.keypoints.calibration import Isotonic, Logistic, choose, fit_logistic
from reconstruction.keypoints.crops import apply, crop_matrix, image_box, invert, normalise, read_image, warp
from reconstruction.keypoints.data import Sample
from reconstruction.keypoints.evaluate import WITHIN
from reconstruction.keypoints.heatmaps import Peak, decode, peaks, to_input
from reconstruction.keypoints.hrnet import Architecture, HRNet, channels_last
from reconstruction.keypoints.postures import Postures
from reconstruction.keypoints.weights_file import SHIPPED, SHIPPED_FILE
from reconstruction.landmarks import LANDMARKS, MIRROR
from reconstruction.torch_library import torch

FORMAT = "mfar-keypoints-1"


@dataclass(frozen=True)
class Calibration:
    """What turns the height of a peak into probabilities.

    Attributes
    ----------
    confidence : Isotonic or Logistic
        That a present point lies within `within` of the prediction.
    present : Logistic
        That the point exists on the garment. If no training garment lacks the point, this cannot know: a type that does was not
        learnt.
    within : float
        Input pixels.
    """

    confidence: Isotonic | Logistic
    present: Logistic
    within: float = WITHIN

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Calibration:
        """From the plain values of ``dataclasses.asdict``."""
        c = values["confidence"]
        confidence = Isotonic(tuple(c["x"]), tuple(c["y"])) if "x" in c else Logistic(**c)
        return cls(confidence, Logistic(**values["present"]), values["within"])


@dataclass(frozen=True)
class Predictions:
    """Points of n images.

    Attributes
    ----------
    points : numpy.ndarray, shape (n, 12, 2)
        Image pixels.
    confidence : numpy.ndarray, shape (n, 12)
        Probability that a present point is within :attr:`Calibration.within`; without calibration the height of the peak, in
        [0, 1].
    present : numpy.ndarray, shape (n, 12)
        Probability that the point exists; without calibration the height of the peak.
    score : numpy.ndarray, shape (n, 12)
        Height of the peak.
    within : float or None
        Distance that the confidence is about, input pixels; None without calibration.
    matrices : numpy.ndarray, shape (n, 2, 3)
        From image to input pixels.
    heatmaps : numpy.ndarray, shape (n, 12, 64, 48), or None
    moved : numpy.ndarray of bool, shape (n, 12)
        Points that are not at their highest peak, because known postures speak against it.
    """

    points: np.ndarray
    confidence: np.ndarray
    present: np.ndarray
    score: np.ndarray
    within: float | None
    matrices: np.ndarray
    heatmaps: np.ndarray | None = None
    moved: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.points)

    def select(self, rows) -> Predictions:
        """Some of the images."""
        maps = None if self.heatmaps is None else self.heatmaps[rows]
        return Predictions(self.points[rows], self.confidence[rows], self.present[rows], self.score[rows], self.within,
                           self.matrices[rows], maps, None if self.moved is None else self.moved[rows])

    @property
    def scale(self) -> np.ndarray:
        """Input pixels per image pixel, (n,)."""
        return np.sqrt(np.abs(np.linalg.det(self.matrices[:, :, :2])))

    def deviations(self) -> np.ndarray:
        """Standard deviation (n, 12) along x and along y, image pixels, of a Gaussian that has the confidence within its distance.

        Without calibration the distance is taken as :data:`WITHIN`, and the numbers mean little.
        """
        p = np.clip(self.confidence, 1e-3, 1.0 - 1e-6)
        return (self.within or WITHIN) / np.sqrt(-2.0 * np.log1p(-p)) / self.scale[:, None]

    def alternatives(self, i: int, threshold: float = 0.2) -> dict[str, list[Peak]]:
        """All peaks of image i by point, in image pixels, highest first; needs ``keep_heatmaps``."""
        if self.heatmaps is None:
            raise ParameterError("the heat maps were not kept; predict with keep_heatmaps=True")
        back, found = invert(self.matrices[i]), {}
        for name, heatmap in zip(LANDMARKS, self.heatmaps[i], strict=True):
            tops = peaks(heatmap, threshold=threshold)
            xy = apply(back, to_input(np.array([[p.x, p.y] for p in tops]).reshape(-1, 2)))
            found[name] = [Peak(float(x), float(y), p.score) for (x, y), p in zip(xy, tops, strict=True)]
        return found


@dataclass
class Detector:
    """A trained network with everything its use depends on.

    Parameters
    ----------
    model : HRNet
        With twelve heat maps.
    sigma : float
        Of the heat maps it was trained with, heat-map pixels.
    margin : float
        Added around the box of the figure.
    calibration : Calibration, optional
    flip : bool
        Also look at the mirrored image and average: twice the time.
    notes : dict
        Where the weights come from; kept in the file.
    postures : Postures, optional
        Of the training pictures: points have to agree with them (:mod:`reconstruction.keypoints.postures`).
    """

    model: HRNet
    sigma: float
    margin: float = 0.0
    calibration: Calibration | None = None
    flip: bool = False
    notes: dict[str, Any] = field(default_factory=dict)
    postures: Postures | None = None

    def __post_init__(self):
        if self.model.arch.joints != len(LANDMARKS):
            raise ParameterError(f"the network has {self.model.arch.joints} heat maps; a detector needs {len(LANDMARKS)}")
        self.model.eval()

    @classmethod
    def load(cls, path: str | Path = SHIPPED) -> Detector:
        """A detector from its file, or the one shipped with the package.

        Raises
        ------
        InputError
            No weights are shipped with this installation.
        DataFileError
            There is no such file or it is no detector.
        """
        if path == SHIPPED:
            path = SHIPPED_FILE
            if not path.exists():
                raise InputError("this installation has no keypoint weights; train some with `mfar train keypoints`")
        try:
            state = torch.load(path, map_location="cpu", weights_only=True)
        except FileNotFoundError:
            raise DataFileError("there is no such file", path=path) from None
        except Exception as error:
            raise DataFileError(f"is not a file that torch can read safely: {str(error).splitlines()[0]}", path=path) from error
        if not isinstance(state, dict) or state.get("format") != FORMAT:
            raise DataFileError(f"is no detector (format '{FORMAT}'); published HRNet weights need training first", path=path)
        model = HRNet(Architecture.from_dict(state["arch"]))
        model.load_state_dict({k: v.float() if v.is_floating_point() else v for k, v in state["state"].items()})
        calibration = None if state["calibration"] is None else Calibration.from_dict(state["calibration"])
        known = state.get("postures")
        postures = None if known is None else Postures.from_dict({k: v.numpy() for k, v in known.items()})
        return cls(channels_last(model), state["sigma"], state["margin"], calibration, state["flip"], state["notes"], postures)

    def save(self, path: str | Path) -> None:
        """Write the detector: convolutions as 16-bit numbers, the rest as they are; atomically."""
        from reconstruction.state_dict import save_state

        state = {k: v.half() if v.ndim == 4 else v for k, v in self.model.state_dict().items()}
        save_state({
            "format": FORMAT, "arch": self.model.arch.to_dict(), "state": state,
            "sigma": float(self.sigma), "margin": float(self.margin),
            "calibration": None if self.calibration is None else asdict(self.calibration), "flip": self.flip, "notes": self.notes,
            "postures": None if self.postures is None else {k: torch.from_numpy(v) for k, v in self.postures.to_dict().items()},
        }, Path(path))

    @torch.no_grad()
    def heatmaps(self, images: np.ndarray) -> np.ndarray:
        """Normalised crops (b, 3, 256, 192) to heat maps (b, 12, 64, 48)."""
        x = torch.from_numpy(images).contiguous(memory_format=torch.channels_last)
        maps = self.model(x)
        if self.flip:
            mirrored = self.model(x.flip(3).contiguous(memory_format=torch.channels_last)).flip(3)
            maps = 0.5 * (maps + mirrored[:, list(MIRROR)])
        return maps.numpy()

    def predict(
        self,
        images: Sequence[str | Path | np.ndarray],
        boxes: Sequence[tuple[float, float, float, float] | None] | None = None,
        *,
        present: Sequence[Sequence[bool]] | np.ndarray | None = None,
        batch_size: int = 16,
        keep_heatmaps: bool = False,
        progress: Callable[..., None] | None = None,
    ) -> Predictions:
        """Find the points in images.

        Parameters
        ----------
        images : sequence of paths or arrays (h, w, 3) of red, green, blue bytes
        boxes : sequence of (x0, y0, x1, y1) or None, optional
            Of the figures, image pixels; whole images without.
        present : (n, 12) bool array, optional
            Points that each garment has (:func:`reconstruction.landmarks.points_of` its type): they have to agree with known
            postures. Without it every point is where its heat map is highest.
        batch_size : int
        keep_heatmaps : bool
            For :meth:`Predictions.alternatives` and pictures.
        progress : callable, optional
            ``progress(number of images done)`` after every batch.
        """
        boxes = boxes if boxes is not None else [None] * len(images)
        if len(boxes) != len(images):
            raise ParameterError(f"{len(boxes)} boxes for {len(images)} images; give one for each (None for a whole image)")
        there = None if present is None else np.asarray(present, dtype=bool)
        if there is not None and there.shape != (len(images), len(LANDMARKS)):
            raise ParameterError(f"present has shape {there.shape}; it must be {(len(images), len(LANDMARKS))}")
        points, scores, matrices, kept, moved = [], [], [], [], []
        for start in range(0, len(images), batch_size):
            crops, maps_to = [], []
            for item, box in zip(images[start : start + batch_size], boxes[start : start + batch_size], strict=True):
                image = item if isinstance(item, np.ndarray) else read_image(item)
                matrix = crop_matrix(box if box is not None else image_box(image.shape), self.margin)
                crops.append(warp(image, matrix))
                maps_to.append(matrix)
            maps = self.heatmaps(normalise(np.stack(crops)))
            found, score = decode(maps, sigma=self.sigma)
            found = to_input(found)
            other = np.zeros(score.shape, dtype=bool)
            if self.postures is not None and there is not None:
                for i in range(len(found)):
                    found[i], score[i], other[i] = self.postures.settle(found[i], score[i], maps[i], there[start + i])
            moved.append(other)
            points += [apply(invert(m), p) for m, p in zip(maps_to, found, strict=True)]
            scores.append(score)
            matrices += maps_to
            if keep_heatmaps:
                kept.append(maps)
            if progress is not None:
                progress(len(crops))
        score = np.concatenate(scores) if scores else np.zeros((0, len(LANDMARKS)))
        raw, c = np.clip(score, 0.0, 1.0), self.calibration
        return Predictions(
            np.array(points).reshape(-1, len(LANDMARKS), 2), raw if c is None else c.confidence(score),
            raw if c is None else c.present(score), score, None if c is None else c.within, np.array(matrices).reshape(-1, 2, 3),
            np.concatenate(kept) if kept else None,
            np.concatenate(moved) if moved else np.zeros((0, len(LANDMARKS)), dtype=bool),
        )

    def predict_samples(self, samples: Sequence[Sample], **options) -> Predictions:
        """:meth:`predict` for samples, with their boxes and the points that their garments have."""
        there = np.array([s.present for s in samples]).reshape(-1, len(LANDMARKS))
        return self.predict([s.image_path for s in samples], [s.box for s in samples], present=there, **options)

    def calibrate(self, samples: Sequence[Sample], within: float = WITHIN, predictions: Predictions | None = None) -> Calibration:
        """Fit and keep the calibration on samples that the network was not trained on.

        Raises
        ------
        ParameterError
            No sample has a present point.
        """
        p = predictions if predictions is not None else self.predict_samples(samples)
        score, near, present = outcomes(samples, p, within)
        if not present.any():
            raise ParameterError("no sample has a point that is present; calibration needs some")
        group = np.broadcast_to(np.array([s.identity for s in samples])[:, None], present.shape)
        confidence = choose(score[present], near[present], group[present])
        self.calibration = Calibration(confidence, fit_logistic(score, present), within)
        return self.calibration


def outcomes(samples: Sequence[Sample], p: Predictions, within: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Heights of the peaks, whether the point is within the distance (input pixels), whether it is present; (n, 12) each."""
    truth = np.array([s.keypoints for s in samples])
    present = np.array([s.present for s in samples])
    distance = np.linalg.norm(p.points - np.where(present[..., None], truth, 0.0), axis=-1) * p.scale[:, None]
    return p.score, (distance <= within) & present, present
