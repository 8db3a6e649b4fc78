"""Distances between surfaces, of their rims, and between their normals.

Formula (18) of the silk paper, which it calls the average Hausdorff distance, is the mean distance of nearest *samples*, pooled
over both sets: no Hausdorff distance (that is the largest), and never zero for samples, not even of one surface twice. It is given
under its true name beside the exact distances from points to triangles, with the value that two samplings of the true surface have.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from reconstruction.libraries import optional
from reconstruction.surface.analytic import curve_distances, mesh_distance, sample_mesh
from reconstruction.surface.connectivity import boundary_loops
from reconstruction.surface.triangles import TriangleMesh

SAMPLES = 20_000
"""Random points of each surface."""


def nearest_samples(first: np.ndarray, second: np.ndarray) -> float:
    """Formula (18): mean distance of nearest points between two sets (n, 3) and (m, 3), pooled, in their unit."""
    there, back = cKDTree(second).query(first)[0], cKDTree(first).query(second)[0]
    return float((there.sum() + back.sum()) / (len(first) + len(second)))


def distances(mesh: TriangleMesh, truth: TriangleMesh, seed: int = 0, samples: int = SAMPLES) -> dict[str, float]:
    """Figures of a surface against the true one, mm and degrees.

    Parameters
    ----------
    mesh, truth : TriangleMesh
        m.
    seed : int
        Of the samples.
    samples : int
        Of each surface.

    Returns
    -------
    dict of str to float
        ``mean``: mean of both directions' mean distances (exact point to triangle); ``off_*``: of the mesh from the truth, mean,
        median, 95 %; ``missing_*``: of the truth from the mesh; ``largest``: of all samples, a lower bound of the Hausdorff
        distance; ``nearest_samples`` and ``floor``: (18), and (18) of the truth with itself; ``normals``: mean angle between the
        normals at nearest points, up to their sign, degrees; ``rim_mean``, ``rim_95``: between the boundaries, if both have some.
    """
    rng = np.random.default_rng(seed)
    (ours, our_face), (theirs, _), (again, _) = (sample_mesh(m, samples, rng) for m in (mesh, truth, truth))
    igl = optional("igl", "distances need")
    squared, face, _ = igl.point_mesh_squared_distance(np.ascontiguousarray(ours), truth.vertices, truth.faces)
    off, missing = np.sqrt(np.maximum(squared, 0.0)), mesh_distance(theirs, mesh)
    out = {"mean": 0.5 * (off.mean() + missing.mean()), "largest": max(off.max(), missing.max()),
           "nearest_samples": nearest_samples(ours, theirs), "floor": nearest_samples(again, theirs)}  # fmt: skip
    for name, values in (("off", off), ("missing", missing)):
        out |= {f"{name}_mean": values.mean(), f"{name}_median": np.median(values), f"{name}_95": np.percentile(values, 95)}
    loops = [[m.vertices[c] for c in boundary_loops(m.faces)] for m in (mesh, truth)]
    if all(loops):
        rim = curve_distances(*loops)
        out |= {"rim_mean": rim.mean(), "rim_95": np.percentile(rim, 95)}
    cosine = np.abs(np.einsum("ni,ni->n", mesh.face_normals[our_face], truth.face_normals[face]))
    angle = float(np.degrees(np.arccos(np.clip(cosine, 0, 1))).mean())
    return {name: 1e3 * float(v) for name, v in out.items()} | {"normals": angle}
