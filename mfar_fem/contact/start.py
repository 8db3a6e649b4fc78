"""A start that touches or intersects: which pairs, and what would do."""

from __future__ import annotations

import numpy as np

from mfar_fem.contact.collision_mesh import CollisionMesh, ipctk
from mfar_fem.errors import InputError

TOO_CLOSE = 1e-3
"""Share of the activation distance below which a start counts as touching: the barrier's force is a thousand times its usual."""


class IntersectingStartError(InputError):
    """The sheet intersects, touches or lies inside a body, or itself, before anything moved.

    Attributes
    ----------
    pairs : list of (int, str or int)
        Element of the sheet and name of the body (or the other element).
    distance : float
        Least distance met, m; 0 where surfaces intersect.
    """

    def __init__(self, message: str, pairs=(), distance: float = 0.0):
        self.pairs, self.distance = list(pairs), float(distance)
        super().__init__(message)


def _name(mesh: CollisionMesh, vertex: int) -> str:
    body = next(i for i, part in enumerate(mesh.body_vertices) if part.start <= vertex < part.stop)
    return mesh.bodies[body].name


def _pair(mesh: CollisionMesh, a: np.ndarray, b: np.ndarray, owners: dict) -> tuple:
    """(element, other) of two primitives given by their vertices; the sheet's first."""
    if a[0] >= mesh.n_sheet:
        a, b = b, a
    element = owners[int(a[0])]
    return (element, _name(mesh, int(b[0]))) if b[0] >= mesh.n_sheet else (element, owners[int(b[0])])


def _owners(mesh: CollisionMesh) -> dict[int, int]:
    sheet = mesh.triangles[: len(mesh.elements)]
    return dict(zip(sheet.ravel().tolist(), np.repeat(mesh.elements, 3).tolist(), strict=True))


def intersecting_pairs(mesh: CollisionMesh, vertices: np.ndarray) -> list[tuple]:
    """Pairs (element, body name or element) whose edges pierce each other's triangles at ``vertices`` (n, 3)."""
    ipc = ipctk()
    if not ipc.has_intersections(mesh.mesh, vertices):
        return []
    phase = ipc.LBVH()
    phase.can_vertices_collide = mesh.mesh.can_collide
    phase.build(vertices, mesh.mesh.edges, mesh.mesh.faces, 0.0)
    owners, pairs = _owners(mesh), set()
    for c in phase.detect_edge_face_candidates():
        e, f = mesh.mesh.edges[c.edge_id], mesh.mesh.faces[c.face_id]
        if ipc.is_edge_intersecting_triangle(vertices[e[0]], vertices[e[1]], *vertices[f]):
            pairs.add(_pair(mesh, e, f, owners))
    return sorted(pairs, key=str)


def inside_pairs(mesh: CollisionMesh, vertices: np.ndarray, t: float) -> list[tuple[int, str, float]]:
    """(element, body name, depth in m) of the bodies in which the sheet's deepest vertex lies deeper than their mesh is coarse."""
    found, owners, sheet = [], _owners(mesh), vertices[: mesh.n_sheet]
    for body, part in zip(mesh.bodies, mesh.body_vertices, strict=True):
        distance, _ = body.signed_distance(sheet, t)
        deepest = int(np.argmin(distance))
        coarse = _coarseness(body, mesh, part, vertices, t)
        if distance[deepest] < -coarse:
            found.append((owners[deepest], body.name, -float(distance[deepest])))
    return found


def _coarseness(body, mesh: CollisionMesh, part: slice, vertices: np.ndarray, t: float) -> float:
    """How far the triangles of a body lie inside its true surface, m: at their centres."""
    faces = mesh.triangles[mesh.triangles[:, 0] >= part.start]
    faces = faces[faces[:, 0] < part.stop]
    distance, _ = body.signed_distance(vertices[faces].mean(axis=1), t)
    return 1.05 * max(0.0, -float(distance.min(initial=0.0))) + 1e-12


def close_pairs(mesh: CollisionMesh, vertices: np.ndarray, candidates, limit: float) -> list[tuple]:
    """(distance in m, element, body name or element) of the candidate pairs nearer than ``limit``, nearest first."""
    ipc, owners = ipctk(), _owners(mesh)
    edges, faces = mesh.mesh.edges, mesh.mesh.faces
    found: dict[tuple, float] = {}

    def note(squared, a, b):
        if squared < limit**2:
            pair = _pair(mesh, a, b, owners)
            found[pair] = min(float(np.sqrt(max(squared, 0.0))), found.get(pair, np.inf))

    # the lists hold copies; single collisions of an ipctk set must not be touched from Python (1.6.1 crashes when it frees them)
    for c in candidates.fv_candidates:
        face = faces[c.face_id]
        note(ipc.point_triangle_distance(vertices[c.vertex_id], *vertices[face]), np.array([c.vertex_id]), face)
    for c in candidates.ee_candidates:
        a, b = edges[c.edge0_id], edges[c.edge1_id]
        note(ipc.edge_edge_distance(*vertices[a], *vertices[b]), a, b)
    return sorted(((d, *pair) for pair, d in found.items()), key=lambda pair: pair[0])


def describe(pairs, limit: int = 6) -> str:
    """The first pairs as text."""
    text = "; ".join(f"element {a} – {f'body {b!r}' if isinstance(b, str) else f'element {b}'}" for a, b in pairs[:limit])
    return text + (f"; and {len(pairs) - limit} more" if len(pairs) > limit else "")


def encloses(mesh: CollisionMesh, vertices: np.ndarray, t: float) -> bool:
    """Whether a connected part of a sheet that intersects nothing lies inside a body.

    A part with a vertex outside the box of a body's vertices cannot.
    """
    sheet = vertices[: mesh.n_sheet]
    for body, part in zip(mesh.bodies, mesh.body_vertices, strict=True):
        low, high = vertices[part].min(axis=0), vertices[part].max(axis=0)
        outside = np.any((sheet < low) | (sheet > high), axis=1)
        for component in mesh.components:
            if not outside[component].any() and body.signed_distance(sheet[component], t)[0].max() < 0:
                return True
    return False
