"""Open a closed Poisson surface where there are no points: hem, cuffs, collar.

Two rules. By distance (:func:`trim_by_distance`): the surface farther than ``factor`` spacings from every point goes, then the
edge moves back by as much (a morphological closing: gaps narrower than twice that distance stay closed, the edge itself is
not moved outward). By curves (:func:`reconstruction.surface.openings.trim_by_curves`): the surface is cut along given closed
lines.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from mfar_fem.errors import ParameterError, SurfaceError
from reconstruction.libraries import optional
from reconstruction.surface.connectivity import boundary_loops, face_pieces, loop_lengths, vertex_average
from reconstruction.surface.cutting import split_at_zero
from reconstruction.surface.denoise import point_spacing
from reconstruction.surface.triangles import TriangleMesh

FACTOR = 3.0
"""Spacings that a part of the surface may be from the points. Random points leave gaps of two spacings by chance."""
SHORT = 0.5
"""Spacings by which the edge moves back less than the trimming distance: the last points lie about so far from the true edge,
and the surface bends inward beyond them (measured on cylinders of 3000 to 20000 random points: the edge is then within 0.2
spacings of the true one on average)."""
LEAST_LOOP = 6.0
"""Holes with a circumference below this many spacings are left open by chance: they are not counted as openings."""


class OpeningsError(SurfaceError):
    """Number of openings other than expected, or an opening that does not lie on the surface."""


@dataclass(frozen=True, eq=False)
class Trimmed:
    """A surface with its openings.

    Attributes
    ----------
    mesh : TriangleMesh
    loops : tuple of (k,) arrays
        Vertex ids of every boundary loop, the longest first.
    lengths : tuple of float
        m.
    removed_area : float
        m².
    actions : tuple of str
    """

    mesh: TriangleMesh
    loops: tuple[np.ndarray, ...]
    lengths: tuple[float, ...]
    removed_area: float
    actions: tuple[str, ...]


def trimmed(mesh: TriangleMesh, before: TriangleMesh, actions: list[str], expected: int | None = None) -> Trimmed:
    """Count the loops of a trimmed mesh.

    Raises
    ------
    OpeningsError
        Their number is not the expected one; ``ids`` holds one vertex of each.
    """
    loops = boundary_loops(mesh.faces)
    lengths = loop_lengths(mesh, loops)
    order = np.argsort(lengths)[::-1]
    loops, lengths = [loops[i] for i in order], [lengths[i] for i in order]
    if expected is not None and len(loops) != expected:
        sizes = ", ".join(f"{100 * v:.1f}" for v in lengths) or "none"
        raise OpeningsError(
            f"{len(loops)} openings, expected {expected}; circumferences in cm: {sizes}", [int(c[0]) for c in loops]
        )
    return Trimmed(mesh, tuple(loops), tuple(lengths), float(before.areas.sum() - mesh.areas.sum()), tuple(actions))


def trim_by_distance(
    mesh: TriangleMesh, points, spacing: float | None = None, factor: float = FACTOR, expected: int | None = None
) -> Trimmed:
    """Take away what is far from all points.

    Parameters
    ----------
    mesh : TriangleMesh
        Closed or open.
    points : (n, 3) array
        m.
    spacing : float, optional
        m; else :func:`reconstruction.surface.denoise.point_spacing`.
    factor : float
        Distance in spacings, at least 1.
    expected : int, optional
        Number of openings.

    Raises
    ------
    ParameterError
        Factor below 1.
    OpeningsError
        Another number of openings than expected, or nothing left.
    """
    if not factor >= 1:
        raise ParameterError(f"trimming distance is {factor} spacings; below 1 the surface itself would go")
    points = np.asarray(points, dtype=float)
    spacing = point_spacing(points) if spacing is None else spacing
    reach = factor * spacing
    distance = cKDTree(points).query(mesh.vertices)[0]
    average = vertex_average(mesh.faces, len(mesh.vertices))
    for _ in range(2):
        distance = 0.5 * (distance + average @ distance)
    if distance.max() <= reach:
        return trimmed(mesh, mesh, ["nothing is far from the points"], expected)
    if distance.min() > reach:
        raise OpeningsError(f"the whole surface is farther than {1e3 * reach:.3g} mm from the points")
    cut, _, side = split_at_zero(mesh, reach - distance)
    kept = cut.submesh(side > 0)
    kept = _eroded(kept, reach - SHORT * spacing)
    kept, actions = _main_pieces(kept, reach)
    kept, filled = fill_small_loops(kept, LEAST_LOOP * spacing)
    kept = smooth_boundary(kept)
    actions.insert(0, f"surface farther than {1e3 * reach:.3g} mm ({factor:g} spacings) from the points removed")
    if filled:
        actions.append(f"{filled} holes with less than {1e3 * LEAST_LOOP * spacing:.3g} mm circumference closed")
    return trimmed(kept, mesh, actions, expected)


def _eroded(mesh: TriangleMesh, by: float) -> TriangleMesh:
    """Without the strip along the boundary."""
    igl = optional("igl", "trimming needs")
    rim = np.ascontiguousarray(mesh.boundary_edges)
    if not len(rim):
        return mesh
    squared, _, _ = igl.point_mesh_squared_distance(mesh.vertices, mesh.vertices, rim)
    cut, _, side = split_at_zero(mesh, np.sqrt(np.maximum(squared, 0.0)) - by)
    if not (side > 0).any():
        raise OpeningsError(f"nothing is left within {1e3 * by:.3g} mm of the edge: are the points too few?")
    return cut.submesh(side > 0)


def _main_pieces(mesh: TriangleMesh, reach: float) -> tuple[TriangleMesh, list[str]]:
    label = face_pieces(mesh)
    area = np.bincount(label, weights=mesh.areas)
    small = area < min(np.pi * reach**2, area.max())
    if not small.any():
        return mesh, []
    return mesh.submesh(~small[label]), [f"{small.sum()} islands of {1e4 * area[small].sum():.3g} cm² removed"]


def fill_small_loops(mesh: TriangleMesh, below: float) -> tuple[TriangleMesh, int]:
    """Close the loops shorter than a length by a fan around their mean point, and how many."""
    loops = [
        c for c, length in zip(*(lambda l: (l, loop_lengths(mesh, l)))(boundary_loops(mesh.faces)), strict=True) if length < below
    ]
    vertices, faces = [mesh.vertices], [mesh.faces]
    for k, loop in enumerate(loops):
        back = np.roll(loop, -1)
        faces.append(
            np.stack([back, loop, np.full(len(loop), len(mesh.vertices) + k)], axis=1)
            if len(loop) > 3 else np.array([[loop[2], loop[1], loop[0]]])
        )  # fmt: skip
        vertices.append(mesh.vertices[loop].mean(axis=0)[None])
    if not loops:
        return mesh, 0
    return TriangleMesh(np.vstack(vertices), np.vstack(faces)).submesh(slice(None)), len(loops)


def smooth_boundary(mesh: TriangleMesh, steps: int = 10) -> TriangleMesh:
    """Boundary loops smoothed along themselves without shrinking (G. Taubin, SIGGRAPH 1995, doi:10.1145/218380.218473)."""
    out = mesh.vertices.copy()
    for loop in boundary_loops(mesh.faces):
        line = out[loop]
        for factor in (0.5, -0.52) * steps:
            line = line + factor * (0.5 * (np.roll(line, 1, axis=0) + np.roll(line, -1, axis=0)) - line)
        out[loop] = line
    return moved_to(mesh, out)


def moved_to(mesh: TriangleMesh, vertices: np.ndarray) -> TriangleMesh:
    """The mesh with other places of its vertices, but for the corners of faces that would turn over or all but vanish."""
    out = vertices.copy()
    moved = TriangleMesh(out, mesh.faces)
    bad = np.einsum("ij,ij->i", moved.area_vectors, mesh.area_vectors) < 0.2 * mesh.areas**2
    out[mesh.faces[bad]] = mesh.vertices[mesh.faces[bad]]
    return TriangleMesh(out, mesh.faces)
