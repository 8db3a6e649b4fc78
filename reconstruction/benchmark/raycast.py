"""Ray casting on triangle meshes (embree), with exact hit points in double precision."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mfar_fem.errors import MissingDependencyError

from .camera import Camera


@dataclass(frozen=True)
class Hits:
    """What an image's rays meet, all of *Shape:* (height, width, ...).

    Parameters
    ----------
    face : (h, w) array of int
        Triangle, -1 for none.
    weights : (h, w, 3) array
        Barycentric coordinates (0 where nothing is hit).
    depth : (h, w) array
        Depth as the camera defines it, m, NaN for none.
    """

    face: np.ndarray
    weights: np.ndarray
    depth: np.ndarray


class Caster:
    """Rays against a fixed mesh.

    Parameters
    ----------
    vertices : (n, 3) array
        m.
    faces : (m, 3) array of int

    Raises
    ------
    MissingDependencyError
        embreex is not installed.
    """

    def __init__(self, vertices, faces):
        try:
            from embreex import rtcore_scene
            from embreex.mesh_construction import TriangleMesh
        except ImportError as error:
            raise MissingDependencyError("ray casting needs embreex: pip install 'mfar-fem[recon]'") from error
        self.vertices, self.faces = np.asarray(vertices, dtype=float), np.asarray(faces)
        self._scene = rtcore_scene.EmbreeScene()
        self._mesh = TriangleMesh(self._scene, np.ascontiguousarray(self.vertices[self.faces], dtype=np.float32))

    def first(self, origins, directions) -> np.ndarray:
        """(n,) first triangle met by each ray, -1 for none."""
        return self._scene.run(
            np.ascontiguousarray(origins, dtype=np.float32), np.ascontiguousarray(directions, dtype=np.float32)
        ).astype(np.int64)

    def nearest(self, origins, directions) -> tuple[np.ndarray, np.ndarray]:
        """First triangle met by each ray, -1 for none, and the distance to it along a unit direction, m (infinite for none)."""
        origins, directions = np.asarray(origins, dtype=float), np.asarray(directions, dtype=float)
        face = self.first(origins, directions)
        hit, t = face >= 0, np.full(len(face), np.inf)
        t[hit] = self._meet(face[hit], origins[hit], directions[hit])[0]
        return face, t

    def blocked(self, origins, directions, limit: float = np.inf) -> np.ndarray:
        """(n,) bool: whether a ray meets anything nearer than `limit` (m)."""
        if not np.isfinite(limit):
            return self.first(origins, directions) >= 0
        return self.nearest(origins, directions)[1] < limit

    def _meet(self, face, origins, directions):
        """Ray parameter and barycentric coordinates of rays with the planes of their triangles (Moeller & Trumbore 1997)."""
        a, b, c = (self.vertices[self.faces[face, k]] for k in range(3))
        e1, e2, s = b - a, c - a, origins - a
        h = np.cross(directions, e2)
        det = np.einsum("ij,ij->i", e1, h)
        det = np.where(np.abs(det) < 1e-14, 1e-14, det)
        q = np.cross(s, e1)
        v = np.einsum("ij,ij->i", s, h) / det
        w = np.einsum("ij,ij->i", directions, q) / det
        return np.einsum("ij,ij->i", e2, q) / det, np.stack([1 - v - w, v, w], axis=1)

    def image(self, camera: Camera, scale: int = 1) -> Hits:
        """Cast a camera's rays, `scale` x `scale` a pixel."""
        rows, columns = camera.window(self.vertices)
        origins, directions = camera.rays(scale, (rows, columns))
        found = self.first(origins, directions)
        hit = np.flatnonzero(found >= 0)
        t, w = self._meet(found[hit], origins[hit], directions[hit])
        face = np.full((camera.height * scale, camera.width * scale), -1)
        weights, depth = np.zeros((*face.shape, 3), dtype=np.float32), np.full(face.shape, np.nan)
        x, y = np.arange(columns.start * scale, columns.stop * scale), np.arange(rows.start * scale, rows.stop * scale)
        at = (y[hit // len(x)], x[hit % len(x)]) if len(x) else (hit, hit)
        face[at], weights[at] = found[hit], w
        depth[at] = (origins[hit] + t[:, None] * directions[hit]) @ camera.depth_row[:3] + camera.depth_row[3]
        return Hits(face, weights, depth)
