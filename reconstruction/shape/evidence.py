"""What the pictures ask of a shape: outlines, depths and landmarks as targets of vertices.

A target is where a vertex should be according to one picture; its weight falls with the square of its standard deviation. What
supports a vertex is recorded by name, so that a point of which no picture says anything can be told from one that is seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from reconstruction.libraries import optional
from reconstruction.shape.cloth import Cloth
from reconstruction.stereo.sweep import DepthMap
from reconstruction.stereo.view import View
from reconstruction.surface.triangles import TriangleMesh

FIRM = 12000.0
"""Stiffness of evidence of :data:`SIGMA`, N/m³: the weight of the cloth (1 N/m²) moves it by a tenth of a millimetre."""
SIGMA = 5e-3
"""m."""
OUTLINE_SIGMA = 1.5
"""Standard deviation of an outline, px."""
HIDDEN = 0.02
"""How far a vertex may lie behind what is seen at its pixel and count as seen, m."""
THICK = 0.04
"""How far a figure may come through the cloth without hiding it, m."""
STRIDE = 2
"""Every so many pixels are drawn."""


@dataclass(frozen=True, eq=False)
class Drawn:
    """A mesh as a view sees it, every :data:`STRIDE` pixels.

    Attributes
    ----------
    depth : (h, w) array
        Along the axis, m, of what is seen first (figure too); inf: nothing.
    face : (h, w) array of int
        Triangle of the garment; -1: figure or nothing.
    outer : (h, w) bool array
        Whether the garment's outer side is seen.
    """

    depth: np.ndarray
    face: np.ndarray
    outer: np.ndarray


def draw(view: View, mesh: TriangleMesh, figure: np.ndarray | None = None, stride: int = STRIDE) -> Drawn:
    """Ray-cast a garment into a view.

    Parameters
    ----------
    figure : (h, w) array, optional
        Depths of the figure at the same pixels (:func:`cast`); it hides what lies more than :data:`THICK` behind it. A figure that
        comes through the cloth by less is wrong about itself.
    """
    hit, depth, facing = cast(view, mesh, stride)
    if figure is not None:
        hidden = figure + THICK < depth
        hit, depth = np.where(hidden, -1, hit), np.minimum(depth, np.where(hidden, figure, np.inf))
    return Drawn(depth, hit, (hit >= 0) & (facing < 0))


def cast(view: View, mesh: TriangleMesh, stride: int = STRIDE) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First triangles of the view's rays (-1: none), their depths (m; inf) and the sign of normal times ray, (h, w) each."""
    trimesh = optional("trimesh", "drawing a mesh needs")
    embree = optional("trimesh.ray.ray_pyembree", "drawing a mesh needs")
    caster = embree.RayMeshIntersector(trimesh.Trimesh(mesh.vertices, mesh.faces, process=False))
    rays = view.grid_rays()[::stride, ::stride]
    shape = rays.shape[:2]
    rays = rays.reshape(-1, 3)
    hit = np.asarray(caster.intersects_first(np.broadcast_to(view.centre, rays.shape), rays))
    a, b, c = (mesh.vertices[mesh.faces[np.maximum(hit, 0), i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    facing = np.einsum("ni,ni->n", normal, rays)
    depth = np.einsum("ni,ni->n", normal, a - view.centre) / np.where(np.abs(facing) > 1e-12, facing, np.inf)
    depth = np.where(hit >= 0, depth, np.inf)
    return hit.reshape(shape), depth.reshape(shape), np.sign(facing).reshape(shape)


class Targets:
    """Weighted targets of vertices, summed up.

    Attributes
    ----------
    weight : (nv,) array
        N/m.
    support : dict of str to (nv,) array
        Weight by the name of what supports a vertex.
    """

    def __init__(self, count: int):
        self.weight, self._sum = np.zeros(count), np.zeros((count, 3))
        self.support: dict[str, np.ndarray] = {}

    def add(self, name: str, ids, places, weight) -> None:
        """Add targets `places` (k, 3) of vertices `ids` (k,), weights (k,)."""
        weight = np.broadcast_to(np.asarray(weight, dtype=float), np.shape(ids))
        np.add.at(self.weight, ids, weight)
        np.add.at(self._sum, ids, weight[:, None] * places)
        np.add.at(self.support.setdefault(name, np.zeros(len(self.weight))), ids, weight)

    @property
    def places(self) -> np.ndarray:
        """(nv, 3) weighted means, m; zero where there is no target."""
        return self._sum / np.where(self.weight > 0, self.weight, 1.0)[:, None]


def seen(view: View, drawn: Drawn, vertices, stride: int = STRIDE) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which vertices a view sees, with their pixels (nv, 2) and depths (nv,)."""
    pixels, depth = view.project(vertices)
    h, w = drawn.depth.shape
    i, j = (np.clip(np.rint(pixels[:, k] / stride), 0, n - 1).astype(int) for k, n in ((1, h), (0, w)))
    inside = (pixels >= 0).all(axis=1) & (pixels[:, 0] <= view.size[1] - 1) & (pixels[:, 1] <= view.size[0] - 1) & (depth > 0)
    return inside & (depth <= drawn.depth[i, j] + HIDDEN), pixels, depth


def outline_targets(targets: Targets, view: View, drawn: Drawn, cloth: Cloth, reach: float = 40.0, stride: int = STRIDE) -> float:
    """Draw a shape's outline to a mask's: what sticks out goes in, and where it falls short its rim goes out.

    Parameters
    ----------
    reach : float
        Longest way that is believed, px.

    Returns
    -------
    float
        Share of the union of both areas that only one of them covers.
    """
    mask, mine = view.mask[::stride, ::stride], drawn.outer
    if not mask.any() or not mine.any():
        return 1.0
    visible, pixels, depth = seen(view, drawn, cloth.x, stride)
    facing = _facing(view, cloth)
    away, (row, column) = distance_transform_edt(~mask, return_indices=True)
    h, w = mask.shape
    i, j = (np.clip(np.rint(pixels[:, k] / stride), 0, n - 1).astype(int) for k, n in ((1, h), (0, w)))
    out = np.flatnonzero(visible & (facing > 0) & (away[i, j] * stride > 1.0) & (away[i, j] * stride < reach))
    goal = stride * np.stack([column[i[out], j[out]], row[i[out], j[out]]], axis=1).astype(float)
    _pull(targets, view, cloth, out, pixels[out], goal, depth[out])
    short, (row, column) = distance_transform_edt(~mine, return_indices=True)
    bare_i, bare_j = np.nonzero(mask & ~mine & (short * stride < reach) & (short * stride > 1.0))
    if len(bare_i):
        from_i, from_j = row[bare_i, bare_j], column[bare_i, bare_j]
        way = stride * np.stack([bare_j - from_j, bare_i - from_i], axis=1).astype(float)
        ids = cloth.sewn.faces[drawn.face[from_i, from_j]].ravel()
        way = np.repeat(way, 3, axis=0)
        order = np.argsort(np.linalg.norm(way, axis=1))  # the longest way of a vertex is the last one written
        longest = np.zeros((len(cloth.x), 2))
        longest[ids[order]] = way[order]
        ids = np.unique(ids)
        _pull(targets, view, cloth, ids, pixels[ids], pixels[ids] + longest[ids], depth[ids])
    return float((mask ^ mine).sum() / (mask | mine).sum())


def _pull(targets: Targets, view: View, cloth: Cloth, ids, pixels, goal, depth) -> None:
    """Targets across the line of sight."""
    sigma = OUTLINE_SIGMA * depth / _focal(view)
    places = cloth.x[ids] + depth[:, None] * (view.rays(goal) - view.rays(pixels))
    targets.add("outline", ids, places, FIRM * cloth.vertex_area[ids] * (SIGMA / sigma) ** 2)


def _focal(view: View) -> float:
    """Pixels for the tangent of an angle: geometric mean of both axes."""
    m = view.camera[:, :3]
    return float(np.sqrt(abs(np.linalg.det(m))))


def _facing(view: View, cloth: Cloth) -> np.ndarray:
    """Cosine between the outer normal of each vertex and the way to the camera."""
    way = view.centre - cloth.x
    normals = cloth.sewn.mesh(cloth.x).vertex_normals
    return np.einsum("ni,ni->n", normals, way / np.linalg.norm(way, axis=1)[:, None])


def depth_targets(targets: Targets, found: DepthMap, drawn: Drawn, cloth: Cloth, gate: float) -> float:
    """Draw vertices along the line of sight to measured depths.

    Parameters
    ----------
    gate : float
        Larger differences are taken for mistakes of one or the other, m.

    Returns
    -------
    float
        Median absolute difference of the vertices that have a depth, m; NaN without any.
    """
    view = found.view
    visible, pixels, depth = seen(view, drawn, cloth.x)
    facing = _facing(view, cloth)
    ids = np.flatnonzero(visible & (facing > 0.2))
    measured, sigma = _about(found, pixels[ids])
    difference = measured - depth[ids]
    there = np.isfinite(measured)
    good = there & (np.abs(difference) < gate)
    ids, difference, sigma = ids[good], difference[good], sigma[good]
    places = cloth.x[ids] + difference[:, None] * view.rays(pixels[ids])
    targets.add("stereo", ids, places, FIRM * cloth.vertex_area[ids] * facing[ids] * (SIGMA / np.maximum(sigma, 1e-3)) ** 2)
    return float(np.median(np.abs(difference))) if len(difference) else float("nan")


def _about(found: DepthMap, pixels, half: int = 3, least: int = 5) -> tuple[np.ndarray, np.ndarray]:
    """Medians of depth and standard deviation in windows about pixels (n, 2); NaN where few pixels have a depth."""
    h, w = found.depth.shape
    offset = np.arange(-half, half + 1)
    i = np.clip(np.rint(pixels[:, 1]).astype(int)[:, None, None] + offset[:, None], 0, h - 1)
    j = np.clip(np.rint(pixels[:, 0]).astype(int)[:, None, None] + offset, 0, w - 1)
    depth, sigma = (a[i, j].reshape(len(pixels), (2 * half + 1) ** 2) for a in (found.depth, found.sigma))
    enough = np.isfinite(depth).sum(axis=1) >= least
    middle, spread = np.full(len(pixels), np.nan), np.full(len(pixels), np.nan)
    middle[enough], spread[enough] = np.nanmedian(depth[enough], axis=1), np.nanmedian(sigma[enough], axis=1)
    return middle, spread


def landmark_targets(targets: Targets, where: Sequence[tuple[int, np.ndarray, float]], patch: float = 2.5e-3) -> None:
    """Targets of single vertices: (vertex, place (3,), standard deviation in m); each stands for a patch of cloth, m²."""
    for vertex, place, sigma in where:
        targets.add("landmark", np.array([vertex]), place[None], FIRM * patch * (SIGMA / max(sigma, SIGMA)) ** 2)
