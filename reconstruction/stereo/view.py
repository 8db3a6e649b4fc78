"""A calibrated picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mfar_fem.errors import InputError
from reconstruction.libraries import optional
from reconstruction.matching.cameras import centre

ANGLE = np.radians(60.0)
"""Views whose axes differ by more are not compared with each other."""


@dataclass(frozen=True, eq=False)
class View:
    """A picture whose camera is known.

    Attributes
    ----------
    name : str
    image : (h, w, 3) float32 array
        0 to 1.
    camera : (3, 4) array
        World (m) to pixels; its third row gives depths in metres, positive in front (see :meth:`of`).
    mask : (h, w) bool array
        Where the object is.
    """

    name: str
    image: np.ndarray
    camera: np.ndarray
    mask: np.ndarray

    @classmethod
    def of(cls, name: str, image, camera, mask=None) -> View:
        """View with a normalised camera.

        Parameters
        ----------
        image : (h, w) or (h, w, 3) array
            uint8, or floats of 0 to 1.
        camera : (3, 4) array
            Any scale and sign.
        mask : (h, w) array, optional
            Non-zero where the object is; everything by default.

        Raises
        ------
        InputError
            Shapes that do not belong together, or a camera without a centre.
        """
        image = np.asarray(image)
        if image.ndim == 2:
            image = np.repeat(image[..., None], 3, axis=2)
        if image.ndim != 3 or image.shape[2] != 3:
            raise InputError(f"view '{name}': an image has shape (h, w) or (h, w, 3), not {image.shape}")
        pixels = image.astype(np.float32) / (255.0 if image.dtype == np.uint8 else 1.0)
        seen = np.ones(image.shape[:2], dtype=bool) if mask is None else np.asarray(mask) > 0
        if seen.shape != image.shape[:2]:
            raise InputError(f"view '{name}': the mask is {seen.shape[::-1]} pixels, the image {image.shape[1::-1]}")
        camera = np.asarray(camera, dtype=float)
        if camera.shape != (3, 4):
            raise InputError(f"view '{name}': a camera is a 3x4 matrix, not {camera.shape}")
        if not np.isfinite(camera).all():
            raise InputError(f"view '{name}': the numbers of its camera are not all finite")
        if np.linalg.matrix_rank(camera[:, :3] / np.abs(camera[:, :3]).max(axis=1, keepdims=True).clip(1e-300), tol=1e-9) < 3:
            raise InputError(f"view '{name}': the left 3x3 block of its camera is singular: it would have no centre in space")
        scale = np.linalg.norm(camera[2, :3]) * np.sign(np.linalg.det(camera[:, :3]))
        return cls(name, pixels, camera / scale, seen)

    @property
    def centre(self) -> np.ndarray:
        """Centre of projection (3,), m."""
        return centre(self.camera)

    @property
    def axis(self) -> np.ndarray:
        """Unit viewing direction (3,)."""
        return self.camera[2, :3]

    @property
    def size(self) -> tuple[int, int]:
        """Height and width, pixels."""
        return self.mask.shape[0], self.mask.shape[1]

    def project(self, points) -> tuple[np.ndarray, np.ndarray]:
        """Pixels (..., 2) and depths (...) along the axis, m, of points (..., 3)."""
        local = np.asarray(points) @ self.camera[:, :3].T + self.camera[:, 3]
        return local[..., :2] / local[..., 2:], local[..., 2]

    def rays(self, pixels) -> np.ndarray:
        """Directions (..., 3) of pixels (..., 2), of length one along the axis: point = centre + depth * ray."""
        pixels = np.asarray(pixels, dtype=float)
        local = np.concatenate([pixels, np.ones((*pixels.shape[:-1], 1))], axis=-1)
        return local @ np.linalg.inv(self.camera[:, :3]).T

    def grid_rays(self) -> np.ndarray:
        """Rays (h, w, 3) of all pixels, computed once."""
        return self._grid

    @cached_property
    def _grid(self) -> np.ndarray:
        h, w = self.size
        x, y = np.meshgrid(np.arange(w), np.arange(h))
        return self.rays(np.stack([x, y], axis=-1))

    def points(self, depth) -> np.ndarray:
        """World points (h, w, 3), m, of a depth map (h, w), m."""
        return self.centre + np.asarray(depth)[..., None] * self.grid_rays()

    def cropped(self, box: tuple[slice, slice]) -> View:
        """The part of rows and columns ``box``; its camera sees that part only."""
        rows, columns = box
        shift = np.array([[1.0, 0, -columns.start], [0, 1.0, -rows.start], [0, 0, 1.0]])
        return View(self.name, self.image[box], shift @ self.camera, self.mask[box])

    def shrunk(self, longest: int) -> View:
        """The picture made smaller, its longer side `longest` pixels (left alone where it is smaller), with its camera; the mask
        is where at least half a pixel was."""
        cv2 = optional("cv2", "pictures need")
        h, w = self.size
        factor = min(1.0, longest / max(h, w))
        new = (max(2, round(w * factor)), max(2, round(h * factor)))
        fx, fy = new[0] / w, new[1] / h
        centred = np.array([[fx, 0, 0.5 * (fx - 1)], [0, fy, 0.5 * (fy - 1)], [0, 0, 1.0]])  # centres of pixels
        image = cv2.resize(np.ascontiguousarray(self.image), new, interpolation=cv2.INTER_AREA)
        mask = cv2.resize(self.mask.astype(np.float32), new, interpolation=cv2.INTER_AREA)
        return View(self.name, image, centred @ self.camera, mask >= 0.5)

    def parallax(self, other: View, depth: float) -> float:
        """How far the other view's pixel of the middle of the mask moves, pixels for each metre of depth."""
        middle = np.argwhere(self.mask).mean(axis=0)[::-1]
        point = self.centre + np.array([depth - 0.01, depth + 0.01])[:, None] * self.rays(middle)
        return float(np.linalg.norm(np.diff(other.project(point)[0], axis=0)) / 0.02)

    def neighbours(self, views: Sequence[View]) -> list[View]:
        """The others that look from less than :data:`ANGLE` apart."""
        return [v for v in views if v is not self and np.arccos(np.clip(v.axis @ self.axis, -1, 1)) < ANGLE]
