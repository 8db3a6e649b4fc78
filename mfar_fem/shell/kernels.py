"""Numba kernels of the shell: strain samples, element energy, residual and tangent, scattered into a fixed sparsity pattern.

Every element matrix is a sum of products ``aᵀ b`` of rows: strain-displacement rows (membrane), rows ``R ∂c/∂u`` (bending)
and, in the exact tangent, the rows of ``∂²c/∂u²``, which are of low rank too. Rows are collected first and multiplied once. The
readable reference is :mod:`mfar_fem.shell.twin`. Kernels are compiled once for each
order and cached on disk.
"""

from __future__ import annotations

import numpy as np
from numba import njit

jit = njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})


@jit
def _clamp3(D):
    """Replace the symmetric ``D`` (3, 3) by its positive semi-definite part, in place; cheap if it is positive."""
    m2 = D[0, 0] * D[1, 1] - D[0, 1] * D[1, 0]
    det = (D[0, 0] * (D[1, 1] * D[2, 2] - D[1, 2] * D[2, 1]) - D[0, 1] * (D[1, 0] * D[2, 2] - D[1, 2] * D[2, 0])
           + D[0, 2] * (D[1, 0] * D[2, 1] - D[1, 1] * D[2, 0]))
    if D[0, 0] > 0.0 and m2 > 0.0 and det > 0.0:
        return
    A, V = D.copy(), np.eye(3)
    for _sweep in range(12):
        off = A[0, 1] ** 2 + A[0, 2] ** 2 + A[1, 2] ** 2
        if off <= 1e-30 * (A[0, 0] ** 2 + A[1, 1] ** 2 + A[2, 2] ** 2 + off):
            break
        for p in range(2):
            for q in range(p + 1, 3):
                if A[p, q] != 0.0:
                    tau = (A[q, q] - A[p, p]) / (2.0 * A[p, q])
                    t = 1.0 / (abs(tau) + np.sqrt(1.0 + tau * tau))
                    if tau < 0.0:
                        t = -t
                    c = 1.0 / np.sqrt(1.0 + t * t)
                    s = t * c
                    for k in range(3):
                        u, v = A[k, p], A[k, q]
                        A[k, p], A[k, q] = c * u - s * v, s * u + c * v
                    for k in range(3):
                        u, v = A[p, k], A[q, k]
                        A[p, k], A[q, k] = c * u - s * v, s * u + c * v
                    for k in range(3):
                        u, v = V[k, p], V[k, q]
                        V[k, p], V[k, q] = c * u - s * v, s * u + c * v
    for i in range(3):
        for j in range(3):
            D[i, j] = 0.0
            for k in range(3):
                if A[k, k] > 0.0:
                    D[i, j] += A[k, k] * V[i, k] * V[j, k]


@jit
def _scatter(K, n, position, data):
    """Add the leading n × n block of an element matrix to the matrix data at the given positions."""
    for i in range(n):
        for j in range(n):
            data[position[i * n + j]] += K[i, j]


@jit
def _clamp2(a, b, c):
    """Positive semi-definite part of the symmetric 2×2 with diagonal a, b and off-diagonal c."""
    mean, radius = 0.5 * (a + b), np.sqrt(0.25 * (a - b) ** 2 + c * c)
    high, low = mean + radius, mean - radius
    if low >= 0.0:
        return a, b, c
    if high <= 0.0:
        return 0.0, 0.0, 0.0
    scale = high / (high - low)
    return scale * (a - low), scale * (b - low), scale * c


@jit
def _base(X, dN, q, g):
    nn = X.shape[0]
    for a in range(2):
        for c in range(3):
            acc = 0.0
            for i in range(nn):
                acc += dN[q, i, a] * X[i, c]
            g[a, c] = acc


@jit
def _contravariant(g, gc, n):
    n[0] = g[0, 1] * g[1, 2] - g[0, 2] * g[1, 1]
    n[1] = g[0, 2] * g[1, 0] - g[0, 0] * g[1, 2]
    n[2] = g[0, 0] * g[1, 1] - g[0, 1] * g[1, 0]
    J2 = n[0] ** 2 + n[1] ** 2 + n[2] ** 2
    if not J2 > 0.0:
        return False
    J = np.sqrt(J2)
    g11 = g[0, 0] ** 2 + g[0, 1] ** 2 + g[0, 2] ** 2
    g22 = g[1, 0] ** 2 + g[1, 1] ** 2 + g[1, 2] ** 2
    g12 = g[0, 0] * g[1, 0] + g[0, 1] * g[1, 1] + g[0, 2] * g[1, 2]
    for c in range(3):
        n[c] /= J
        gc[0, c] = (g22 * g[0, c] - g12 * g[1, c]) / J2
        gc[1, c] = (g11 * g[1, c] - g12 * g[0, c]) / J2
    return True


@jit
def strain(shape, x, conn, edge_ds, mean, samples, interpolation, push, C):
    """Right Cauchy–Green tensor C (nt, nq, 3) in the warp/weft frame."""
    nn, nq, ns, edge_samples = len(shape[0]), len(shape[1]), len(shape[3]) + 3, len(shape[3])
    s, X, e = np.empty(ns), np.empty((nn, 3)), np.empty(3)
    for el in range(conn.shape[0]):
        for i in range(nn):
            for c in range(3):
                X[i, c] = x[conn[el, i], c] - x[conn[el, 0], c]
        for k in range(edge_samples):
            acc = 0.0
            for c in range(3):
                d = 0.0
                for i in range(nn):
                    d += edge_ds[k, i] * X[i, c]
                acc += d * d
            s[k] = 0.5 * acc - samples[el, k]
        for ab in range(3):
            acc = 0.0
            for i in range(nn):
                for j in range(nn):
                    acc += mean[ab, i, j] * (X[i, 0] * X[j, 0] + X[i, 1] * X[j, 1] + X[i, 2] * X[j, 2])
            s[edge_samples + ab] = (acc if ab == 2 else 0.5 * acc) - samples[el, edge_samples + ab]
        for q in range(nq):
            for a in range(3):
                acc = 0.0
                for k in range(ns):
                    acc += interpolation[q, a, k] * s[k]
                e[a] = acc
            for a in range(3):
                E = push[el, q, a, 0] * e[0] + push[el, q, a, 1] * e[1] + push[el, q, a, 2] * e[2]
                C[el, q, a] = E if a == 2 else 1.0 + 2.0 * E


@jit
def bending_samples(shape, el, X, directors, edge_director, dN, second, edge_dN, edge_ds, c0i, c0e, want,
                    ci, ce, zi, ni, gi, ne, ee, ve, me, de, te, le, tau):
    """Curvature samples of an element; with ``want`` also what their derivatives are made of. False without a normal."""
    nn, nq, nk, curved = len(shape[0]), len(shape[1]), len(shape[2]), len(shape[3]) > 0
    g, gc, xab = np.empty((2, 3)), np.empty((2, 3)), np.empty((3, 3))
    if curved:
        for a in range(3):
            for c in range(3):
                acc = 0.0
                for i in range(nn):
                    acc += second[i, a] * X[i, c]
                xab[a, c] = acc
        for q in range(nq):
            _base(X, dN, q, g)
            if not _contravariant(g, gc, ni[q]):
                return False
            for a in range(3):
                ci[q, a] = xab[a, 0] * ni[q, 0] + xab[a, 1] * ni[q, 1] + xab[a, 2] * ni[q, 2] - c0i[el, q, a]
            if want:
                for a in range(3):
                    G1 = xab[a, 0] * gc[0, 0] + xab[a, 1] * gc[0, 1] + xab[a, 2] * gc[0, 2]
                    G2 = xab[a, 0] * gc[1, 0] + xab[a, 1] * gc[1, 1] + xab[a, 2] * gc[1, 2]
                    for i in range(nn):
                        zi[q, a, i] = second[i, a] - G1 * dN[q, i, 0] - G2 * dN[q, i, 1]
                for a in range(2):
                    for c in range(3):
                        gi[q, a, c] = gc[a, c]
    n = np.empty(3)
    for k in range(nk):
        _base(X, edge_dN, k, g)
        if not _contravariant(g, gc, n):
            return False
        t0 = t1 = t2 = 0.0
        for i in range(nn):
            w = edge_ds[k, i]
            t0 += w * X[i, 0]
            t1 += w * X[i, 1]
            t2 += w * X[i, 2]
        length = np.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
        t0, t1, t2 = t0 / length, t1 / length, t2 / length
        p = edge_director[el, k]
        N0, N1, N2 = directors[p, 0], directors[p, 1], directors[p, 2]
        along = N0 * t0 + N1 * t1 + N2 * t2
        d0, d1, d2 = N0 - along * t0, N1 - along * t1, N2 - along * t2
        rho = np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
        if not rho > 1e-6:
            return False
        d0, d1, d2 = d0 / rho, d1 / rho, d2 / rho
        m0, m1, m2 = t1 * d2 - t2 * d1, t2 * d0 - t0 * d2, t0 * d1 - t1 * d0
        s = n[0] * m0 + n[1] * m1 + n[2] * m2
        co = n[0] * d0 + n[1] * d1 + n[2] * d2
        ce[k] = np.arctan2(s, co) - c0e[el, k]
        if want:
            te[k, 0], te[k, 1], te[k, 2] = t0, t1, t2
            de[k, 0], de[k, 1], de[k, 2] = d0, d1, d2
            me[k, 0], me[k, 1], me[k, 2] = m0, m1, m2
            ee[k, 0], ee[k, 1] = co, s
            e0, e1, e2 = co * m0 - s * d0, co * m1 - s * d1, co * m2 - s * d2
            le[k] = length
            tau[k] = along / (rho * length)
            eps0 = gc[0, 0] * e0 + gc[0, 1] * e1 + gc[0, 2] * e2
            eps1 = gc[1, 0] * e0 + gc[1, 1] * e1 + gc[1, 2] * e2
            for i in range(nn):
                ve[k, i] = edge_dN[k, i, 0] * eps0 + edge_dN[k, i, 1] * eps1
            for c in range(3):
                ne[k, 0, c] = n[c]
                ne[k, 1, c] = gc[0, c]
                ne[k, 2, c] = gc[1, c]
    return True


@jit
def curvature(shape, x, alpha, directors, conn, edge_director, edge_sign, dN, second, edge_dN, edge_ds, c0i, c0e, interior, edge):
    """Curvature samples of every element at its interior points (nt, nq, 3) and edge points (nt, nk, α included)."""
    nn, nq, nk = len(shape[0]), len(shape[1]), len(shape[2])
    X = np.empty((nn, 3))
    zi, ni, gi = np.empty((nq, 3, nn)), np.empty((nq, 3)), np.empty((nq, 2, 3))
    ne, ee, ve, me = np.empty((nk, 3, 3)), np.empty((nk, 2)), np.empty((nk, nn)), np.empty((nk, 3))
    de, te, le, tau = np.empty((nk, 3)), np.empty((nk, 3)), np.empty(nk), np.empty(nk)
    for el in range(conn.shape[0]):
        for i in range(nn):
            for c in range(3):
                X[i, c] = x[conn[el, i], c] - x[conn[el, 0], c]
        bending_samples(shape, el, X, directors, edge_director, dN, second, edge_dN, edge_ds, c0i, c0e, False,
                        interior[el], edge[el], zi, ni, gi, ne, ee, ve, me, de, te, le, tau)
        for k in range(nk):
            edge[el, k] += edge_sign[el, k] * alpha[edge_director[el, k]]


@jit
def bending_energy(shape, x, alpha, directors, conn, edge_director, edge_sign, dN, second, edge_dN, edge_ds,
                   Ri, Re, c0i, c0e, out):
    """Bending energy (nt,) of every element, +inf where an element has no normal."""
    nn, nq, nk, curved = len(shape[0]), len(shape[1]), len(shape[2]), len(shape[3]) > 0
    X = np.empty((nn, 3))
    ci, ce = np.zeros((nq, 3)), np.empty(nk)
    zi, ni, gi = np.empty((nq, 3, nn)), np.empty((nq, 3)), np.empty((nq, 2, 3))
    ne, ee, ve, me = np.empty((nk, 3, 3)), np.empty((nk, 2)), np.empty((nk, nn)), np.empty((nk, 3))
    de, te, le, tau = np.empty((nk, 3)), np.empty((nk, 3)), np.empty(nk), np.empty(nk)
    for el in range(conn.shape[0]):
        for i in range(nn):
            for c in range(3):
                X[i, c] = x[conn[el, i], c] - x[conn[el, 0], c]
        if not bending_samples(shape, el, X, directors, edge_director, dN, second, edge_dN, edge_ds, c0i, c0e, False,
                               ci, ce, zi, ni, gi, ne, ee, ve, me, de, te, le, tau):
            out[el] = np.inf
            continue
        for k in range(nk):
            ce[k] += edge_sign[el, k] * alpha[edge_director[el, k]]
        W = 0.0
        for q in range(nq):
            for r in range(3):
                b = 0.0
                if curved:
                    for a in range(3):
                        b += Ri[el, q, r, a] * ci[q, a]
                for k in range(nk):
                    b += Re[el, q, r, k] * ce[k]
                W += b * b
        out[el] = 0.5 * W


@jit
def assemble(shape, x, alpha, directors, conn, edge_director, edge_sign, dN, second, edge_dN, edge_ds, mean, interpolation,
             push, weights, S, S_geometric, D, with_membrane, with_bending, Ri, Re, c0i, c0e, exact, want_tangent,
             alpha_offset, position, gradient, data):
    """Add residual and tangent of all elements to ``gradient`` and ``data``; the number of elements without a normal.

    ``S`` is the stress of the residual, ``S_geometric`` that of the geometric stiffness (the same, but in mixed iterations).
    """
    nn, nq, nk, edge_samples = len(shape[0]), len(shape[1]), len(shape[2]), len(shape[3])
    curved, ns, nx = edge_samples > 0, edge_samples + 3, 3 * nn
    nu = nx + nk
    rows, n_second = 6 * nq, 2 * nk + (2 * nq if curved else 0)
    X = np.empty((nn, 3))
    ci, ce = np.zeros((nq, 3)), np.empty(nk)
    zi, ni, gi = np.empty((nq, 3, nn)), np.empty((nq, 3)), np.empty((nq, 2, 3))
    ne, ee, ve, me = np.empty((nk, 3, 3)), np.empty((nk, 2)), np.empty((nk, nn)), np.empty((nk, 3))
    de, te, le, tau = np.empty((nk, 3)), np.empty((nk, 3)), np.empty(nk), np.empty(nk)
    Js = np.zeros((ns, nu))
    Jk = np.zeros((nk, nu))
    left, right = np.zeros((rows, nu)), np.zeros((rows, nu))
    second_left, second_right = np.zeros((n_second, nx)), np.zeros((n_second, nx))
    K, H, G = np.zeros((nu, nu)), np.zeros((nx, nx)), np.zeros((nn, nn))
    f, fs, fg, fk = np.zeros(nu), np.empty(ns), np.empty(ns), np.empty(nk)
    Dq, TP = np.empty((3, 3)), np.empty((3 * nq, ns))
    m, Phi, row, edge_t = np.empty(3), np.empty((3, 3)), np.empty(nu), np.empty(3)
    bad = 0
    for el in range(conn.shape[0]):
        for i in range(nn):
            for c in range(3):
                X[i, c] = x[conn[el, i], c] - x[conn[el, 0], c]
        f[:] = 0.0
        used = 0
        if with_membrane:
            for k in range(edge_samples):
                for c in range(3):
                    acc = 0.0
                    for i in range(nn):
                        acc += edge_ds[k, i] * X[i, c]
                    edge_t[c] = acc
                for i in range(nn):
                    for c in range(3):
                        Js[k, 3 * i + c] = edge_ds[k, i] * edge_t[c]
            for ab in range(3):
                factor = 2.0 if ab == 2 else 1.0
                for i in range(nn):
                    a0 = a1 = a2 = 0.0
                    for j in range(nn):
                        w = factor * mean[ab, i, j]
                        a0 += w * X[j, 0]
                        a1 += w * X[j, 1]
                        a2 += w * X[j, 2]
                    k = edge_samples + ab
                    Js[k, 3 * i], Js[k, 3 * i + 1], Js[k, 3 * i + 2] = a0, a1, a2
            fs[:] = 0.0
            fg[:] = 0.0
            for q in range(nq):
                w = weights[el, q]
                for a in range(3):
                    for k in range(ns):
                        acc = 0.0
                        for b in range(3):
                            acc += push[el, q, a, b] * interpolation[q, b, k]
                        TP[3 * q + a, k] = acc
                    for k in range(ns):
                        fs[k] += w * S[el, q, a] * TP[3 * q + a, k]
                        fg[k] += w * S_geometric[el, q, a] * TP[3 * q + a, k]
            if want_tangent:
                np.dot(TP, Js, left[:3 * nq])
                for q in range(nq):
                    w = weights[el, q]
                    for a in range(3):
                        for b in range(3):
                            Dq[a, b] = D[el, q, a, b]
                    if not exact:
                        _clamp3(Dq)
                    for a in range(3):
                        d0, d1, d2 = w * Dq[a, 0], w * Dq[a, 1], w * Dq[a, 2]
                        for j in range(nu):
                            right[used + a, j] = d0 * left[used, j] + d1 * left[used + 1, j] + d2 * left[used + 2, j]
                    used += 3
            for k in range(ns):
                v = fs[k]
                for j in range(nx):
                    f[j] += v * Js[k, j]
        if with_bending:
            if not bending_samples(shape, el, X, directors, edge_director, dN, second, edge_dN, edge_ds, c0i, c0e, True,
                                   ci, ce, zi, ni, gi, ne, ee, ve, me, de, te, le, tau):
                bad += 1
                continue
            for k in range(nk):
                ce[k] += edge_sign[el, k] * alpha[edge_director[el, k]]
                for i in range(nn):
                    v, w = -ve[k, i], tau[k] * edge_ds[k, i]
                    for c in range(3):
                        Jk[k, 3 * i + c] = v * ne[k, 0, c] + w * me[k, c]
                Jk[k, nx + k] = edge_sign[el, k]
            fk[:] = 0.0
            for q in range(nq):
                m[:] = 0.0
                for r in range(3):
                    b = 0.0
                    if curved:
                        for a in range(3):
                            b += Ri[el, q, r, a] * ci[q, a]
                    for k in range(nk):
                        b += Re[el, q, r, k] * ce[k]
                    for k in range(nk):
                        fk[k] += Re[el, q, r, k] * b
                    if curved:
                        for a in range(3):
                            m[a] += Ri[el, q, r, a] * b
                    if want_tangent:
                        row[:] = 0.0
                        if curved:
                            for i in range(nn):
                                v = Ri[el, q, r, 0] * zi[q, 0, i] + Ri[el, q, r, 1] * zi[q, 1, i] + Ri[el, q, r, 2] * zi[q, 2, i]
                                row[3 * i] = v * ni[q, 0]
                                row[3 * i + 1] = v * ni[q, 1]
                                row[3 * i + 2] = v * ni[q, 2]
                        for k in range(nk):
                            v = Re[el, q, r, k]
                            for j in range(nu):
                                row[j] += v * Jk[k, j]
                        for j in range(nu):
                            left[used, j] = row[j]
                            right[used, j] = row[j]
                        used += 1
                if curved:
                    kappa = 0.0  # m : second fundamental form, with the reference part added back
                    for a in range(3):
                        kappa += m[a] * (ci[q, a] + c0i[el, q, a])
                    for i in range(nn):
                        v = m[0] * zi[q, 0, i] + m[1] * zi[q, 1, i] + m[2] * zi[q, 2, i]
                        for c in range(3):
                            f[3 * i + c] += v * ni[q, c]
                    if want_tangent and exact:
                        for d in range(2):
                            h0 = h1 = 0.0
                            for c in range(3):
                                h0 += gi[q, d, c] * gi[q, 0, c]
                                h1 += gi[q, d, c] * gi[q, 1, c]
                            for i in range(nn):
                                z = m[0] * zi[q, 0, i] + m[1] * zi[q, 1, i] + m[2] * zi[q, 2, i]
                                s = 0.5 * kappa * (h0 * dN[q, i, 0] + h1 * dN[q, i, 1])
                                for c in range(3):
                                    second_left[2 * q + d, 3 * i + c] = -(z * gi[q, d, c] + s * ni[q, c])
                                    second_right[2 * q + d, 3 * i + c] = dN[q, i, d] * ni[q, c]
            for k in range(nk):
                v = fk[k]
                for j in range(nu):
                    f[j] += v * Jk[k, j]
            if want_tangent and exact:
                for k in range(nk):
                    v, r = fk[k], 2 * k + (2 * nq if curved else 0)
                    for i in range(nn):
                        a0, a1, w = edge_dN[k, i, 0], edge_dN[k, i, 1], v * ve[k, i]
                        for c in range(3):
                            second_left[r, 3 * i + c] = w * ne[k, 1, c]
                            second_left[r + 1, 3 * i + c] = w * ne[k, 2, c]
                            second_right[r, 3 * i + c] = a0 * ne[k, 0, c]
                            second_right[r + 1, 3 * i + c] = a1 * ne[k, 0, c]
        if want_tangent:
            np.dot(left[:used].T, right[:used], K)
            if with_bending and exact:
                np.dot(second_left.T, second_right, H)
                for i in range(nx):
                    for j in range(nx):
                        K[i, j] += H[i, j] + H[j, i]
            if with_membrane:
                G[:, :] = 0.0
                for k in range(edge_samples):
                    v = fg[k]
                    if exact or v > 0.0:
                        for i in range(nn):
                            for j in range(nn):
                                G[i, j] += v * edge_ds[k, i] * edge_ds[k, j]
                r11, r22, r12 = fg[edge_samples], fg[edge_samples + 1], fg[edge_samples + 2]
                if not exact:
                    r11, r22, r12 = _clamp2(r11, r22, r12)
                for i in range(nn):
                    for j in range(nn):
                        G[i, j] += r11 * mean[0, i, j] + r22 * mean[1, i, j] + 2.0 * r12 * mean[2, i, j]
                for i in range(nn):
                    for j in range(nn):
                        for c in range(3):
                            K[3 * i + c, 3 * j + c] += G[i, j]
            if with_bending and exact:
                for k in range(nk):
                    v, co, si, il = fk[k], ee[k, 0], ee[k, 1], 1.0 / le[k]
                    dm = v * (co * co * il * il + tau[k] * tau[k])
                    dd = v * si * co * il * il
                    tm = v * tau[k] * il
                    for a in range(3):
                        for b in range(3):
                            Phi[a, b] = (dd * (me[k, a] * me[k, b] - de[k, a] * de[k, b])
                                         + dm * (de[k, a] * me[k, b] + me[k, a] * de[k, b])
                                         - tm * (te[k, a] * me[k, b] + me[k, a] * te[k, b]))
                    for i in range(nn):
                        wi = edge_ds[k, i]
                        if wi != 0.0:
                            for j in range(nn):
                                wj = wi * edge_ds[k, j]
                                if wj != 0.0:
                                    for a in range(3):
                                        for b in range(3):
                                            K[3 * i + a, 3 * j + b] += wj * Phi[a, b]
            _scatter(K, nu if with_bending else nx, position[el], data)
        for i in range(nn):
            for c in range(3):
                gradient[3 * conn[el, i] + c] += f[3 * i + c]
        if with_bending:
            for k in range(nk):
                gradient[alpha_offset + edge_director[el, k]] += f[nx + k]
    return bad


SHAPES = {1: ((0,) * 3, (0,), (0,) * 3, ()), 2: ((0,) * 6, (0,) * 3, (0,) * 6, (0,) * 6)}
"""First argument of the kernels for each order. Only the lengths count (nodes, interior points, edge points, edge strain
samples): tuple lengths are part of a type, so the compiler sees them as constants and the result can be cached on disk."""
