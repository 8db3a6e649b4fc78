"""Structured triangle meshes in pure numpy: strips, annuli, discs, and patches of cylinders and spheres.

A `Pattern` is geometry only: straight-sided triangles, the parameters (u, v) of every vertex, and the map (u, v) ->
(x, y, z) that puts the nodes of higher order on the true surface (`Pattern.midpoints`). Triangles run
counter-clockwise seen from the side the normal X_u x X_v points to, which is +z for the plane patterns and outwards
for cylinders and spheres.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from mfar_fem.errors import InputError
from mfar_fem.surface.grid import triangulate

Mapping = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Pattern:
    """A triangle mesh of a known surface.

    Attributes
    ----------
    vertices : (n, 3) float64
        Positions in metres.
    triangles : (m, 3) int64
        Vertex ids, counter-clockwise seen from the normal's side.
    boundary : dict of str to (k,) int64
        Vertex ids of each named side, in order along it.
    uv : (n, 2) float64
        Parameters of the vertices.
    mapping : callable
        (..., 2) parameters -> (..., 3) positions.
    period : tuple of float or None
        Period of u and of v where the pattern closes on itself.
    straight_inside : bool
        Only boundary edges follow the mapping; edges inside a plane pattern stay straight (the disc).
    """

    vertices: np.ndarray
    triangles: np.ndarray
    boundary: dict[str, np.ndarray]
    uv: np.ndarray
    mapping: Mapping
    period: tuple[float | None, float | None] = (None, None)
    straight_inside: bool = field(default=False)

    def boundary_edges(self) -> np.ndarray:
        """Edges that belong to one triangle only, (k, 2) vertex ids, low id first."""
        edges = np.sort(self.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        unique, count = np.unique(edges, axis=0, return_counts=True)
        return unique[count == 1]

    def midpoints(self, edges: np.ndarray) -> np.ndarray:
        """Points (k, 3) of the true surface half way (in u and v) along each edge; `edges` (k, 2) vertex ids."""
        edges = np.asarray(edges)
        first, step = self.uv[edges[:, 0]], self.uv[edges[:, 1]] - self.uv[edges[:, 0]]
        for axis, period in enumerate(self.period):
            if period:
                step[:, axis] -= period * np.round(step[:, axis] / period)
        points = self.mapping(first + 0.5 * step)
        if self.straight_inside:
            n = len(self.vertices)
            rim = np.isin(np.sort(edges, axis=1) @ [n, 1], self.boundary_edges() @ [n, 1])
            points = np.where(rim[:, None], points, self.vertices[edges].mean(axis=1))
        return points


def plane(uv: np.ndarray) -> np.ndarray:
    """The identity map (..., 2) -> (..., 3) with z = 0."""
    return np.concatenate([uv, np.zeros((*uv.shape[:-1], 1))], axis=-1)


def rectangle(
    nx: int,
    ny: int,
    u: tuple[float, float] = (0.0, 1.0),
    v: tuple[float, float] = (0.0, 1.0),
    mapping: Mapping = plane,
    pattern: str = "right",
    jitter: float | None = None,
    seed: int = 0,
    close: str | None = None,
) -> Pattern:
    """Structured mesh of a rectangle of parameters, carried to space by `mapping`.

    Parameters
    ----------
    nx, ny : int
        Cells along u and along v.
    u, v : (low, high)
        Ranges of the parameters.
    mapping : callable
        (..., 2) -> (..., 3), metres.
    pattern, jitter, seed
        See `mfar_fem.surface.grid.triangulate`.
    close : {'u', 'v'}, optional
        Glue the two ends of that parameter: the range is then one period (at least 3 cells; not with ``equilateral``
        in u).

    Returns
    -------
    Pattern
        With the sides ``left`` (u low), ``right``, ``bottom`` (v low) and ``top``; glued sides are absent.
    """
    if not (u[1] > u[0] and v[1] > v[0]):
        raise InputError(f"a pattern needs increasing ranges, not u {u} and v {v}")
    points, triangles = triangulate(nx, ny, pattern, jitter, seed)
    sides = {}
    for name, axis, value in (("left", 0, 0), ("right", 0, nx), ("bottom", 1, 0), ("top", 1, ny)):
        ids = np.flatnonzero(points[:, axis] == value)
        sides[name] = ids[np.argsort(points[ids, 1 - axis], kind="stable")]
    low, span = np.array([u[0], v[0]]), np.array([u[1] - u[0], v[1] - v[0]])
    uv = low + points * (span / [nx, ny])
    for axis, value, end in ((0, nx, u[1]), (1, ny, v[1])):
        uv[points[:, axis] == value, axis] = end  # exact, whatever the rounding
    period: list[float | None] = [None, None]
    if close is not None:
        axis = {"u": 0, "v": 1}.get(close, -1)
        keep, drop = (("left", "right"), ("bottom", "top"))[axis]
        if axis < 0 or (nx, ny)[axis] < 3 or len(sides[keep]) != len(sides[drop]):
            raise InputError(f"cannot close {nx} x {ny} '{pattern}' cells in '{close}': 'u' or 'v', 3 cells or more")
        period[axis] = float(span[axis])
        new = np.arange(len(uv))
        new[sides[drop]] = sides[keep]
        rest = np.unique(new)
        renumber = np.full(len(uv), -1)
        renumber[rest] = np.arange(len(rest))
        new = renumber[new]
        del sides[keep], sides[drop]
        triangles, uv = new[triangles], uv[rest]
        sides = {name: new[ids][:-1] for name, ids in sides.items()}
    vertices = np.ascontiguousarray(mapping(uv), dtype=np.float64)
    return Pattern(vertices, np.ascontiguousarray(triangles), sides, uv, mapping, (period[0], period[1]))


def strip(
    length: float, width: float, nx: int, ny: int, pattern: str = "right", jitter: float | None = None, seed: int = 0
) -> Pattern:
    """Flat strip 0 <= x <= length, 0 <= y <= width (m); sides ``left``, ``right``, ``bottom``, ``top``."""
    _positive(length=length, width=width)
    return rectangle(nx, ny, (0.0, length), (0.0, width), plane, pattern, jitter, seed)


def graded(s: np.ndarray, grading: float) -> np.ndarray:
    """The map of [0, 1] onto itself whose slope grows geometrically, to `grading` times that at 0."""
    s = np.asarray(s, dtype=float)
    return s if grading == 1.0 else np.expm1(s * np.log(grading)) / (grading - 1.0)


def ungraded(s: np.ndarray, grading: float) -> np.ndarray:
    """The inverse of :func:`graded`."""
    s = np.asarray(s, dtype=float)
    return s if grading == 1.0 else np.log1p(s * (grading - 1.0)) / np.log(grading)


def annulus(
    r_in: float,
    r_out: float,
    n_r: int,
    n_theta: int,
    angle: float = 2 * np.pi,
    slit: bool = False,
    pattern: str = "right",
    jitter: float | None = None,
    seed: int = 0,
    grading: float = 1.0,
) -> Pattern:
    """Flat annulus or sector in the plane z = 0, parameters u = radius (m; without grading), v = polar angle (rad).

    A full turn is closed unless `slit`; then the two faces of the slit, at angle 0, have vertices of their own in the
    same places. Sides: ``inner``, ``outer``, and, where open, ``slit0`` (angle 0) and ``slit1`` (the other end),
    inner to outer. Rings widen outward in a geometric series, the outermost about `grading` times as wide as the innermost.
    """
    _positive(r_in=r_in, angle=angle, grading=grading)
    if not r_out > r_in:
        raise InputError(f"an annulus needs r_out > r_in, not {r_out} and {r_in}")
    if angle > 2 * np.pi + 1e-12:
        raise InputError(f"an annulus turns by 2 pi at most, not {angle} rad")
    closed = abs(angle - 2 * np.pi) < 1e-12 and not slit

    def mapping(uv):
        r, t = graded((uv[..., 0] - r_in) / (r_out - r_in), grading) * (r_out - r_in) + r_in, uv[..., 1]
        return np.stack([r * np.cos(t), r * np.sin(t), np.zeros_like(r)], axis=-1)

    mesh = rectangle(
        n_r, n_theta, (r_in, r_out), (0.0, angle), mapping, pattern, jitter, seed, close="v" if closed else None
    )
    return _rename(mesh, left="inner", right="outer", bottom="slit0", top="slit1")


def disc(r: float, n: int) -> Pattern:
    """Flat disc of radius `r` (m) round the origin in `n` rings of 6, 12, 18 ... vertices; side ``outer``.

    Parameters (u, v) lie in a regular hexagon whose concentric hexagons are carried to circles.
    """
    _positive(r=r)
    if int(n) != n or n < 1:
        raise InputError(f"a disc needs at least 1 whole ring, not {n}")
    corner = np.exp(1j * np.pi / 3 * np.arange(7))
    rings = [np.zeros(1, complex)]
    for k in range(1, n + 1):
        s = np.arange(k) / k
        rings.append(k * ((1 - s) * corner[:6, None] + s * corner[1:, None]).ravel())
    z = np.concatenate(rings) / n
    start = np.cumsum([0] + [len(ring) for ring in rings])
    tri = [(0, 1 + i, 1 + (i + 1) % 6) for i in range(6)]
    for k in range(2, n + 1):
        a, b, inner, outer = start[k - 1], start[k], 6 * (k - 1), 6 * k
        for side in range(6):
            for i in range(k):
                p, q = b + side * k + i, b + (side * k + i + 1) % outer
                low = a + (side * (k - 1) + i) % inner
                tri.append((low, p, q))
                if i < k - 1:
                    tri.append((low, q, a + (side * (k - 1) + i + 1) % inner))

    def mapping(uv):
        w = uv[..., 0] + 1j * uv[..., 1]
        sector = np.floor(np.mod(np.angle(w), 2 * np.pi) / (np.pi / 3) + 1e-12)
        local = w * np.exp(-1j * np.pi / 3 * sector)
        height = local.imag / np.sin(np.pi / 3)  # along the hexagon's side, 0 .. size
        size = local.real + local.imag / np.tan(np.pi / 3)
        share = np.divide(height, size, out=np.zeros_like(size), where=size > 0)
        p = r * size * np.exp(1j * np.pi / 3 * (sector + share))
        return np.stack([p.real, p.imag, np.zeros_like(size)], axis=-1)

    uv = np.column_stack([z.real, z.imag])
    triangles = np.array(tri, dtype=np.int64)
    outer_ids = np.arange(start[n], start[n + 1])
    return Pattern(mapping(uv), triangles, {"outer": outer_ids}, uv, mapping, straight_inside=True)


def cylinder(
    radius: float,
    length: float,
    angle: tuple[float, float],
    n_angle: int,
    n_length: int,
    pattern: str = "right",
    jitter: float | None = None,
    seed: int = 0,
    closed: bool = False,
) -> Pattern:
    """Patch of a cylinder about the y axis, normal outwards.

    u = angle from +z towards +x (rad) in the range `angle`, v = y from 0 to `length` (m). Sides: ``left`` and
    ``right`` are the generators at the low and the high angle, ``bottom`` and ``top`` the arcs at y = 0 and y =
    length. With `closed` the range must be a full turn and there is neither ``left`` nor ``right``.
    """
    _positive(radius=radius, length=length)

    def mapping(uv):
        t, y = uv[..., 0], uv[..., 1]
        return np.stack([radius * np.sin(t), y, radius * np.cos(t)], axis=-1)

    if closed and abs(angle[1] - angle[0] - 2 * np.pi) > 1e-12:
        raise InputError(f"a closed cylinder turns by 2 pi, not {angle[1] - angle[0]} rad")
    close = "u" if closed else None
    return rectangle(n_angle, n_length, angle, (0.0, length), mapping, pattern, jitter, seed, close)


def sphere(
    radius: float,
    azimuth: tuple[float, float],
    latitude: tuple[float, float],
    n_azimuth: int,
    n_latitude: int,
    pattern: str = "right",
    jitter: float | None = None,
    seed: int = 0,
    closed: bool = False,
) -> Pattern:
    """Patch of a sphere about the origin, normal outwards, poles excluded.

    u = azimuth from +x towards +y (rad), v = latitude (rad) strictly between -pi/2 and pi/2. Sides: ``left`` and
    ``right`` are the meridians at the low and high azimuth (absent when `closed`, a full turn), ``bottom`` and
    ``top`` the parallels.
    """
    _positive(radius=radius)
    if not (-np.pi / 2 < latitude[0] and latitude[1] < np.pi / 2):
        raise InputError(f"the latitudes must lie strictly between the poles, not {latitude} rad")
    if closed and abs(azimuth[1] - azimuth[0] - 2 * np.pi) > 1e-12:
        raise InputError(f"a closed zone turns by 2 pi, not {azimuth[1] - azimuth[0]} rad")

    def mapping(uv):
        a, b = uv[..., 0], uv[..., 1]
        return radius * np.stack([np.cos(b) * np.cos(a), np.cos(b) * np.sin(a), np.sin(b)], axis=-1)

    close = "u" if closed else None
    return rectangle(n_azimuth, n_latitude, azimuth, latitude, mapping, pattern, jitter, seed, close)


def _rename(mesh: Pattern, **names: str) -> Pattern:
    boundary = {names.get(name, name): ids for name, ids in mesh.boundary.items()}
    return Pattern(mesh.vertices, mesh.triangles, boundary, mesh.uv, mesh.mapping, mesh.period)


def _positive(**values: float) -> None:
    for name, value in values.items():
        if not (np.isfinite(value) and value > 0):
            raise InputError(f"{name} must be positive, not {value}")
