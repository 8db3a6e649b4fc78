"""Quarter of a disc with meridians, and an eighth of a sphere; a fabric that is all membrane."""

from __future__ import annotations

import numpy as np

from mfar_fem.errors import InputError
from mfar_fem.materials import Bending, Fabric, Law
from mfar_fem.surface import Surface, patterns


def membrane(law: Law, thickness: float) -> Fabric:
    """A sheet of a law (thickness in m) for problems without bending and inertia."""
    return Fabric("membrane", law, thickness, 1e3 * thickness, Bending.from_rigidities(1e-6, 1e-6))


def quarter_disc(radius: float, rings: int, sectors: int, order: int) -> Surface:
    """Quarter of a disc (x, y >= 0) on ``rings`` circles and ``sectors + 1`` meridians, which element edges follow.

    Boundaries ``outer`` (the rim), ``along_x`` and ``along_y`` (the straight sides, centre included), ``centre``.
    """
    if min(rings, sectors) < 2:
        raise InputError(f"a quarter disc needs 2 rings and 2 sectors at least, not {rings} and {sectors}")
    ring = patterns.annulus(radius / rings, radius, rings - 1, sectors, 0.5 * np.pi)
    vertices = np.vstack([ring.vertices, np.zeros(3)])
    centre, inner = len(vertices) - 1, ring.boundary["inner"]
    fan = np.column_stack([np.full(sectors, centre), inner[:-1], inner[1:]])

    def midpoint(i, j):
        middle = 0.5 * (vertices[i] + vertices[j])
        r, other = (np.linalg.norm(vertices[k], axis=1) for k in (i, j))
        arc = np.abs(r - other) < 1e-9 * radius
        middle[arc] *= (r[arc] / np.linalg.norm(middle[arc], axis=1))[:, None]
        return middle

    sides = {"outer": ring.boundary["outer"], "centre": np.array([centre])}
    sides |= {name: np.append(ring.boundary[slit], centre) for name, slit in (("along_x", "slit0"), ("along_y", "slit1"))}
    return Surface(vertices, np.vstack([ring.triangles, fan]), order, midpoint=midpoint, boundary=sides, size=None)


def sphere_octant(radius: float, n: int, order: int) -> Surface:
    """An eighth of a sphere (x, y, z >= 0), an octahedron's face cut into n² and carried outwards.

    Boundaries ``x``, ``y``, ``z``: the vertices on the plane where that coordinate is zero.
    """
    if n < 2:
        raise InputError(f"an octant needs 2 divisions of a side at least, not {n}")
    at = {(i, j): k for k, (i, j) in enumerate((i, j) for i in range(n + 1) for j in range(n + 1 - i))}
    flat = np.array([[i, j, n - i - j] for i, j in at], dtype=float)
    vertices = radius * flat / np.linalg.norm(flat, axis=1, keepdims=True)
    triangles = [(at[i, j], at[i + 1, j], at[i, j + 1]) for i in range(n) for j in range(n - i)]
    triangles += [(at[i + 1, j], at[i + 1, j + 1], at[i, j + 1]) for i in range(n - 1) for j in range(n - 1 - i)]

    def midpoint(i, j):
        middle = vertices[i] + vertices[j]
        return radius * middle / np.linalg.norm(middle, axis=1, keepdims=True)

    sides = {name: np.flatnonzero(flat[:, axis] == 0) for axis, name in enumerate("xyz")}
    return Surface(vertices, triangles, order, midpoint=midpoint, boundary=sides, size=None)
