r"""Better triangles by ARAP with ideal rest shapes, on the surface.

What the paper attributes to (10), "optimizes the spatial distribution of vertices", (10) does not do
(:mod:`reconstruction.surface.arap`). Here every triangle's rest shape is replaced by an equilateral one with the area that
its neighbourhood has on average, turned to fit (local step); all are reconciled by one sparse solve, factorised once (global
step); the movement is taken along the surface, projected back to it, and halved until

.. math:: E = \frac{1}{n_f} \sum_f \sum_{i \in f} \lVert x_i - c_f - R_f \hat{x}_{f,i} \rVert^2 / A_f

falls. E never rises; connectivity stays; boundary vertices slide along their boundary, its corners stay.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, identity
from scipy.sparse.linalg import splu

from mfar_fem.errors import ParameterError
from reconstruction.libraries import optional
from reconstruction.surface.arap import TOLERANCE
from reconstruction.surface.connectivity import boundary_loops, vertex_average
from reconstruction.surface.quality import smallest_angles
from reconstruction.surface.triangles import TriangleMesh

CORNER = np.radians(30.0)
"""A boundary vertex where the boundary turns by more stays in its place."""

FRACTIONS = tuple(0.5**k for k in range(7))
"""Steps tried."""
LEAST_ANGLE = np.radians(20.0)
"""No triangle's smallest angle may fall below this, or further below where it is already smaller."""


@dataclass(frozen=True, eq=False)
class Improved:
    """A mesh with better triangles.

    Attributes
    ----------
    mesh : TriangleMesh
        Same faces.
    energies : tuple of float
        Never rising.
    moved_mean, moved_max : float
        Distance of the vertices from where they were, m.
    off_mean, off_max : float
        Distance of the new face centres from the old surface, m (its vertices are on it but for rounding).
    """

    mesh: TriangleMesh
    energies: tuple[float, ...]
    moved_mean: float
    moved_max: float
    off_mean: float
    off_max: float


def target_areas(mesh: TriangleMesh, smoothing: int = 5) -> np.ndarray:
    """(nf,) area of each face averaged over its surroundings, m²; the sum is kept."""
    count, n = np.zeros(len(mesh.vertices)), len(mesh.vertices)
    total = np.zeros(n)
    for i in range(3):
        np.add.at(total, mesh.faces[:, i], mesh.areas)
        np.add.at(count, mesh.faces[:, i], 1.0)
    value = total / np.maximum(count, 1)
    average = vertex_average(mesh.faces, n)
    for _ in range(smoothing):
        value = 0.5 * (value + average @ value)
    out = value[mesh.faces].mean(axis=1)
    return np.maximum(out * mesh.areas.sum() / out.sum(), 1e-300)


def ideal_corners(x: np.ndarray, faces: np.ndarray, areas: np.ndarray) -> tuple[np.ndarray, float]:
    """(nf, 3, 3) corners, from the centre, of the equilateral triangles of given areas that fit best, and E (see the
    module)."""
    corner = x[faces]
    local = corner - corner.mean(axis=1, keepdims=True)
    normal = np.cross(local[:, 1] - local[:, 0], local[:, 2] - local[:, 0])
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    normal /= np.maximum(size, 1e-300)
    first = np.where(np.linalg.norm(local[:, :1], axis=2) > 0, local[:, 0], local[:, 1])
    first -= normal * np.einsum("ij,ij->i", first, normal)[:, None]
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-300)
    second = np.cross(normal, first)
    z = np.einsum("nkj,nj->nk", local, first) + 1j * np.einsum("nkj,nj->nk", local, second)
    unit = np.exp(2j * np.pi * np.arange(3) / 3)
    turn = (np.conj(unit) * z).sum(axis=1)
    turn = np.where(np.abs(turn) > 0, turn, 1.0)
    w = (turn / np.abs(turn) * np.sqrt(4 * areas / (3 * np.sqrt(3))))[:, None] * unit
    target = w.real[:, :, None] * first[:, None] + w.imag[:, :, None] * second[:, None]
    energy = float((((local - target) ** 2).sum(axis=(1, 2)) / areas).mean())
    return target, energy


def improve(
    mesh: TriangleMesh, surface: TriangleMesh | None = None, iterations: int = 20, tolerance: float = TOLERANCE,
    damping: float = 0.05, smoothing: int = 5,
) -> Improved:  # fmt: skip
    """Slide the vertices over the surface until the triangles are as near to equilateral ones as they get.

    Parameters
    ----------
    mesh : TriangleMesh
        Manifold.
    surface : TriangleMesh, optional
        What the vertices stay on; default the mesh itself. It has to have the same openings.
    iterations : int
    tolerance : float
        Relative change of E at which iteration stops.
    damping : float
        Pull of every vertex to where it is, against the triangles' weights.
    smoothing : int
        Of :func:`target_areas`: more makes sizes more even, less keeps the grading of an adaptive mesh.

    Raises
    ------
    ParameterError
        Iterations, tolerance or damping not positive.
    """
    if iterations < 1 or not tolerance > 0 or not damping > 0:
        raise ParameterError(f"iterations {iterations}, tolerance {tolerance} and damping {damping} must be positive")
    surface = mesh if surface is None else surface
    areas, faces, n = target_areas(mesh, smoothing), mesh.faces, len(mesh.vertices)
    weight = 1.0 / areas / np.mean(1.0 / areas)
    rows = np.repeat(faces, 3, axis=1).ravel()
    block = (weight[:, None, None] * (np.eye(3) - 1.0 / 3.0)).ravel()
    stiffness = coo_matrix((block, (rows, np.tile(faces, (1, 3)).ravel())), shape=(n, n)).tocsc()
    factor = splu((stiffness + damping * identity(n)).tocsc())
    slide = _Slide(mesh, surface)
    x = mesh.vertices.copy()
    target, energy = ideal_corners(x, faces, areas)
    energies = [energy]
    for _ in range(iterations):
        pull = -(stiffness @ x)
        np.add.at(pull, faces.ravel(), (weight[:, None, None] * target).reshape(-1, 3))
        step = slide.tangential(factor.solve(slide.tangential(pull, x)), x)  # P K⁻¹ P g: descends for any projection P
        accepted = False
        for fraction in FRACTIONS:
            y = slide.onto(x, fraction * step)
            new_target, new_energy = ideal_corners(y, faces, areas)
            if new_energy < energies[-1]:
                accepted = True
                break
        if not accepted:
            break
        x, target = y, new_target
        energies.append(new_energy)
        if energies[-2] - new_energy <= tolerance * energies[-2]:
            break
    moved = np.linalg.norm(x - mesh.vertices, axis=1)
    off = slide.distance(x[faces].mean(axis=1))
    out = TriangleMesh(x, faces)
    return Improved(out, tuple(energies), float(moved.mean()), float(moved.max()), float(off.mean()), float(off.max()))


class _Slide:
    """Moves along a surface and its boundary."""

    def __init__(self, mesh: TriangleMesh, surface: TriangleMesh):
        self.igl = optional("igl", "surfaces need")
        self.faces, self.surface = mesh.faces, surface
        self.tree = self.igl.AABB()
        self.tree.init(surface.vertices, surface.faces)
        self.rim = np.ascontiguousarray(surface.boundary_edges)
        self.loops = boundary_loops(mesh.faces)
        self.edge = np.unique(np.concatenate([*self.loops, mesh.boundary_vertices])) if self.loops else mesh.boundary_vertices
        self.fixed = self._corners(mesh)

    def _corners(self, mesh: TriangleMesh) -> np.ndarray:
        fixed = np.zeros(len(mesh.vertices), bool)
        if len(self.edge) and not len(self.rim):
            fixed[self.edge] = True
        loose = np.setdiff1d(mesh.boundary_vertices, np.concatenate(self.loops) if self.loops else [])
        fixed[loose.astype(int)] = True
        for loop in self.loops:
            d = mesh.vertices[np.roll(loop, -1)] - mesh.vertices[loop]
            d /= np.maximum(np.linalg.norm(d, axis=1, keepdims=True), 1e-300)
            fixed[loop[np.einsum("ij,ij->i", d, np.roll(d, 1, axis=0)) < np.cos(CORNER)]] = True
        return fixed

    def tangential(self, step: np.ndarray, x: np.ndarray) -> np.ndarray:
        now = TriangleMesh(x, self.faces)
        normal = now.vertex_normals
        step = step - np.einsum("ij,ij->i", step, normal)[:, None] * normal
        for loop in self.loops:
            t = x[np.roll(loop, -1)] - x[np.roll(loop, 1)]
            t /= np.maximum(np.linalg.norm(t, axis=1, keepdims=True), 1e-300)
            step[loop] = np.einsum("ij,ij->i", step[loop], t)[:, None] * t
        step[self.fixed] = 0.0
        return step

    def onto(self, x: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Projected movement; a vertex whose projection is far from where it went, or whose faces would turn over or get too
        sharp, stays."""
        y = x + step
        _, _, near = self.tree.squared_distance(self.surface.vertices, self.surface.faces, np.ascontiguousarray(y))
        if len(self.edge) and len(self.rim):
            _, _, near[self.edge] = self.igl.point_mesh_squared_distance(
                np.ascontiguousarray(y[self.edge]), self.surface.vertices, self.rim
            )
        far = np.linalg.norm(near - y, axis=1) > 0.5 * np.linalg.norm(step, axis=1) + 1e-12
        near[far | self.fixed] = x[far | self.fixed]
        old, floor = TriangleMesh(x, self.faces).area_vectors, np.minimum(smallest_angles(x, self.faces), LEAST_ANGLE) - 1e-9
        for _ in range(30):
            new = TriangleMesh(near, self.faces).area_vectors
            worse = (np.einsum("ij,ij->i", old, new) < 0.0) | (smallest_angles(near, self.faces) < floor)
            if not worse.any():
                return near
            stay = np.unique(self.faces[worse])
            near[stay] = x[stay]
        return x.copy()

    def distance(self, points: np.ndarray) -> np.ndarray:
        squared, _, _ = self.tree.squared_distance(self.surface.vertices, self.surface.faces, np.ascontiguousarray(points))
        return np.sqrt(np.maximum(squared, 0.0))
