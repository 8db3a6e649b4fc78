"""Checks of a triangle mesh before it becomes a shell: each failure is a named error with the ids concerned.

`check_surface` runs them all, in the order in which one failure would make the next report misleading.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from mfar_fem.errors import SurfaceError

LOCAL_EDGES = np.array([[0, 1], [1, 2], [2, 0]])


class DegenerateTriangleError(SurfaceError):
    """Triangles without area; ``ids`` are triangles."""


class InvertedTriangleError(SurfaceError):
    """Triangles that face the other way than their neighbours, or are folded over in a plane mesh; ``ids`` are
    triangles."""


class NonManifoldEdgeError(SurfaceError):
    """Edges shared by more than two triangles; ``ids`` are (low, high) vertex pairs."""


class DuplicateVertexError(SurfaceError):
    """Different vertices in the same place; ``ids`` are (first, second) vertex pairs."""


class UnreferencedVertexError(SurfaceError):
    """Vertices no triangle uses; ``ids`` are vertices."""


class SuspectUnitsError(SurfaceError):
    """The mesh is so large or so small that its unit is probably not the metre."""


def check_surface(
    vertices: np.ndarray,
    triangles: np.ndarray,
    coincident: Iterable[int] = (),
    size: tuple[float, float] | None = (1e-3, 20.0),
    flatness: float = 1e-6,
) -> None:
    """Raise the error that describes what is wrong with a triangle mesh, or return None.

    Parameters
    ----------
    vertices : (n, 3) array
        Positions in metres.
    triangles : (m, 3) array of int
        Vertex ids.
    coincident : iterable of int
        Vertices that may lie on top of another on purpose (the two faces of a slit).
    size : (smallest, largest) or None
        Accepted longest side of the bounding box, m; None skips that check.
    flatness : float
        A triangle whose height is below this fraction of its longest edge counts as degenerate.

    Raises
    ------
    DegenerateTriangleError, NonManifoldEdgeError, InvertedTriangleError, DuplicateVertexError, UnreferencedVertexError
        See the classes.
    SuspectUnitsError
        Longest side of the bounding box outside `size`.
    SurfaceError
        Wrong array shapes, no triangle, ids out of range, or positions that are not finite.
    """
    vertices, triangles = np.asarray(vertices, dtype=float), np.asarray(triangles)
    check_arrays(vertices, triangles)
    check_referenced(vertices, triangles)
    check_degenerate(vertices, triangles, flatness)
    check_manifold(triangles)
    check_orientation(vertices, triangles)
    check_duplicates(vertices, coincident)
    if size is not None:
        check_units(vertices, size)


def check_arrays(vertices: np.ndarray, triangles: np.ndarray) -> None:
    """Shapes, ids within range, finite positions."""
    if vertices.ndim != 2 or vertices.shape[1] != 3 or triangles.ndim != 2 or triangles.shape[1] != 3:
        raise SurfaceError(f"expected (n, 3) vertices and (m, 3) triangles, not {vertices.shape} and {triangles.shape}")
    if not len(triangles):
        raise SurfaceError("the mesh has no triangles")
    bad = np.flatnonzero(((triangles < 0) | (triangles >= len(vertices))).any(axis=1))
    if len(bad):
        raise SurfaceError(f"{_some(bad, 'triangle')} with vertex ids outside 0 to {len(vertices) - 1}", bad)
    bad = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    if len(bad):
        raise SurfaceError(f"{_some(bad, 'vertex')} with coordinates that are not finite", bad)


def check_referenced(vertices: np.ndarray, triangles: np.ndarray) -> None:
    """Every vertex belongs to a triangle."""
    used = np.zeros(len(vertices), bool)
    used[triangles] = True
    if not used.all():
        bad = np.flatnonzero(~used)
        raise UnreferencedVertexError(f"{_some(bad, 'vertex')} used by no triangle: remove them", bad)


def check_degenerate(vertices: np.ndarray, triangles: np.ndarray, flatness: float = 1e-6) -> None:
    """Every triangle has three distinct vertices and a height above `flatness` times its longest edge."""
    corners = vertices[triangles]
    longest2 = ((corners - corners[:, [1, 2, 0]]) ** 2).sum(axis=2).max(axis=1)
    double_area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    bad = np.flatnonzero(~(double_area > flatness * longest2))
    if len(bad):
        raise DegenerateTriangleError(
            f"{_some(bad, 'triangle')} without area (a repeated vertex, or three on one line): remove or remesh", bad
        )


def check_manifold(triangles: np.ndarray) -> None:
    """No edge belongs to more than two triangles, and no triangle is there twice."""
    same = np.sort(triangles, axis=1)
    _, first, count = np.unique(same, axis=0, return_index=True, return_counts=True)
    if (count > 1).any():
        bad = np.unique(np.sort(same[first[count > 1]][:, LOCAL_EDGES].reshape(-1, 2), axis=1), axis=0)
        message = f"{(count > 1).sum()} triangle(s) given more than once: remove the repeats"
        raise NonManifoldEdgeError(message, _pairs(bad))
    edges, count = np.unique(np.sort(triangles[:, LOCAL_EDGES].reshape(-1, 2), axis=1), axis=0, return_counts=True)
    bad = edges[count > 2]
    if len(bad):
        raise NonManifoldEdgeError(
            f"{_some(_pairs(bad), 'edge')} shared by more than two triangles: a shell needs one sheet", _pairs(bad)
        )


def check_orientation(vertices: np.ndarray, triangles: np.ndarray) -> None:
    """Neighbours run through their common edge in opposite directions, and a plane mesh is not folded over."""
    directed = triangles[:, LOCAL_EDGES].reshape(-1, 2)
    key = directed[:, 0].astype(np.int64) * len(vertices) + directed[:, 1]
    _, inverse, count = np.unique(key, return_inverse=True, return_counts=True)
    if (count > 1).any():
        bad = _minority(triangles)
        if bad is None:
            bad = np.unique(np.flatnonzero(count[inverse] > 1) // 3)
            raise InvertedTriangleError(f"the surface has one side only (a Möbius band): {_some(bad, 'triangle')}", bad)
        raise InvertedTriangleError(
            f"{_some(bad, 'triangle')} turned against the neighbours: swap two of its vertices each", bad
        )
    normal = np.cross(*(vertices[triangles[:, i]] - vertices[triangles[:, 0]] for i in (1, 2)))
    extent = np.ptp(vertices, axis=0).max()
    centred = vertices - vertices.mean(axis=0)
    axis = np.linalg.eigh(centred.T @ centred)[1][:, 0]
    if np.ptp(vertices @ axis) > 1e-7 * extent:
        return  # curved: a fold is not an error
    side = normal @ axis
    bad = np.flatnonzero(side * np.sign(np.median(np.sign(side)) or 1.0) < 0)
    if len(bad):
        raise InvertedTriangleError(f"{_some(bad, 'triangle')} folded over in a plane mesh", bad)


def check_duplicates(vertices: np.ndarray, coincident: Iterable[int] = (), tolerance: float = 1e-9) -> None:
    """No two vertices closer than `tolerance` times the size of the mesh, except those in `coincident`."""
    from scipy.spatial import cKDTree

    extent = np.ptp(vertices, axis=0).max()
    pairs = cKDTree(vertices).query_pairs(tolerance * extent, output_type="ndarray")
    bad = pairs[~np.isin(pairs, np.fromiter(coincident, np.int64)).any(axis=1)]
    if len(bad):
        bad = bad[np.lexsort(bad.T[::-1])]
        raise DuplicateVertexError(
            f"{_some(_pairs(bad), 'pair')} of vertices in the same place: merge them (the sheet is torn there), "
            "or name them as 'coincident' if the slit is meant",
            _pairs(bad),
        )


def check_units(vertices: np.ndarray, size: tuple[float, float] = (1e-3, 20.0)) -> None:
    """The longest side of the bounding box lies within `size` (m)."""
    extent = np.ptp(vertices, axis=0).max()
    if extent > size[1]:
        raise SuspectUnitsError(f"the mesh is {extent:g} m long: coordinates are metres, are these mm? (then x 0.001)")
    if extent < size[0]:
        raise SuspectUnitsError(f"the mesh is only {extent:g} m long: coordinates are metres, check their unit")


def merge_duplicates(vertices: np.ndarray, triangles: np.ndarray, tolerance: float = 1e-9):
    """Weld vertices closer than `tolerance` times the size; the order of first appearance is kept.

    Returns
    -------
    vertices : (k, 3) float64
    triangles : (m, 3) int64
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    n = len(vertices)
    pairs = cKDTree(vertices).query_pairs(tolerance * np.ptp(vertices, axis=0).max(), output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    _, first = np.unique(label, return_index=True)
    order = np.argsort(first)
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    return np.ascontiguousarray(vertices[first[order]], dtype=float), rank[label][triangles]


def _minority(triangles: np.ndarray) -> np.ndarray | None:
    """Triangles to turn so that all agree (the fewer in each connected part), or None if no choice agrees."""
    neighbours: dict[tuple[int, int], list[tuple[int, bool]]] = {}
    for t, corners in enumerate(triangles.tolist()):
        for a, b in ((0, 1), (1, 2), (2, 0)):
            p, q = corners[a], corners[b]
            neighbours.setdefault((min(p, q), max(p, q)), []).append((t, p < q))
    links: list[list[tuple[int, bool]]] = [[] for _ in triangles]
    for pair in neighbours.values():
        if len(pair) == 2:
            (s, up), (t, also) = pair
            links[s].append((t, up == also))
            links[t].append((s, up == also))
    turned = np.full(len(triangles), -1)
    flip: list[int] = []
    for seed in range(len(triangles)):
        if turned[seed] >= 0:
            continue
        turned[seed], part, stack = 0, [seed], [seed]
        while stack:
            s = stack.pop()
            for t, differs in links[s]:
                wanted = turned[s] ^ int(differs)
                if turned[t] < 0:
                    turned[t] = wanted
                    part.append(t)
                    stack.append(t)
                elif turned[t] != wanted:
                    return None
        ones = [t for t in part if turned[t]]
        flip += ones if 2 * len(ones) <= len(part) else [t for t in part if not turned[t]]
    return np.sort(np.array(flip, dtype=np.int64))


def _pairs(array: np.ndarray) -> list[tuple[int, int]]:
    return [(int(a), int(b)) for a, b in array]


def _some(ids, what: str, most: int = 5) -> str:
    """'3 triangles (0, 4, 7)' or '12 triangles (0, 1, 2, 3, 4, ...)'."""
    plural = {"vertex": "vertices"}.get(what, what + "s") if len(ids) > 1 else what
    shown = ", ".join(str(i if isinstance(i, tuple) else int(i)) for i in list(ids)[:most])
    return f"{len(ids)} {plural} ({shown}{', ...' if len(ids) > most else ''})"
