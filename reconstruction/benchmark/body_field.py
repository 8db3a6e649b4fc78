"""A smooth union of tapered capsules as a signed distance field, and its surface."""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import field as dataclass_field

import numba
import numpy as np


@dataclass(frozen=True)
class Field:
    """Smooth union of tapered capsules.

    Parameters
    ----------
    capsules : (n, 8) array
        Ends, then radii at the ends, m.
    softness : float
        Length k of the soft minimum ``-k log sum exp(-d / k)``, m: creases are rounded over about that length.
    grid : (a, b, c) array
        If it has more than one point: distances on a grid, m, used instead of the capsules (trilinear).
    frame : (4,) array
        Position of the grid's first point and its spacing, m.
    """

    capsules: np.ndarray
    softness: float
    grid: np.ndarray = dataclass_field(default_factory=lambda: np.zeros((1, 1, 1)))
    frame: np.ndarray = dataclass_field(default_factory=lambda: np.zeros(4))

    def __call__(self, points) -> np.ndarray:
        """Distance of (n, 3) points to the surface, m, negative inside (exact for one capsule up to its taper)."""
        return distances(np.ascontiguousarray(points, dtype=float), self.capsules, self.softness, self.grid, self.frame)[0]

    def with_gradient(self, points) -> tuple[np.ndarray, np.ndarray]:
        """Distance (n,) and its unit gradient (n, 3)."""
        return distances(np.ascontiguousarray(points, dtype=float), self.capsules, self.softness, self.grid, self.frame)

    def box(self, margin: float) -> tuple[np.ndarray, np.ndarray]:
        """Low and high corner of a box around the surface, m."""
        c = self.capsules
        radius = c[:, 6:].max(axis=1)[:, None] + margin
        ends = np.stack([c[:, :3], c[:, 3:6]])
        return (ends - radius).min(axis=(0, 1)), (ends + radius).max(axis=(0, 1))


@numba.njit(cache=True, fastmath=True)
def field_at(x, y, z, c, softness, grid, frame, grad, work):
    """Distance of one point; the unit gradient is written into `grad`; `work` is (n, 4) scratch."""
    if grid.shape[0] > 1:
        return _grid_at(x, y, z, grid, frame, grad)
    n = c.shape[0]
    least = 1e30
    for i in range(n):
        bx, by, bz = c[i, 3] - c[i, 0], c[i, 4] - c[i, 1], c[i, 5] - c[i, 2]
        px, py, pz = x - c[i, 0], y - c[i, 1], z - c[i, 2]
        t = (px * bx + py * by + pz * bz) / (bx * bx + by * by + bz * bz)
        t = min(max(t, 0.0), 1.0)
        qx, qy, qz = px - t * bx, py - t * by, pz - t * bz
        r = np.sqrt(qx * qx + qy * qy + qz * qz) + 1e-12
        d = r - (c[i, 6] + t * (c[i, 7] - c[i, 6]))
        work[i, 0], work[i, 1], work[i, 2], work[i, 3] = d, qx / r, qy / r, qz / r
        least = min(least, d)
    total = 0.0
    gx = gy = gz = 0.0
    for i in range(n):
        over = work[i, 0] - least
        if over < 8.0 * softness:
            w = np.exp(-over / softness)
            total += w
            gx += w * work[i, 1]
            gy += w * work[i, 2]
            gz += w * work[i, 3]
    size = np.sqrt(gx * gx + gy * gy + gz * gz) + 1e-30
    grad[0], grad[1], grad[2] = gx / size, gy / size, gz / size
    return least - softness * np.log(total)


@numba.njit(cache=True)
def _grid_at(x, y, z, grid, frame, grad):
    px, py, pz = (x - frame[0]) / frame[3], (y - frame[1]) / frame[3], (z - frame[2]) / frame[3]
    nx, ny, nz = grid.shape
    qx, qy, qz = min(max(px, 0.0), nx - 1.001), min(max(py, 0.0), ny - 1.001), min(max(pz, 0.0), nz - 1.001)
    i, j, k = int(qx), int(qy), int(qz)
    s, t, r = qx - i, qy - j, qz - k
    value = gx = gy = gz = 0.0
    for a in range(2):
        wa, da = (s, 1.0) if a else (1 - s, -1.0)
        for b in range(2):
            wb, db = (t, 1.0) if b else (1 - t, -1.0)
            for c in range(2):
                wc, dc = (r, 1.0) if c else (1 - r, -1.0)
                d = grid[i + a, j + b, k + c]
                value += wa * wb * wc * d
                gx += da * wb * wc * d
                gy += wa * db * wc * d
                gz += wa * wb * dc * d
    size = np.sqrt(gx * gx + gy * gy + gz * gz) + 1e-30
    grad[0], grad[1], grad[2] = gx / size, gy / size, gz / size
    ox, oy, oz = px - qx, py - qy, pz - qz  # outside the grid: at least as far as the grid's edge
    return value + frame[3] * np.sqrt(ox * ox + oy * oy + oz * oz)


@numba.njit(cache=True)
def distances(points, capsules, softness, grid, frame):
    """Distances (n,) and gradients (n, 3) of all points."""
    n = points.shape[0]
    value, grad, work = np.empty(n), np.empty((n, 3)), np.empty((capsules.shape[0], 4))
    for i in range(n):
        value[i] = field_at(points[i, 0], points[i, 1], points[i, 2], capsules, softness, grid, frame, grad[i], work)
    return value, grad


def surface(field: Field, size: float = 0.012, floor: float = -np.inf) -> tuple[np.ndarray, np.ndarray]:
    """Closed triangle mesh of the zero level, by marching tetrahedra on a grid, vertices then moved onto it.

    Parameters
    ----------
    field : Field
    size : float
        Grid spacing, m.
    floor : float
        What lies below this height is flattened onto it, m.

    Returns
    -------
    vertices : (n, 3) array
    faces : (m, 3) array of int
        Counter-clockwise seen from outside.
    """
    low, high = field.box(2 * size)
    axes = [np.arange(a, b + size, size) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    shape = grid.shape[:3]
    points = grid.reshape(-1, 3)
    value = field(points)
    value[value == 0.0] = 1e-12
    index = np.arange(len(points)).reshape(shape)
    cells = index[:-1, :-1, :-1].reshape(-1)
    step = np.array([index[1, 0, 0], index[0, 1, 0], index[0, 0, 1]])
    corners = cells[:, None] + np.array([(i & 1) * step[0] + (i >> 1 & 1) * step[1] + (i >> 2) * step[2] for i in range(8)])
    mixed = (value[corners] < 0).any(axis=1) & (value[corners] > 0).any(axis=1)
    corners = corners[mixed]
    tets = np.concatenate(
        [corners[:, list(t)] for t in ((0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7))]
    )
    order = np.argsort(value[tets], axis=1, kind="stable")
    tets = np.take_along_axis(tets, order, axis=1)
    negative = (value[tets] < 0).sum(axis=1)
    ends = []
    one, two, three = tets[negative == 1], tets[negative == 2], tets[negative == 3]
    ends.append(np.stack([one[:, [0, 1]], one[:, [0, 2]], one[:, [0, 3]]], axis=1))
    ends.append(np.stack([three[:, [3, 0]], three[:, [3, 1]], three[:, [3, 2]]], axis=1))
    ends.append(np.stack([two[:, [0, 2]], two[:, [0, 3]], two[:, [1, 3]]], axis=1))
    ends.append(np.stack([two[:, [0, 2]], two[:, [1, 3]], two[:, [1, 2]]], axis=1))
    cut = np.sort(np.concatenate(ends), axis=2)
    unique, where = np.unique(cut.reshape(-1, 2), axis=0, return_inverse=True)
    a, b = unique.T
    t = value[a] / (value[a] - value[b])
    vertices = points[a] + t[:, None] * (points[b] - points[a])
    for _ in range(3):
        d, g = field.with_gradient(vertices)
        vertices = vertices - d[:, None] * g
    faces = where.reshape(-1, 3)
    p = vertices[faces]
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    wrong = np.einsum("ij,ij->i", normal, field.with_gradient(p.mean(axis=1))[1]) < 0
    faces[wrong] = faces[wrong][:, ::-1]
    vertices[:, 2] = np.maximum(vertices[:, 2], floor)
    return vertices, faces
