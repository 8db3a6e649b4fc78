"""The mass of a sheet, consistent or lumped, as an operator on nodal vectors."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from mfar_fem.errors import InputError
from mfar_fem.shell import Shell

KINDS = ("consistent", "lumped")


class Mass:
    """Mass matrix of a shell; edge rotations carry none (rotary inertia is of the order of the thickness squared).

    Parameters
    ----------
    shell : Shell
    areal_density : float
        kg/m².
    kind : {'consistent', 'lumped'}
        Lumped: diagonal, the consistent diagonal scaled to the element's mass (Hinton, Rock, Zienkiewicz, Earthquake Engng
        Struct. Dyn. 4 (1976) 245, doi 10.1002/eqe.4290040305), positive at order 2 too.

    Attributes
    ----------
    total : float
        kg.
    diagonal : (nn,) array
        Lumped nodal masses, kg (also of the consistent matrix: for estimates).
    blocks : (nt, nn_e, nn_e) array
        Element matrices, kg.
    """

    def __init__(self, shell: Shell, areal_density: float, kind: str = "consistent"):
        if kind not in KINDS:
            raise InputError(f"unknown mass '{kind}'; choose one of {', '.join(KINDS)}")
        if not (np.isfinite(areal_density) and areal_density > 0):
            raise InputError(f"the areal density must be positive and finite, got {areal_density} kg/m²")
        t, elements = shell.geometry.tables, shell.surface.elements
        weights, N, _ = element_quadrature(shell)
        blocks = areal_density * np.einsum("eq,qi,qj->eij", weights, N, N)
        lumped = np.einsum("eii->ei", blocks)
        lumped = lumped * (blocks.sum(axis=(1, 2)) / lumped.sum(axis=1))[:, None]
        n = len(shell.surface.nodes)
        self.kind, self.order = kind, t.order
        self.diagonal = np.bincount(elements.ravel(), lumped.ravel(), minlength=n)
        self.total = float(self.diagonal.sum())
        self.blocks = blocks if kind == "consistent" else np.einsum("ei,ij->eij", lumped, np.eye(lumped.shape[1]))
        size = elements.shape[1]
        rows, columns = np.repeat(elements, size, axis=1).ravel(), np.tile(elements, (1, size)).ravel()
        self._matrix = csr_matrix((self.blocks.ravel(), (rows, columns)), shape=(n, n))
        if kind == "lumped":
            self._matrix.eliminate_zeros()

    def __call__(self, nodal: np.ndarray) -> np.ndarray:
        """Mass times a nodal vector (nn, 3)."""
        if self.kind == "lumped":
            return self.diagonal[:, None] * nodal
        return self._matrix @ nodal

    def solve(self, force: np.ndarray, free: np.ndarray) -> np.ndarray:
        """Acceleration (3 nn,) of free unknowns under a force (3 nn,); the others stay 0. ``free``: ids of position unknowns."""
        out = np.zeros(len(force))
        if self.kind == "lumped":
            out[free] = force[free] / np.repeat(self.diagonal, 3)[free]
            return out
        from scipy.sparse.linalg import splu

        for c in range(3):
            ids = free[free % 3 == c]
            if len(ids):
                block = self._matrix[ids // 3][:, ids // 3]
                out[ids] = splu(block.tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve(force[ids])
        return out


def element_quadrature(shell: Shell) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Quadrature that integrates products of two shape functions exactly on flat elements.

    Weights (nt, nq), m², shape values (nq, nn_e) and their derivatives (nq, nn_e, 2).
    """
    from mfar_fem.shell.geometry import tangents
    from mfar_fem.shell.tables import shape

    order, surface = shell.geometry.tables.order, shell.surface
    if order == 1:
        points, weights = np.array([[0.5, 0.0], [0.5, 0.5], [0.0, 0.5]]), np.full(3, 1 / 6)
    else:  # degree 4
        a, b, wa, wb = 0.445948490915965, 0.091576213509771, 0.111690794839005, 0.054975871827661
        points = np.array([[a, a], [1 - 2 * a, a], [a, 1 - 2 * a], [b, b], [1 - 2 * b, b], [b, 1 - 2 * b]])
        weights = np.array([wa, wa, wa, wb, wb, wb])
    N, dN = shape(order, points)
    G = tangents(surface.nodes, surface.elements, dN)
    return np.linalg.norm(np.cross(G[:, :, 0], G[:, :, 1]), axis=-1) * weights, N, dN
