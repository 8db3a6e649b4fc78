"""Images, the affine map from an image to the network's input, and its random changes.

All maps are (2, 3) arrays from image pixels to input pixels. Edges are mapped to edges; pixel centres lie half a pixel inside them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mfar_fem.errors import ParameterError
from reconstruction.libraries import opencv

INPUT_SIZE = (256, 192)
"""Height and width of the network's input, pixels."""
MEAN = np.array([0.485, 0.456, 0.406], np.float32)
SPREAD = np.array([0.229, 0.224, 0.225], np.float32)
"""Mean and standard deviation of red, green and blue that the published HRNet weights were trained with (ImageNet)."""


def read_image(path: str | Path) -> np.ndarray:
    """An image file as red, green, blue bytes (h, w, 3), upright; :class:`reconstruction.images.ImageError` if it cannot be
    used."""
    from reconstruction.images import load

    return load(path).rgb


@dataclass(frozen=True)
class Augmentation:
    """Random changes of training images: the paper's rotation, mirroring, brightness; three more are off (:data:`WIDE`).

    Attributes
    ----------
    rotation : float
        Largest angle, degrees.
    flip : bool
        Mirror every second image, exchanging left and right.
    brightness : float
        Largest relative change.
    scale, shift : float
        Largest relative change of the size, and shift as a fraction of the crop.
    colour : float
        Largest relative change of red, green and blue each.
    """

    rotation: float = 15.0
    flip: bool = True
    brightness: float = 0.2
    scale: float = 0.0
    shift: float = 0.0
    colour: float = 0.0


NO_AUGMENTATION = Augmentation(0.0, False, 0.0)
WIDE = Augmentation(scale=0.2, shift=0.08, colour=0.25)
"""The paper's changes with others of size, place and colour: what a small network needs that has seen few pictures."""


def crop_matrix(box, margin: float = 0.1, size: tuple[int, int] = INPUT_SIZE) -> np.ndarray:
    """Affine map (2, 3) from image pixels to input pixels: the box, grown by the margin and to the input's aspect, fills the input.

    Edges are mapped to edges (pixel centres lie half a pixel inside them).
    """
    x0, y0, x1, y1 = (float(v) for v in box)
    if not (x1 > x0 and y1 > y0):
        raise ParameterError(f"the box {tuple(box)} is empty; it is x0, y0, x1, y1 with x0 < x1 and y0 < y1")
    h, w = size
    scale = min(w / ((x1 - x0) * (1 + margin)), h / ((y1 - y0) * (1 + margin)))
    centre = np.array([0.5 * (x0 + x1), 0.5 * (y0 + y1)])
    shift = 0.5 * np.array([w - 1.0, h - 1.0]) - scale * centre
    return np.array([[scale, 0.0, shift[0]], [0.0, scale, shift[1]]])


def image_box(shape) -> tuple[float, float, float, float]:
    """Box of a whole image (h, w, …), from edge to edge of its pixels."""
    return (-0.5, -0.5, shape[1] - 0.5, shape[0] - 0.5)


def apply(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Affine map (2, 3) of points (..., 2)."""
    return np.asarray(points, float) @ matrix[:, :2].T + matrix[:, 2]


def invert(matrix: np.ndarray) -> np.ndarray:
    """Inverse of an affine map (2, 3)."""
    inverse = np.linalg.inv(matrix[:, :2])
    return np.column_stack([inverse, -inverse @ matrix[:, 2]])


def compose(second: np.ndarray, first: np.ndarray) -> np.ndarray:
    """The affine map that does `first`, then `second`."""
    return np.column_stack([second[:, :2] @ first[:, :2], second[:, :2] @ first[:, 2] + second[:, 2]])


def warp(image: np.ndarray, matrix: np.ndarray, size: tuple[int, int] = INPUT_SIZE) -> np.ndarray:
    """Image (h, w, 3) through an affine map (2, 3) onto `size` (height, width); outside is the image's mean colour.

    Images that shrink by more than a half are blurred before, against aliasing.
    """
    cv2 = opencv()
    scale = np.sqrt(abs(np.linalg.det(matrix[:, :2])))
    if scale < 0.5:
        image = cv2.GaussianBlur(image, (0, 0), 0.4 / scale)
    sparse = image[:: max(1, image.shape[0] // 32), :: max(1, image.shape[1] // 32)]
    fill = [float(v) for v in sparse.mean(axis=(0, 1))]
    return cv2.warpAffine(image, matrix, size[::-1], flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=fill)


def normalise(crops: np.ndarray) -> np.ndarray:
    """Bytes (b, h, w, 3) to the network's numbers (b, 3, h, w), float32, in channels-last memory."""
    values = (crops.astype(np.float32) / 255.0 - MEAN) / SPREAD
    return values.transpose(0, 3, 1, 2)


def augment(matrix: np.ndarray, how: Augmentation, rng: np.random.Generator) -> tuple[np.ndarray, bool, np.ndarray]:
    """A random change of a crop's map: the new map, whether it mirrors, and the factors (3,) of red, green and blue.

    A mirrored map needs the points' left and right exchanged (``MIRROR``); :meth:`Dataset.crop` does it.
    """
    angle = np.deg2rad(rng.uniform(-how.rotation, how.rotation))
    flipped = bool(how.flip and rng.random() < 0.5)
    gain = 1.0 + rng.uniform(-how.brightness, how.brightness)
    factor = 1.0 + rng.uniform(-how.scale, how.scale)
    shift = rng.uniform(-how.shift, how.shift, 2) * np.array(INPUT_SIZE[::-1])
    cos, sin = factor * np.cos(angle), factor * np.sin(angle)
    linear = np.array([[cos, -sin], [sin, cos]])
    if flipped:
        linear = np.diag([-1.0, 1.0]) @ linear
    centre = 0.5 * (np.array(INPUT_SIZE[::-1]) - 1.0)
    change = np.column_stack([linear, centre - linear @ centre + shift])
    colour = rng.uniform(-how.colour, how.colour, 3) if how.colour else np.zeros(3)
    return compose(change, matrix), flipped, gain * (1.0 + colour)

