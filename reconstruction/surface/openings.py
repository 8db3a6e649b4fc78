"""Cut a surface along given closed curves (hem, cuff, collar lines of a template)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from mfar_fem.errors import ParameterError
from reconstruction.libraries import optional
from reconstruction.surface.connectivity import face_pieces
from reconstruction.surface.cutting import split_at_zero
from reconstruction.surface.triangles import TriangleMesh
from reconstruction.surface.trimming import OpeningsError, Trimmed, trimmed

BAND = 2.5
"""Half-width of the strip about a curve in which the surface may be cut, in longest edges near it."""


def plane_curve(centre, normal, radius: float, count: int = 128) -> np.ndarray:
    """Closed circle (count, 3) in a plane, m; the simplest opening."""
    normal = np.asarray(normal, dtype=float) / np.linalg.norm(normal)
    first = np.cross(normal, [1.0, 0, 0] if abs(normal[0]) < 0.9 else [0, 1.0, 0])
    first /= np.linalg.norm(first)
    angle = 2 * np.pi * np.arange(count)[:, None] / count
    return np.asarray(centre, dtype=float) + radius * (np.cos(angle) * first + np.sin(angle) * np.cross(normal, first))


def trim_by_curves(mesh: TriangleMesh, curves: Sequence, points=None, expected: int | None = None, project: bool = True) -> Trimmed:
    """Cut along closed curves and take away what lies beyond them.

    Near a curve the surface gets the function (p − c) · (n × t), with c the nearest point of the curve, t its direction there
    and n the normal of the surface; its zero line is the cut.

    Parameters
    ----------
    mesh : TriangleMesh
    curves : sequence of (k, 3) arrays
        m; the last point joins the first. They need to lie near the surface, not on it.
    points : (n, 3) array, optional
        Points of the garment: the side of the curve with more of them stays. Without them what lies to the left of the curve,
        seen from outside, stays.
    expected : int, optional
        Number of openings of the result.
    project : bool
        Move the new rim onto the curve.

    Raises
    ------
    OpeningsError
        A curve is farther from the surface than the triangles there are long, or does not separate it.
    ParameterError
        A curve with less than three points, or with points that are not finite.
    """
    actions: list[str] = []
    before, tree = mesh, None if points is None else cKDTree(np.asarray(points, dtype=float))
    for number, curve in enumerate(curves):
        line = np.asarray(curve, dtype=float)
        if line.ndim != 2 or line.shape[1] != 3 or len(line) < 3 or not np.isfinite(line).all():
            raise ParameterError(f"curve {number} has shape {line.shape}; (k, 3) finite points with k of 3 or more are needed (m)")
        mesh, area, far = _cut(mesh, line, number, tree, project)
        actions.append(f"curve {number}: {1e4 * area:.3g} cm² beyond it removed, {1e3 * far:.2g} mm between curve and surface")
    return trimmed(mesh, before, actions, expected)


def _cut(
    mesh: TriangleMesh, line: np.ndarray, number: int, tree: cKDTree | None, project: bool
) -> tuple[TriangleMesh, float, float]:
    igl = optional("igl", "trimming needs")
    segments = np.stack([np.arange(len(line)), np.roll(np.arange(len(line)), -1)], axis=1)
    squared, touched, _ = igl.point_mesh_squared_distance(line, mesh.vertices, mesh.faces)
    corners = mesh.vertices[mesh.faces[touched]]
    edge = float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max())
    far = float(np.sqrt(max(squared.max(), 0.0)))
    if far > 2 * edge:
        where = np.round(line[np.argmax(squared)], 3).tolist()
        raise OpeningsError(
            f"curve {number} is {1e3 * far:.3g} mm from the surface at {where} m; triangles there have {1e3 * edge:.3g} mm"
        )
    squared, segment, nearest = igl.point_mesh_squared_distance(mesh.vertices, line, segments)
    along = np.roll(line, -1, axis=0) - line
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-300)[:, None]
    tangent = _tangents(line, along, segment, nearest)
    left = np.einsum("ij,ij->i", mesh.vertices - nearest, np.cross(mesh.vertex_normals, tangent))
    left[np.sqrt(np.maximum(squared, 0.0)) > BAND * edge + far] = np.nan
    cut, value, side = split_at_zero(mesh, left)
    if not (side > 0).any() or not (side < 0).any():
        raise OpeningsError(f"curve {number} lies beside the surface, not across it: nothing to cut")
    keep = 1
    if tree is not None:
        distance = tree.query(cut.vertices[cut.faces].mean(axis=1))[0]
        keep = 1 if distance[side > 0].mean() <= distance[side < 0].mean() else -1
    on_line = value == 0
    label = face_pieces(cut, blocked=on_line)
    gone = np.isin(label, np.unique(label[side == -keep]))
    stay = np.unique(label[side == keep])
    if np.isin(label[gone], stay).any():
        raise OpeningsError(f"curve {number} does not separate the surface: it must be closed, and pass through no hole or fold")
    if project:
        vertices = cut.vertices.copy()
        rim = np.flatnonzero(on_line)
        _, _, vertices[rim] = igl.point_mesh_squared_distance(vertices[rim], line, segments)
        cut = TriangleMesh(vertices, cut.faces)
    return cut.submesh(~gone), float(cut.areas[gone].sum()), far


def _tangents(line: np.ndarray, along: np.ndarray, segment: np.ndarray, nearest: np.ndarray) -> np.ndarray:
    """Directions at points of a closed polyline, turning steadily from corner to corner."""
    at = along + np.roll(along, 1, axis=0)
    at /= np.maximum(np.linalg.norm(at, axis=1), 1e-300)[:, None]
    following = (segment + 1) % len(line)
    length = np.maximum(np.linalg.norm(line[following] - line[segment], axis=1), 1e-300)
    t = (np.linalg.norm(nearest - line[segment], axis=1) / length)[:, None]
    mixed = (1 - t) * at[segment] + t * at[following]
    return mixed / np.maximum(np.linalg.norm(mixed, axis=1), 1e-300)[:, None]
