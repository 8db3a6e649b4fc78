"""Bodies that move within a step: as far as the sheet lets them, and the sheet pushed along ahead of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import coo_matrix, diags
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

from mfar_fem.contact.collision_mesh import CollisionMesh
from mfar_fem.surface import Surface

MAX_PIECES = 400
"""Straight pieces into which a step's motion is divided at most."""
MAX_CUTS = 8
"""How often a piece that is not free is cut before the bodies stop."""
BEND = 0.1
"""How far, in mean edges of the sheet, a piece of the bodies' way may deviate from a straight line."""


class BodyAdvance:
    """Where the bodies' vertices are, and their way through one step.

    Attributes
    ----------
    time : float
        Time, s, for which the bodies are placed.
    vertices : (nb, 3) array
        Their vertices.
    placement : int
        Changes whenever they move.
    """

    def __init__(self, mesh: CollisionMesh, time: float):
        self._mesh, self.placement = mesh, 0
        self.time, self.vertices = float(time), mesh.placed(time)
        self._t0 = self._t1 = self.time

    def start(self, t0: float, t1: float) -> None:
        """Place the bodies at ``t0`` for a step to ``t1``."""
        if t0 != self.time:
            self.place(t0, self._mesh.placed(t0))
        self._t0, self._t1 = float(t0), float(t1)

    def place(self, time: float, vertices: np.ndarray) -> None:
        """Put the bodies' vertices for ``time`` in place."""
        if not np.array_equal(vertices, self.vertices):
            self.placement += 1
            self.vertices = vertices
        self.time = float(time)

    @property
    def fraction(self) -> float:
        """How much of the step's way is done, 0 to 1."""
        return 1.0 if self.time == self._t1 else (self.time - self._t0) / (self._t1 - self._t0)

    def piece(self, longest: float = np.inf) -> tuple[float, np.ndarray]:
        """Time and vertices (nb, 3) of the end of the next nearly straight piece, at most ``longest`` (m)."""
        goal = self._t1
        for _ in range(60):
            target = self._mesh.placed(goal)
            bend = max(self._deviation(goal, target, share) for share in (0.5, 0.29))  # two: whole turns look still
            way = np.abs(target - self.vertices).max(initial=0.0)
            if bend <= BEND * self._mesh.edge_length and way <= longest:
                break
            goal = self.time + 0.5 * (goal - self.time)
        return goal, target

    def _deviation(self, goal: float, target: np.ndarray, share: float) -> float:
        way = self._mesh.placed(self.time + share * (goal - self.time))
        return float(np.abs(way - (1.0 - share) * self.vertices - share * target).max(initial=0.0))

    def try_piece(self, goal: float, target: np.ndarray, free: Callable[[np.ndarray, float], float]) -> float:
        """Go to ``goal`` if ``free(target, 1)`` is 1, else as far as is free; the share of the piece that was gone.

        ``free(target, share)`` is the free fraction of the way to ``target``, which lies at ``share`` of this piece.
        """
        part = 1.0
        for _ in range(MAX_CUTS):
            share = free(target, part)
            if share == 1.0:
                self.place(goal, target)
                return part
            part *= share
            goal = self.time + share * (goal - self.time)
            target = self._mesh.placed(goal)
        return 0.0

    def advance(self, free: Callable[[np.ndarray, float], float]) -> float:
        """Move on while the way is free (``free`` as in :meth:`try_piece`); returns :attr:`fraction`."""
        for _ in range(MAX_PIECES):
            if self.time == self._t1 or self.try_piece(*self.piece(), free) < 1.0:
                break
        return self.fraction


def carried(surface: Surface, mesh: CollisionMesh, x: np.ndarray, held: np.ndarray, now: np.ndarray, target: np.ndarray,
            goal: float, reach: float) -> np.ndarray:
    """Displacement (nn, 3) that takes nodes out of the bodies' way.

    Nodes that would lie within ``reach`` (m) of a body at time ``goal`` move with its nearest vertex; held nodes stay; the others
    follow smoothly, over about three times the bodies' way.
    """
    driven, move = np.zeros(len(x), dtype=bool), np.zeros_like(x)
    for body, part in zip(mesh.bodies, mesh.body_vertices, strict=True):
        rows = slice(part.start - mesh.n_sheet, part.stop - mesh.n_sheet)
        way = target[rows] - now[rows]
        longest = float(np.linalg.norm(way, axis=1).max(initial=0.0))
        if longest == 0.0:
            continue
        distance, _ = body.signed_distance(x, goal)
        hit = np.flatnonzero((distance < reach + 0.5 * longest) & ~held)
        if len(hit):
            move[hit] = way[cKDTree(now[rows]).query(x[hit])[1]]
            driven[hit] = True
    if not driven.any():
        return move
    follow = ~(driven | held)
    i, j = np.triu_indices(surface.elements.shape[1], 1)
    a, b = surface.elements[:, i].ravel(), surface.elements[:, j].ravel()
    graph = coo_matrix((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape=(len(x), len(x))).tocsr()
    length = 3.0 * float(np.linalg.norm(move, axis=1).max())
    degree = np.asarray(graph.sum(axis=1)).ravel()
    laplacian = (diags(degree * (1.0 + (mesh.edge_length / length) ** 2)) - graph).tocsr()
    if follow.any():
        move[follow] = spsolve(laplacian[follow][:, follow].tocsc(), -(laplacian[follow][:, ~follow] @ move[~follow]))
    return move
