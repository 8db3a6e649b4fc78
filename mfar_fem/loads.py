"""Loads and foundations: everything that adds to the potential besides the shell itself.

Each offers ``energy``, ``gradient`` and, where it is not linear, ``hessian`` of a :class:`mfar_fem.shell.State` at a load factor
``lam`` (loads with ``ramp=True`` are multiplied by it). ``conservative`` is False where no potential exists; the line search
then works on the residual alone.
"""

from __future__ import annotations

import numpy as np

from mfar_fem.errors import InputError
from mfar_fem.shell import Shell, State
from mfar_fem.shell.geometry import tangents
from mfar_fem.shell.tables import shape, tables

GRAVITY = (0.0, 0.0, -9.80665)
"""Standard gravity, m/s²."""


class DeadLoad:
    """A constant generalised force on the unknowns.

    Parameters
    ----------
    assemble : callable
        ``assemble(shell) -> (n,)`` array of forces, N (N·m for rotations).
    ramp : bool
        Whether the load factor multiplies it.
    """

    conservative = True
    element_dofs = None

    def __init__(self, assemble, ramp: bool = True):
        self._assemble, self.ramp = assemble, ramp
        self._force = self._reference = np.zeros(0)

    def bind(self, shell: Shell) -> None:
        """Compute the force vector on ``shell``."""
        self._force = self._assemble(shell)
        self._reference = shell.reference_state().u

    def force(self, lam: float) -> np.ndarray:
        """Force vector (n,) at a load factor."""
        return self._force * (lam if self.ramp else 1.0)

    def energy(self, shell: Shell, state: State, lam: float) -> float:
        """Potential -f·(u - u0), J."""
        return -float(self.force(lam) @ (state.u - self._reference))

    def gradient(self, shell: Shell, state: State, lam: float, out: np.ndarray) -> None:
        """Add the gradient, minus the force."""
        out -= self.force(lam)


def nodal_force(nodes, force, ramp: bool = True) -> DeadLoad:
    """Forces (3,) or (m, 3), N, on the given nodes (ids)."""
    def assemble(shell):
        f = np.zeros(shell.n)
        np.add.at(f[: shell.alpha_offset].reshape(-1, 3), np.asarray(nodes), np.asarray(force, dtype=float))
        return f

    return DeadLoad(assemble, ramp)


def area_load(density, ramp: bool = True) -> DeadLoad:
    """Dead load per reference area (3,), N/m²."""
    def assemble(shell):
        g, t = shell.geometry, shell.geometry.tables
        w = np.einsum("eq,qi->ei", g.area_weights, t.N)
        f = np.zeros(shell.n)
        nodal = np.bincount(shell.surface.elements.ravel(), w.ravel(), minlength=len(shell.surface.nodes))
        f[: shell.alpha_offset] = (nodal[:, None] * np.asarray(density, dtype=float)).ravel()
        return f

    return DeadLoad(assemble, ramp)


def gravity(areal_density: float, g=GRAVITY, ramp: bool = True) -> DeadLoad:
    """Weight of the sheet; ``areal_density`` in kg/m², ``g`` in m/s²."""
    return area_load(areal_density * np.asarray(g, dtype=float), ramp)


def edge_load(boundary, force_per_length, ramp: bool = True) -> DeadLoad:
    """Dead force per reference length (3,), N/m, on part of the boundary (name or vertex ids)."""
    def assemble(shell):
        surface, f = shell.surface, np.zeros(shell.n)
        edges = surface.edges_of(boundary)
        if len(edges) == 0:
            raise InputError(f"edge load: no boundary edge lies in {boundary!r}")
        nodes = surface.edges[edges]
        length = surface.edge_lengths[edges]
        weights = (0.5, 0.5)
        if surface.order == 2:
            nodes = np.column_stack([nodes, len(surface.vertices) + edges])
            length, weights = _quadratic_edge_lengths(surface.nodes[nodes]), (1 / 6, 1 / 6, 2 / 3)
        force = np.asarray(force_per_length, dtype=float)
        for column, w in zip(nodes.T, weights, strict=True):
            np.add.at(f[: shell.alpha_offset].reshape(-1, 3), column, (w * length)[:, None] * force)
        return f

    return DeadLoad(assemble, ramp)


def _quadratic_edge_lengths(X: np.ndarray) -> np.ndarray:
    """Lengths (m,) of quadratic edges with nodes (first, last, middle)."""
    s, w = np.polynomial.legendre.leggauss(4)
    s = 0.5 * (s + 1)
    d = np.stack([4 * s - 3, 4 * s - 1, 4 - 8 * s], axis=1)
    return 0.5 * np.linalg.norm(np.einsum("gi,eic->egc", d, X), axis=2) @ w


def edge_moment(boundary, moment_per_length: float, axis=None, ramp: bool = True) -> DeadLoad:
    """Moment per length, N·m/m, that rotates the edge's director about the edge.

    Positive about the edge's tangent in the sense in which the elements run along it (interior on the left seen from the
    normal's tip), or about ``axis`` (3,) where given. The moment follows the edge; its work is moment times rotation.
    """
    def assemble(shell):
        if not shell.with_bending:
            raise InputError("edge moment: the shell has no bending, so no rotation to act on")
        surface, f, t = shell.surface, np.zeros(shell.n), shell.geometry.tables
        for edge in surface.edges_of(boundary):
            element = surface.edge_elements[edge, 0]
            sign = surface.edge_signs[element, surface.element_edges[element] == edge][0]
            if axis is not None:
                a, b = surface.vertices[surface.edges[edge]]
                sign = np.sign((b - a) @ np.asarray(axis, dtype=float))
            points = shell.alpha_offset + edge * t.ng + np.arange(t.ng)
            f[points] -= sign * moment_per_length * surface.edge_lengths[edge] * t.edge_weights
        return f

    return DeadLoad(assemble, ramp)


class Pressure:
    """Follower pressure on the deformed surface, N/m², positive along the normal.

    The force is exact on any surface. A potential (pressure times enclosed volume) exists where the boundary is closed or
    held; on a free boundary the load is not conservative, so the tangent is the symmetric part and ``conservative`` is False.
    """

    def __init__(self, pressure: float, ramp: bool = True):
        self.pressure, self.ramp, self.conservative = float(pressure), ramp, False

    def bind(self, shell: Shell) -> None:
        """Prepare the element tables."""
        self.element_dofs = shell.element_dofs[:, : 3 * shell.surface.elements.shape[1]]
        order = tables(shell.surface.order)
        points = np.array([[1, 1], [4, 1], [1, 4]]) / 6.0 if order.order == 2 else np.array([[1, 1]]) / 3.0
        if order.order == 2:  # x · (x,1 × x,2) has degree 4: six points
            a, b, wa, wb = 0.445948490915965, 0.091576213509771, 0.223381589678011, 0.109951743655322
            points = np.array([[a, a], [1 - 2 * a, a], [a, 1 - 2 * a], [b, b], [1 - 2 * b, b], [b, 1 - 2 * b]])
            self.weights = 0.5 * np.array([wa, wa, wa, wb, wb, wb])
        else:
            self.weights = np.array([0.5])
        self.N, self.dN = shape(order.order, points)

    def _scale(self, lam: float) -> float:
        return self.pressure * (lam if self.ramp else 1.0)

    def energy(self, shell: Shell, state: State, lam: float) -> float:
        """-p V with V = ⅓ ∫ x · n da, J (the potential only where the boundary is closed or held)."""
        x, el = shell.positions(state), shell.surface.elements
        g = tangents(x, el, self.dN)
        position = np.einsum("qi,eic->eqc", self.N, x[el])
        volume = np.einsum("q,eqc,eqc->", self.weights, position, np.cross(g[:, :, 0], g[:, :, 1])) / 3.0
        return -self._scale(lam) * float(volume)

    def gradient(self, shell: Shell, state: State, lam: float, out: np.ndarray) -> None:
        """Add minus the pressure force, consistent on any boundary."""
        g = tangents(shell.positions(state), shell.surface.elements, self.dN)
        f = np.einsum("q,qi,eqc->eic", self.weights, self.N, np.cross(g[:, :, 0], g[:, :, 1]), optimize=True)
        np.add.at(out, self.element_dofs, -self._scale(lam) * f.reshape(len(f), -1))

    def hessian(self, shell: Shell, state: State, lam: float, data, positions, exact: bool) -> None:
        """Add the symmetric part of the derivative; nothing to the safe tangent (it is indefinite)."""
        if not exact:
            return
        g = tangents(shell.positions(state), shell.surface.elements, self.dN)
        eps = np.zeros((3, 3, 3))
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            eps[i, j, k], eps[i, k, j] = 1.0, -1.0
        # d(g1 × g2)_c = eps_cbd (dN_j1 g2_d - dN_j2 g1_d) dx_jb
        v = (np.einsum("qj,eqd->eqjd", self.dN[:, :, 0], g[:, :, 1]) - np.einsum("qj,eqd->eqjd", self.dN[:, :, 1], g[:, :, 0]))
        k = -self._scale(lam) * np.einsum("q,qi,cbd,eqjd->eicjb", self.weights, self.N, eps, v, optimize=True)
        k = k.reshape(len(k), 3 * self.N.shape[1], -1)
        np.add.at(data, positions, (0.5 * (k + k.transpose(0, 2, 1))).reshape(len(k), -1))


class Foundation:
    """Elastic foundation: springs of ``stiffness`` (N/m³ per area) from the reference position, along ``direction`` or all ways."""

    conservative = True

    def __init__(self, stiffness: float, direction=None):
        if not stiffness >= 0:
            raise InputError(f"foundation stiffness must be >= 0 N/m³, got {stiffness}")
        self.stiffness, self.direction = float(stiffness), direction

    def bind(self, shell: Shell) -> None:
        """Compute the consistent element matrices."""
        t, g = shell.geometry.tables, shell.geometry
        P = np.eye(3)
        if self.direction is not None:
            d = np.asarray(self.direction, dtype=float)
            P = np.outer(d, d) / (d @ d)
        self.element_dofs = shell.element_dofs[:, : 3 * shell.surface.elements.shape[1]]
        m = self.stiffness * np.einsum("eq,qi,qj->eij", g.area_weights, t.N, t.N)
        self._blocks = np.einsum("eij,cd->eicjd", m, P).reshape(len(m), self.element_dofs.shape[1], -1)
        self._reference = shell.reference_state().u

    def _force(self, state: State) -> np.ndarray:
        return np.einsum("eij,ej->ei", self._blocks, (state.u - self._reference)[self.element_dofs])

    def energy(self, shell: Shell, state: State, lam: float) -> float:
        """Spring energy, J."""
        return 0.5 * float(np.sum(self._force(state) * (state.u - self._reference)[self.element_dofs]))

    def gradient(self, shell: Shell, state: State, lam: float, out: np.ndarray) -> None:
        """Add the spring forces."""
        np.add.at(out, self.element_dofs, self._force(state))

    def hessian(self, shell: Shell, state: State, lam: float, data, positions, exact: bool) -> None:
        """Add the (constant, positive) spring matrix."""
        np.add.at(data, positions, self._blocks.reshape(len(self._blocks), -1))
