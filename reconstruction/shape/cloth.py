"""Cloth that hangs, touches a figure and is pulled by evidence: projective dynamics.

S. Bouaziz et al., Projective dynamics: fusing constraint projections for fast simulation, ACM TOG 33 (2014) 154,
doi:10.1145/2601097.2601116. Each triangle is drawn to the nearest deformation without stretch (singular values between
``compressed`` and 1: cloth does not stretch, but its folds may be finer than the mesh); a quadratic bending energy; targets
of vertices with weights. A few iterations a step damp whatever turns: what no target draws comes to rest slowly. It gives a
shape, not a solution of the shell: for that the garment goes to the solver.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, diags
from scipy.sparse.linalg import splu

from mfar_fem.errors import NotConvergedError
from reconstruction.shape.mannequin import Mannequin
from reconstruction.shape.sewn import Sewn

DENSITY, GRAVITY = 0.1, 9.81
"""kg/m² and m/s²: a light silk."""


@dataclass(frozen=True)
class ClothSettings:
    """Membrane stiffness (N/m), bending stiffness (N m), time step (s), share of the velocity kept, clearance from the figure (m),
    stiffness of contact (N/m³), iterations of a step, smallest singular value that costs nothing."""

    membrane: float = 300.0
    bending: float = 3e-3
    dt: float = 0.02
    keep: float = 0.3
    clearance: float = 4e-3
    contact: float = 2e5
    inner: int = 8
    compressed: float = 0.97


class Cloth:
    """A sewn pattern with a shape.

    Parameters
    ----------
    sewn : Sewn
    vertices : (nv, 3) array
        Start, m, in axes with z up.
    body : Mannequin or None
    settings : ClothSettings
    """

    def __init__(self, sewn: Sewn, vertices, body: Mannequin | None, settings: ClothSettings | None = None):
        self.sewn, self.body, self.s = sewn, body, settings or ClothSettings()
        self.x = np.array(vertices, dtype=float)
        self.velocity = np.zeros_like(self.x)
        edges = np.stack([sewn.flat[:, 1] - sewn.flat[:, 0], sewn.flat[:, 2] - sewn.flat[:, 0]], axis=2)
        self.area = 0.5 * np.abs(np.linalg.det(edges))
        inverse = np.linalg.inv(edges)
        # F = sum over corners of x_c (outer) g_c, g (nf, 3 corners, 2)
        self._g = np.concatenate([-(inverse[:, :1] + inverse[:, 1:2]), inverse], axis=1)
        self.vertex_area = np.zeros(len(self.x))
        np.add.at(self.vertex_area, sewn.faces.ravel(), np.repeat(self.area / 3, 3))
        self.laplacian = self._laplacian()
        self._stiffness = self.s.membrane * self.laplacian + self.bending(self.laplacian)
        self._weight = np.full(len(self.x), -1.0)
        self._solve: Any = None

    def _laplacian(self) -> csc_matrix:
        """Stiffness matrix of the Laplacian of the flat panels."""
        faces, n = self.sewn.faces, len(self.x)
        local = self.area[:, None, None] * np.einsum("fai,fbi->fab", self._g, self._g)
        pairs = np.repeat(faces, 3, axis=1).ravel(), np.tile(faces, (1, 3)).ravel()
        return coo_matrix((local.ravel(), pairs), shape=(n, n)).tocsc()

    def bending(self, laplacian: csc_matrix) -> csc_matrix:
        """Bending of isometric surfaces, M. Wardetzky et al., Computer Aided Geometric Design 24 (2007) 499; free edges bend for
        nothing."""
        inner = np.ones(len(self.x))
        for ids in self.sewn.openings.values():
            inner[ids] = 0.0
        return (self.s.bending * laplacian.T @ diags(inner / self.vertex_area) @ laplacian).tocsc()

    def deformation(self, x=None) -> np.ndarray:
        """Deformation gradients (nf, 3, 2)."""
        x = self.x if x is None else x
        return np.einsum("fci,fcj->fij", x[self.sewn.faces], self._g)

    def stretches(self) -> np.ndarray:
        """Singular values (nf, 2) of the deformation gradients, large first."""
        return np.linalg.svd(self.deformation(), compute_uv=False)

    def step(self, weight=None, targets=None, gravity: float = GRAVITY) -> float:
        """One implicit time step.

        Parameters
        ----------
        weight : (nv,) array, optional
            Stiffness of each vertex's target, N/m; 0: none.
        targets : (nv, 3) array, optional
            m.
        gravity : float
            m/s².

        Returns
        -------
        float
            Largest movement, m.

        Raises
        ------
        NotConvergedError
            A vertex left the numbers.
        """
        weight = np.zeros(len(self.x)) if weight is None else np.asarray(weight, dtype=float)
        targets = self.x if targets is None else np.where(weight[:, None] > 0, targets, 0.0)
        mass = DENSITY * self.vertex_area / self.s.dt**2
        start = self.x
        ahead = start + self.s.dt * self.velocity
        ahead[:, 2] -= self.s.dt**2 * gravity
        near, places, normals = self._contacts(start)
        whole = weight.copy()
        whole[near] += self.s.contact * self.vertex_area[near]
        if self._solve is None or not np.array_equal(whole, self._weight):
            self._solve = splu(
                (self._stiffness + diags(mass + whole)).tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}
            )
            self._weight = whole
        constant = mass[:, None] * ahead + weight[:, None] * targets
        x = start
        for _ in range(self.s.inner):
            force = constant + self._forces(x)
            depth = np.einsum("ni,ni->n", x[near] - places, normals)
            force[near] += (self.s.contact * self.vertex_area[near])[:, None] * (
                x[near] - np.minimum(depth, 0.0)[:, None] * normals
            )
            x = self._solve.solve(force)
        if not np.isfinite(x).all():
            raise NotConvergedError("the cloth's shape ran away: targets that contradict the pattern, or too long a time step")
        self.velocity = self.s.keep * (x - start) / self.s.dt
        self.x = x
        return float(np.linalg.norm(x - start, axis=1).max())

    def _contacts(self, x) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Vertices near the figure or in it, a point of the tangent plane for each, and its normal."""
        if self.body is None:
            return np.zeros(0, dtype=int), np.zeros((0, 3)), np.zeros((0, 3))
        depth = self.body.distance(x) - self.s.clearance
        near = np.flatnonzero(depth < 0.01)
        normals = self.body.outwards(x[near])
        return near, x[near] - depth[near, None] * normals, normals

    def _forces(self, x) -> np.ndarray:
        """Right-hand side of the membrane: drawn to the nearest deformations that cost nothing."""
        near = _unstretched(self.deformation(x), self.s.compressed)
        local = self.s.membrane * self.area[:, None, None] * np.einsum("fij,fcj->fci", near, self._g)
        out = np.zeros_like(x)
        for c in range(3):
            for i in range(3):
                out[:, i] += np.bincount(self.sewn.faces[:, c], local[:, c, i], minlength=len(x))
        return out


def _unstretched(f: np.ndarray, compressed: float) -> np.ndarray:
    """The nearest deformation gradients (nf, 3, 2) that cost nothing: F V diag(s'/s) V^T with V, s² of the 2x2 matrices F^T F."""
    a, b, c = (np.einsum("fi,fi->f", f[..., i], f[..., j]) for i, j in ((0, 0), (0, 1), (1, 1)))
    mean, half = 0.5 * (a + c), 0.5 * (a - c)
    radius = np.hypot(half, b)
    large, small = np.sqrt(mean + radius), np.sqrt(np.maximum(mean - radius, 1e-12))
    p, q = np.clip(large, compressed, 1.0) / large, np.clip(small, compressed, 1.0) / small
    # V diag(p, q) V^T = (p+q)/2 I + (p-q)/2 [[cos, sin], [sin, -cos]] of twice the angle
    scale = 0.5 * (p - q) / np.maximum(radius, 1e-15)
    m = 0.5 * (p + q)
    d, o = scale * half, scale * b
    return np.stack(
        [f[..., 0] * (m + d)[:, None] + f[..., 1] * o[:, None], f[..., 0] * o[:, None] + f[..., 1] * (m - d)[:, None]], axis=-1
    )
