"""The steps of :func:`reconstruction.surface.repair.repair`; each takes a mesh and a list to which it adds what it did."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from mfar_fem.surface.quality import InvertedTriangleError
from reconstruction.libraries import optional
from reconstruction.surface.collapse import collapse_short_edges
from reconstruction.surface.connectivity import boundary_loops, edge_faces, face_edges, face_pieces, loop_lengths
from reconstruction.surface.triangles import TriangleMesh

FLAT = 2e-6
"""Height below which a triangle counts as without area, in longest edges (twice that of the check, so that what passes here
passes there)."""


@dataclass(frozen=True)
class Action:
    """One thing that was done.

    Attributes
    ----------
    what : str
    count : int
    ids : tuple of int
        Triangles (vertices where `what` says so) in the numbering of the mesh at that step.
    """

    what: str
    count: int
    ids: tuple[int, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def _note(actions: list[Action], what: str, ids) -> None:
    if len(ids):
        actions.append(Action(what, len(ids), tuple(int(i) for i in ids)))


def merged(mesh: TriangleMesh, part: float, actions: list[Action]) -> TriangleMesh:
    """Vertices in one place joined, vertices without triangles left out. Exact doubles stay where joining them would make
    edges of more than two triangles: that is what :func:`split_sheets` leaves."""
    used = np.zeros(len(mesh.vertices), bool)
    used[mesh.faces] = True
    _note(actions, "vertices of no triangle left out", np.flatnonzero(~used))
    mesh = mesh.submesh(slice(None))
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    near = cKDTree(mesh.vertices).query_pairs(part * float(np.ptp(mesh.vertices, axis=0).max()), output_type="ndarray")
    if not len(near):
        return mesh
    n = len(mesh.vertices)
    _, label = connected_components(coo_matrix((np.ones(len(near)), (near[:, 0], near[:, 1])), shape=(n, n)), directed=False)
    _, first = np.unique(label, return_index=True)
    joined = first[label]
    faces = joined[mesh.faces]
    if _many(faces).sum() > _many(mesh.faces).sum() and _parted(mesh, near):
        return mesh
    _note(actions, "vertices joined to another in the same place", np.flatnonzero(joined != np.arange(n)))
    return TriangleMesh(mesh.vertices, faces).submesh(slice(None))


def _many(faces: np.ndarray) -> np.ndarray:
    edges, of_face = face_edges(faces)
    return np.bincount(of_face.ravel(), minlength=len(edges)) > 2


def _parted(mesh: TriangleMesh, near: np.ndarray) -> bool:
    """Whether all pairs are exact doubles: what :func:`split_sheets` leaves."""
    return bool((mesh.vertices[near[:, 0]] == mesh.vertices[near[:, 1]]).all())


def without_degenerate(mesh: TriangleMesh, actions: list[Action]) -> TriangleMesh:
    """Without triangles of fewer than three vertices, given twice, or without area."""
    f = mesh.faces
    point = (f[:, 0] == f[:, 1]) | (f[:, 1] == f[:, 2]) | (f[:, 2] == f[:, 0])
    _note(actions, "triangles of fewer than three vertices left out", np.flatnonzero(point))
    mesh = mesh.submesh(~point)
    first = np.zeros(len(mesh.faces), bool)
    if len(mesh.faces):
        first[np.unique(np.sort(mesh.faces, axis=1), axis=0, return_index=True)[1]] = True
    _note(actions, "triangles given more than once left out", np.flatnonzero(~first))
    mesh = mesh.submesh(first)
    for _ in range(6):
        flat = _flat(mesh)
        if not flat.any():
            break
        _note(actions, "triangles without area: short edge collapsed, or long edge turned", np.flatnonzero(flat))
        mesh = _unflatten(mesh, flat)
    flat = _flat(mesh)
    if flat.any():
        _note(actions, "triangles without area left out", np.flatnonzero(flat))
        mesh = mesh.submesh(~flat)
    return mesh


def _flat(mesh: TriangleMesh) -> np.ndarray:
    corner = mesh.vertices[mesh.faces]
    longest2 = ((corner - np.roll(corner, 1, axis=1)) ** 2).sum(axis=2).max(axis=1, initial=0.0)
    return ~(2 * mesh.areas > FLAT * longest2)


def _unflatten(mesh: TriangleMesh, flat: np.ndarray) -> TriangleMesh:
    edges, of_face = face_edges(mesh.faces)
    length = np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)
    tiny = 1e-4 * float(np.median(length))
    if (length[of_face[flat]].min(axis=1) < tiny).any() and not _many(mesh.faces).any():
        collapsed, count = collapse_short_edges(mesh, tiny)
        if count:
            return collapsed
    pair = edge_faces(of_face, len(edges))
    many = _many(mesh.faces)
    faces, locked, dead = mesh.faces.copy(), np.zeros(len(mesh.faces), bool), np.zeros(len(mesh.faces), bool)
    known = {tuple(e) for e in edges.tolist()}
    for f in np.flatnonzero(flat):  # the vertex on the long edge divides the neighbour there
        e = of_face[f, np.argmax(length[of_face[f]])]
        g = pair[e].sum() - f if pair[e, 1] >= 0 else -1
        if locked[f] or many[e] or (g >= 0 and locked[g]):
            continue
        if g < 0:
            dead[f] = locked[f] = True
            continue
        a, b = edges[e]
        c, d = mesh.faces[f].sum() - a - b, mesh.faces[g].sum() - a - b
        if c == d or tuple(sorted((c, d))) in known:
            continue
        faces[f] = np.where(mesh.faces[g] == b, c, mesh.faces[g])
        faces[g] = np.where(mesh.faces[g] == a, c, mesh.faces[g])
        locked[f] = locked[g] = True
        known.add(tuple(sorted((c, d))))
    return TriangleMesh(mesh.vertices, faces[~dead]).submesh(slice(None))


def without_fins(mesh: TriangleMesh, actions: list[Action]) -> TriangleMesh:
    """Without triangles that hang on an edge of three or more by that edge alone, or by nothing where others make a sheet."""
    for _ in range(20):
        edges, of_face = face_edges(mesh.faces)
        count = np.bincount(of_face.ravel(), minlength=len(edges))
        fin = (count[of_face] > 2).any(axis=1) & ((count[of_face] == 1).sum(axis=1) == 2)
        if not fin.any():
            break
        _note(actions, "triangles hanging on by an edge of three or more taken out", np.flatnonzero(fin))
        mesh = mesh.submesh(~fin)
    return mesh


def oriented(mesh: TriangleMesh, actions: list[Action]) -> TriangleMesh:
    """Neighbours turned the same way; of each piece the way of the larger area stays.

    Raises
    ------
    InvertedTriangleError
        A piece has one side only.
    """
    igl = optional("igl", "repair needs")
    turned, piece = igl.bfs_orient(np.ascontiguousarray(mesh.faces))
    flipped = np.array([not _same(a, b) for a, b in zip(turned, mesh.faces, strict=True)])
    weight = np.bincount(piece, weights=np.where(flipped, mesh.areas, -mesh.areas))
    flipped ^= (weight > 0)[piece]
    faces = np.where(flipped[:, None], mesh.faces[:, ::-1], mesh.faces)
    edges, of_face = face_edges(faces)
    two = np.bincount(of_face.ravel(), minlength=len(edges)) == 2
    forward = np.where(faces[:, [0, 1, 2]] < faces[:, [1, 2, 0]], 1, -1)
    total = np.bincount(of_face.ravel(), weights=forward.ravel(), minlength=len(edges))
    bad = two & (np.abs(total) == 2)
    if bad.any():
        ids = np.unique(np.flatnonzero(bad[of_face].any(axis=1)))
        raise InvertedTriangleError(
            f"the surface has one side only (a Möbius band): {len(ids)} triangles cannot be turned right", ids
        )
    _note(actions, "triangles turned to agree with their neighbours", np.flatnonzero(flipped))
    return TriangleMesh(mesh.vertices, faces)


def _same(a: np.ndarray, b: np.ndarray) -> bool:
    k = int(np.flatnonzero(b == a[0])[0])
    return bool(b[(k + 1) % 3] == a[1])


def split_sheets(mesh: TriangleMesh, actions: list[Action]) -> TriangleMesh:
    """Sheets that meet in an edge of three or more triangles, or in a vertex only, parted: each gets its own vertex there."""
    igl = optional("igl", "repair needs")
    if not _many(mesh.faces).any() and igl.is_vertex_manifold(np.ascontiguousarray(mesh.faces)).all():
        return mesh
    faces, source = igl.split_nonmanifold(np.ascontiguousarray(mesh.faces))
    _, first = np.unique(source, return_index=True)
    extra = np.setdiff1d(np.arange(len(source)), first)
    _note(actions, "vertices doubled where sheets met in an edge or a vertex", source[extra])
    return TriangleMesh(mesh.vertices[source], faces).submesh(slice(None))


def without_specks(mesh: TriangleMesh, part: float, actions: list[Action]) -> TriangleMesh:
    """Without pieces of less than a part of the area."""
    label = face_pieces(mesh)
    area = np.bincount(label, weights=mesh.areas)
    gone = (area < part * area.sum())[label]
    _note(actions, "triangles of small separate pieces removed", np.flatnonzero(gone))
    return mesh.submesh(~gone)


def fill_holes(mesh: TriangleMesh, openings: int, actions: list[Action]) -> TriangleMesh:
    """All boundary loops but the longest ``openings`` closed by a fan around their middle (flat: made for small holes)."""
    loops = boundary_loops(mesh.faces)
    lengths = np.array(loop_lengths(mesh, loops))
    closed = np.argsort(-lengths, kind="stable")[openings:]
    vertices, faces = [mesh.vertices], [mesh.faces]
    count = len(mesh.vertices)
    for k in closed:
        loop = loops[k]
        back = np.roll(loop, -1)
        if len(loop) == 3:
            faces.append(np.array([[loop[2], loop[1], loop[0]]]))
        else:
            faces.append(np.stack([back, loop, np.full(len(loop), count)], axis=1))
            vertices.append(mesh.vertices[loop].mean(axis=0)[None])
            count += 1
        actions.append(
            Action(
                f"hole of {len(loop)} edges, {1e3 * lengths[k]:.3g} mm around, closed (ids: its vertices)", 1, tuple(loop.tolist())
            )
        )
    if not len(closed):
        return mesh
    return TriangleMesh(np.vstack(vertices), np.vstack(faces))
