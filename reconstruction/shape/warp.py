"""The warp on a surface: from the panels where the template reaches, smoothed along the surface, with its singularities and (12).

Directions without a sign: a yarn runs both ways. They are smoothed as the tangent tensors ``a (outer) a`` are, which needs no sign,
and then given one that is consistent over the mesh. A vertex around which the line turns by a multiple of half a turn is a
singularity (index +-1/2, ...); on a cut garment there should be none away from the seams.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, diags, identity
from scipy.sparse.csgraph import breadth_first_order
from scipy.sparse.linalg import splu

from mfar_fem.errors import InputError
from reconstruction.libraries import optional
from reconstruction.surface.connectivity import edge_faces, face_edges
from reconstruction.surface.triangles import TriangleMesh

ETA, WARP, WEFT = 1.8, 0.75, 0.25
"""η, ω1 and ω2 of (12)."""


@dataclass(frozen=True, eq=False)
class WarpField:
    """Warp directions.

    Attributes
    ----------
    directions : (nf, 3) array
        Unit, in the plane of each face.
    prior : (nf,) bool array
        True where no panel reaches and the direction follows the surface.
    singular : dict of int to float
        Vertices with their index, in turns.
    flipped : int
        Inner edges across which the sign could not be made consistent.
    """

    directions: np.ndarray
    prior: np.ndarray
    singular: dict[int, float]
    flipped: int

    def tensors(self, mesh: TriangleMesh) -> np.ndarray:
        """(12), (nf, 3, 3), with the weft b in place of the curl, which vanishes for straight yarns: eta (w1 a a + w2 b b)."""
        a = self.directions
        b = np.cross(mesh.face_normals, a)
        return ETA * (WARP * a[:, :, None] * a[:, None, :] + WEFT * b[:, :, None] * b[:, None, :])


def warp_field(mesh: TriangleMesh, points, directions, reach: float, smoothing: float = 1.0, seams=None) -> WarpField:
    """Carry directions from points to the faces of a mesh and smooth them.

    Parameters
    ----------
    mesh : TriangleMesh
    points : (n, 3) array
        m.
    directions : (n, 3) array
        There; zero or NaN where unknown.
    reach : float
        Faces further than this from every known point (m) follow the direction of least curvature of the surface instead.
    smoothing : float
        Weight of the differences between neighbours against the data; 0: none.
    seams : (ne,) bool array, optional
        Edges (in the order of ``mesh.edges``) across which nothing is smoothed.

    Raises
    ------
    InputError
        Wrong shapes, or nothing known at all.
    """
    from scipy.spatial import cKDTree

    points, directions = np.asarray(points, dtype=float), np.asarray(directions, dtype=float)
    if points.shape != directions.shape or points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"points and directions have shapes {points.shape} and {directions.shape}; both must be (n, 3)")
    known = np.isfinite(directions).all(axis=1) & (np.linalg.norm(np.nan_to_num(directions), axis=1) > 1e-9)
    if not known.any():
        raise InputError("no direction of the warp is known anywhere")
    distance, nearest = cKDTree(points[known]).query(mesh.vertices[mesh.faces].mean(axis=1))
    frame = _frames(mesh)
    given = directions[known][nearest]
    prior = distance > reach
    if prior.any():
        given[prior] = _least_curved(mesh)[prior]
    local = np.einsum("fij,fj->fi", frame, given)
    angle = np.arctan2(local[:, 1], local[:, 0])
    z = np.exp(2j * angle)  # a line field in each face's own frame
    if smoothing > 0:
        z = _smoothed(mesh, frame, z, np.where(prior, 0.1, 1.0), smoothing, seams)
    angle = 0.5 * np.angle(z)
    out = np.cos(angle)[:, None] * frame[:, 0] + np.sin(angle)[:, None] * frame[:, 1]
    out = out * np.where(np.einsum("fi,fi->f", out, given) < 0, -1.0, 1.0)[:, None]
    out, flipped = _signed(mesh, out)
    return WarpField(out, prior, singularities(mesh, out), flipped)


def _frames(mesh: TriangleMesh) -> np.ndarray:
    """Two unit tangents of each face (nf, 2, 3)."""
    x = mesh.vertices[mesh.faces[:, 1]] - mesh.vertices[mesh.faces[:, 0]]
    x /= np.maximum(np.linalg.norm(x, axis=1), 1e-300)[:, None]
    return np.stack([x, np.cross(mesh.face_normals, x)], axis=1)


def _pairs(mesh: TriangleMesh) -> tuple[np.ndarray, np.ndarray]:
    """Faces on both sides of every inner edge (k, 2), and the edges' ids."""
    _, of_face = face_edges(mesh.faces)
    sides = edge_faces(of_face, len(mesh.edges))
    inner = np.flatnonzero((sides >= 0).all(axis=1))
    return sides[inner], inner


def _turns(mesh: TriangleMesh, frame: np.ndarray, pairs: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Angle to add when an angle of the first face's frame is read in the second's, the faces unfolded about their edge."""
    ends = mesh.vertices[mesh.edges[edges]]
    along = ends[:, 1] - ends[:, 0]
    angles = []
    for side in (0, 1):
        local = np.einsum("kij,kj->ki", frame[pairs[:, side]], along)
        angles.append(np.arctan2(local[:, 1], local[:, 0]))
    return angles[1] - angles[0]


def _smoothed(mesh, frame, z, weight, smoothing, seams) -> np.ndarray:
    pairs, edges = _pairs(mesh)
    if seams is not None:
        keep = ~np.asarray(seams, dtype=bool)[edges]
        pairs, edges = pairs[keep], edges[keep]
    turn = np.exp(2j * _turns(mesh, frame, pairs, edges))
    n = len(z)
    i, j = pairs.T
    one = np.ones(len(i))
    laplace = coo_matrix(
        (np.concatenate([one, one, -np.conj(turn), -turn]), (np.concatenate([i, j, i, j]), np.concatenate([i, j, j, i]))),
        shape=(n, n),
    )
    area = weight * mesh.areas / mesh.areas.mean()
    out = splu((diags(area) + smoothing * laplace + 1e-9 * identity(n)).tocsc()).solve((area * z).astype(complex))
    return out / np.maximum(np.abs(out), 1e-12)


def _signed(mesh: TriangleMesh, directions: np.ndarray) -> tuple[np.ndarray, int]:
    """Signs chosen from face to face in the order of a breadth-first walk; the first face of each piece keeps its own."""
    pairs, edges = _pairs(mesh)
    frame = _frames(mesh)
    turn = _turns(mesh, frame, pairs, edges)
    local = np.einsum("fij,fj->fi", frame, directions)
    angle = np.arctan2(local[:, 1], local[:, 0])
    same = np.cos(angle[pairs[:, 0]] + turn - angle[pairs[:, 1]]) >= 0
    n = len(directions)
    graph = coo_matrix((np.ones(2 * len(pairs)), (pairs.T.ravel(), pairs[:, ::-1].T.ravel())), shape=(n, n)).tocsr()
    agree = {(int(a), int(b)): bool(s) for (a, b), s in zip(pairs, same, strict=True)}
    sign = np.zeros(n)
    for start in range(n):
        if sign[start]:
            continue
        order, before = breadth_first_order(graph, start, directed=False)
        sign[start] = 1.0
        for face in order[1:]:
            parent = int(before[face])
            alike = agree.get((parent, int(face)), agree.get((int(face), parent), True))
            sign[face] = sign[parent] if alike else -sign[parent]
    flipped = int((same != (sign[pairs[:, 0]] == sign[pairs[:, 1]])).sum())
    total = sign @ (mesh.areas * np.sign(directions[:, 2]))
    return directions * (sign if total >= 0 else -sign)[:, None], flipped


def singularities(mesh: TriangleMesh, directions) -> dict[int, float]:
    """Index, in turns, of the line field about every inner vertex where it is not zero.

    The turning of the line from face to face, each time the smallest that fits, summed around the vertex, less what
    the frames turn: a multiple of 1/2 (N. Ray et al., N-symmetry direction field design, ACM TOG 27 (2008) 10,
    doi:10.1145/1356682.1356683).
    """
    pairs, edges = _pairs(mesh)
    frame = _frames(mesh)
    turn = _turns(mesh, frame, pairs, edges)
    local = np.einsum("fij,fj->fi", frame, np.asarray(directions, dtype=float))
    angle = np.arctan2(local[:, 1], local[:, 0])
    delta = angle[pairs[:, 1]] - angle[pairs[:, 0]] - turn
    delta = (delta + np.pi / 2) % np.pi - np.pi / 2  # of a line, the smallest turn from the first face to the second
    corners = mesh.vertices[mesh.faces]
    a, b = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    inside = np.arctan2(np.linalg.norm(np.cross(a, b), axis=2), np.einsum("fci,fci->fc", a, b))
    angle_sum = np.bincount(mesh.faces.ravel(), inside.ravel(), minlength=len(mesh.vertices))
    total = np.zeros(len(mesh.vertices))
    # an inner edge (low, high): its first face lies left of it or right; counter-clockwise about `low` one goes right to left
    edge = mesh.edges[edges]
    left_first = _runs(mesh.faces[pairs[:, 0]], edge)
    forward = np.where(left_first, -1.0, 1.0) * delta
    np.add.at(total, edge[:, 0], forward)
    np.add.at(total, edge[:, 1], -forward)
    # carried around once, a direction turns by the vertex's defect: what the line turned beyond it makes whole half turns
    defect = 2 * np.pi - angle_sum
    index = np.rint((total + defect) / np.pi) / 2
    rim = np.zeros(len(mesh.vertices), dtype=bool)
    rim[mesh.boundary_vertices] = True
    there = np.flatnonzero((index != 0) & ~rim & (angle_sum > 0))
    return {int(i): float(index[i]) for i in there}


def _runs(faces: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """Whether each face runs along its edge from the first vertex to the second."""
    out = np.zeros(len(faces), dtype=bool)
    for i in range(3):
        out |= (faces[:, i] == edge[:, 0]) & (faces[:, (i + 1) % 3] == edge[:, 1])
    return out


def _least_curved(mesh: TriangleMesh) -> np.ndarray:
    """Direction of least absolute curvature of each face (libigl's quadric fit), the mean of its corners' lines."""
    igl = optional("igl", "directions of curvature need")
    first, second, k1, k2 = (np.asarray(a) for a in igl.principal_curvature(mesh.vertices, mesh.faces)[:4])
    along = np.where((np.abs(k1) < np.abs(k2))[:, None], first, second)
    tensor = (along[:, :, None] * along[:, None, :])[mesh.faces].mean(axis=1)
    return np.linalg.eigh(tensor)[1][:, :, 2]
