"""Trim a Poisson surface to the extent of a sheet that is known already (the fitted pattern): open where that ends."""

from __future__ import annotations

import numpy as np

from mfar_fem.errors import ParameterError
from reconstruction.libraries import optional
from reconstruction.surface.connectivity import edge_faces, face_edges, face_pieces, loop_lengths
from reconstruction.surface.cutting import split_at_zero
from reconstruction.surface.triangles import TriangleMesh
from reconstruction.surface.trimming import OpeningsError, Trimmed, fill_small_loops, moved_to, trimmed

SMALL = 0.5
"""Holes beyond the sheet's number and shorter than this part of its shortest rim are closed: where sheets touch, the surface has
handles and holes."""


def trim_by_sheet(mesh: TriangleMesh, sheet: TriangleMesh, reach: float) -> Trimmed:
    """Keep what lies over a sheet: near it, within its rims, in pieces that face its way; its new rim lies on the sheet's.

    The surface gets a function that is zero above the rims of the sheet: within them the distance of the nearest point of the
    sheet from its rim, beyond them the distance from the rim outwards in the sheet's plane, taken negative. Unlike a cut along
    curves (:func:`reconstruction.surface.openings.trim_by_curves`) no rim has to part the surface in two on its own: hems with
    slits, ribbons and brims are cut as well.

    Parameters
    ----------
    mesh : TriangleMesh
    sheet : TriangleMesh
        Oriented like the mesh, with one rim at least.
    reach : float
        What is farther from the sheet goes, m.

    Raises
    ------
    ParameterError
        The sheet has no closed rim, or `reach` is not positive.
    OpeningsError
        Nothing of the surface lies over the sheet, or the result has another number of openings than it.
    """
    lengths = loop_lengths(sheet)
    if not lengths or not reach > 0:
        raise ParameterError(f"a sheet with a rim and a positive reach are needed, not {len(lengths)} rims and {reach} m")
    rim = np.ascontiguousarray(sheet.boundary_edges)
    igl = optional("igl", "trimming needs")
    squared, _, nearest = igl.point_mesh_squared_distance(mesh.vertices, sheet.vertices, sheet.faces)
    distance = np.sqrt(np.maximum(squared, 0.0))
    inside = np.sqrt(np.maximum(igl.point_mesh_squared_distance(nearest, sheet.vertices, rim)[0], 0.0))
    _, segment, at = igl.point_mesh_squared_distance(mesh.vertices, sheet.vertices, rim)
    outwards = _outwards(sheet, rim)[segment]
    beyond = inside < 1e-6 * reach
    value = np.where(beyond, -np.maximum(np.einsum("ij,ij->i", mesh.vertices - at, outwards), 0.0), inside)
    value = np.minimum(value, reach - distance)
    cut, _, side = split_at_zero(mesh, value)
    if not (side > 0).any():
        raise OpeningsError(f"nothing of the surface lies within {1e3 * reach:.3g} mm of the sheet")
    kept = cut.submesh(side > 0)
    label = face_pieces(kept)
    area = np.bincount(label, weights=kept.areas)
    face = igl.point_mesh_squared_distance(kept.vertices[kept.faces].mean(axis=1), sheet.vertices, sheet.faces)[1]
    facing = np.bincount(label, weights=np.einsum("ij,ij->i", kept.area_vectors, sheet.face_normals[face]))
    gone = (facing <= 0) | (area < min(np.pi * reach**2, area.max()))  # the far side of the closed surface; islands
    if gone.all():
        raise OpeningsError("what of the surface lies over the sheet faces the other way: are the normals turned?")
    kept = kept.submesh(~gone[label])
    openings = sorted(loop_lengths(kept), reverse=True)[: len(lengths)]  # those stay
    kept, filled = fill_small_loops(kept, min([SMALL * min(lengths), *openings]))
    vertices, ids = kept.vertices.copy(), kept.boundary_vertices
    vertices[ids] = igl.point_mesh_squared_distance(vertices[ids], sheet.vertices, rim)[2]
    kept = moved_to(kept, vertices)
    actions = [
        f"{1e4 * (mesh.areas.sum() - kept.areas.sum()):.3g} cm² beyond the sheet's {len(lengths)} rims or farther than "
        f"{1e3 * reach:.3g} mm from it removed, {int(gone.sum())} islands or far sides among it, {filled} small holes closed"
    ]
    return trimmed(kept, mesh, actions, len(lengths))


def _outwards(sheet: TriangleMesh, rim: np.ndarray) -> np.ndarray:
    """(nb, 3) unit vectors in the plane of each rim edge's face, square to the edge, away from the face."""
    edges, of_face = face_edges(sheet.faces)
    size = int(sheet.faces.max()) + 1
    place = np.searchsorted(edges[:, 0] * size + edges[:, 1], rim[:, 0] * size + rim[:, 1])
    face = edge_faces(of_face, len(edges))[place, 0]
    along = sheet.vertices[rim[:, 1]] - sheet.vertices[rim[:, 0]]
    away = np.cross(along, sheet.face_normals[face])
    from_centre = sheet.vertices[rim[:, 0]] - sheet.vertices[sheet.faces[face]].mean(axis=1)
    away *= np.sign(np.einsum("ij,ij->i", away, from_centre))[:, None]
    return away / np.maximum(np.linalg.norm(away, axis=1), 1e-300)[:, None]
