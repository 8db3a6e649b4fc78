r"""The shell energy once more, in plain numpy as the formulas read: the reference of the numba kernels. Slow; small meshes only.

All depends on the unknowns u of an element (node positions, then edge rotations) through two kinds of samples.

*Strain samples* (order 2: two on each edge and three means; order 1: the means, which are the strain):

.. math:: s_k = \tfrac12 (|x_{,s}|^2 - |X_{,s}|^2), \qquad
          s_{ab} = \frac1{|T|}\int_T \tfrac12 (g_a\cdot g_b - G_a\cdot G_b)\,d\xi \quad (2 s_{12} \text{ for } ab = 12)

whose interpolant is the covariant strain; pushed to the warp/weft frame it gives C = I + 2E and :math:`W_m = \sum_q w_q \Psi(C_q)`.

*Curvature samples*: the second fundamental form :math:`b_{ab} = x_{,ab}\cdot n` at the interior points and, at the edge points, the
angle from the director to the normal

.. math:: \theta = \mathrm{atan2}(n\cdot m,\, n\cdot d) + s\alpha, \qquad
          d = \frac{\bar N - (\bar N\cdot t)t}{|\cdot|}, \quad m = t\times d .

Against the moments :math:`\sigma = \sum_i \sigma_i \psi_i` (contravariant, P0 or P1, scaled by the double Piola factor
:math:`(J_0/J)^2`) they do the work :math:`b_i = B_{ik} (c_k - c^0_k)`; with the compliance
:math:`A_{ij} = \int \psi_i : D^{-1} : \psi_j\, dA` eliminated, :math:`W_b = \tfrac12 (c - c^0)^T B^T A^{-1} B (c - c^0)`.

Derivatives, with the conjugate forces :math:`f = \partial W/\partial s` (or c):

.. math:: \nabla W = J^T f, \qquad \nabla^2 W = J^T W_{ss} J + \sum_k f_k \nabla^2 s_k .

The *safe* tangent keeps :math:`J^T W_{cc} J` of the bending, clamps :math:`W_{EE}` of the law point by point and the forces
in the last sum: edge samples at zero from below, the three means as one 2×2 stress. The derivatives of the samples are second-order
jets (:mod:`mfar_fem.shell.jets`), so none is written by hand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mfar_fem.shell.geometry import local_frames, tangents, unit_normals
from mfar_fem.shell.jets import Jet, angle, constant, cross, dot, linear, stack, unit
from mfar_fem.shell.shell import Shell, State


@dataclass(frozen=True)
class Twin:
    """Element by element: ``membrane``, ``bending`` energy (nt,), ``gradient`` (nt, nu), ``hessian``, ``safe`` (nt, nu, nu)."""

    membrane: np.ndarray
    bending: np.ndarray
    gradient: np.ndarray
    hessian: np.ndarray
    safe: np.ndarray


def evaluate(shell: Shell, state: State) -> Twin:
    """Energy, gradient, exact and safe tangent of every element, in its own unknowns (``shell.element_dofs``)."""
    nt, nu = shell.element_dofs.shape
    membrane, bending, gradient = np.zeros(nt), np.zeros(nt), np.zeros((nt, nu))
    hessian, safe = np.zeros((nt, nu, nu)), np.zeros((nt, nu, nu))
    if shell.with_membrane:
        membrane, g, exact, clamped = _membrane(shell, state, nu)
        gradient, hessian, safe = gradient + g, hessian + exact, safe + clamped
    if shell.with_bending:
        bending, g, exact, clamped = _bending(shell, state, nu)
        gradient, hessian, safe = gradient + g, hessian + exact, safe + clamped
    return Twin(membrane, bending, gradient, hessian, safe)


def assemble(shell: Shell, twin: Twin, exact: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Gradient (n,) and dense tangent (n, n) of the whole shell."""
    g, K = np.zeros(shell.n), np.zeros((shell.n, shell.n))
    np.add.at(g, shell.element_dofs, twin.gradient)
    dofs = shell.element_dofs
    np.add.at(K, (dofs[:, :, None], dofs[:, None, :]), twin.hessian if exact else twin.safe)
    return g, K


def positive_part(A: np.ndarray) -> np.ndarray:
    """Symmetric matrices (..., m, m) without their negative eigenvalues."""
    values, vectors = np.linalg.eigh(A)
    return np.einsum("...ik,...k,...jk->...ij", vectors, np.maximum(values, 0.0), vectors)


# -- membrane ----------------------------------------------------------------------------------------------------------------
def strain_samples(shell: Shell, nodes: np.ndarray, nu: int) -> Jet:
    """Samples of ½ g_a·g_b (nt, ns) of a configuration with ``nodes`` (nn, 3)."""
    t = shell.geometry.tables
    x = _relative(shell, nodes)
    samples = []
    if t.order == 2:
        for weights in t.edge_ds:
            along = linear(weights, x, nu)
            samples.append(dot(along, along) * 0.5)
    for a, b, factor in ((0, 0, 0.5), (1, 1, 0.5), (0, 1, 1.0)):
        at_points = [dot(linear(dN[:, a], x, nu), linear(dN[:, b], x, nu)) for dN in t.dN]  # degree 2: exact
        total = at_points[0]
        for p in at_points[1:]:
            total = total + p
        samples.append(total * (factor / len(at_points)))
    return stack(samples)


def _membrane(shell: Shell, state: State, nu: int):
    t = shell.geometry.tables
    s = strain_samples(shell, shell.positions(state), nu)
    s0 = strain_samples(shell, shell.surface.nodes, nu).value
    _, J, _, L = local_frames(shell.surface, t)
    weights, K = J * t.weights, np.linalg.inv(L)
    E = np.einsum("qak,ek->eqa", t.interpolation, s.value - s0)
    P = _push(K)
    T = np.einsum("eqab,qbk->eqak", P, t.interpolation)
    E = np.einsum("eqab,eqb->eqa", P, E)
    C = np.array([1.0, 1.0, 0.0]) + E * np.array([2.0, 2.0, 1.0])
    W, S, D = shell.fabric.law.evaluate(C.reshape(-1, 3), 2)
    scale = shell.fabric.membrane_scale
    W, S, D = scale * W.reshape(C.shape[:2]), scale * S.reshape(C.shape), scale * D.reshape(*C.shape, 3)
    force = np.einsum("eq,eqa,eqak->ek", weights, S, T)

    def stiffness(law, f):
        inner = np.einsum("eq,eqak,eqab,eqbl->ekl", weights, T, law, T, optimize=True)
        return (np.einsum("eki,ekl,elj->eij", s.first, inner, s.first, optimize=True)
                + np.einsum("ek,ekij->eij", f, s.second))

    clamped = force.copy()
    clamped[:, :-3] = np.maximum(force[:, :-3], 0.0)
    stress = positive_part(force[:, [[-3, -1], [-1, -2]]])
    clamped[:, -3], clamped[:, -2], clamped[:, -1] = stress[:, 0, 0], stress[:, 1, 1], stress[:, 0, 1]
    return (np.einsum("eq,eq->e", weights, W), np.einsum("ek,eki->ei", force, s.first),
            stiffness(D, force), stiffness(positive_part(D), clamped))


def _push(K: np.ndarray) -> np.ndarray:
    """Covariant (E11, E22, 2 E12) to the frame whose base is ``K`` (nt, nq, 2, 2): E_fg = K_af K_bg E_ab."""
    E = np.zeros((3, 2, 2))
    E[0, 0, 0] = E[1, 1, 1] = 1.0
    E[2, 0, 1] = E[2, 1, 0] = 0.5
    full = np.einsum("eqaf,sab,eqbg->eqfgs", K, E, K, optimize=True)
    return np.stack([full[:, :, 0, 0], full[:, :, 1, 1], 2.0 * full[:, :, 0, 1]], axis=2)


# -- bending -----------------------------------------------------------------------------------------------------------------
def curvature_samples(shell: Shell, nodes: np.ndarray, alpha: np.ndarray, directors: np.ndarray, nu: int) -> Jet:
    """Second fundamental form at the interior points (order 2: nt, 3 nq), then the angles at the edge points (nt, nk)."""
    g, t = shell.geometry, shell.geometry.tables
    x = _relative(shell, nodes)
    samples = []
    if t.order == 2:
        for dN in t.dN:
            n = unit(cross(linear(dN[:, 0], x, nu), linear(dN[:, 1], x, nu)))
            samples += [dot(linear(t.second[:, ab], x, nu), n) for ab in range(3)]
    for k in range(3 * t.ng):
        dN = t.edge_dN[k]
        n = unit(cross(linear(dN[:, 0], x, nu), linear(dN[:, 1], x, nu)))
        tangent = unit(linear(t.edge_ds[k], x, nu))
        director = constant(directors[g.edge_director[:, k]], nu)
        along = dot(director, tangent)
        d = unit(director - stack([tangent[:, c] * along for c in range(3)]))
        theta = angle(dot(n, cross(tangent, d)), dot(n, d))
        first = theta.first.copy()
        first[:, 3 * t.nn + k] += g.edge_sign[:, k]
        samples.append(Jet(theta.value + g.edge_sign[:, k] * alpha[g.edge_director[:, k]], first, theta.second))
    return stack(samples)


def bending_stiffness(shell: Shell) -> np.ndarray:
    """``Bᵀ A⁻¹ B`` (nt, nc, nc) of the curvature samples: moments eliminated from compliance and work, both integrated anew."""
    surface, t = shell.surface, shell.geometry.tables
    nt, nk, nq = len(surface.elements), 3 * t.ng, t.nq
    _, J, _, L = local_frames(surface, t)
    J0 = J.mean(axis=1)
    unit_tensors = np.zeros((3, 2, 2))
    unit_tensors[0, 0, 0] = unit_tensors[1, 1, 1] = unit_tensors[2, 0, 1] = unit_tensors[2, 1, 0] = 1.0
    in_frame = np.einsum("eqfa,iab,eqgb->eqfgi", L, unit_tensors, L, optimize=True)
    voigt = np.stack([in_frame[:, :, 0, 0], in_frame[:, :, 1, 1], in_frame[:, :, 0, 1]], axis=2)
    voigt *= ((J0[:, None] / J) ** 2)[..., None, None]
    compliance = np.linalg.inv(shell.fabric.bending.matrix)
    at_points = np.eye(nq)  # the moment basis is Lagrange at the interior points
    A = np.einsum("eq,q,qm,qn,eqvi,vw,eqwj->eminj", J, t.weights, at_points, at_points, voigt, compliance, voigt, optimize=True)
    A = A.reshape(nt, 3 * nq, 3 * nq)
    B: np.ndarray = np.zeros((nt, nq, 3, (3 * nq if t.order == 2 else 0) + nk))
    if t.order == 2:
        for q in range(nq):
            work = J[:, q] * t.weights[q] * (J0 / J[:, q]) ** 2
            for i, double in enumerate((1.0, 1.0, 2.0)):
                B[:, q, i, 3 * q + i] = double * work
    G = tangents(surface.nodes, surface.elements, t.edge_dN)
    N = unit_normals(G)
    ds = np.einsum("ki,eic->ekc", t.edge_ds, surface.nodes[surface.elements])
    length = np.linalg.norm(ds, axis=-1)
    conormal = np.cross(ds / length[..., None], N)
    mu = np.einsum("ekac,ekc->eka", G, conormal)
    J_edge = np.linalg.norm(np.cross(G[:, :, 0], G[:, :, 1]), axis=-1)
    normal_moment = np.einsum("eka,iab,ekb->eki", mu, unit_tensors, mu)
    weight = length * np.tile(t.edge_weights, 3) * (J0[:, None] / J_edge) ** 2
    B[..., -nk:] = np.einsum("ek,kq,eki->eqik", weight, t.moment_at_edges, normal_moment)
    B = B.reshape(nt, 3 * nq, -1)
    return np.einsum("eik,eil->ekl", B, np.linalg.solve(A, B))


def _bending(shell: Shell, state: State, nu: int):
    c = curvature_samples(shell, shell.positions(state), shell.alpha(state), state.directors, nu)
    c0 = curvature_samples(shell, shell.surface.nodes, np.zeros(shell.n_alpha), shell.geometry.directors, nu).value
    Q = bending_stiffness(shell)
    change = c.value - c0
    force = np.einsum("ekl,el->ek", Q, change)
    material = np.einsum("eki,ekl,elj->eij", c.first, Q, c.first, optimize=True)
    return (0.5 * np.einsum("ek,ek->e", force, change), np.einsum("ek,eki->ei", force, c.first),
            material + np.einsum("ek,ekij->eij", force, c.second), material)


def _relative(shell: Shell, nodes: np.ndarray) -> np.ndarray:
    """Element nodes (nt, nn, 3) relative to the first, which keeps rounding at the size of the element."""
    x = nodes[shell.surface.elements]
    return x - x[:, :1]
