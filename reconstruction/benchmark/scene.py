"""What a picture is taken of: cloth and figure as one mesh with what shading needs, and the buffers of one view."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from .camera import Camera
from .raycast import Caster
from .sewing import SewnMesh


@dataclass(frozen=True)
class Scene:
    """Cloth first, then figure.

    Parameters
    ----------
    mesh : SewnMesh
    cloth : (n, 3) array
        Cloth vertices, m (draped, or laid flat).
    body_vertices, body_faces : arrays
        Closed mesh of the figure; empty for a laid-out garment.
    head : (3,) array
        Middle of the head, m.
    stature : float
        m.
    skirt : bool
        The figure wears a skirt of two colours.
    """

    mesh: SewnMesh
    cloth: np.ndarray
    body_vertices: np.ndarray
    body_faces: np.ndarray
    head: np.ndarray = field(default_factory=lambda: np.zeros(3))
    stature: float = 1.7
    skirt: bool = False

    @cached_property
    def vertices(self) -> np.ndarray:
        """(n, 3) all vertices, m."""
        return np.concatenate([self.cloth, self.body_vertices])

    @cached_property
    def faces(self) -> np.ndarray:
        """(m, 3) all faces."""
        return np.concatenate([self.mesh.faces, self.body_faces + len(self.cloth)])

    @cached_property
    def caster(self) -> Caster:
        """Rays against everything."""
        return Caster(self.vertices, self.faces)

    @cached_property
    def normals(self) -> np.ndarray:
        """(n, 3) unit vertex normals, weighted by area."""
        p = self.vertices[self.faces]
        face = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        total = np.zeros_like(self.vertices)
        for k in range(3):
            np.add.at(total, self.faces[:, k], face)
        return total / (np.linalg.norm(total, axis=1, keepdims=True) + 1e-30)

    @cached_property
    def open_sky(self) -> np.ndarray:
        """(n, 2) share of the hemisphere that is not blocked within 0.5 m, over and under the surface at every vertex."""
        rays = 20
        k = np.arange(rays) + 0.5
        z, turn = np.sqrt(1 - k / rays), k * np.pi * (3 - np.sqrt(5))  # cosine-weighted spiral
        local = np.stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], axis=1)
        n = self.normals
        helper = np.where(np.abs(n[:, :1]) < 0.7, [[1.0, 0, 0]], [[0, 1.0, 0]])
        t1 = np.cross(n, helper)
        t1 /= np.linalg.norm(t1, axis=1, keepdims=True) + 1e-30
        frame = np.stack([t1, np.cross(n, t1), n], axis=1)
        free = np.ones((len(n), 2))
        for side, sign in ((0, 1.0), (1, -1.0)):
            at = np.arange(len(n)) if side == 0 else np.arange(len(self.cloth))
            directions = np.einsum("rk,nkj->nrj", local * [1, 1, sign], frame[at]).reshape(-1, 3)
            origins = np.repeat(self.vertices[at] + 0.004 * sign * n[at], rays, axis=0)
            free[at, side] = 1 - self.caster.blocked(origins, directions, 0.5).reshape(-1, rays).mean(axis=1)
        return free


@dataclass(frozen=True)
class View:
    """Buffers of one picture, all (h, w, ...), at `scale` samples a pixel in each direction.

    Parameters
    ----------
    face : int array
        Triangle of the scene, -1 for background.
    position, normal : (h, w, 3) arrays
        m; normals smooth, turned towards the camera.
    depth : array
        As the camera defines it, m; NaN for background.
    sky, trim : arrays
        Interpolated open sky of the visible side and distance from an open edge.
    uv : (h, w, 2) array
        Panel coordinates, m; NaN off the cloth.
    toward : (h, w, 3) array
        Unit direction to the camera.
    cloth : bool array
        The garment is there.
    under : bool array
        A triangle's inner side is seen.
    """

    face: np.ndarray
    position: np.ndarray
    normal: np.ndarray
    depth: np.ndarray
    sky: np.ndarray
    trim: np.ndarray
    uv: np.ndarray
    toward: np.ndarray
    cloth: np.ndarray
    under: np.ndarray

    @property
    def hit(self) -> np.ndarray:
        """(h, w) bool: something is there."""
        return self.face >= 0

    @property
    def body(self) -> np.ndarray:
        """(h, w) bool: the figure is there."""
        return self.hit & ~self.cloth


def look(scene: Scene, camera: Camera, scale: int = 1) -> View:
    """Cast a camera's rays and interpolate what the styles need."""
    hits = scene.caster.image(camera, scale)
    shape = hits.face.shape
    at = hits.face >= 0
    face, w = hits.face[at], hits.weights[at].astype(float)
    corner = scene.faces[face]
    mix = lambda values: np.einsum("nk,nk...->n...", w, values[corner])  # noqa: E731
    position = mix(scene.vertices)
    p = scene.vertices[corner]
    flat = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    toward = camera.towards(position)
    under = np.einsum("ij,ij->i", flat, toward) < 0
    normal = mix(scene.normals) * np.where(under, -1.0, 1.0)[:, None]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True) + 1e-30
    sky = mix(scene.open_sky)
    n_cloth = len(scene.mesh.faces)
    cloth = face < n_cloth
    uv = np.full((len(face), 2), np.nan)
    uv[cloth] = np.einsum("nk,nkj->nj", w[cloth], scene.mesh.uv[face[cloth]])
    trim = np.full(len(face), 10.0)
    trim[cloth] = np.einsum("nk,nk->n", w[cloth], scene.mesh.corner_trim[face[cloth]])
    full = lambda values, fill: _spread(values, at, shape, fill)  # noqa: E731
    return View(
        hits.face,
        full(position, 0.0),
        full(normal, 0.0),
        hits.depth,
        full(np.where(under, sky[:, 1], sky[:, 0]), 1.0),
        full(trim, 10.0),
        full(uv, np.nan),
        full(toward, 0.0),
        full(cloth, False),
        full(under, False),
    )


def _spread(values, at, shape, fill):
    out = np.full((*shape, *values.shape[1:]), fill, dtype=values.dtype)
    out[at] = values
    return out


def shrink(image: np.ndarray, scale: int) -> np.ndarray:
    """Average `scale` x `scale` blocks of an image (h, w, ...)."""
    h, w = image.shape[0] // scale, image.shape[1] // scale
    return image.reshape(h, scale, w, scale, *image.shape[2:]).mean(axis=(1, 3))
