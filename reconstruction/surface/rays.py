"""First hits of rays on a mesh."""

from __future__ import annotations

import numpy as np

from reconstruction.libraries import optional
from reconstruction.surface.triangles import TriangleMesh


class Rays:
    """A mesh that any number of rays are cast at."""

    def __init__(self, mesh: TriangleMesh):
        trimesh = optional("trimesh", "casting rays needs")
        embree = optional("trimesh.ray.ray_pyembree", "casting rays needs")
        self.mesh = mesh
        self._embree = embree.RayMeshIntersector(trimesh.Trimesh(mesh.vertices, mesh.faces, process=False))

    def first(self, origins, rays) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """First triangles, how far along, and from which side.

        Parameters
        ----------
        origins : (n, 3) or (3,) array
            m.
        rays : (n, 3) array
            Directions of any length.

        Returns
        -------
        face : (n,) array of int
            -1: none.
        along : (n,) array
            Point = origin + along * ray, on the triangle's plane; inf: none.
        sign : (n,) array
            Of normal times ray; 0: none.
        """
        rays = np.ascontiguousarray(rays, dtype=float)
        origins = np.broadcast_to(np.asarray(origins, dtype=float), rays.shape)
        face = np.asarray(self._embree.intersects_first(origins, rays))
        there = np.flatnonzero(face >= 0)
        normal, corner = self.mesh.area_vectors[face[there]], self.mesh.vertices[self.mesh.faces[face[there], 0]]
        facing = np.einsum("ni,ni->n", normal, rays[there])
        along, sign = np.full(len(rays), np.inf), np.zeros(len(rays))
        reach = np.einsum("ni,ni->n", normal, corner - origins[there])
        along[there] = reach / np.where(np.abs(facing) > 1e-15, facing, np.inf)
        sign[there] = np.sign(facing)
        return face, along, sign
