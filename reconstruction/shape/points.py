"""The fitted shape as a dense oriented point set that says of every point where it comes from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import DataFileError
from reconstruction.shape.fit import Shape
from reconstruction.surface.connectivity import boundary_loops

SOURCES = ("stereo", "outline", "landmark", "template")
"""What supports a point: depth from several pictures, an outline, a landmark; ``template``: no picture, the prior alone."""
PRIOR = "template"


@dataclass(frozen=True, eq=False)
class PointSet:
    """Oriented points.

    Attributes
    ----------
    points, normals : (n, 3) arrays
        m; unit, outwards.
    sigma : (n,) array
        Standard deviation, m.
    source : (n,) array of int
        Index into :data:`SOURCES`.
    panel : (n,) array of int
        Of the template.
    warp : (n, 3) array
        Unit warp direction.
    openings : tuple of (k, 3) arrays
        Closed curves along the free edges, m.
    """

    points: np.ndarray
    normals: np.ndarray
    sigma: np.ndarray
    source: np.ndarray
    panel: np.ndarray
    warp: np.ndarray
    openings: tuple[np.ndarray, ...]

    def shares(self) -> dict[str, float]:
        """Share of the points by source."""
        return {name: float((self.source == i).mean()) for i, name in enumerate(SOURCES)}

    def write(self, folder: Path) -> None:
        """``points.npz`` and, for other programs, ``points.vtu``."""
        import meshio

        loops: dict[str, Any] = {f"opening_{i}": loop for i, loop in enumerate(self.openings)}
        np.savez_compressed(
            folder / "points.npz",
            points=self.points,
            normals=self.normals,
            sigma=self.sigma,
            source=self.source,
            panel=self.panel,
            warp=self.warp,
            **loops,
        )
        data = {"normals": self.normals, "sigma": self.sigma, "source": self.source.astype(float), "warp": self.warp}
        meshio.Mesh(self.points, [("vertex", np.arange(len(self.points))[:, None])], data).write(folder / "points.vtu")

    @classmethod
    def read(cls, path) -> PointSet:
        """Read ``points.npz``.

        Raises
        ------
        DataFileError
            It is not one.
        """
        try:
            with np.load(path) as stored:
                known = {key: stored[key] for key in stored}
            loops = tuple(known.pop(key) for key in sorted(known) if key.startswith("opening_"))
            return cls(openings=loops, **known)
        except (OSError, ValueError, TypeError) as error:
            raise DataFileError(f"is no point set that can be read: {error}", path=Path(path)) from error


def sample(shape: Shape, vertices=None) -> PointSet:
    """Vertices, middles of edges and of triangles of a fitted shape.

    Parameters
    ----------
    shape : Shape
    vertices : (nv, 3) array, optional
        In other axes than the world's.
    """
    mesh = shape.sewn.mesh(shape.vertices if vertices is None else vertices)
    edges, x = mesh.edges, mesh.vertices
    normals = np.concatenate([mesh.vertex_normals, mesh.vertex_normals[edges].sum(axis=1), mesh.face_normals])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
    code = np.array([SOURCES.index(name) for name in shape.source])
    of_face = np.zeros(len(x), dtype=int)
    of_face[mesh.faces.ravel()] = np.repeat(np.arange(len(mesh.faces)), 3)
    face = np.concatenate([of_face, of_face[edges[:, 0]], np.arange(len(mesh.faces))])
    source = np.concatenate([code, code[edges].max(axis=1), code[mesh.faces].max(axis=1)])  # no better than the worst of them
    sigma = np.concatenate([shape.sigma, shape.sigma[edges].max(axis=1), shape.sigma[mesh.faces].max(axis=1)])
    warp = shape.sewn.warp_in_space(x)
    openings = tuple(x[loop] for loop in boundary_loops(mesh.faces))
    return PointSet(
        np.concatenate([x, x[edges].mean(axis=1), x[mesh.faces].mean(axis=1)]),
        normals,
        sigma,
        source,
        shape.sewn.panel[face],
        warp[face],
        openings,
    )
