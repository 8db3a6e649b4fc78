"""What the reference surface contributes to every shell element, computed once and constant afterwards.

The bending energy of an element is ``½ |R (c - c0)|²`` with curvature samples ``c``: the covariant second fundamental form at the
interior points (order 2) and the angle at the edge points. ``R`` holds the eliminated moments (see :mod:`mfar_fem.shell.shell`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mfar_fem.errors import ParameterError
from mfar_fem.shell.tables import Tables, tables
from mfar_fem.surface.mesh import Surface


@dataclass(frozen=True)
class ReferenceGeometry:
    """Element constants (``nt`` elements, ``nq`` interior points, ``nk = 3 ng`` edge points, ``ns`` strain samples).

    Attributes
    ----------
    area_weights : (nt, nq)
        Quadrature weight times area element, m².
    push : (nt, nq, 3, 3)
        Covariant strain (E11, E22, 2 E12) to the warp/weft frame.
    samples : (nt, ns)
        Metric samples of the reference, m².
    edge_director : (nt, nk) int, edge_sign : (nt, nk)
        Global edge point behind each local one, and the side s = ±1 on which the element lies.
    R_interior : (nt, nq, 3, 3), R_edge : (nt, nq, 3, nk)
        Factors of the bending energy (empty where bending is off).
    c0_interior : (nt, nq, 3), c0_edge : (nt, nk)
        Curvature samples of the reference.
    directors : (ne ng, 3)
        Directors of the reference: mean normal of the two sides.
    """

    tables: Tables
    area_weights: np.ndarray
    frame: np.ndarray
    push: np.ndarray
    samples: np.ndarray
    edge_director: np.ndarray
    edge_sign: np.ndarray
    R_interior: np.ndarray
    R_edge: np.ndarray
    c0_interior: np.ndarray
    c0_edge: np.ndarray
    directors: np.ndarray


def tangents(nodes: np.ndarray, elements: np.ndarray, dN: np.ndarray) -> np.ndarray:
    """Covariant base vectors (nt, m, 2, 3) at the points of ``dN`` (m, nn, 2)."""
    return np.einsum("kia,eic->ekac", dN, nodes[elements], optimize=True)


def unit_normals(g: np.ndarray) -> np.ndarray:
    """Unit normals (..., 3) of base vectors (..., 2, 3)."""
    n = np.cross(g[..., 0, :], g[..., 1, :])
    return n / np.linalg.norm(n, axis=-1, keepdims=True)


def edge_points_of_elements(surface: Surface, ng: int) -> tuple[np.ndarray, np.ndarray]:
    """Global edge point (nt, 3 ng) and side (nt, 3 ng) of the local edge points; points run from the low to the high vertex."""
    forward = np.arange(ng)
    sign = surface.edge_signs
    local = np.where(sign[:, :, None] > 0, forward, ng - 1 - forward)
    index = surface.element_edges[:, :, None] * ng + local
    return index.reshape(len(sign), -1), np.repeat(sign, ng, axis=1)


def mean_directors(surface: Surface, nodes: np.ndarray, t: Tables, edge_director: np.ndarray) -> np.ndarray:
    """Directors (ne ng, 3) at the edge points: the normalised mean of the normals on both sides."""
    n = unit_normals(tangents(nodes, surface.elements, t.edge_dN))
    directors = np.zeros((len(surface.edges) * t.ng, 3))
    np.add.at(directors, edge_director, n)
    return directors / np.linalg.norm(directors, axis=1, keepdims=True)


def edge_angles(g: np.ndarray, ds: np.ndarray, directors: np.ndarray) -> np.ndarray:
    """Angle (nt, nk) from the director to the element normal about the edge; ``g`` (nt, nk, 2, 3), ``ds`` (nt, nk, 3)."""
    n, t = unit_normals(g), ds / np.linalg.norm(ds, axis=-1, keepdims=True)
    d = directors - np.sum(directors * t, axis=-1, keepdims=True) * t
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    return np.arctan2(np.sum(n * np.cross(t, d), axis=-1), np.sum(n * d, axis=-1))


def local_frames(surface: Surface, t: Tables) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Normals (nt, nq, 3), area elements (nt, nq), warp/weft frames (nt, nq, 2, 3) and ``L = Tᵀ G`` (nt, nq, 2, 2)."""
    G = tangents(surface.nodes, surface.elements, t.dN)
    cross = np.cross(G[:, :, 0], G[:, :, 1])
    J = np.linalg.norm(cross, axis=-1)
    N0 = cross / J[..., None]
    warp = surface.warp[:, None] - np.sum(surface.warp[:, None] * N0, axis=-1, keepdims=True) * N0
    length = np.linalg.norm(warp, axis=-1)
    if np.any(length < 1e-8):
        bad = np.flatnonzero((length < 1e-8).any(axis=1))
        raise ParameterError(f"the warp direction is normal to the surface in {len(bad)} elements, first {bad[:5].tolist()}")
    warp = warp / length[..., None]
    frame = np.stack([warp, np.cross(N0, warp)], axis=-2)  # (nt, nq, 2, 3)
    L = np.einsum("eqfc,eqac->eqfa", frame, G)
    return N0, J, frame, L


def strain_push(K: np.ndarray) -> np.ndarray:
    """Matrices (nt, nq, 3, 3) that take covariant (E11, E22, 2 E12) to the frame; ``K[a, f] = dxi^a / ds^f`` (nt, nq, 2, 2)."""
    push = np.empty((*K.shape[:2], 3, 3))
    for row, (f, h) in enumerate(((0, 0), (1, 1), (0, 1))):
        two = 1.0 if f == h else 2.0
        push[:, :, row, 0] = two * K[:, :, 0, f] * K[:, :, 0, h]
        push[:, :, row, 1] = two * K[:, :, 1, f] * K[:, :, 1, h]
        push[:, :, row, 2] = 0.5 * two * (K[:, :, 0, f] * K[:, :, 1, h] + K[:, :, 1, f] * K[:, :, 0, h])
    return push


def bending_factors(surface: Surface, D: np.ndarray, direction: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Factors ``R`` of the bending energy for interior samples (nt, nq, 3, 3) and edge samples (nt, nq, 3, nk).

    With ``direction`` v (3,), factors of the derivative of that energy along ``dD = v vᵀ`` instead.
    """
    t = tables(surface.order)
    _, J, _, L = local_frames(surface, t)
    area_weights = J * t.weights
    X = surface.nodes[surface.elements]
    edge_ds = np.einsum("ki,eic->ekc", t.edge_ds, X)
    nt = len(X)
    Ge = tangents(surface.nodes, surface.elements, t.edge_dN)
    Ne, length = unit_normals(Ge), np.linalg.norm(edge_ds, axis=-1)
    mu = np.einsum("ekac,ekc->eka", Ge, np.cross(edge_ds / length[..., None], Ne))
    mumu = np.stack([mu[..., 0] ** 2, mu[..., 1] ** 2, 2 * mu[..., 0] * mu[..., 1]], axis=-1)
    Je = np.linalg.norm(np.cross(Ge[:, :, 0], Ge[:, :, 1]), axis=-1)
    # moments are (J0/J)² times a linear contravariant tensor (double Piola): linear normal moments on curved edges too
    J0 = J.mean(axis=1)
    piola, piola_edge = (J0[:, None] / J) ** 2, (J0[:, None] / Je) ** 2
    V = np.empty((nt, t.nq, 3, 3))
    for row, (f, h) in enumerate(((0, 0), (1, 1), (0, 1))):
        V[:, :, row, 0] = L[:, :, f, 0] * L[:, :, h, 0]
        V[:, :, row, 1] = L[:, :, f, 1] * L[:, :, h, 1]
        V[:, :, row, 2] = L[:, :, f, 0] * L[:, :, h, 1] + L[:, :, f, 1] * L[:, :, h, 0]
    V *= piola[..., None, None]
    # A = w V' D⁻¹ V; V⁻ᵀ transforms strains, so A⁻¹ = factor' factor is written down: computing it loses 3e-3 on slivers of 1:1000
    factor = np.einsum("kf,eqka->eqfa", np.linalg.cholesky(D), strain_push(np.linalg.inv(L)))
    factor /= (np.sqrt(area_weights) * piola)[..., None, None]
    B_interior = np.array([1.0, 1.0, 2.0]) * (area_weights * piola)[..., None]  # diagonal
    weight = np.tile(t.edge_weights, 3) * length * piola_edge
    B_edge = np.einsum("ek,kq,eka->eqak", weight, t.moment_at_edges, mumu, optimize=True)
    if direction is not None:  # dA⁻¹ = A⁻¹ (V' D⁻¹ v)(V' D⁻¹ v)' A⁻¹, of rank one at every point
        y = np.einsum("eqij,eqkj,k->eqi", factor, V, np.linalg.solve(D, direction))
        y *= np.sqrt(area_weights)[..., None]
        factor = np.einsum("eqi,eqj,eqjk->eqik", y / np.maximum(np.linalg.norm(y, axis=-1, keepdims=True), 1e-300), y, factor)
    return np.ascontiguousarray(factor * B_interior[:, :, None, :]), np.ascontiguousarray(factor @ B_edge)


def reference_geometry(surface: Surface, D: np.ndarray | None, directors: np.ndarray | None = None) -> ReferenceGeometry:
    """Element constants of ``surface``.

    Parameters
    ----------
    surface : Surface
    D : (3, 3) array or None
        Bending stiffness, N·m, in the warp/weft frame; None leaves bending (and the edge unknowns) out.
    directors : (ne ng, 3) array, optional
        Directors of the reference, where supports prescribe them; default: mean normals.
    """
    t = tables(surface.order)
    nt, nk = len(surface.elements), 3 * t.ng
    N0, J, frame, L = local_frames(surface, t)
    K = np.linalg.inv(L)  # K[a, f]: dxi^a / ds^f
    push = strain_push(K)
    area_weights = J * t.weights
    edge_director, edge_sign = edge_points_of_elements(surface, t.ng)
    X = surface.nodes[surface.elements]
    edge_ds = np.einsum("ki,eic->ekc", t.edge_ds, X)
    samples = _metric_samples(t, X, edge_ds)
    if D is None:
        empty = np.zeros((nt, 0, 3, 3))
        return ReferenceGeometry(t, area_weights, frame, push, samples, edge_director, edge_sign, empty,
                                 np.zeros((nt, 0, 3, nk)), np.zeros((nt, 0, 3)), np.zeros((nt, nk)), np.zeros((0, 3)))
    if directors is None:
        directors = mean_directors(surface, surface.nodes, t, edge_director)
    Ge = tangents(surface.nodes, surface.elements, t.edge_dN)
    R_interior, R_edge = bending_factors(surface, D)
    x_ab = np.einsum("is,eic->esc", t.second, X)
    c0_interior = np.einsum("esc,eqc->eqs", x_ab, N0)
    c0_edge = edge_angles(Ge, edge_ds, directors[edge_director])
    return ReferenceGeometry(t, area_weights, frame, push, samples, edge_director, edge_sign,
                             R_interior, R_edge, c0_interior, c0_edge, directors)


def _metric_samples(t: Tables, X: np.ndarray, edge_ds: np.ndarray) -> np.ndarray:
    """Strain samples of a configuration measured from nothing: ½|x_s|² at the edge points (order 2), means of ½ g_a·g_b."""
    X = X - X[:, :1]  # as in the kernels: positions relative to the first node keep rounding at the size of the element
    half = np.array([0.5, 0.5, 1.0])
    means = half * np.einsum("sij,eic,ejc->es", t.mean, X, X, optimize=True)
    if t.order == 1:
        return means
    return np.concatenate([0.5 * np.sum(edge_ds**2, axis=-1), means], axis=1)
