"""Constants of the reference triangle for the two shell orders: shape functions, sample points, the Regge interpolation.

Parametric triangle (0,0), (1,0), (0,1); local nodes 0, 1, 2 at the vertices and, at order 2, 3, 4, 5 at the middle of the edges
(0,1), (1,2), (2,0). Symmetric pairs ``ab`` are stored as 11, 22, 12.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

EDGE_START = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
EDGE_DIRECTION = np.array([[1.0, 0.0], [-1.0, 1.0], [0.0, -1.0]])
EDGE_NODES = np.array([[0, 1, 3], [1, 2, 4], [2, 0, 5]])


@dataclass(frozen=True)
class Tables:
    """Reference-element constants; ``nn`` nodes, ``nq`` interior points, ``ng`` points an edge, ``ns`` strain samples.

    Attributes
    ----------
    dN : (nq, nn, 2), second : (nn, 3)
        First derivatives of the shape functions at the interior points, second derivatives (11, 22, 12; constant).
    weights : (nq,)
        Quadrature weights (their sum is 1/2).
    edge_dN : (3 ng, nn, 2), edge_ds : (3 ng, nn)
        Derivatives at the edge points, and along the edge (counter-clockwise, edge parameter in [0, 1]).
    edge_weights : (ng,)
        Weights on [0, 1].
    mean : (3, nn, nn)
        Symmetric ``M_ab``: the element mean of ``∂a x · ∂b x`` is ``Σ_ij M_ab,ij x_i · x_j``.
    interpolation : (nq, 3, ns)
        Covariant strain (E11, E22, 2 E12) at the interior points from the strain samples.
    moment_at_edges : (3 ng, nq)
        Values at the edge points of the moment basis (Lagrange at the interior points).
    """

    order: int
    nn: int
    nq: int
    ng: int
    ns: int
    points: np.ndarray
    weights: np.ndarray
    N: np.ndarray
    dN: np.ndarray
    second: np.ndarray
    edge_points: np.ndarray
    edge_dN: np.ndarray
    edge_ds: np.ndarray
    edge_weights: np.ndarray
    mean: np.ndarray
    interpolation: np.ndarray
    moment_at_edges: np.ndarray


def shape(order: int, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values (m, nn) and derivatives (m, nn, 2) of the Lagrange shape functions at parametric ``points`` (m, 2)."""
    xi, eta = points[:, 0], points[:, 1]
    lam = np.stack([1 - xi - eta, xi, eta], axis=1)
    dlam = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    if order == 1:
        return lam, np.broadcast_to(dlam, (len(points), 3, 2)).copy()
    pairs = [(0, 1), (1, 2), (2, 0)]
    values = np.concatenate([lam * (2 * lam - 1), np.stack([4 * lam[:, i] * lam[:, j] for i, j in pairs], axis=1)], axis=1)
    grads = [(4 * lam[:, i] - 1)[:, None] * dlam[i] for i in range(3)]
    grads += [4 * (lam[:, i, None] * dlam[j] + lam[:, j, None] * dlam[i]) for i, j in pairs]
    return values, np.stack(grads, axis=1)


def _second_derivatives(order: int) -> np.ndarray:
    if order == 1:
        return np.zeros((3, 3))
    _, g00 = shape(2, np.array([[0.0, 0.0]]))
    _, g10 = shape(2, np.array([[1.0, 0.0]]))
    _, g01 = shape(2, np.array([[0.0, 1.0]]))
    return np.stack([(g10 - g00)[0, :, 0], (g01 - g00)[0, :, 1], (g10 - g00)[0, :, 1]], axis=1)


def _regge_interpolation(points: np.ndarray, edge_points: np.ndarray) -> np.ndarray:
    """(m, 3, 9): P1 symmetric tensors from ``t·E·t`` at two points of each edge and the mean of E11, E22, 2 E12."""
    def basis(p):  # (m, 3, 9): E11, E22, 2 E12 of the nine monomials
        out = np.zeros((len(p), 3, 9))
        for c in range(3):
            out[:, c, 3 * c] = 1.0
            out[:, c, 3 * c + 1:3 * c + 3] = p
        return out

    at_edges = basis(edge_points)
    functionals = np.empty((9, 9))
    for k in range(6):
        t = EDGE_DIRECTION[k // 2]
        functionals[k] = np.array([t[0] ** 2, t[1] ** 2, t[0] * t[1]]) @ at_edges[k]
    functionals[6:] = basis(np.array([[1 / 3, 1 / 3]]))[0]
    return basis(points) @ np.linalg.inv(functionals)


@cache
def tables(order: int) -> Tables:
    """The constants of shell order 1 or 2."""
    if order == 1:
        points, weights = np.array([[1 / 3, 1 / 3]]), np.array([0.5])
        s, edge_weights = np.array([0.5]), np.array([1.0])
    else:
        points, weights = np.array([[1, 1], [4, 1], [1, 4]]) / 6.0, np.full(3, 1 / 6)
        s, edge_weights = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0), np.array([0.5, 0.5])
    edge_points = np.concatenate([EDGE_START[e] + s[:, None] * EDGE_DIRECTION[e] for e in range(3)])
    N, dN = shape(order, points)
    _, edge_dN = shape(order, edge_points)
    edge_ds = np.einsum("kia,ka->ki", edge_dN, np.repeat(EDGE_DIRECTION, len(s), axis=0))
    edge_ds[np.abs(edge_ds) < 1e-14] = 0.0
    # the products of two P2 derivatives are quadratic: three points integrate them exactly
    q3 = np.array([[1, 1], [4, 1], [1, 4]]) / 6.0
    _, d3 = shape(order, q3)
    pairs = ((0, 0), (1, 1), (0, 1))
    mean = np.stack([(d3[:, :, None, a] * d3[:, None, :, b]).mean(axis=0) for a, b in pairs])
    mean = 0.5 * (mean + mean.transpose(0, 2, 1))
    if order == 1:
        interpolation, moment_at_edges = np.eye(3)[None], np.ones((3, 1))
    else:
        interpolation = _regge_interpolation(points, edge_points)
        at_points = np.column_stack([np.ones(3), points])
        moment_at_edges = np.column_stack([np.ones(6), edge_points]) @ np.linalg.inv(at_points)
    return Tables(order, dN.shape[1], len(points), len(s), interpolation.shape[2], points, weights, N, dN,
                  _second_derivatives(order), edge_points, edge_dN, edge_ds, edge_weights, mean, interpolation, moment_at_edges)
