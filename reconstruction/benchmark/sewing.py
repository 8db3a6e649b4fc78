"""Panels meshed and sewn: one triangle mesh, welded along the seams, that knows its panel coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from .panel_mesh import mesh_panel
from .panels import Garment


@dataclass(frozen=True)
class SewnMesh:
    """A garment's mesh before it is worn.

    Parameters
    ----------
    garment : Garment
    faces : (m, 3) array of int
        Vertices, counter-clockwise seen from outside.
    uv : (m, 3, 2) array
        Panel coordinates of the corners, m: a seam vertex has different ones on its two sides.
    panel : (m,) array of int
        Index into ``garment.panels``.
    flat : (n, 3) array
        The garment laid flat, m.
    eased : (n,) bool array
        Vertices on a gathered seam.
    known_trim : (m, 3) array, optional
        ``corner_trim``, where it can no longer be found from the open edges.
    """

    garment: Garment
    faces: np.ndarray
    uv: np.ndarray
    panel: np.ndarray
    flat: np.ndarray
    eased: np.ndarray
    known_trim: np.ndarray | None = None

    @cached_property
    def edges(self) -> np.ndarray:
        """(k, 2) vertices of the edges, low then high, in a fixed order."""
        return self._edges[0]

    @cached_property
    def rest_lengths(self) -> np.ndarray:
        """(k,) length of the edges in the panels, m; of a seam edge the mean of its two sides."""
        return self._edges[1]

    @cached_property
    def _edges(self):
        corners = np.array([[0, 1], [1, 2], [2, 0]])
        ends = np.sort(self.faces[:, corners].reshape(-1, 2), axis=1)
        length = np.linalg.norm(self.uv[:, corners[:, 0]] - self.uv[:, corners[:, 1]], axis=2).reshape(-1)
        edges, where, count = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
        return edges, np.bincount(where.reshape(-1), length) / count

    @cached_property
    def boundary(self) -> np.ndarray:
        """(k, 2) edges with one face."""
        ends = np.sort(self.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        edges, count = np.unique(ends, axis=0, return_counts=True)
        return edges[count == 1]

    def unsewn(self) -> SewnMesh:
        """The same faces with every panel's vertices to itself, as the pieces lie when laid out.

        A seam may join a panel to itself, so vertices are told apart by their panel coordinates.
        """
        places = np.column_stack([np.repeat(self.panel, 3), np.round(self.uv.reshape(-1, 2) / 1e-7)])
        _, first, where = np.unique(places, axis=0, return_index=True, return_inverse=True)
        flat = self.corner_flat.reshape(-1, 3)[first]
        return SewnMesh(
            self.garment, where.reshape(-1, 3), self.uv, self.panel, flat, np.zeros(len(flat), dtype=bool), self.corner_trim
        )

    @cached_property
    def corner_flat(self) -> np.ndarray:
        """(m, 3, 3) where the corners of the faces lie when the garment is laid out, m."""
        out = np.empty((len(self.faces), 3, 3))
        for index, panel in enumerate(self.garment.panels):
            at = self.panel == index
            out[at] = self.garment.layout(panel.name, self.uv[at].reshape(-1, 2)).reshape(-1, 3, 3)
        return out

    @cached_property
    def corner_trim(self) -> np.ndarray:
        """(m, 3) distance of the corners of the faces from the nearest open edge of their panel, m (10 if it has none)."""
        if self.known_trim is not None:
            return self.known_trim
        n = len(self.flat)
        pairs = np.array([[0, 1], [1, 2], [2, 0]])
        ends = np.sort(self.faces[:, pairs], axis=2)
        face, side = np.nonzero(np.isin(ends[..., 0] * n + ends[..., 1], self.boundary[:, 0] * n + self.boundary[:, 1]))
        a, b = self.uv[face, pairs[side, 0]], self.uv[face, pairs[side, 1]]
        points = np.concatenate([a + t * (b - a) for t in (0.0, 0.25, 0.5, 0.75)])
        owner = np.tile(self.panel[face], 4)
        out = np.full(self.faces.shape, 10.0)
        for index in np.unique(owner):
            at = self.panel == index
            out[at] = cKDTree(points[owner == index]).query(self.uv[at])[0]
        return out

    def locate(self, panel: str, uv) -> tuple[int, np.ndarray]:
        """Face and barycentric coordinates of a point of a panel (the nearest face if it lies a hair outside)."""
        index = [p.name for p in self.garment.panels].index(panel)
        at = np.flatnonzero(self.panel == index)
        a, b, c = (self.uv[at, k] for k in range(3))
        area = _cross(b - a, c - a)
        point = np.asarray(uv, dtype=float)
        weights = np.stack([_cross(c - b, point - b), _cross(a - c, point - c), _cross(b - a, point - a)], axis=1) / area[:, None]
        best = int(np.argmax(weights.min(axis=1)))
        found = np.clip(weights[best], 0.0, None)
        return int(at[best]), found / found.sum()

    def warp(self, vertices: np.ndarray) -> np.ndarray:
        """Unit warp direction in every face of a placed mesh.

        Parameters
        ----------
        vertices : (n, 3) array

        Returns
        -------
        (m, 3) array
            Image of the panel's v axis.
        """
        p = vertices[self.faces]
        d1, d2 = self.uv[:, 1] - self.uv[:, 0], self.uv[:, 2] - self.uv[:, 0]
        det = _cross(d1, d2)[:, None]
        direction = (-d2[:, :1] * (p[:, 1] - p[:, 0]) + d1[:, :1] * (p[:, 2] - p[:, 0])) / det
        return direction / np.linalg.norm(direction, axis=1, keepdims=True)


def _cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def sew(garment: Garment, size: float) -> SewnMesh:
    """Mesh the draped panels and weld their seams.

    Parameters
    ----------
    garment : Garment
    size : float
        Edge length aimed at, m.

    Raises
    ------
    SurfaceError
        A panel cannot be meshed at that size.
    """
    count: dict[tuple[str, str], int] = {}
    for panel in garment.panels:
        for edge in panel.edges:
            count[panel.name, edge.name] = max(1, round(edge.length / size))
    for _ in range(2):  # an edge may be in two seams
        for seam in garment.seams:
            count[seam.first] = count[seam.second] = max(count[seam.first], count[seam.second])
    meshes, offset, total = {}, {}, 0
    for panel in garment.panels:
        if panel.draped:
            pieces = {e.name: count[panel.name, e.name] for e in panel.edges}
            meshes[panel.name], offset[panel.name] = mesh_panel(panel, size, pieces), total
            total += len(meshes[panel.name].uv)
    first, second, eased = [], [], []
    for seam in garment.seams:
        a = meshes[seam.first[0]].edges[seam.first[1]] + offset[seam.first[0]]
        b = meshes[seam.second[0]].edges[seam.second[1]] + offset[seam.second[0]]
        first.append(a)
        second.append(b[::-1] if seam.flip else b)
        eased.append(np.full(len(a), seam.eased))
    pairs = (np.concatenate(first), np.concatenate(second)) if first else (np.zeros(0, int), np.zeros(0, int))
    _, label = connected_components(coo_matrix((np.ones(len(pairs[0])), pairs), shape=(total, total)), directed=False)
    order = np.argsort(np.unique(label, return_index=True)[1])  # number the welded vertices by their first appearance
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    weld = rank[label]
    faces, uvs, owner, flat, n = [], [], [], np.zeros((len(order), 3)), np.zeros(len(order))
    for index, panel in enumerate(garment.panels):
        if not panel.draped:
            continue
        mesh = meshes[panel.name]
        local = mesh.faces if panel.outward > 0 else mesh.faces[:, ::-1]
        faces.append(weld[local + offset[panel.name]])
        uvs.append(mesh.uv[local])
        owner.append(np.full(len(local), index))
        where = weld[offset[panel.name] + np.arange(len(mesh.uv))]
        np.add.at(flat, where, garment.layout(panel.name, mesh.uv))
        np.add.at(n, where, 1.0)
    gathered = np.zeros(len(order), dtype=bool)
    if eased:
        gathered[weld[pairs[0][np.concatenate(eased)]]] = True
    return SewnMesh(garment, np.concatenate(faces), np.concatenate(uvs), np.concatenate(owner), flat / n[:, None], gathered)
