"""Samples and batches of their crops: the same seed, epoch and sample always give the same augmented crop."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from mfar_fem.errors import ParameterError
from reconstruction.keypoints.crops import (
    INPUT_SIZE,
    Augmentation,
    apply,
    augment,
    crop_matrix,
    image_box,
    normalise,
    read_image,
    warp,
)
from reconstruction.keypoints.heatmaps import SIGMA, encode, to_map
from reconstruction.landmarks import LANDMARKS, MIRROR


@dataclass(frozen=True)
class Sample:
    """One picture of one garment with the truth about its points.

    Attributes
    ----------
    image_path : pathlib.Path
    keypoints : numpy.ndarray, shape (12, 2)
        Image pixels; what stands at absent points is not used.
    visible, present : numpy.ndarray of bool, shape (12,)
        Seen in the picture; existing on this garment (a hidden point is present).
    style, split, identity : str
        Kind of source; "train", "validation" or "test"; what no other split may share.
    damage : int
        Level of decay.
    box : tuple of float, optional
        x0, y0, x1, y1 of the figure, image pixels; the whole image without it.
    """

    image_path: Path
    keypoints: np.ndarray
    visible: np.ndarray
    present: np.ndarray
    style: str = "mural"
    damage: int = 0
    split: str = "train"
    identity: str = ""
    box: tuple[float, float, float, float] | None = None

    def __post_init__(self):
        shapes = {"keypoints": (len(LANDMARKS), 2), "visible": (len(LANDMARKS),), "present": (len(LANDMARKS),)}
        for name, shape in shapes.items():
            array = np.asarray(getattr(self, name), float if name == "keypoints" else bool)
            if array.shape != shape:
                raise ParameterError(f"{self.image_path}: {name} has shape {array.shape}; it must be {shape}")
            object.__setattr__(self, name, array)
        if not np.isfinite(self.keypoints[self.present]).all():
            raise ParameterError(f"{self.image_path}: a point that is present has no finite coordinates")


@dataclass(frozen=True)
class Batch:
    """What one step of training gets.

    Attributes
    ----------
    images : numpy.ndarray, shape (b, 3, 256, 192), float32
    points : numpy.ndarray, shape (b, 12, 2)
        Input pixels.
    visible, present : numpy.ndarray of bool, shape (b, 12)
        Points that augmentation or the crop moved outside count as absent.
    matrices : numpy.ndarray, shape (b, 2, 3)
        From image to input pixels.
    """

    images: np.ndarray
    points: np.ndarray
    visible: np.ndarray
    present: np.ndarray
    matrices: np.ndarray

    def targets(self, sigma: float = SIGMA) -> np.ndarray:
        """Heat maps (b, 12, 64, 48) by formula (5); zero where absent."""
        size = (self.images.shape[2] // 4, self.images.shape[3] // 4)
        return encode(to_map(self.points), size, sigma, self.present)


@dataclass
class Dataset:
    """Samples with their crops: `dataset.batch(indices)` as they are, `dataset.batch(indices, epoch)` augmented.

    Parameters
    ----------
    samples : sequence of Sample
    augmentation : Augmentation
    seed : int
        With epoch and index it determines every random number.
    margin : float
        Added around the box, as a fraction of it.
    cache : bool
        Keep the decoded images in memory.
    """

    samples: Sequence[Sample]
    augmentation: Augmentation = field(default_factory=Augmentation)
    seed: int = 0
    margin: float = 0.0
    cache: bool = True

    def __post_init__(self) -> None:
        self._images: dict[int, np.ndarray] = {}

    def __len__(self) -> int:
        return len(self.samples)

    def image(self, i: int) -> np.ndarray:
        """Decoded image of a sample."""
        if i in self._images:
            return self._images[i]
        image = read_image(self.samples[i].image_path)
        if self.cache:
            self._images[i] = image
        return image

    def crop(self, i: int, epoch: int | None = None):
        """Crop bytes (256, 192, 3), points (12, 2) in it, visible, present, and the affine map from image to crop."""
        sample, image = self.samples[i], self.image(i)
        box = sample.box if sample.box is not None else image_box(image.shape)
        matrix, flipped, gain = crop_matrix(box, self.margin), False, np.ones(3)
        if epoch is not None:
            rng = np.random.default_rng((self.seed, epoch, i))
            matrix, flipped, gain = augment(matrix, self.augmentation, rng)
        crop = warp(image, matrix)
        if (gain != 1.0).any():
            crop = np.clip(crop.astype(np.float32) * gain.astype(np.float32), 0, 255).astype(np.uint8)
        points = apply(matrix, np.where(sample.present[:, None], sample.keypoints, 0.0))
        order = list(MIRROR) if flipped else slice(None)
        points, visible, present = points[order], sample.visible[order], sample.present[order]
        inside = ((points > -0.5) & (points < np.array(INPUT_SIZE[::-1]) - 0.5)).all(axis=1)
        return crop, points, visible & inside, present & inside, matrix

    def batch(self, indices: Sequence[int], epoch: int | None = None) -> Batch:
        """Several crops as one :class:`Batch`; augmented if an epoch is given."""
        crops, points, visible, present, matrices = zip(*(self.crop(i, epoch) for i in indices), strict=True)
        return Batch(normalise(np.stack(crops)), np.stack(points), np.stack(visible), np.stack(present), np.stack(matrices))

    def epoch(self, epoch: int, batch_size: int) -> Iterator[Batch]:
        """All samples once, in an order given by seed and epoch, augmented; the last batch may be smaller, but is never a
        single one (it then joins the one before: batch normalisation needs two)."""
        order = np.random.default_rng((self.seed, epoch)).permutation(len(self))
        starts = list(range(0, len(order), batch_size))
        if len(starts) > 1 and len(order) - starts[-1] == 1:
            starts.pop()
        for a, b in zip(starts, [*starts[1:], len(order)], strict=True):
            yield self.batch([int(i) for i in order[a:b]], epoch)

    def plain(self, batch_size: int) -> Iterator[Batch]:
        """All samples once, in order, as they are."""
        for start in range(0, len(self), batch_size):
            yield self.batch(range(start, min(start + batch_size, len(self))))
