"""Position correction: move the vertices of a sheet along separating axes until no triangle of a body is penetrated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from mfar_fem.contact import position_correction_kernels as kernels
from mfar_fem.contact.broad_phase import candidate_pairs
from mfar_fem.errors import InputError


@dataclass(frozen=True)
class CorrectionReport:
    """What `resolve` did.

    Attributes
    ----------
    iterations : int
        Passes over the pairs in which something moved.
    penetration : float
        Largest depth left among those above the tolerance, thickness included, m; 0 where none is.
    pairs : int
        Pairs of triangles compared in the last pass.
    penetrating : int
        Pairs deeper than the tolerance that are left.
    stop : {'clear', 'enclosed', 'iteration limit'}
        'enclosed': no surfaces meet, but a connected part of the sheet lies within the body.
    """

    iterations: int
    penetration: float
    pairs: int
    penetrating: int
    stop: str


def resolve(positions, triangles, inverse_mass, body_vertices, body_triangles, tolerance: float, max_iterations: int = 100,
            thickness: float = 0.0) -> tuple[np.ndarray, CorrectionReport]:
    """Move a sheet out of a body.

    Pairs are corrected one after the other (Gauss-Seidel): along the axis of least translation every corner short of the clear
    side is moved to it. As the body does not give way, that is the least correction in the norm of the masses, whatever they
    are: only vertices of inverse mass 0 are told apart, they stay. Only axes toward the body's outside count, where
    neighbouring faces are flat the face normal alone, so that vertices neither leave through the far side nor slide from face
    to face. A sheet that has gone through the surface is drawn back as long as some of it still meets the surface.

    Parameters
    ----------
    positions : (n, 3) array_like
        Vertices of the sheet, m.
    triangles : (k, 3) array_like of int
        Triangles of the sheet.
    inverse_mass : (n,) array_like
        1/kg, >= 0; 0 holds a vertex.
    body_vertices, body_triangles : array_like
        The body's mesh where it is now, outward oriented, m.
    tolerance : float
        Depth that may be left, m, > 0.
    max_iterations : int
        Cap on the passes.
    thickness : float
        Distance to be kept from the body, m.

    Returns
    -------
    positions : (n, 3)
        New positions.
    report : CorrectionReport

    Raises
    ------
    InputError
        Shapes or numbers that do not fit, positions that are not finite.
    """
    x = np.array(positions, dtype=float)
    weights = np.ascontiguousarray(inverse_mass, dtype=float)
    triangles = np.ascontiguousarray(triangles, dtype=np.int64)
    body_vertices, body_triangles = np.asarray(body_vertices, dtype=float), np.asarray(body_triangles, dtype=np.int64)
    if x.ndim != 2 or x.shape[1] != 3 or weights.shape != (len(x),) or not np.all(np.isfinite(weights) & (weights >= 0.0)):
        raise InputError("position correction: positions must have shape (n, 3) and inverse masses (n,), finite and >= 0; got "
                         f"{x.shape} and {weights.shape}")
    if body_triangles.ndim != 2 or body_triangles.shape[1] != 3 or len(body_triangles) == 0:
        raise InputError(f"position correction: the body needs triangles of shape (k, 3), k > 0; got {body_triangles.shape}")
    if not tolerance > 0.0 or not thickness >= 0.0 or max_iterations < 0:
        raise InputError(f"position correction: tolerance {tolerance} m must be > 0, thickness {thickness} m and the cap "
                         f"{max_iterations} >= 0")
    free = weights > 0.0
    corners = np.ascontiguousarray(body_vertices[body_triangles])
    normals, limits = outward_cones(body_vertices, body_triangles)
    slack = 0.25 * float(np.mean(np.ptp(corners, axis=1))) + 2.0 * thickness
    moved, pairs, iterations = np.inf, np.zeros((0, 2), dtype=np.int64), 0
    while True:
        if moved >= slack:
            pairs, moved = candidate_pairs(x, triangles, body_vertices, body_triangles, thickness + slack), 0.0
        last = iterations >= max_iterations
        start = x.copy()
        count, largest = kernels.sweep(x, triangles, free, corners, normals, limits, pairs, tolerance, thickness, not last)
        if count == 0 or last:
            break
        moved += np.sqrt(np.max(np.sum((x - start) ** 2, axis=1)))
        iterations += 1
    if count:
        stop = "iteration limit"
    else:
        stop = "enclosed" if _enclosed(x, triangles, corners) else "clear"
    return x, CorrectionReport(iterations, float(largest), len(pairs), int(count), stop)


def outward_cones(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals (k, 3) of a body's faces, and the least cosine (k,) to them of directions that lead outward from the face.

    The directions that lead out of the body at a point of a face are its normal and, on its rim, those between it and the
    normals of the faces the surface bends down to: the least cosine is that of the steepest of them, 1 where none bends down,
    at most 0 on open edges; a face without area (normal 0) lets every direction pass.
    """
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.where(length > 0.0, length, 1.0)
    face = np.repeat(np.arange(len(triangles)), 3)
    incidence = coo_array((np.ones(len(face)), (face, triangles.ravel())), (len(triangles), len(vertices))).tocsr()
    a, b = (incidence @ incidence.T).nonzero()
    centres = corners.mean(axis=1)
    below = np.einsum("ic,ic->i", centres[b] - centres[a], normals[a]) < -1e-9 * np.linalg.norm(centres[b] - centres[a], axis=1)
    limits = np.where(length[:, 0] > 0.0, 1.0, 0.0)
    np.minimum.at(limits, a[below], np.einsum("ic,ic->i", normals[a[below]], normals[b[below]]))
    pairs = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, edge, counts = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
    open_faces = (counts[edge.ravel()] == 1).reshape(-1, 3).any(axis=1)
    limits[open_faces] = np.minimum(limits[open_faces], 0.0)
    return normals, limits - 1e-6


def _enclosed(x: np.ndarray, triangles: np.ndarray, corners: np.ndarray) -> bool:
    """Whether three vertices of a connected part of the sheet all lie within the body, by its winding number."""
    graph = coo_array((np.ones(triangles.size), (triangles.ravel(), np.roll(triangles, 1, axis=1).ravel())), (len(x), len(x)))
    labels = connected_components(graph, directed=False)[1]
    used = np.unique(triangles)
    for part in np.unique(labels[used]):
        ids = used[labels[used] == part]
        if all(_winding(x[i], corners) > 0.5 for i in ids[[0, len(ids) // 2, -1]]):
            return True
    return False


def _winding(point: np.ndarray, corners: np.ndarray) -> float:
    """Winding number of a mesh (k, 3, 3) about a point: 1 inside a closed one, 0 outside (van Oosterom and Strackee 1983,
    doi:10.1109/TBME.1983.325207).
    """
    a, b, c = np.moveaxis(corners - point, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    dot = np.einsum
    below = la * lb * lc + dot("kc,kc->k", a, b) * lc + dot("kc,kc->k", b, c) * la + dot("kc,kc->k", c, a) * lb
    return float(np.arctan2(dot("kc,kc->k", a, np.cross(b, c)), below).sum() / (2.0 * np.pi))
