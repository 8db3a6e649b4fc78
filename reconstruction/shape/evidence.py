"""What the pictures ask of a shape: outlines, depths and landmarks as targets of vertices.

A target is where a vertex should be according to one picture; its weight falls with the square of its standard deviation. What
supports a vertex is recorded by name, so that a point of which no picture says anything can be told from one that is seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from reconstruction.shape.cloth import Cloth
from reconstruction.stereo.sweep import DepthMap
from reconstruction.stereo.view import View
from reconstruction.surface.rays import Rays
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


class Caster:
    """A mesh that rays are cast at, from any number of views; of a two-sided one both faces belong to the masks."""

    def __init__(self, mesh: TriangleMesh, two_sided: bool = False):
        self.mesh, self.two_sided = mesh, two_sided
        self._rays = Rays(mesh)

    def cast(self, view: View, stride: int = STRIDE) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """First triangles of the view's rays (-1: none), their depths (m; inf) and the sign of normal times ray, (h, w) each."""
        rays = view.grid_rays()[::stride, ::stride]
        hit, depth, sign = self._rays.first(view.centre, rays.reshape(-1, 3))
        return hit.reshape(rays.shape[:2]), depth.reshape(rays.shape[:2]), sign.reshape(rays.shape[:2])


@dataclass(frozen=True, eq=False)
class Drawn:
    """A garment as a view sees it, every :data:`STRIDE` pixels.

    Attributes
    ----------
    depth : (h, w) array
        Along the axis, m, of what is seen first (figure too); inf: nothing.
    face : (h, w) array of int
        Triangle of the garment; -1: figure or nothing.
    outer : (h, w) bool array
        Whether the garment's outer side is seen; of a two-sided one, whether it is seen.
    """

    depth: np.ndarray
    face: np.ndarray
    outer: np.ndarray


def draw(view: View, garment: Caster, figure: np.ndarray | None = None, stride: int = STRIDE) -> Drawn:
    """Draw a garment.

    Parameters
    ----------
    figure : (h, w) array, optional
        Depths of the figure at the same pixels (:meth:`Caster.cast`); it hides what lies more than :data:`THICK` behind it. A
        figure that comes through the cloth by less is wrong about itself.
    """
    hit, depth, facing = garment.cast(view, stride)
    if figure is not None:
        hidden = figure + THICK < depth
        hit, depth = np.where(hidden, -1, hit), np.where(hidden, figure, depth)
    return Drawn(depth, hit, (hit >= 0) & (garment.two_sided | (facing < 0)))


class Outline:
    """A view's mask every :data:`STRIDE` pixels, with the nearest pixel of it everywhere."""

    def __init__(self, view: View):
        self.mask = view.mask[::STRIDE, ::STRIDE]
        self.away, self.nearest = distance_transform_edt(~self.mask, return_indices=True)


@dataclass(frozen=True, eq=False)
class Seen:
    """The vertices of a cloth in a view.

    Attributes
    ----------
    visible : (nv,) bool array
    facing : (nv,) array
        Cosine between the outer normal (of a cloth without an outside the one that is seen) and the way to the camera.
    pixels : (nv, 2) array
    depth : (nv,) array
        m.
    """

    visible: np.ndarray
    facing: np.ndarray
    pixels: np.ndarray
    depth: np.ndarray


def seen(view: View, drawn: Drawn, mesh: TriangleMesh, outside: bool = True) -> Seen:
    """Which vertices a view sees, and where."""
    pixels, depth = view.project(mesh.vertices)
    i, j = _cells(pixels, drawn.depth.shape)
    inside = (pixels >= 0).all(axis=1) & (pixels[:, 0] <= view.size[1] - 1) & (pixels[:, 1] <= view.size[0] - 1) & (depth > 0)
    way = view.centre - mesh.vertices
    facing = np.einsum("ni,ni->n", mesh.vertex_normals, way / np.linalg.norm(way, axis=1)[:, None])
    facing = facing if outside else np.abs(facing)
    return Seen(inside & (depth <= drawn.depth[i, j] + HIDDEN), facing, pixels, depth)


def _cells(pixels, shape, stride: int = STRIDE) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of pixels (n, 2) in an array of every so many, the nearest where they lie outside."""
    i, j = (np.clip(np.rint(pixels[:, k] / stride), 0, n - 1).astype(int) for k, n in ((1, shape[0]), (0, shape[1])))
    return i, j


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


def outline_targets(targets: Targets, view: View, outline: Outline, drawn: Drawn, at: Seen, cloth: Cloth,
                    reach: float = 40.0) -> float:  # fmt: skip
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
    mask, mine = outline.mask, drawn.outer
    if not mask.any() or not mine.any():
        return 1.0
    i, j = _cells(at.pixels, mask.shape)
    away = STRIDE * outline.away[i, j]
    out = np.flatnonzero(at.visible & (at.facing > 0) & (away > 1.0) & (away < reach))
    row, column = outline.nearest[:, i[out], j[out]]
    _pull(targets, view, cloth, at, out, STRIDE * np.stack([column, row], axis=1).astype(float))
    short, (row, column) = distance_transform_edt(~mine, return_indices=True)
    bare_i, bare_j = np.nonzero(mask & ~mine & (STRIDE * short < reach) & (STRIDE * short > 1.0))
    if len(bare_i):
        from_i, from_j = row[bare_i, bare_j], column[bare_i, bare_j]
        way = np.repeat(STRIDE * np.stack([bare_j - from_j, bare_i - from_i], axis=1).astype(float), 3, axis=0)
        ids = cloth.sewn.faces[drawn.face[from_i, from_j]].ravel()
        order = np.argsort(np.linalg.norm(way, axis=1))  # the longest way of a vertex is the last one written
        longest = np.zeros((len(cloth.x), 2))
        longest[ids[order]] = way[order]
        ids = np.unique(ids)
        _pull(targets, view, cloth, at, ids, at.pixels[ids] + longest[ids])
    return float((mask ^ mine).sum() / (mask | mine).sum())


def _pull(targets: Targets, view: View, cloth: Cloth, at: Seen, ids, goal) -> None:
    """Targets across the line of sight, at pixels `goal` (k, 2)."""
    depth = at.depth[ids]
    sigma = OUTLINE_SIGMA * depth / np.sqrt(abs(np.linalg.det(view.camera[:, :3])))  # pixels for the tangent of an angle
    places = cloth.x[ids] + depth[:, None] * (view.rays(goal) - view.rays(at.pixels[ids]))
    targets.add("outline", ids, places, FIRM * cloth.vertex_area[ids] * (SIGMA / sigma) ** 2)


def depth_targets(targets: Targets, found: DepthMap, at: Seen, cloth: Cloth, gate: float) -> float | None:
    """Draw vertices along the line of sight to measured depths.

    Parameters
    ----------
    gate : float
        Larger differences are taken for mistakes of one or the other, m.

    Returns
    -------
    float or None
        Median absolute difference of the vertices that have a depth, m; None without any.
    """
    ids = np.flatnonzero(at.visible & (at.facing > 0.2))
    measured, sigma = _about(found, at.pixels[ids])
    difference = measured - at.depth[ids]
    good = np.abs(difference) < gate  # not where nothing was measured
    ids, difference, sigma = ids[good], difference[good], sigma[good]
    places = cloth.x[ids] + difference[:, None] * found.view.rays(at.pixels[ids])
    targets.add("stereo", ids, places, FIRM * cloth.vertex_area[ids] * at.facing[ids] * (SIGMA / np.maximum(sigma, 1e-3)) ** 2)
    return float(np.median(np.abs(difference))) if len(difference) else None


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
