"""Perspective and affine cameras with one interface: project, rays, depth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mfar_fem.errors import InputError

FAR = 5.0
"""Distance of an affine camera's reference plane from the world's origin, m."""


@dataclass(frozen=True)
class Camera:
    """A camera.

    Parameters
    ----------
    matrix : (3, 4) array
        Projection: world (m, homogeneous) to pixels; the last row of an affine camera is (0, 0, 0, 1).
    depth_row : (4,) array
        Depth of a world point, m: the third camera coordinate, or for an affine camera the distance along the viewing ray from the
        plane across it that lies :data:`FAR` before the origin.
    width, height : int
        Pixels; x runs to the right and y downwards from the centre of the top-left pixel.
    intrinsics, rotation, translation : arrays or None
        K (3, 3), R (3, 3), t (3,) of a perspective camera, ``matrix = K [R | t]``.
    """

    matrix: np.ndarray
    depth_row: np.ndarray
    width: int
    height: int
    intrinsics: np.ndarray | None = None
    rotation: np.ndarray | None = None
    translation: np.ndarray | None = None

    @property
    def affine(self) -> bool:
        """Whether rays are parallel."""
        return self.rotation is None

    @property
    def centre(self) -> np.ndarray:
        """(3,) where the rays of a perspective camera meet, m."""
        return -np.linalg.solve(self.matrix[:, :3], self.matrix[:, 3])

    def project(self, points) -> tuple[np.ndarray, np.ndarray]:
        """Pixels (n, 2) and depths (n,) of (n, 3) points."""
        homogeneous = np.concatenate([np.asarray(points, dtype=float), np.ones((len(points), 1))], axis=1)
        image = homogeneous @ self.matrix.T
        return image[:, :2] / image[:, 2:], homogeneous @ self.depth_row

    def unproject(self, pixels, depth) -> np.ndarray:
        """World points (n, 3) of pixels (n, 2) at depths (n,)."""
        pixels, depth = np.asarray(pixels, dtype=float), np.asarray(depth, dtype=float)
        if self.affine:
            system = np.stack([self.matrix[0], self.matrix[1], self.depth_row])
            inverse, shift = np.linalg.inv(system[:, :3]), system[:, 3]
            a, b, c = pixels[:, 0] - shift[0], pixels[:, 1] - shift[1], depth - shift[2]
        else:  # pixel times depth = K (R x + t)
            inverse, shift = np.linalg.inv(self.matrix[:, :3]), self.matrix[:, 3]
            a, b, c = pixels[:, 0] * depth - shift[0], pixels[:, 1] * depth - shift[1], depth - shift[2]
        return np.stack([inverse[k, 0] * a + inverse[k, 1] * b + inverse[k, 2] * c for k in range(3)], axis=1)

    def window(self, points) -> tuple[slice, slice]:
        """Rows and columns of the picture that contain the projections of points (n, 3)."""
        pixels = self.project(points)[0]
        low = np.clip(np.floor(pixels.min(axis=0)).astype(int) - 1, 0, [self.width, self.height])
        high = np.clip(np.ceil(pixels.max(axis=0)).astype(int) + 2, 0, [self.width, self.height])
        return slice(low[1], high[1]), slice(low[0], high[0])

    def rays(self, scale: int = 1, window: tuple[slice, slice] | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Origins and unit directions of the rays through ``scale`` x ``scale`` points of every pixel, row by row.

        Parameters
        ----------
        scale : int
        window : (slice, slice), optional
            Rows and columns, in pixels; all by default.

        Returns
        -------
        origins, directions : (n, 3) arrays
        """
        rows, columns = window or (slice(0, self.height), slice(0, self.width))
        x = (np.arange(columns.start * scale, columns.stop * scale) + 0.5) / scale - 0.5
        y = (np.arange(rows.start * scale, rows.stop * scale) + 0.5) / scale - 0.5
        pixels = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        if self.affine:
            origins = self.unproject(pixels, np.zeros(len(pixels)))
            return origins, np.broadcast_to(self.depth_row[:3] / np.linalg.norm(self.depth_row[:3]), origins.shape)
        far = self.unproject(pixels, np.ones(len(pixels)))
        centre = self.centre
        directions = far - centre
        return np.broadcast_to(centre, far.shape), directions / np.linalg.norm(directions, axis=1, keepdims=True)

    def towards(self, points) -> np.ndarray:
        """Unit directions (n, 3) from points to the camera."""
        points = np.asarray(points, dtype=float)
        if self.affine:
            return np.broadcast_to(-self.depth_row[:3] / np.linalg.norm(self.depth_row[:3]), points.shape)
        back = self.centre - points
        return back / np.linalg.norm(back, axis=1, keepdims=True)

    def to_dict(self) -> dict[str, Any]:
        """JSON form."""
        listed = lambda a: None if a is None else np.asarray(a).tolist()  # noqa: E731
        return {
            "kind": "affine" if self.affine else "perspective",
            "width": self.width,
            "height": self.height,
            "P": listed(self.matrix),
            "depth_row": listed(self.depth_row),
            "K": listed(self.intrinsics),
            "R": listed(self.rotation),
            "t": listed(self.translation),
        }

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Camera:
        """The camera of a JSON form."""
        array = lambda k: None if data[k] is None else np.array(data[k], dtype=float)  # noqa: E731
        return cls(
            np.array(data["P"], dtype=float),
            np.array(data["depth_row"], dtype=float),
            int(data["width"]),
            int(data["height"]),
            array("K"),
            array("R"),
            array("t"),
        )


def axes(azimuth: float, elevation: float) -> np.ndarray:
    """Right, down and forward axes as rows, for a camera in front of the body at azimuth 0 (towards its left if positive).

    Parameters
    ----------
    azimuth, elevation : float
        Degrees.
    """
    a, e = np.radians(azimuth), np.radians(elevation)
    forward = -np.array([np.sin(a) * np.cos(e), -np.cos(a) * np.cos(e), np.sin(e)])
    right = np.array([np.cos(a), np.sin(a), 0.0])
    return np.stack([right, np.cross(forward, right), forward])


def perspective(points, azimuth: float, elevation: float, distance: float, width: int, height: int, fill: float = 0.93) -> Camera:
    """A camera that looks at points from a distance and is zoomed so that they fill the image.

    Parameters
    ----------
    points : (n, 3) array
        What must be in the picture, m.
    azimuth, elevation, distance : float
        Degrees, degrees, m from the middle of the points' box.
    width, height : int
        Pixels.
    fill : float
        Fraction of the height or width that is used.
    """
    points = np.asarray(points, dtype=float)
    rotation = axes(azimuth, elevation)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    translation = -rotation @ (middle - distance * rotation[2])
    local = points @ rotation.T + translation
    if local[:, 2].min() <= 0.1:
        raise InputError(f"a camera {distance} m away stands inside the figure; use a larger distance")
    flat = local[:, :2] / local[:, 2:]
    low, high = flat.min(axis=0), flat.max(axis=0)
    focal = float((fill * np.array([width, height]) / (high - low)).min())
    centre = (np.array([width, height]) - 1) / 2 - focal * (low + high) / 2
    intrinsics = np.array([[focal, 0, centre[0]], [0, focal, centre[1]], [0, 0, 1.0]])
    pose = np.column_stack([rotation, translation])
    return Camera(intrinsics @ pose, pose[2], width, height, intrinsics, rotation, translation)


def oblique(
    points,
    azimuth: float,
    elevation: float,
    width: int,
    height: int,
    recede=(0.0, 0.0),
    squeeze: float = 1.0,
    shear: float = 0.0,
    roll: float = 0.0,
    fill: float = 0.93,
) -> Camera:
    """A parallel projection with wrong foreshortening.

    With right r, down w and depth d of a view, the picture is ``s A (r + k_x d, w + k_y d)``, ``A = rotation(roll) [[1, shear], [0,
    squeeze]]``: receding lines run off along k as in cavalier drawing, heights are squeezed and sheared. It is one 3 x 4 affine
    camera, so points, rays and depth all follow it exactly.

    Parameters
    ----------
    points : (n, 3) array
        What must be in the picture, m.
    azimuth, elevation, roll : float
        Degrees.
    width, height : int
        Pixels.
    recede : (float, float)
        k_x, k_y.
    squeeze, shear : float
    fill : float
        Fraction of the height or width that is used.
    """
    view = axes(azimuth, elevation)
    linear = view[:2] + np.asarray(recede, dtype=float)[:, None] * view[2]
    c, s = np.cos(np.radians(roll)), np.sin(np.radians(roll))
    linear = np.array([[c, -s], [s, c]]) @ np.array([[1.0, shear], [0.0, squeeze]]) @ linear
    flat = np.asarray(points, dtype=float) @ linear.T
    low, high = flat.min(axis=0), flat.max(axis=0)
    scale = float((fill * np.array([width, height]) / (high - low)).min())
    offset = (np.array([width, height]) - 1) / 2 - scale * (low + high) / 2
    ray = np.cross(linear[0], linear[1])  # along it the picture does not change
    ray = ray * np.sign(ray @ view[2]) / np.linalg.norm(ray)
    matrix = np.vstack([np.column_stack([scale * linear, offset]), [0, 0, 0, 1.0]])
    return Camera(matrix, np.append(ray, FAR), width, height)
