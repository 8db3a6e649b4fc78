"""The triangle mesh that the stages of the reconstruction hand on: vertices in metres and oriented triangles, nothing else."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import DataFileError, SurfaceError


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A triangle mesh; it may have holes, several pieces, or defects (:mod:`reconstruction.surface.repair` lists them).

    Parameters
    ----------
    vertices : (nv, 3) array
        m.
    faces : (nf, 3) array of int
        Vertex ids; their order fixes the outward normal.

    Raises
    ------
    SurfaceError
        Wrong shapes, a vertex id that does not exist, or a coordinate that is not finite.
    """

    vertices: np.ndarray
    faces: np.ndarray

    def __post_init__(self):
        vertices = np.ascontiguousarray(self.vertices, dtype=float).reshape(-1, 3)
        faces = np.ascontiguousarray(self.faces, dtype=np.int64).reshape(-1, 3)
        if not np.isfinite(vertices).all():
            bad = int(np.flatnonzero(~np.isfinite(vertices).all(axis=1))[0])
            raise SurfaceError(f"vertex {bad} is {vertices[bad].tolist()}; coordinates must be finite (m)")
        if len(faces) and not (faces.min() >= 0 and faces.max() < len(vertices)):
            raise SurfaceError(f"faces name vertices {faces.min()} to {faces.max()}; there are 0 to {len(vertices) - 1}")
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)

    @cached_property
    def area_vectors(self) -> np.ndarray:
        """(nf, 3) normals times area, m²."""
        a, b, c = (self.vertices[self.faces[:, i]] for i in range(3))
        return 0.5 * np.cross(b - a, c - a)

    @cached_property
    def areas(self) -> np.ndarray:
        """(nf,) m²."""
        return np.linalg.norm(self.area_vectors, axis=1)

    @cached_property
    def face_normals(self) -> np.ndarray:
        """(nf, 3) unit normals; zero where a face has no area."""
        return self.area_vectors / np.maximum(self.areas, 1e-300)[:, None]

    @cached_property
    def vertex_normals(self) -> np.ndarray:
        """(nv, 3) unit normals, mean of the faces weighted by area; zero where there are none."""
        total = np.zeros_like(self.vertices)
        for i in range(3):
            np.add.at(total, self.faces[:, i], self.area_vectors)
        return total / np.maximum(np.linalg.norm(total, axis=1), 1e-300)[:, None]

    @cached_property
    def _edges(self) -> tuple[np.ndarray, np.ndarray]:
        corners = np.sort(self.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        return np.unique(corners, axis=0, return_counts=True)

    @property
    def edges(self) -> np.ndarray:
        """(ne, 2) vertex ids, low then high."""
        return self._edges[0]

    @property
    def boundary_edges(self) -> np.ndarray:
        """(nb, 2) edges of one face only."""
        edges, count = self._edges
        return edges[count == 1]

    @property
    def boundary_vertices(self) -> np.ndarray:
        """Ids of the vertices on the boundary, ascending."""
        return np.unique(self.boundary_edges)

    def outwards(self) -> TriangleMesh:
        """A closed mesh with its faces turned so that its volume is positive."""
        volume = np.einsum("fi,fi->", self.vertices[self.faces].mean(axis=1), self.area_vectors)
        return self if volume > 0 else TriangleMesh(self.vertices, self.faces[:, ::-1])

    def submesh(self, keep) -> TriangleMesh:
        """Some of the faces (mask or ids) with the vertices they use, in their order."""
        faces = self.faces[keep]
        used, inverse = np.unique(faces, return_inverse=True)
        return TriangleMesh(self.vertices[used], inverse.reshape(-1, 3))

    def write(self, path: str | Path) -> Path:
        """Write as PLY, OBJ, STL or GLB by the ending of the name."""
        import trimesh

        trimesh.Trimesh(self.vertices, self.faces, process=False).export(str(path))
        return Path(path)

    @classmethod
    def read(cls, path: str | Path) -> TriangleMesh:
        """Read a mesh file as it is: nothing is merged or removed.

        Raises
        ------
        DataFileError
            It cannot be read or holds no triangles.
        """
        import trimesh

        try:
            mesh: Any = trimesh.load(str(path), force="mesh", process=False)
            faces = np.asarray(mesh.faces)
        except Exception as error:
            raise DataFileError(f"is no mesh that can be read: {error}", path=Path(path)) from error
        if not len(faces):
            raise DataFileError("holds no triangles", path=Path(path))
        return cls(np.asarray(mesh.vertices), faces)
