"""Surfaces with exact distances, to measure what a reconstruction is off by: sphere, torus, cylinder and frustum without
lids, pleated sleeve."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from mfar_fem.errors import UnknownNameError
from reconstruction.libraries import optional
from reconstruction.surface.openings import plane_curve
from reconstruction.surface.triangles import TriangleMesh


@dataclass(frozen=True)
class Sphere:
    """Radius in m; closed."""

    radius: float = 0.2

    def sample(self, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Points (n, 3), m, even over the area, and outward unit normals."""
        n = rng.normal(size=(count, 3))
        n /= np.linalg.norm(n, axis=1)[:, None]
        return self.radius * n, n

    def distance(self, points: np.ndarray) -> np.ndarray:
        """(n,) distance from the surface, m."""
        return np.abs(np.linalg.norm(points, axis=1) - self.radius)

    @property
    def openings(self) -> list[np.ndarray]:
        """Exact rims, (k, 3) closed polylines, m."""
        return []

    def curvature(self, points: np.ndarray) -> np.ndarray:
        """(n,) mean curvature, 1/m."""
        return np.full(len(points), 1 / self.radius)


@dataclass(frozen=True)
class Torus:
    """Radii of the circle and of the tube, m; closed."""

    radius: float = 0.2
    tube: float = 0.06

    def sample(self, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Sphere.sample`."""
        u = rng.random(20 * count) * 2 * np.pi
        u = u[rng.random(len(u)) * (self.radius + self.tube) < self.radius + self.tube * np.cos(u)][:count]
        v = rng.random(len(u)) * 2 * np.pi
        n = np.stack([np.cos(u) * np.cos(v), np.cos(u) * np.sin(v), np.sin(u)], axis=1)
        centre = self.radius * np.stack([np.cos(v), np.sin(v), 0 * v], axis=1)
        return centre + self.tube * n, n

    def distance(self, points: np.ndarray) -> np.ndarray:
        """See :meth:`Sphere.distance`."""
        return np.abs(np.hypot(np.hypot(points[:, 0], points[:, 1]) - self.radius, points[:, 2]) - self.tube)

    @property
    def openings(self) -> list[np.ndarray]:
        """See :meth:`Sphere.openings`."""
        return []


@dataclass(frozen=True)
class Frustum:
    """Radii below and above and height, m; a sleeve: no lids. Equal radii make a cylinder."""

    below: float = 0.2
    above: float = 0.1
    height: float = 0.6

    def sample(self, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Sphere.sample`."""
        t, r0, r1 = rng.random(count), self.below, self.above
        if r0 != r1:  # density of t grows with the radius
            t = (np.sqrt(r0**2 + t * (r1**2 - r0**2)) - r0) / (r1 - r0)
        v = rng.random(count) * 2 * np.pi
        r = r0 + t * (r1 - r0)
        slope = np.array([self.height, r0 - r1]) / np.hypot(self.height, r0 - r1)
        n = np.stack([slope[0] * np.cos(v), slope[0] * np.sin(v), np.full(count, slope[1])], axis=1)
        return np.stack([r * np.cos(v), r * np.sin(v), t * self.height], axis=1), n

    def distance(self, points: np.ndarray) -> np.ndarray:
        """See :meth:`Sphere.distance`; beyond the rims it is the distance from the rim."""
        profile = np.stack([np.hypot(points[:, 0], points[:, 1]), points[:, 2]], axis=1)
        start, along = np.array([self.below, 0.0]), np.array([self.above - self.below, self.height])
        t = np.clip((profile - start) @ along / (along @ along), 0, 1)
        return np.linalg.norm(profile - start - t[:, None] * along, axis=1)

    @property
    def openings(self) -> list[np.ndarray]:
        """See :meth:`Sphere.openings`."""
        ends = ((0.0, self.below), (self.height, self.above))
        return [plane_curve((0, 0, z), (0, 0, 1), r, 256) for z, r in ends]


@dataclass(frozen=True)
class Pleats:
    """A sleeve that falls into folds towards its end: r = R + a s(z)² cos m θ, s from 0 to 1. Distances are from a mesh of
    480 000 triangles."""

    radius: float = 0.15
    fold: float = 0.02
    folds: int = 8
    height: float = 0.5
    _cache: dict = field(default_factory=dict, compare=False, repr=False)

    def at(self, t: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Points at height t (0 to 1) and angle v."""
        r = self.radius + self.fold * t**2 * np.cos(self.folds * v)
        return np.stack([r * np.cos(v), r * np.sin(v), t * self.height], axis=-1)

    def mesh(self, around: int, along: int) -> TriangleMesh:
        """Triangles with their vertices on the surface."""
        v, t = np.meshgrid(2 * np.pi * np.arange(around) / around, np.linspace(0, 1, along + 1))
        i, j = np.meshgrid(np.arange(around), np.arange(along))
        a, b = j * around + i, j * around + (i + 1) % around
        c, d = a + around, b + around
        faces = np.concatenate([np.stack([a, b, d], axis=-1).reshape(-1, 3), np.stack([a, d, c], axis=-1).reshape(-1, 3)])
        return TriangleMesh(self.at(t.ravel(), v.ravel()), faces)

    @property
    def dense(self) -> TriangleMesh:
        """The mesh that stands for the surface."""
        return self._cache.setdefault("mesh", self.mesh(800, 300))

    def sample(self, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Sphere.sample`."""
        points, face = sample_mesh(self.dense, count, rng)
        return points, self.dense.face_normals[face]

    def distance(self, points: np.ndarray) -> np.ndarray:
        """See :meth:`Sphere.distance`."""
        return mesh_distance(points, self.dense)

    @property
    def openings(self) -> list[np.ndarray]:
        """See :meth:`Sphere.openings`."""
        v = 2 * np.pi * np.arange(512) / 512
        return [self.at(np.full(512, t), v) for t in (0.0, 1.0)]


SURFACES = {"sphere": Sphere(), "torus": Torus(), "cylinder": Frustum(0.2, 0.2, 0.8), "frustum": Frustum(), "pleats": Pleats()}
"""By name."""


def analytic(name: str):
    """A surface of :data:`SURFACES`.

    Raises
    ------
    UnknownNameError
    """
    if name not in SURFACES:
        raise UnknownNameError(f"surface '{name}' is unknown: {', '.join(SURFACES)}")
    return SURFACES[name]


def sample_mesh(mesh: TriangleMesh, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3), m, even over the area of a mesh, and their faces."""
    face = rng.choice(len(mesh.faces), count, p=mesh.areas / mesh.areas.sum())
    u, v = rng.random((2, count))
    over = u + v > 1
    u, v = np.where(over, 1 - u, u), np.where(over, 1 - v, v)
    a, b, c = (mesh.vertices[mesh.faces[face, k]] for k in range(3))
    return a + u[:, None] * (b - a) + v[:, None] * (c - a), face


def mesh_distance(points: np.ndarray, mesh: TriangleMesh) -> np.ndarray:
    """(n,) exact distance of points from the triangles of a mesh, m."""
    igl = optional("igl", "distances need")
    squared, _, _ = igl.point_mesh_squared_distance(np.ascontiguousarray(points), mesh.vertices, mesh.faces)
    return np.sqrt(np.maximum(squared, 0.0))


def curve_points(line: np.ndarray, step: float = 5e-4) -> np.ndarray:
    """Points along a closed polyline, at most a step apart, m."""
    following = np.roll(line, -1, axis=0)
    pieces = [a + np.linspace(0, 1, max(2, int(np.ceil(np.linalg.norm(b - a) / step))), endpoint=False)[:, None] * (b - a)
              for a, b in zip(line, following, strict=True)]  # fmt: skip
    return np.vstack(pieces)


def curve_distances(first: list[np.ndarray], second: list[np.ndarray]) -> np.ndarray:
    """Distances both ways between closed polylines, m; sampled every 0.5 mm."""
    a, b = (np.vstack([curve_points(c) for c in lines]) for lines in (first, second))
    return np.concatenate([cKDTree(b).query(a)[0], cKDTree(a).query(b)[0]])
