"""Short strokes along a field of directions on the faces of a mesh, to be shown on it."""

from __future__ import annotations

import numpy as np

from mfar_fem.errors import InputError
from reconstruction.surface.triangles import TriangleMesh


def warp_strokes(mesh: TriangleMesh, directions, count: int = 3000, length: float | None = None, seed: int = 0) -> np.ndarray:
    """Strokes through random points of the surface, uniform by area.

    Parameters
    ----------
    mesh : TriangleMesh
    directions : (nf, 3) array
        Of any length; faces where they are zero or NaN get no strokes. Only the part in the face counts.
    count : int
        Strokes at most.
    length : float, optional
        m; by default 0.8 of the mean distance between strokes, sqrt(area / count).
    seed : int

    Returns
    -------
    (n, 2, 3) array
        Their ends, m.

    Raises
    ------
    InputError
        Directions of another shape.
    """
    d = np.asarray(directions, dtype=float)
    if d.shape != mesh.faces.shape:
        raise InputError(f"directions have shape {d.shape}; {mesh.faces.shape} is needed, one a face")
    n = mesh.face_normals
    d = d - np.sum(d * n, axis=1, keepdims=True) * n
    size = np.linalg.norm(d, axis=1)
    weight = np.where(np.isfinite(size) & (size > 1e-12), mesh.areas, 0.0)
    if weight.sum() <= 0:
        return np.zeros((0, 2, 3))
    rng = np.random.default_rng(seed)
    # one point in each of `count` equal parts of the cumulated area: more even than independent draws
    total = np.cumsum(weight)
    face = np.searchsorted(total, (np.arange(count) + rng.random(count)) / count * total[-1])
    face = np.minimum(face, len(weight) - 1)
    a, b = np.sqrt(rng.random(count)), rng.random(count)
    shares = np.column_stack([1 - a, a * (1 - b), a * b])
    middle = np.einsum("nc,ncx->nx", shares, mesh.vertices[mesh.faces[face]])
    half = 0.5 * (length if length is not None else 0.8 * np.sqrt(weight.sum() / count))
    along = half * d[face] / size[face, None]
    return np.stack([middle - along, middle + along], axis=1)
