"""The figure inside a garment, made to fit: whatever of it comes too near to the cloth or through it is taken away.

A reconstruction puts cloth where the pictures show it and the figure where its landmarks are; the two overlap by millimetres to
centimetres at shoulders and arms. Contact wants a start without intersection, so the figure gives way: with its signed distance
``f`` (negative inside) and the distance ``d`` from the cloth, the fitted figure is ``max(f, c - d) < 0`` on a grid, its surface
found by marching cubes. It is closed, inside the figure, and touches the cloth nowhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mfar_fem.errors import SurfaceError
from reconstruction.libraries import optional
from reconstruction.surface.intersections import self_intersections
from reconstruction.surface.triangles import TriangleMesh

SPACING = 0.02
"""Grid of the figure, m."""
ATTEMPTS = ((1.0, 0.1), (1.0, 0.25), (1.0, 0.5), (1.0, 0.9), (0.7, 0.5), (0.7, 0.9), (0.5, 0.9))
"""What is tried until no triangle meets the cloth: grid, of that spacing, and room besides the clearance, of the grid's. Cloth
falls by the room that it is given: as little as will do comes first."""
LEAST = 0.1
"""Of the clearance: what has to be left of it where triangles come nearer than the grid's points."""


@dataclass(frozen=True)
class FittedBody:
    """A figure that a garment does not touch.

    Attributes
    ----------
    mesh : TriangleMesh
        Closed, m.
    taken : float
        Share of the figure's volume that was taken away.
    moved : float
        Share of its surface (vertices of the grid's surface) that lies more than one grid cell inside the figure.
    distance : float
        Least distance of its vertices from the cloth, m.
    """

    mesh: TriangleMesh
    taken: float
    moved: float
    distance: float

    @property
    def facts(self) -> dict[str, float]:
        """Plain values."""
        return {"volume_taken": self.taken, "surface_moved": self.moved, "least_distance_m": self.distance}


def fit_body(body: TriangleMesh, cloth: TriangleMesh, clearance: float, spacing: float = SPACING) -> FittedBody:
    """Take from a figure what is too near to the cloth.

    Parameters
    ----------
    body : TriangleMesh
        Closed, normals outwards, m.
    cloth : TriangleMesh
        m.
    clearance : float
        Distance that is asked for, m; some of it is lost between the points of the grid, down to :data:`LEAST`.
    spacing : float
        Of the grid, m; features below it are lost. Where its triangles still meet the cloth between their corners, more room and
        finer grids are tried (:data:`ATTEMPTS`).

    Returns
    -------
    FittedBody

    Raises
    ------
    SurfaceError
        The figure is not closed, nothing of it is left, or it meets the cloth on the finest grid too.
    """
    if len(body.boundary_edges):
        raise SurfaceError(f"the figure is not closed: {len(body.boundary_edges)} edges have one face only")
    grids: dict[float, _Grid] = {}
    for finer, room in ATTEMPTS:
        if finer not in grids:
            grids[finer] = _Grid.of(body, cloth, spacing * finer)
        found = _fitted(grids[finer], body, cloth, clearance + room * spacing * finer)
        meeting = crossings(found.mesh, cloth)
        if not meeting and found.distance >= LEAST * clearance:
            return found
    raise SurfaceError(f"{meeting} triangles of the figure still meet the cloth on a grid of {1e3 * spacing * finer:.3g} mm, or "
                       f"come nearer to it than {1e3 * LEAST * clearance:.2g} mm")  # fmt: skip


def crossings(first: TriangleMesh, second: TriangleMesh) -> int:
    """Pairs of triangles of two meshes that pass through each other."""
    n = len(first.faces)
    both = TriangleMesh(np.concatenate([first.vertices, second.vertices]),
                        np.concatenate([first.faces, second.faces + len(first.vertices)]))  # fmt: skip
    pairs = self_intersections(both)
    return int(((pairs < n).sum(axis=1) == 1).sum()) if len(pairs) else 0


@dataclass(frozen=True, eq=False)
class _Grid:
    """Signed distance from a figure and, near it, distance from a cloth (inf elsewhere), (nx, ny, nz) each, m; `low` is the first
    point."""

    low: np.ndarray
    spacing: float
    figure: np.ndarray
    cloth: np.ndarray

    @classmethod
    def of(cls, body: TriangleMesh, cloth: TriangleMesh, spacing: float) -> _Grid:
        igl = optional("igl", "fitting a figure needs")
        low, high = body.vertices.min(axis=0) - 2 * spacing, body.vertices.max(axis=0) + 2 * spacing
        axes = [np.arange(a, b + spacing, spacing) for a, b in zip(low, high, strict=True)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        points = grid.reshape(-1, 3)
        f = np.asarray(igl.signed_distance(points, body.vertices, body.faces, _sign(igl))[0])
        near = f < 2 * spacing  # elsewhere the figure is not
        d = np.full(len(points), np.inf)
        d[near] = np.sqrt(igl.point_mesh_squared_distance(points[near], cloth.vertices, cloth.faces)[0])
        return cls(low, spacing, f.reshape(grid.shape[:3]), d.reshape(grid.shape[:3]))


def _fitted(grid: _Grid, body: TriangleMesh, cloth: TriangleMesh, away: float) -> FittedBody:
    """The figure without what is nearer to the cloth than `away` on a grid: marching cubes places its vertices between the grid's
    points by linear interpolation."""
    igl, measure = optional("igl", "fitting a figure needs"), optional("skimage.measure", "fitting a figure needs")
    field = np.maximum(grid.figure, away - grid.cloth)
    inside, before = int((field < 0).sum()), int((grid.figure < 0).sum())
    if not inside:
        raise SurfaceError("nothing of the figure is left inside the garment: are both in metres and in one place?")
    v, t, _, _ = measure.marching_cubes(field, 0.0, spacing=(grid.spacing,) * 3)
    mesh = _largest_pieces(TriangleMesh(v + grid.low, np.asarray(t, dtype=np.int64)).outwards())
    gap = float(np.sqrt(igl.point_mesh_squared_distance(mesh.vertices, cloth.vertices, cloth.faces)[0]).min())
    depth = np.asarray(igl.signed_distance(mesh.vertices, body.vertices, body.faces, _sign(igl))[0])
    return FittedBody(mesh, 1.0 - inside / before, float((depth < -grid.spacing).mean()), gap)


def _sign(igl):
    """Sign by winding number: right for slightly broken meshes too."""
    return igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_FAST_WINDING_NUMBER


def _largest_pieces(mesh: TriangleMesh, least: float = 0.01) -> TriangleMesh:
    """Without pieces whose area is below a share of the whole: crumbs that the cloth cut off."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    edges = mesh.edges
    n = len(mesh.vertices)
    graph = coo_matrix((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n, n))
    piece = connected_components(graph, directed=False)[1][mesh.faces[:, 0]]
    area = np.bincount(piece, mesh.areas)
    return mesh.submesh(area[piece] >= least * mesh.areas.sum())
