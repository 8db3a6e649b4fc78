"""Separating axes between triangles: overlap, penetration and distance.

Two closed triangles are apart if and only if their projections on some axis are. The paper's formula (17) counts 15 axes, the
number for two boxes; for triangles the candidates are 2 face normals, 9 products of edges and, where the triangles are
coplanar, 6 normals of edges in the plane. Two more, the line of centres and the longest edge, complete the set where
triangles degenerate to segments or points. Source of the theorem: Gottschalk, Lin and Manocha, OBBTree, SIGGRAPH 1996,
doi:10.1145/237170.237244; the candidates are the facet normals of the Minkowski difference of the triangles.

Triangles are closed: touching is overlap, with depth 0. The axes are compared without normalisation or tolerance, so that
the answer is exact for integer coordinates up to 1000 in size; else it has the rounding of the coordinates.
"""

from __future__ import annotations

import numpy as np

from mfar_fem.contact import separating_axis_kernels as kernels
from mfar_fem.contact.broad_phase import candidate_pairs
from mfar_fem.contact.position_correction import CorrectionReport, resolve
from mfar_fem.errors import InputError

__all__ = ["CorrectionReport", "candidate_pairs", "penetration", "resolve", "triangles_overlap"]


def triangles_overlap(A, B, thickness: float = 0.0) -> np.ndarray:
    """Whether triangles meet.

    Parameters
    ----------
    A, B : (n, 3, 3) array_like
        Corners of the n pairs; degenerate triangles (segments, points) are what they are.
    thickness : float
        Triangles at most this distance apart count as meeting, m.

    Returns
    -------
    (n,) array of bool

    Raises
    ------
    InputError
        Shapes that do not fit, corners that are not finite, a negative thickness.
    """
    if not 0.0 <= thickness < np.inf:
        raise InputError(f"separating axes: thickness must be finite and >= 0 m, got {thickness}")
    if thickness > 0.0:
        return penetration(A, B)[0] >= -thickness
    A, B = _pairs(A, B)
    out = np.empty(len(A), dtype=np.bool_)
    kernels.overlap(A, B, out)
    return out


def penetration(A, B) -> tuple[np.ndarray, np.ndarray]:
    """Least translation that makes triangles just touch.

    Parameters
    ----------
    A, B : (n, 3, 3) array_like
        Corners of the n pairs, m.

    Returns
    -------
    depth : (n,)
        How far A has to move along the axis, m: positive where the triangles overlap, 0 where they touch (coplanar triangles
        that overlap touch: the least move along their normal parts them), minus their distance where they are apart.
    axis : (n, 3)
        Unit vectors, from B toward A.

    Raises
    ------
    InputError
        Shapes that do not fit, corners that are not finite.
    """
    A, B = _pairs(A, B)
    depth, axis = np.empty(len(A)), np.empty((len(A), 3))
    kernels.penetration(A, B, depth, axis)
    return depth, axis


def _pairs(A, B) -> tuple[np.ndarray, np.ndarray]:
    A, B = np.ascontiguousarray(A, dtype=float), np.ascontiguousarray(B, dtype=float)
    if A.ndim != 3 or A.shape[1:] != (3, 3) or A.shape != B.shape:
        raise InputError(f"separating axes: two arrays of shape (n, 3, 3) are needed, got {A.shape} and {B.shape}")
    bad = np.flatnonzero(~(np.isfinite(A) & np.isfinite(B)).all(axis=(1, 2)))
    if len(bad):
        raise InputError(f"separating axes: {len(bad)} pairs have corners that are not finite, the first is pair {bad[0]}")
    return A, B
