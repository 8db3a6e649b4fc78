"""What can touch what: the sheet's collision vertices and the bodies' meshes as one ipctk mesh.

The sheet comes first, then the bodies as obstacles. A surface of order 2 touches with flat pieces: each element is divided into
``subdivision²`` triangles whose corners lie on the quadratic surface; a sparse displacement map evaluates the shape functions
there.
What cannot touch is never built: two obstacles, and without self-contact two parts of the sheet.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.sparse import block_diag, coo_matrix, csc_matrix, csr_matrix, identity
from scipy.sparse.csgraph import connected_components

from mfar_fem.contact.body import Plane
from mfar_fem.errors import InputError, MissingDependencyError
from mfar_fem.shell.tables import shape
from mfar_fem.surface import Surface
from mfar_fem.surface.mesh import LOCAL_EDGES

BODY_SIZE = 1.5
"""Edge length of the bodies' meshes in mean edges of the sheet: pairs, and with them the cost, grow with its inverse square."""


def ipctk():
    """The ipctk module (Li et al. 2020).

    Raises
    ------
    MissingDependencyError
        If it is not installed, or lacks what is needed here.
    """
    try:
        import ipctk as module
    except ImportError as error:
        raise MissingDependencyError("barrier contact needs ipctk: pip install 'mfar-fem[contact]'") from error
    if not hasattr(module, "make_vertex_patches_filter"):
        raise MissingDependencyError("barrier contact needs a newer ipctk (1.6): pip install --upgrade 'mfar-fem[contact]'")
    return module


@contextmanager
def threads(count: int | None):
    """Let ipctk use ``count`` threads (None: as many as before) within the block."""
    module = ipctk()
    before = module.get_num_threads()
    if count is not None and count != before:
        module.set_num_threads(count)
    try:
        yield
    finally:
        if module.get_num_threads() != before:
            module.set_num_threads(before)


@dataclass(frozen=True)
class Subdivision:
    """Flat pieces of the elements.

    Attributes
    ----------
    map : (m, nn) sparse array
        Collision vertices from nodes.
    triangles : (k, 3) array of int
        Collision vertex ids, oriented like the elements.
    elements : (k,) array of int
        Element each piece belongs to.
    """

    map: csr_matrix
    triangles: np.ndarray
    elements: np.ndarray


def subdivide(surface: Surface, count: int) -> Subdivision:
    """Divide every edge of every element into ``count`` parts.

    The first vertices are those of the surface, then those inside edges (from the low to the high vertex), then those inside
    elements: with ``count = order`` they are the nodes.
    """
    n, ne, nt, inner = len(surface.vertices), len(surface.edges), len(surface.triangles), count - 1
    lattice = [(i, j) for j in range(count + 1) for i in range(count + 1 - j)]
    index = {ij: k for k, ij in enumerate(lattice)}
    interior = [k for k, (i, j) in enumerate(lattice) if i > 0 and j > 0 and i + j < count]
    ids = np.empty((nt, len(lattice)), dtype=np.int64)
    corners = ((0, 0), (count, 0), (0, count))
    for a, corner in enumerate(corners):
        ids[:, index[corner]] = surface.triangles[:, a]
    for e, (a, b) in enumerate(LOCAL_EDGES):
        for s in range(1, count):
            at = tuple((np.array(corners[a]) * (count - s) + np.array(corners[b]) * s) // count)
            along = np.where(surface.edge_signs[:, e] > 0, s - 1, inner - s)
            ids[:, index[at]] = n + surface.element_edges[:, e] * inner + along
    ids[:, interior] = n + ne * inner + np.arange(nt * len(interior)).reshape(nt, -1)

    values, _ = shape(surface.order, np.array(lattice) / count)
    total = n + ne * inner + nt * len(interior)
    owner = np.full(total, -1)
    owner[ids.ravel()] = np.repeat(np.arange(nt), len(lattice))
    place = np.empty(total, dtype=np.int64)
    at_owner = owner[ids] == np.arange(nt)[:, None]
    place[ids[at_owner]] = np.broadcast_to(np.arange(len(lattice)), ids.shape)[at_owner]
    weights = values[place]
    nodes = surface.elements[owner]
    rows = np.repeat(np.arange(total), nodes.shape[1])
    keep = weights.ravel() != 0.0
    weights_map = coo_matrix((weights.ravel()[keep], (rows[keep], nodes.ravel()[keep])), shape=(total, len(surface.nodes))).tocsr()

    pieces = [(index[i, j], index[i + 1, j], index[i, j + 1]) for i, j in lattice if i + j < count]
    pieces += [(index[i + 1, j], index[i + 1, j + 1], index[i, j + 1]) for i, j in lattice if i + j < count - 1]
    return Subdivision(weights_map, ids[:, np.array(pieces)].reshape(-1, 3), np.repeat(np.arange(nt), len(pieces)))


def facet(body, deviation: float) -> float:
    """Longest edge, m, of flat facets that deviate from a round body by at most ``deviation`` (m); inf where there is no radius."""
    radius = getattr(body, "radius", None)
    return np.inf if radius is None else float(np.sqrt(8.0 * radius * deviation))


class CollisionMesh:
    """Sheet and bodies as ipctk sees them.

    Parameters
    ----------
    surface : Surface
    bodies : sequence of Body
    self_contact : bool
        Whether parts of the sheet can touch each other.
    subdivision : int, optional
        Parts of an edge; default: the order of the surface (vertices = nodes).
    body_size : float, optional
        Edge length wanted of the bodies' meshes, m; default: 1.5 mean edges of the sheet's elements, whatever their order.

    Attributes
    ----------
    mesh : ipctk.CollisionMesh
    n_sheet : int
        Collision vertices of the sheet; those of ``bodies[i]`` are ``body_vertices[i]`` (slices).
    rest : (n, 3) array
        Reference sheet, bodies in their reference placement.
    triangles : (k, 3) array of int
        All triangles; the first ``len(elements)`` are the sheet's, piece ``i`` of element ``elements[i]``.
    components : list of arrays of int
        Connected parts of the sheet, by collision vertices.
    """

    def __init__(self, surface: Surface, bodies: Sequence = (), self_contact: bool = False, subdivision: int | None = None,
                 body_size: float | None = None, deviation: float = np.inf):
        ipc = ipctk()
        count = surface.order if subdivision is None else subdivision
        if not (isinstance(count, (int, np.integer)) and count >= 1):
            raise InputError(f"subdivision must be a whole number of parts of an edge, at least 1, got {subdivision!r}")
        pieces = subdivide(surface, int(count))
        sheet = pieces.map @ surface.nodes
        edges = ipc.edges(pieces.triangles.astype(np.int32))
        self.edge_length = float(np.linalg.norm(sheet[edges[:, 1]] - sheet[edges[:, 0]], axis=1).mean())
        # a plane is exact on two triangles, and every edge of its mesh would cost time
        size = body_size or BODY_SIZE * count * self.edge_length
        limit = np.inf if body_size else deviation
        meshes = [b.mesh(b.extent if isinstance(b, Plane) else min(size, facet(b, limit))) for b in bodies]
        self.bodies, self.self_contact, self.elements = tuple(bodies), bool(self_contact), pieces.elements
        self.n_sheet, self.n_nodes = len(sheet), len(surface.nodes)
        ends = self.n_sheet + np.cumsum([0] + [len(v) for v, _ in meshes])
        self.body_vertices = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        self.body_rest = [np.asarray(v, dtype=float) for v, _ in meshes]
        self.rest = np.asfortranarray(np.vstack([sheet, *self.body_rest]))
        parts = [pieces.triangles] + [np.asarray(t) + a for (_, t), a in zip(meshes, ends, strict=False)]
        self.triangles = np.asfortranarray(np.vstack(parts), dtype=np.int32)
        self.map = None if count == surface.order else pieces.map
        self.mesh = self._build(ipc)
        a, b = edges.T
        _, label = connected_components(coo_matrix((np.ones(len(a)), (a, b)), shape=(self.n_sheet, self.n_sheet)), directed=False)
        self.components = [np.flatnonzero(label == i) for i in range(label.max() + 1)]

    def _build(self, ipc):
        edges = np.asfortranarray(ipc.edges(self.triangles))
        if self.map is None:
            mesh = ipc.CollisionMesh(self.rest, edges, self.triangles)
        else:
            obstacles = identity(len(self.rest) - self.n_sheet)
            mesh = ipc.CollisionMesh(self.rest, edges, self.triangles, csc_matrix(block_diag([self.map, obstacles])))
        if self.self_contact:
            mesh.can_collide = ipc.make_static_obstacle_filter(self.n_sheet)
        else:
            patches = (np.arange(len(self.rest)) >= self.n_sheet).astype(np.int32)
            mesh.can_collide = ipc.make_vertex_patches_filter(patches)
        # an obstacle's share of a contact must not grow with its triangles: at most that of the sheet
        for name, sheet in (("vertex_areas", np.arange(len(self.rest)) < self.n_sheet), ("edge_areas", edges[:, 0] < self.n_sheet)):
            areas = np.array(getattr(mesh, name))
            areas[~sheet] = np.minimum(areas[~sheet], areas[sheet].mean())
            setattr(mesh, name, areas)
        return mesh

    def placed(self, t: float) -> np.ndarray:
        """Vertices (nb, 3) of all bodies at time ``t``, s."""
        return np.vstack([np.zeros((0, 3)), *(b.placed(v, t) for b, v in zip(self.bodies, self.body_rest, strict=True))])

    def vertices(self, x: np.ndarray, bodies: np.ndarray) -> np.ndarray:
        """Collision vertices (n, 3), column-major, from nodes (nn, 3) and body vertices (nb, 3)."""
        out = np.empty_like(self.rest)
        out[: self.n_sheet] = x if self.map is None else self.map @ x
        out[self.n_sheet:] = bodies
        return out

    def nodal_gradient(self, g: np.ndarray) -> np.ndarray:
        """Gradient (3 nn,) on the nodes from one on the collision vertices (3 n,)."""
        full = g if self.map is None else self.mesh.to_full_dof(g)
        return full[: 3 * self.n_nodes]

    def nodal_triplets(self, H: csc_matrix) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows, columns (int32) and values of a Hessian on the nodes from one on the collision vertices; obstacles dropped."""
        full = H if self.map is None else self.mesh.to_full_dof(H)
        k = 3 * self.n_nodes
        part = full[:k, :k].tocoo()
        return part.row.astype(np.int32), part.col.astype(np.int32), part.data
