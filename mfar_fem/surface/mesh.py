"""The reference mid-surface: nodes, oriented triangles, edges, and the warp direction of every element.

Topology comes from scikit-fem; the surface mapping (isoparametric, order 1 or 2, in three dimensions) is our own, because
scikit-fem maps triangles to the plane and sorts their vertices, which loses the orientation of the surface.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property

import numpy as np
from skfem import MeshTri

from mfar_fem.errors import SurfaceError

LOCAL_EDGES = np.array([[0, 1], [1, 2], [2, 0]])
"""Vertices of the three local edges, counter-clockwise; the mid-side nodes 3, 4, 5 lie on them."""


class Surface:
    """Reference mid-surface of a shell.

    Parameters
    ----------
    vertices : (nv, 3) array
        Coordinates in metres.
    triangles : (nt, 3) array of int
        Vertex ids; their order fixes the normal (right-hand rule) and is kept.
    order : {1, 2}
        1: flat facets; 2: quadratic, with a node at the middle of every edge.
    warp : (3,) or (nt, 3) array, optional
        Warp (grain) direction, global or one an element; it is projected on the tangent plane. Default: the x axis.
    midpoint : callable, optional
        ``midpoint(a, b) -> (ne, 3)`` places the mid-side nodes of the edges between vertices ``a`` and ``b`` (arrays of
        ids) on a curved surface; default: straight edges.
    boundary : mapping of str to array of vertex ids, optional
        Named parts of the boundary, such as ``left``.
    check : bool
        Run the checks of :mod:`mfar_fem.surface.quality` (named errors with the ids of what is wrong).
    coincident : int array
        Vertices that may lie on others (the faces of a slit).
    size : (low, high) or None
        Plausible range of the largest dimension, m: outside it wrong units are suspected; None: any size is right.

    Raises
    ------
    SurfaceError
        If the mesh is unusable; the subclass names the reason.
    """

    def __init__(self, vertices, triangles, order: int = 1, warp=(1.0, 0.0, 0.0),
                 midpoint: Callable | None = None, boundary: Mapping | None = None, check: bool = True,
                 coincident=(), size: tuple[float, float] | None = (1e-3, 20.0)):
        vertices = np.ascontiguousarray(vertices, dtype=float)
        triangles = np.ascontiguousarray(triangles, dtype=np.int64)
        if vertices.ndim != 2 or vertices.shape[1] != 3:
            raise SurfaceError(f"vertices must have shape (nv, 3), got {vertices.shape}")
        if triangles.ndim != 2 or triangles.shape[1] != 3:
            raise SurfaceError(f"triangles must have shape (nt, 3), got {triangles.shape}")
        if order not in (1, 2):
            raise SurfaceError(f"order must be 1 or 2, got {order!r}")
        if check:
            from mfar_fem.surface.quality import check_surface

            check_surface(vertices, triangles, coincident=coincident, size=size)
        self.vertices, self.triangles, self.order = vertices, triangles, order
        mesh = MeshTri(vertices.T[:2].copy(), triangles.T.copy(), sort_t=False, validate=False)
        self.edges = np.ascontiguousarray(mesh.facets.T.astype(np.int64))
        """(ne, 2) vertex ids, low then high."""
        self.element_edges = np.ascontiguousarray(mesh.t2f.T.astype(np.int64))
        """(nt, 3) edge id of the local edges."""
        self.edge_elements = np.ascontiguousarray(mesh.f2t.T.astype(np.int64))
        """(ne, 2) elements on both sides, -1 outside."""
        first, second = triangles[:, LOCAL_EDGES[:, 0]], triangles[:, LOCAL_EDGES[:, 1]]
        self.edge_signs = np.where(first < second, 1.0, -1.0)
        """(nt, 3) +1 where the element runs along its edge from the low to the high vertex."""
        if order == 2:
            a, b = self.edges.T
            mid = 0.5 * (vertices[a] + vertices[b]) if midpoint is None else np.asarray(midpoint(a, b), dtype=float)
            self.nodes = np.vstack([vertices, mid])
            self.elements = np.hstack([triangles, len(vertices) + self.element_edges])
        else:
            self.nodes, self.elements = vertices, triangles
        self.warp = self._element_field(warp)
        self.boundary = {k: np.asarray(v, dtype=np.int64) for k, v in (boundary or {}).items()}

    @classmethod
    def from_pattern(cls, pattern, order: int = 1, warp=(1.0, 0.0, 0.0), check: bool = True,
                     size: tuple[float, float] | None = (1e-3, 20.0)) -> Surface:
        """Surface of a :class:`mfar_fem.surface.patterns.Pattern`; mid-side nodes lie on its mapping."""
        def midpoint(a, b):
            return pattern.midpoints(np.column_stack([a, b]))

        return cls(pattern.vertices, pattern.triangles, order, warp, midpoint, pattern.boundary, check,
                   coincident=pattern.boundary.get("slit0", ()), size=size)

    def _element_field(self, field) -> np.ndarray:
        field = np.asarray(field, dtype=float)
        if field.shape not in ((3,), (len(self.triangles), 3)):
            raise SurfaceError(f"warp must have shape (3,) or ({len(self.triangles)}, 3), got {field.shape}")
        field = np.broadcast_to(field, (len(self.triangles), 3))
        length = np.linalg.norm(field, axis=1)
        bad = np.flatnonzero(~(length > 0))
        if len(bad):
            raise SurfaceError(f"warp is zero or not finite in {len(bad)} elements, first {bad[:5].tolist()}", bad)
        return field / length[:, None]

    def __repr__(self) -> str:
        counts = f"{len(self.triangles)} triangles, {len(self.nodes)} nodes, {len(self.edges)} edges"
        return f"Surface(order={self.order}, {counts})"

    @cached_property
    def boundary_edges(self) -> np.ndarray:
        """Ids of the edges with one element only, shape (nb,)."""
        return np.flatnonzero(self.edge_elements[:, 1] < 0)

    def edges_of(self, vertices) -> np.ndarray:
        """Ids of the boundary edges both of whose vertices belong to ``vertices`` (ids or a boundary's name)."""
        inside = np.zeros(len(self.vertices), dtype=bool)
        inside[self._vertex_ids(vertices)] = True
        edges = self.boundary_edges
        return edges[inside[self.edges[edges]].all(axis=1)]

    def nodes_of(self, vertices) -> np.ndarray:
        """Nodes (vertices and, at order 2, the mid-side nodes between them) of a part of the boundary."""
        ids = self._vertex_ids(vertices)
        if self.order == 1:
            return ids
        return np.concatenate([ids, len(self.vertices) + self.edges_of(ids)])

    def _vertex_ids(self, vertices) -> np.ndarray:
        if isinstance(vertices, str):
            if vertices not in self.boundary:
                raise SurfaceError(f"the surface has no boundary named '{vertices}'; it has {sorted(self.boundary)}")
            return self.boundary[vertices]
        return np.asarray(vertices, dtype=np.int64)

    @cached_property
    def areas(self) -> np.ndarray:
        """Area of every (straight-sided) triangle, m², shape (nt,)."""
        a, b, c = (self.vertices[self.triangles[:, i]] for i in range(3))
        return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)

    @cached_property
    def edge_lengths(self) -> np.ndarray:
        """Length of every (straight) edge, m, shape (ne,)."""
        return np.linalg.norm(self.vertices[self.edges[:, 1]] - self.vertices[self.edges[:, 0]], axis=1)
