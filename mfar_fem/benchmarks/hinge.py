r"""The hinge model of bending (discrete shells): what most cloth codes use, here only to compare with.

.. math:: W = \tfrac12 D \sum_e \frac{|e|^2}{A_e} \theta_e^2, \qquad A_e = A_1 + A_2

over the interior edges, with the angle :math:`\theta_e` between the normals of the two triangles and their areas at rest. One
number D for all directions; what it costs to bend the sheet depends on how the triangles lie.

References
----------
1. E. Grinspun, A. N. Hirani, M. Desbrun, P. Schröder, "Discrete shells", SCA 2003, doi 10.5555/846276.846284.
"""

from __future__ import annotations

import numpy as np

from mfar_fem.shell import Shell, State
from mfar_fem.shell.jets import Jet, angle, cross, dot, linear, unit
from mfar_fem.surface import Surface


class HingeBending:
    """Hinge energy of a surface of order 1, put as a load on a shell without bending of its own.

    A clamp is made as in cloth codes: two rows of vertices are held.

    Parameters
    ----------
    rigidity : float
        D, N·m.
    """

    conservative = True

    def __init__(self, rigidity: float):
        self.rigidity = float(rigidity)

    def bind(self, shell: Shell) -> None:
        """Collect the hinges and their angles at rest."""
        self.hinges, self.weights = hinges(shell.surface)
        self.element_dofs = (3 * self.hinges[:, :, None] + np.arange(3)).reshape(len(self.hinges), -1)
        self.rest = hinge_angles(shell.surface.nodes, self.hinges).value

    def energy(self, shell: Shell, state: State, lam: float) -> float:
        """½ D Σ |e|²/A θ², J."""
        theta = hinge_angles(shell.positions(state), self.hinges).value - self.rest
        return 0.5 * self.rigidity * float(self.weights @ theta**2)

    def gradient(self, shell: Shell, state: State, lam: float, out: np.ndarray) -> None:
        """Add its gradient."""
        theta = hinge_angles(shell.positions(state), self.hinges)
        f = self.rigidity * self.weights * (theta.value - self.rest)
        np.add.at(out, self.element_dofs, f[:, None] * theta.first)

    def hessian(self, shell: Shell, state: State, lam: float, data, positions, exact: bool) -> None:
        """Add its Hessian, without the second derivative of the angles in the safe tangent."""
        theta = hinge_angles(shell.positions(state), self.hinges)
        w = self.rigidity * self.weights
        K = w[:, None, None] * theta.first[:, :, None] * theta.first[:, None, :]
        if exact:
            K = K + (w * (theta.value - self.rest))[:, None, None] * theta.second
        np.add.at(data, positions, K.reshape(len(K), -1))


def hinges(surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """Interior hinges (m, 4): ends a, b of the edge, tips c, d of its triangles; and |e|²/(A1 + A2), (m,)."""
    inner = np.flatnonzero(surface.edge_elements[:, 1] >= 0)
    ends, elements = surface.edges[inner], surface.edge_elements[inner]
    tips = surface.triangles[elements].sum(axis=2) - ends.sum(axis=1, keepdims=True)
    weight = surface.edge_lengths[inner] ** 2 / surface.areas[elements].sum(axis=1)
    return np.column_stack([ends, tips]), weight


def hinge_angles(x: np.ndarray, hinge_nodes: np.ndarray) -> Jet:
    """Angles (m,) between the normals of the two triangles, with derivatives by the 12 coordinates."""
    nodes = x[hinge_nodes] - x[hinge_nodes[:, :1]]

    def vector(j):
        weights = -np.eye(4)[0]
        weights[j] += 1.0
        return linear(weights, nodes, 12)

    edge = vector(1)
    n1, n2 = unit(cross(edge, vector(2))), unit(cross(vector(3), edge))
    return angle(dot(cross(n1, n2), unit(edge)), dot(n1, n2))
