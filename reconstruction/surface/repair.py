"""Repair a triangle mesh, and list what was done: a mesh comes out that passes `mfar_fem.surface.quality.check_surface`, or a
named error."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mfar_fem.errors import ParameterError, SurfaceError
from mfar_fem.surface.quality import NonManifoldEdgeError, check_surface
from reconstruction.surface.intersections import self_intersections
from reconstruction.surface.repair_steps import (
    Action,
    fill_holes,
    merged,
    oriented,
    split_sheets,
    without_degenerate,
    without_fins,
    without_specks,
)
from reconstruction.surface.triangles import TriangleMesh

__all__ = ["Action", "Repaired", "SelfIntersectionError", "repair"]


class SelfIntersectionError(SurfaceError):
    """Triangles that pass through each other and were not cured; ``ids`` are pairs of triangles."""


@dataclass(frozen=True, eq=False)
class Repaired:
    """A repaired mesh.

    Attributes
    ----------
    mesh : TriangleMesh
    actions : tuple of Action
        In the order they were done.
    coincident : (n,) array of int
        Vertices that lie on another on purpose: where sheets that met in one edge or vertex were parted.
    """

    mesh: TriangleMesh
    actions: tuple[Action, ...]
    coincident: np.ndarray

    def to_dict(self) -> dict[str, Any]:
        """Plain data without the mesh."""
        return {"vertices": len(self.mesh.vertices), "faces": len(self.mesh.faces), "actions": [a.to_dict() for a in self.actions]}


def repair(
    mesh: TriangleMesh, openings: int | None = None, merge: float = 1e-7, specks: float = 1e-3, split: bool = True, rounds: int = 4
) -> Repaired:
    """Mend a mesh step by step.

    Vertices in one place are joined; triangles given twice, without area, or hanging on as fins are taken out; neighbours are
    turned the same way; sheets that meet in an edge are parted; specks are removed; holes are closed; triangles that pass
    through each other are taken out with those around them and the hole is closed.

    Parameters
    ----------
    mesh : TriangleMesh
    openings : int, optional
        How many boundary loops are openings: the longest stay, the others are closed. None closes only the holes that the
        repair itself made.
    merge : float
        Vertices nearer than this part of the largest extent are one. Slits whose two sides touch are closed by that.
    specks : float
        Pieces with less than this part of the area are removed.
    split : bool
        Part sheets at edges of three and more triangles; otherwise such an edge is an error.
    rounds : int
        Attempts to cure triangles that pass through each other.

    Raises
    ------
    NonManifoldEdgeError
        Edges of three and more triangles with ``split=False``; ``ids`` are vertex pairs.
    InvertedTriangleError
        The surface has one side only (a Möbius band).
    SelfIntersectionError
        Triangles still pass through each other; ``ids`` are pairs of triangles.
    SurfaceError
        Nothing is left, or fewer boundary loops than ``openings``.
    ParameterError
        Options out of range.
    """
    if not 0 <= merge < 0.1 or not 0 <= specks < 1 or rounds < 0 or (openings is not None and openings < 0):
        raise ParameterError("merge must lie in [0, 0.1), specks in [0, 1), rounds and openings must not be negative")
    if not len(mesh.faces):
        raise SurfaceError("the mesh has no triangles")
    actions: list[Action] = []
    work = _basic(mesh, merge, specks, split, actions)
    before = len(_loop_list(work))
    if openings is not None:
        if before < openings:
            raise SurfaceError(f"{before} boundary loops where {openings} openings should be")
        work = fill_holes(work, openings, actions)
    for _ in range(rounds):
        pairs = self_intersections(work)
        if not len(pairs):
            break
        trial = _without_crossing(work, pairs, before if openings is None else openings, actions)
        if trial is None:
            break
        work = _basic(trial, merge, specks, split, actions)
    pairs = self_intersections(work)
    if len(pairs):
        raise SelfIntersectionError(f"{len(pairs)} pairs of triangles pass through each other", [tuple(p) for p in pairs.tolist()])
    coincident = _doubles(work)
    check_surface(work.vertices, work.faces, coincident, size=None)
    return Repaired(work, tuple(actions), coincident)


def _basic(mesh: TriangleMesh, merge: float, specks: float, split: bool, actions: list[Action]) -> TriangleMesh:
    work = merged(mesh, merge, actions)
    work = without_degenerate(work, actions)
    work = without_fins(work, actions)
    if not len(work.faces):
        raise SurfaceError("nothing is left of the mesh: all its triangles are without area or repeated")
    edges, count = np.unique(np.sort(work.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0, return_counts=True)
    if (count > 2).any() and not split:
        bad = [tuple(e) for e in edges[count > 2].tolist()]
        raise NonManifoldEdgeError(f"{len(bad)} edges of more than two triangles", bad)
    work = oriented(work, actions)
    work = split_sheets(work, actions)
    return without_specks(work, specks, actions)


def _loop_list(mesh: TriangleMesh) -> list[np.ndarray]:
    from reconstruction.surface.connectivity import boundary_loops

    return boundary_loops(mesh.faces)


def _without_crossing(mesh: TriangleMesh, pairs: np.ndarray, openings: int, actions: list[Action]) -> TriangleMesh | None:
    bad = np.unique(pairs)
    near = np.zeros(len(mesh.vertices), bool)
    near[mesh.faces[bad]] = True
    gone = near[mesh.faces].any(axis=1)
    if gone.sum() > 0.2 * len(mesh.faces):
        return None
    actions.append(
        Action(
            "triangles that pass through each other, and those around, taken out",
            int(gone.sum()),
            tuple(np.flatnonzero(gone).tolist()),
        )
    )
    rest = without_fins(mesh.submesh(~gone), actions)
    if not len(rest.faces):
        return None
    return fill_holes(oriented(rest, actions), openings, actions)


def _doubles(mesh: TriangleMesh) -> np.ndarray:
    _, inverse, count = np.unique(mesh.vertices, axis=0, return_inverse=True, return_counts=True)
    return np.flatnonzero(count[inverse.ravel()] > 1)
