"""A cutting template as a sewn mesh: every triangle knows its flat shape, its panel and its warp.

Garments with sleeves are two T-shaped layers, front and back, one above the other when laid flat: joined along the fold of
shoulders and sleeves, under the arms and at the sides down to the slit; open at neck, cuffs, hem and slits. Flat coordinates:
u to the wearer's left from the middle, v down from the fold of the shoulders, m. Overlaps and collars do not belong to this
outer layer (they are cut, not seen).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from matplotlib.path import Path as Polygon
from scipy.spatial import Delaunay, cKDTree

from mfar_fem.errors import InputError
from reconstruction.shape.polyline import evenly, with_corners
from reconstruction.surface.triangles import TriangleMesh
from reconstruction.template.dimensions import Dimensions, HatDimensions, RibbonDimensions, TDimensions
from reconstruction.template.panel import bezier_points
from reconstruction.template.straight_cut import SHALLOW

FRONT, BACK = 0, 1
"""Panels of a garment with sleeves."""


@dataclass(frozen=True, eq=False)
class Sewn:
    """A sewn pattern before it has a shape in space.

    Attributes
    ----------
    garment : str
        Type.
    uv : (nv, 2) array
        Flat coordinates, m; those of a seam are the first panel's.
    faces : (nf, 3) array of int
        Counter-clockwise seen from outside.
    flat : (nf, 3, 2) array
        Flat corners of each triangle in its own panel, m.
    panel : (nf,) array of int
        Index into `panels`.
    panels : tuple of str
    warp : (nf, 2) array
        Unit warp direction in the flat panel.
    layer : (nv,) array of int
        :data:`FRONT` or :data:`BACK`; -1 on both.
    openings : dict of str to array of int
        Vertices along the free edges, in order.
    two_sided : bool
        Whether both faces are seen (a ribbon, a veil), and belong to masks.
    outside : bool
        Whether one face is the outside, next to nothing; of a ribbon either may be.
    """

    garment: str
    uv: np.ndarray
    faces: np.ndarray
    flat: np.ndarray
    panel: np.ndarray
    panels: tuple[str, ...]
    warp: np.ndarray
    layer: np.ndarray
    openings: dict[str, np.ndarray] = field(default_factory=dict)
    two_sided: bool = False
    outside: bool = True

    def nearest(self, uv, layer: int | None = None) -> int:
        """The vertex next to a flat place, of one layer if one is given."""
        distance = np.linalg.norm(self.uv - np.asarray(uv, dtype=float), axis=1)
        if layer is not None:
            distance = np.where((self.layer == layer) | (self.layer < 0), distance, np.inf)
        return int(distance.argmin())

    def warp_in_space(self, vertices) -> np.ndarray:
        """Unit warp directions (nf, 3) of the sewn mesh with these vertices (nv, 3): the flat ones carried along."""
        corners = np.asarray(vertices)[self.faces]
        edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)
        rest = np.stack([self.flat[:, 1] - self.flat[:, 0], self.flat[:, 2] - self.flat[:, 0]], axis=2)
        along = np.einsum("fij,fjk,fk->fi", edges, np.linalg.inv(rest), self.warp)
        return along / np.maximum(np.linalg.norm(along, axis=1), 1e-300)[:, None]

    def mesh(self, vertices) -> TriangleMesh:
        """The mesh with these vertices (nv, 3), m."""
        return TriangleMesh(vertices, self.faces)


def sew(garment: str, dimensions: Dimensions, edge: float) -> Sewn:
    """Mesh a template's outer layer and join its seams.

    Parameters
    ----------
    garment : str
    dimensions : TDimensions, RibbonDimensions or HatDimensions
    edge : float
        Length of edges, m.

    Raises
    ------
    InputError
        The edge length is no positive number, or too long for the narrowest part.
    """
    if not edge > 0:
        raise InputError(f"the edge length must be positive, not {edge} m")
    if isinstance(dimensions, TDimensions):
        return _tunic(garment, dimensions, edge)
    if isinstance(dimensions, RibbonDimensions):
        return _strip(garment, dimensions, edge)
    if isinstance(dimensions, HatDimensions):
        from reconstruction.shape.sewn_hat import sew_hat

        return sew_hat(dimensions, edge)
    raise InputError(f"no rule to sew {type(dimensions).__name__}")


def _tunic(garment: str, d: TDimensions, edge: float) -> Sewn:
    narrow = min(d.cuff_width, d.neck_width)
    if edge > 0.5 * narrow:
        raise InputError(f"edges of {1e3 * edge:g} mm are too long for a width of {1e3 * narrow:.0f} mm; half of it at most")
    seams = _seams(d, edge)
    shared = sum(len(line) for line in seams.values())
    (front, front_faces, front_free), (back, back_faces, back_free) = (_layer(d, edge, seams, side) for side in (FRONT, BACK))
    number = np.concatenate([np.arange(shared), len(front) + np.arange(len(back) - shared)])  # of the back's points in the whole
    # seen from outside: u runs to the viewer's right and v down in front, u to the left and v down behind
    front_faces, back_faces = _turned(front, front_faces, -1.0), _turned(back, back_faces, 1.0)
    openings = {name: _joined(ids, number[back_free[name]]) for name, ids in front_free.items()}
    layer = np.concatenate([np.full(shared, -1), np.full(len(front) - shared, FRONT), np.full(len(back) - shared, BACK)])
    faces = np.concatenate([front_faces, number[back_faces]])
    return Sewn(
        garment,
        np.concatenate([front, back[shared:]]),
        faces,
        np.concatenate([front[front_faces], back[back_faces]]),
        np.repeat([FRONT, BACK], [len(front_faces), len(back_faces)]),
        ("front", "back"),
        np.tile([0.0, 1.0], (len(faces), 1)),
        layer,
        openings,
    )


def _seams(d: TDimensions, edge: float) -> dict[str, np.ndarray]:
    """Points of the lines that join front and back."""
    armpit, foot = np.array([d.body_width / 2, d.armhole_depth]), np.array([d.hem_width / 2, d.length])
    slit = foot + d.slit * (armpit - foot) / np.linalg.norm(armpit - foot)
    fold = with_corners([(d.neck_width / 2, 0.0), (d.cross_sleeve_width / 2, 0.0)], edge)
    under = with_corners([(d.cross_sleeve_width / 2, d.cuff_width), armpit, slit], edge)
    return {f"{side}_{name}": line * (sign, 1.0) for side, sign in SIDES for name, line in (("fold", fold), ("under", under))}


SIDES = (("left", 1.0), ("right", -1.0))


def _layer(d: TDimensions, edge: float, seams: dict[str, np.ndarray], side: int):
    """Points (those of the seams first), faces and free edges of one layer."""
    half, cuff = d.neck_width / 2, d.cross_sleeve_width / 2
    depth, shape = (d.neck_depth, d.neckline) if side == FRONT else (d.back_neck_depth, SHALLOW)
    quarter = bezier_points(
        np.array([(half, 0.0), *((a * half, b * depth) for a, b in shape), (0.0, depth)]), np.linspace(0, 1, 200)
    )
    neck = evenly(np.concatenate([quarter, (quarter[::-1] * (-1, 1))[1:]]), edge)  # from left to right
    free = {"neck": neck, "hem": with_corners([(d.hem_width / 2, d.length), (-d.hem_width / 2, d.length)], edge)}
    for name, sign in SIDES:
        free[f"{name}_cuff"] = with_corners([(cuff, 0.0), (cuff, d.cuff_width)], edge) * (sign, 1.0)
        if d.slit > 0:
            free[f"{name}_slit"] = with_corners([seams["left_under"][-1], (d.hem_width / 2, d.length)], edge) * (sign, 1.0)
    left = [seams["left_fold"], free["left_cuff"], seams["left_under"], free.get("left_slit")]
    right = [seams["right_fold"], free["right_cuff"], seams["right_under"], free.get("right_slit")]
    pieces = [p for p in left if p is not None] + [free["hem"]] + [p[::-1] for p in right[::-1] if p is not None] + [neck[::-1]]
    points, faces = _triangulated(np.concatenate(list(seams.values())), _distinct(np.concatenate(pieces)), edge)
    tree = cKDTree(points)
    return points, faces, {name: tree.query(line)[1] for name, line in free.items()}


def _strip(garment: str, d: RibbonDimensions, edge: float) -> Sewn:
    """A strip; u along it (the warp), v across."""
    long, wide = d.length / 2, d.width / 2
    if edge > wide:
        raise InputError(f"edges of {1e3 * edge:g} mm are too long for a width of {2e3 * wide:.0f} mm; half of it at most")
    rim = with_corners([(-long, -wide), (long, -wide), (long, wide), (-long, wide), (-long, -wide)], edge)[:-1]
    points, faces = _triangulated(np.zeros((0, 2)), rim, edge)
    faces = _turned(points, faces, 1.0)
    return Sewn(
        garment,
        points,
        faces,
        points[faces],
        np.zeros(len(faces), dtype=int),
        ("ribbon",),
        np.tile([1.0, 0.0], (len(faces), 1)),
        np.full(len(points), FRONT),
        {"edge": np.arange(len(rim))},
        two_sided=True,
        outside=False,
    )


def _triangulated(first: np.ndarray, outline: np.ndarray, edge: float) -> tuple[np.ndarray, np.ndarray]:
    """Even triangles in a polygon (n, 2), its halves u > 0 and u < 0 alike; `first` (points of it) get the first numbers."""
    polygon = Polygon(outline)
    reach = np.abs(outline).max(axis=0) + edge
    rows = np.arange(outline[:, 1].min(), outline[:, 1].max(), edge * np.sqrt(3) / 2)
    half = np.arange(0.0, reach[0], edge)
    grid = []
    for i, v in enumerate(rows):
        u = half + 0.5 * edge * (i % 2)
        u = np.concatenate([-u[::-1], u]) if i % 2 else np.concatenate([-u[:0:-1], u])  # left and right alike
        grid.append(np.stack([u, np.full(len(u), v)], axis=1))
    inner = np.concatenate(grid)
    inner = inner[polygon.contains_points(_right(inner))]
    rim = evenly(np.concatenate([outline, outline[:1]]), 0.25 * edge)
    inner = inner[cKDTree(rim).query(_right(inner))[0] > 0.6 * edge]
    points = np.concatenate([_distinct(np.concatenate([first, outline])), inner])
    faces = Delaunay(points).simplices
    corners = points[faces]
    area = np.abs(_double_area(corners))
    inside = polygon.contains_points(corners.mean(axis=1))
    return points, faces[inside & (area > 1e-3 * edge**2)]


def _right(points: np.ndarray) -> np.ndarray:
    """Points mirrored to u >= 0."""
    return np.column_stack([np.abs(points[:, 0]), points[:, 1]])


def _double_area(corners: np.ndarray) -> np.ndarray:
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _turned(points: np.ndarray, faces: np.ndarray, sign: float) -> np.ndarray:
    """Faces whose area in (u, v) has this sign."""
    wrong = sign * _double_area(points[faces]) < 0
    return np.where(wrong[:, None], faces[:, ::-1], faces)


def _joined(front: np.ndarray, back: np.ndarray) -> np.ndarray:
    """One row of vertices from the free edges of both layers, joined where they meet."""
    if front[0] == back[0] and front[-1] != back[-1]:
        return np.concatenate([front[::-1], back[1:]])
    if front[-1] == back[-1]:
        return np.concatenate([front, back[::-1][1:]])
    return np.concatenate([front, back[::-1]])


def _distinct(points: np.ndarray) -> np.ndarray:
    """Without repetitions, in order of the first appearance."""
    index = np.unique((points / 1e-8).round().astype(np.int64), axis=0, return_index=True)[1]
    return points[np.sort(index)]
