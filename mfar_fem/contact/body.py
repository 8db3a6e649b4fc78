"""Rigid bodies the cloth meets: plane, sphere, cylinder, disc and any closed triangle mesh, fixed or on a prescribed path.

Every body answers for its signed distance (positive outside) with the outward unit gradient, the velocity of its material, a
closed triangle mesh of itself in the reference placement, and where its points are at a time.
"""

from __future__ import annotations

import numpy as np

from mfar_fem.contact import primitive_meshes
from mfar_fem.contact.mesh_distance import MeshDistance
from mfar_fem.contact.motion import Motion
from mfar_fem.errors import InputError, ParameterError

__all__ = ["Body", "Cylinder", "Disc", "MeshBody", "Motion", "Plane", "Sphere"]


class Body:
    """A rigid body.

    Parameters
    ----------
    name : str
        What the reports call it.
    friction : float
        Coulomb coefficient against the cloth, >= 0.
    motion : Motion, optional
        Prescribed path; the body stands still without one.

    Raises
    ------
    ParameterError
        Friction negative or not finite.
    """

    def __init__(self, name: str, friction: float = 0.0, motion: Motion | None = None):
        if not 0.0 <= float(friction) < np.inf:
            raise ParameterError(f"{name}: friction must be a finite coefficient >= 0, got {friction}")
        self.name, self.friction, self.motion = name, float(friction), motion

    @property
    def moving(self) -> bool:
        """Whether the body ever changes its place."""
        return self.motion is not None and self.motion.moving

    def signed_distance(self, x, t: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Distance (n,), m, positive outside, and its outward unit gradient (n, 3), at the points x (n, 3) and time t, s.

        Where the gradient does not exist (centre of a sphere, edges) it is one of the limits.
        """
        x = _points(x)
        if self.motion is None:
            return self._distance(x)
        distance, normal = self._distance(self.motion.reference(x, t))
        return distance, normal @ self.motion.pose(t)[0].T

    def velocity(self, x, t: float) -> np.ndarray:
        """Velocity (n, 3), m/s, of the body's material at the points x (n, 3) and time t, s."""
        x = _points(x)
        return np.zeros_like(x) if self.motion is None else self.motion.velocity(x, t)

    def placed(self, vertices, t: float) -> np.ndarray:
        """Where the reference points (m, 3) of the body are at time t, m."""
        vertices = _points(vertices)
        return vertices.copy() if self.motion is None else self.motion.position(vertices, t)

    def mesh(self, size: float | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Vertices (m, 3), m, and outward oriented triangles (k, 3) of the reference placement; `size`: edge length wanted, m."""
        raise NotImplementedError

    def _distance(self, X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Signed distance (n,) and outward unit gradient (n, 3) in the reference placement."""
        raise NotImplementedError


class Plane(Body):
    """Half-space below a plane through ``point`` with outward ``normal``; its mesh is a square sheet of edge ``extent``, m."""

    def __init__(self, point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), *, extent: float = 1.0, name: str = "plane",
                 friction: float = 0.0, motion: Motion | None = None):
        super().__init__(name, friction, motion)
        self.point, self.normal = _vector(name, "point", point), _unit(name, "normal", normal)
        self.extent = _positive(name, "extent", extent)

    def _distance(self, X):
        return (X - self.point) @ self.normal, np.tile(self.normal, (len(X), 1))

    def mesh(self, size: float | None = None):
        """A square sheet in cells of at most ``size`` (default: a tenth of the extent), centred on the point."""
        vertices, triangles = primitive_meshes.square(self.extent, _size(self.name, size, self.extent / 10))
        return self.point + vertices @ _frame(self.normal), triangles


class Sphere(Body):
    """Ball of ``centre`` and ``radius``, m."""

    def __init__(self, centre=(0.0, 0.0, 0.0), radius: float = 0.1, *, name: str = "sphere", friction: float = 0.0,
                 motion: Motion | None = None):
        super().__init__(name, friction, motion)
        self.centre, self.radius = _vector(name, "centre", centre), _positive(name, "radius", radius)

    def _distance(self, X):
        r, normal = _direction(X - self.centre, np.array([0.0, 0.0, 1.0]))
        return r - self.radius, normal

    def mesh(self, size: float | None = None):
        """Subdivided icosahedron with its vertices on the sphere (default size: a tenth of the radius)."""
        vertices, triangles = primitive_meshes.sphere(self.radius, _size(self.name, size, self.radius / 10))
        return self.centre + vertices, triangles


class _Round(Body):
    """Body of revolution about ``axis`` through ``centre``: distances in the half-plane (r, z)."""

    def __init__(self, centre, axis, name, friction, motion):
        super().__init__(name, friction, motion)
        self.centre, self.axis = _vector(name, "centre", centre), _unit(name, "axis", axis)
        self._frame = _frame(self.axis)

    def _distance(self, X):
        rest = X - self.centre
        z = rest @ self.axis
        r, radial = _direction(rest - z[:, None] * self.axis, self._frame[0])
        distance, outward, along = self._profile(r, z)
        return distance, outward[:, None] * radial + along[:, None] * self.axis

    def _profile(self, r: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Distance and its derivatives by r and z, each (n,)."""
        raise NotImplementedError

    def _placed_mesh(self, profile: np.ndarray, counts: np.ndarray):
        vertices, triangles = primitive_meshes.revolve(profile, counts)
        return self.centre + vertices @ self._frame, triangles


class Cylinder(_Round):
    """Capped cylinder: ``centre`` is the middle, ``axis`` its direction, ``radius`` and full ``length`` in m."""

    def __init__(self, centre=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0), radius: float = 0.1, length: float = 0.5, *,
                 name: str = "cylinder", friction: float = 0.0, motion: Motion | None = None):
        super().__init__(centre, axis, name, friction, motion)
        self.radius, self.length = _positive(name, "radius", radius), _positive(name, "length", length)

    def _profile(self, r, z):
        across, along = r - self.radius, np.abs(z) - 0.5 * self.length
        a, b = np.maximum(across, 0.0), np.maximum(along, 0.0)
        gap = np.hypot(a, b)
        inside = gap == 0.0
        side = across >= along
        scale = np.where(inside, 1.0, gap)
        sign = np.where(z < 0.0, -1.0, 1.0)
        distance = np.where(inside, np.maximum(across, along), gap)
        return distance, np.where(inside, side, a / scale), sign * np.where(inside, ~side, b / scale)

    def mesh(self, size: float | None = None):
        """Rings of vertices on the surface (default size: a tenth of the smaller of radius and length)."""
        h = _size(self.name, size, min(self.radius, self.length) / 10)
        r = primitive_meshes.spaced(0.0, self.radius, h)
        z = primitive_meshes.spaced(-0.5 * self.length, 0.5 * self.length, h)
        profile = np.vstack([np.column_stack([r, np.full_like(r, z[0])]), np.column_stack([np.full_like(z, r[-1]), z])[1:-1],
                             np.column_stack([r, np.full_like(r, z[-1])])[::-1]])
        return self._placed_mesh(profile, primitive_meshes.ring_counts(profile[:, 0], h))


class Disc(_Round):
    """Thin round plate with a rounded rim.

    All points within half the ``thickness`` of a flat disc, so that the distance is smooth outside: the plate reaches
    ``radius`` at mid-thickness and is flat up to radius - thickness / 2.

    Parameters
    ----------
    centre, normal : (3,) array_like
        Middle of the plate, m, and its axis.
    radius, thickness : float
        Outer radius and full thickness, m; thickness < 2 radius.
    """

    def __init__(self, centre=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), radius: float = 0.09, thickness: float = 0.002, *,
                 name: str = "disc", friction: float = 0.0, motion: Motion | None = None):
        super().__init__(centre, normal, name, friction, motion)
        self.radius, self.thickness = _positive(name, "radius", radius), _positive(name, "thickness", thickness)
        if self.thickness >= 2.0 * self.radius:
            raise ParameterError(f"{name}: thickness {thickness} m must be less than twice the radius {radius} m")

    @property
    def normal(self) -> np.ndarray:
        """Unit axis (3,) of the plate."""
        return self.axis

    def _profile(self, r, z):
        half = 0.5 * self.thickness
        across = np.maximum(r - (self.radius - half), 0.0)
        gap = np.hypot(across, z)
        scale = np.where(gap == 0.0, 1.0, gap)
        return gap - half, across / scale, np.where(gap == 0.0, 1.0, z / scale)

    def mesh(self, size: float | None = None):
        """Closed mesh, rings of vertices on the surface, six over the rim or more (default size: a tenth of the radius)."""
        h = _size(self.name, size, self.radius / 10)
        half = 0.5 * self.thickness
        flat = primitive_meshes.spaced(0.0, self.radius - half, h)
        angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, max(6, int(np.ceil(np.pi * half / h))) + 1)[1:-1]
        rim = np.column_stack([self.radius - half + half * np.cos(angle), half * np.sin(angle)])
        bottom = np.column_stack([flat, np.full_like(flat, -half)])
        profile = np.vstack([bottom, rim, (bottom * [1.0, -1.0])[::-1]])
        counts = primitive_meshes.ring_counts(profile[:, 0], h)
        counts[profile[:, 0] >= flat[-1]] = counts.max()
        return self._placed_mesh(profile, counts)


class MeshBody(Body):
    """Any closed triangle mesh.

    Parameters
    ----------
    vertices : (m, 3) array_like
        Reference positions, m.
    triangles : (k, 3) array_like of int
        Outward oriented.

    Raises
    ------
    BodyMeshError
        Not finite, not closed, inconsistently or inwardly oriented, degenerate (see `mesh_distance.check_mesh`).
    """

    def __init__(self, vertices, triangles, *, name: str = "mesh", friction: float = 0.0, motion: Motion | None = None):
        super().__init__(name, friction, motion)
        self._field = MeshDistance(vertices, triangles, name)

    @classmethod
    def load(cls, path, *, scale: float = 1.0, name: str | None = None, friction: float = 0.0,
             motion: Motion | None = None) -> MeshBody:
        """Body from a file trimesh reads (OBJ, STL, PLY, ...); ``scale`` turns the file's unit into m, ``name`` is the file's."""
        import trimesh

        mesh = trimesh.load_mesh(path, process=False)
        if str(path).lower().endswith(".stl"):
            mesh.merge_vertices()
        return cls(scale * np.asarray(mesh.vertices), mesh.faces, name=name or str(path), friction=friction, motion=motion)

    def _distance(self, X):
        return self._field.signed_distance(X)

    def mesh(self, size: float | None = None):
        """The mesh itself, whatever the ``size``."""
        return self._field.vertices.copy(), self._field.triangles.copy()


def _points(x) -> np.ndarray:
    x = np.ascontiguousarray(x, dtype=float)
    if x.ndim != 2 or x.shape[1] != 3:
        raise InputError(f"points must have shape (n, 3), got {x.shape}")
    return x


def _vector(name: str, what: str, value) -> np.ndarray:
    v = np.array(value, dtype=float)
    if v.shape != (3,) or not np.all(np.isfinite(v)):
        raise ParameterError(f"{name}: {what} must be three finite numbers, got {value!r}")
    return v


def _unit(name: str, what: str, value) -> np.ndarray:
    v = _vector(name, what, value)
    length = np.linalg.norm(v)
    if length == 0.0:
        raise ParameterError(f"{name}: {what} must not be zero")
    return v / length


def _positive(name: str, what: str, value) -> float:
    if not 0.0 < float(value) < np.inf:
        raise ParameterError(f"{name}: {what} must be positive and finite (m), got {value}")
    return float(value)


def _size(name: str, size, default: float) -> float:
    return default if size is None else _positive(name, "mesh size", size)


def _direction(v: np.ndarray, fallback: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lengths (n,) and unit vectors (n, 3), ``fallback`` where the length is zero."""
    r = np.linalg.norm(v, axis=1)
    zero = r == 0.0
    return r, np.where(zero[:, None], fallback, v / np.where(zero, 1.0, r)[:, None])


def _frame(axis: np.ndarray) -> np.ndarray:
    """Right-handed orthonormal rows (3, 3), the last one the axis."""
    first = np.zeros(3)
    first[np.argmin(np.abs(axis))] = 1.0
    first -= (first @ axis) * axis
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(axis, first), axis])
