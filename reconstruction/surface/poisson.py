r"""Poisson surface of oriented points, formula (9) of the silk paper.

.. math:: \min_f \int \lVert \nabla f(x) - V(x) \rVert^2 \, dx

with V the smoothed field of the normals; the surface is a level of f. Computed by the screened form of M. Kazhdan, H. Hoppe,
Screened Poisson surface reconstruction, ACM Trans. Graph. 32 (2013) 29, doi:10.1145/2487228.2487237, whose code gpytoolbox
carries (MIT). The level is that of the mean of f over the points, not 0 as the paper prints: f is known up to a constant only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from mfar_fem.errors import NotConvergedError, ParameterError, SurfaceError
from reconstruction.libraries import optional
from reconstruction.surface.connectivity import face_pieces
from reconstruction.surface.denoise import denoised, point_spacing
from reconstruction.surface.triangles import TriangleMesh

SMALLEST_SET = 50
"""Points below which no surface is tried."""
BOX = 2.5
"""2^depth cells of the surface's grid in longest extents of the points: gpytoolbox 0.3.8 puts a cube of 1.25 extents around
them and extracts the surface one level above the depth it is told (measured by counting triangles)."""
CELL = 1.3
"""Largest cell that is chosen, in point spacings (so 0.65 to 1.3; on spheres and tori finer ones make more triangles and with
noise no better surface)."""
DEPTHS = (5, 10)
"""Least and greatest depth of the octree that is chosen."""
FLAT = 1e-5
"""Thickness below which points count as coplanar, in longest extents."""


class TooFewPointsError(SurfaceError):
    """Not enough usable points for a surface."""


class NormalsError(SurfaceError):
    """No usable normals; ``ids`` are points."""


class CoplanarPointsError(SurfaceError):
    """All points lie in one plane: nothing is enclosed and f has no level."""


@dataclass(frozen=True, eq=False)
class PoissonSurface:
    """A closed surface through oriented points.

    Attributes
    ----------
    mesh : TriangleMesh
        The pieces that were kept, normals along those of the points.
    dropped : tuple of TriangleMesh
        Pieces without enough points of their own.
    points, normals : (n, 3) arrays
        The points that were used (doubles and points without a normal left out; smoothed if they came with standard
        deviations).
    spacing : float
        Side of the square a point has to itself, median, m.
    depth : int
        Of the octree.
    cell : float
        Of the grid in which the surface was extracted, m.
    actions : tuple of str
        What was done to points and pieces.
    """

    mesh: TriangleMesh
    dropped: tuple[TriangleMesh, ...]
    points: np.ndarray
    normals: np.ndarray
    spacing: float
    depth: int
    cell: float
    actions: tuple[str, ...]


def poisson_surface(
    points, normals, sigma=None, depth: int | None = None, screening: float = 4.0, keep: float = 0.02
) -> PoissonSurface:
    """Closed surface through oriented points.

    Parameters
    ----------
    points : (n, 3) array
        m.
    normals : (n, 3) array
        Outward; their length does not matter, a zero or non-finite one takes the point out.
    sigma : float or (n,) array, optional
        Standard deviation of the points along their normals, m. With it the points are smoothed first
        (:func:`reconstruction.surface.denoise.denoised`).
    depth : int, optional
        Of the octree; by default the smallest with cells of no more than :data:`CELL` point spacings.
    screening : float
        Weight of passing through the points (4 in the reference); 0 is (9) itself.
    keep : float
        Pieces with less than this share of the points are dropped and listed.

    Raises
    ------
    TooFewPointsError, NormalsError, CoplanarPointsError
        See the classes.
    SurfaceError
        Wrong shapes or points that are not finite.
    ParameterError
        A depth outside 3 to 12, a negative screening, a share outside [0, 1).
    NotConvergedError
        The solver returned no surface.
    """
    if depth is not None and not 3 <= depth <= 12:
        raise ParameterError(f"depth of the octree is {depth}; 3 to 12 are possible")
    if not screening >= 0 or not 0 <= keep < 1:
        raise ParameterError(f"screening {screening} must not be negative, keep {keep} must lie in [0, 1)")
    p, n, s, actions = _usable(points, normals, sigma)
    spacing = point_spacing(p)
    if s is not None:
        moved = denoised(p, n, s, spacing)
        rms = float(np.sqrt(((moved - p) ** 2).sum(axis=1).mean()))
        actions.append(f"{len(p)} points smoothed by their standard deviations, {1e3 * rms:.3g} mm root mean square")
        p = moved
    side = BOX * float(np.ptp(p, axis=0).max())
    level = int(np.clip(np.ceil(np.log2(side / (CELL * spacing))), *DEPTHS)) if depth is None else depth
    toolbox = optional("gpytoolbox", "Poisson reconstruction needs")
    vertices, faces = toolbox.point_cloud_to_mesh(
        p, n, method="PSR", psr_depth=level, psr_screening_weight=float(screening), psr_outer_boundary_type="Dirichlet"
    )
    if faces is None or not len(faces):
        raise NotConvergedError(
            f"Poisson reconstruction of {len(p)} points at depth {level} gave no surface: are the normals consistent?"
        )
    mesh, dropped = _pieces(TriangleMesh(vertices, faces), p, keep, actions)
    mesh = _outward(mesh, p, n, actions)
    return PoissonSurface(mesh, dropped, p, n, spacing, level, side / 2**level, tuple(actions))


def _usable(points, normals, sigma):
    p, n = np.asarray(points, dtype=float), np.asarray(normals, dtype=float)
    if p.ndim != 2 or p.shape[1] != 3 or n.shape != p.shape:
        raise SurfaceError(f"points {p.shape} and normals {n.shape} must both be (n, 3)")
    if not np.isfinite(p).all():
        bad = np.flatnonzero(~np.isfinite(p).all(axis=1))
        raise SurfaceError(f"{len(bad)} points are not finite, the first is number {bad[0]}", bad)
    s = None if sigma is None else np.broadcast_to(np.asarray(sigma, dtype=float), len(p)).copy()
    if s is not None and not (np.isfinite(s).all() and (s >= 0).all()):
        bad = np.flatnonzero(~(s >= 0) | ~np.isfinite(s))
        raise SurfaceError(f"standard deviation of point {bad[0]} is {s[bad[0]]}; it must be finite and not negative (m)", bad)
    actions: list[str] = []
    length = np.linalg.norm(n, axis=1)
    good = np.isfinite(length) & (length > 1e-12)
    if len(p) and not good.any():
        raise NormalsError("no point has a normal: give outward normals that are not zero", np.arange(len(p)))
    if not good.all():
        actions.append(f"{(~good).sum()} points without a normal left out")
    first = np.zeros(len(p), bool)
    if len(p):
        first[np.unique(np.round(p / (1e-9 * max(np.ptp(p, axis=0).max(), 1e-9))), axis=0, return_index=True)[1]] = True
    if (good & ~first).any():
        actions.append(f"{(good & ~first).sum()} points given more than once left out")
    use = good & first
    if use.sum() < SMALLEST_SET:
        raise TooFewPointsError(f"{use.sum()} usable points of {len(p)}: a surface needs {SMALLEST_SET}", np.flatnonzero(use))
    p, n = p[use], n[use] / length[use, None]
    extents = np.linalg.svd(p - p.mean(axis=0), compute_uv=False)
    if extents[2] <= FLAT * extents[0]:
        what = "on one line" if extents[1] <= FLAT * extents[0] else "in one plane"
        raise CoplanarPointsError(f"all {len(p)} points lie {what}; a flat panel needs no reconstruction, triangulate its outline")
    if np.linalg.norm(n.mean(axis=0)) > 0.999:
        actions.append("all normals are nearly parallel: the surface beyond the points is a guess")
    return p, n, (None if s is None else s[use]), actions


def _pieces(
    mesh: TriangleMesh, points: np.ndarray, keep: float, actions: list[str]
) -> tuple[TriangleMesh, tuple[TriangleMesh, ...]]:
    label = face_pieces(mesh)
    of_vertex = np.full(len(mesh.vertices), 0)
    of_vertex[mesh.faces] = label[:, None]
    share = np.bincount(of_vertex[cKDTree(mesh.vertices).query(points)[1]], minlength=label.max() + 1) / len(points)
    kept = share >= min(keep, share.max())
    dropped = []
    for k in np.flatnonzero(~kept):
        piece = mesh.submesh(label == k)
        dropped.append(piece)
        where = np.round(piece.vertices.mean(axis=0), 3).tolist()
        actions.append(f"piece of {len(piece.faces)} triangles at {where} m dropped: {100 * share[k]:.2g} % of the points")
    if kept.sum() > 1:
        shares = ", ".join(f"{100 * v:.0f} %" for v in share[kept])
        actions.append(f"{kept.sum()} separate pieces kept ({shares} of the points)")
    return mesh.submesh(kept[label]), tuple(dropped)


def _outward(mesh: TriangleMesh, points: np.ndarray, normals: np.ndarray, actions: list[str]) -> TriangleMesh:
    along = np.einsum("ij,ij->i", mesh.vertex_normals[cKDTree(mesh.vertices).query(points)[1]], normals)
    if along.mean() < 0:
        actions.append("orientation turned to that of the normals")
        mesh = TriangleMesh(mesh.vertices, mesh.faces[:, ::-1])
    against = float((along < 0).mean() if along.mean() >= 0 else (along > 0).mean())
    if against > 0.05:
        actions.append(f"{100 * against:.0f} % of the normals point against the surface: are they consistent?")
    return mesh
