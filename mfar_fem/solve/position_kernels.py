"""Numba kernels of :mod:`mfar_fem.solve.position_based`: colouring, local matrices, Gauss–Seidel sweeps, contact.

Strain of a triangle: ``F = [x1 - x0, x2 - x0] B`` (3, 2) with ``B`` (2, 2) the inverse of the reference edges in the warp/weft
frame, ``E = [E11, E22, 2 E12]``. Shape-function gradients are the rows of ``B`` and minus their sum.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

jit = njit(cache=True, error_model="numpy", fastmath={"contract"})
TINY = 1e-300


@njit(cache=True)
def colour(items, nodes):
    """Greedy colours (n,): no two ``items`` (n, k) of one colour share a node; entries < 0 are ignored."""
    n, k = items.shape
    used = np.zeros((nodes, 64), dtype=np.bool_)
    out = np.empty(n, dtype=np.int64)
    for e in range(n):
        c = 0
        while c < 63:
            free = True
            for i in range(k):
                if items[e, i] >= 0 and used[items[e, i], c]:
                    free = False
                    break
            if free:
                break
            c += 1
        out[e] = c
        for i in range(k):
            if items[e, i] >= 0 and c < 63:  # colour 63 takes what is left: its items may touch
                used[items[e, i], c] = True
    return out


@jit
def _solve3(A, B, n):
    """Overwrite ``B`` (3, n) by ``A⁻¹ B``, Gauss with pivots; A (3, 3) is destroyed."""
    for p in range(3):
        best = p
        for r in range(p + 1, 3):
            if abs(A[r, p]) > abs(A[best, p]):
                best = r
        if best != p:
            for c in range(3):
                A[p, c], A[best, c] = A[best, c], A[p, c]
            for c in range(n):
                B[p, c], B[best, c] = B[best, c], B[p, c]
        for r in range(p + 1, 3):
            f = A[r, p] / A[p, p]
            for c in range(p, 3):
                A[r, c] -= f * A[p, c]
            for c in range(n):
                B[r, c] -= f * B[p, c]
    for c in range(n):
        for r in range(2, -1, -1):
            s = B[r, c]
            for k in range(r + 1, 3):
                s -= A[r, k] * B[k, c]
            B[r, c] = s / A[r, r]


@jit
def _largest(P):
    """Largest eigenvalue of a product ``P`` (3, 3) of two positive semi-definite matrices, within about 1 %."""
    a = P[0, 0] + P[1, 1] + P[2, 2]
    b = (P[0, 0] * P[1, 1] - P[0, 1] * P[1, 0] + P[0, 0] * P[2, 2] - P[0, 2] * P[2, 0] + P[1, 1] * P[2, 2] - P[1, 2] * P[2, 1])
    d = (P[0, 0] * (P[1, 1] * P[2, 2] - P[1, 2] * P[2, 1]) - P[0, 1] * (P[1, 0] * P[2, 2] - P[1, 2] * P[2, 0])
         + P[0, 2] * (P[1, 0] * P[2, 1] - P[1, 1] * P[2, 0]))
    z = a  # Newton from above on z³ - a z² + b z - d: monotone, for all roots are real and not negative
    for _ in range(30):
        slope = (3.0 * z - 2.0 * a) * z + b
        if not slope > 0.0:
            break
        step = (((z - a) * z + b) * z - d) / slope
        z -= step
        if step <= 1e-3 * z:
            break
    return max(z, 0.0)


@jit
def _frame(x, t, B, F):
    """F (2, 3): the two columns of the deformation gradient."""
    for c in range(3):
        p, q = x[t[1], c] - x[t[0], c], x[t[2], c] - x[t[0], c]
        F[0, c], F[1, c] = p * B[0] + q * B[2], p * B[1] + q * B[3]


@jit
def strains(x, tri, B, out):
    """Green strains ``[E11, E22, 2 E12]`` into ``out`` (nt, 3)."""
    F = np.empty((2, 3))
    for e in range(tri.shape[0]):
        _frame(x, tri[e], B[e], F)
        out[e, 0] = 0.5 * (F[0, 0] ** 2 + F[0, 1] ** 2 + F[0, 2] ** 2 - 1.0)
        out[e, 1] = 0.5 * (F[1, 0] ** 2 + F[1, 1] ** 2 + F[1, 2] ** 2 - 1.0)
        out[e, 2] = F[0, 0] * F[1, 0] + F[0, 1] * F[1, 1] + F[0, 2] * F[1, 2]


@jit
def _strain_compliance(x, t, B, w, F, G):
    """G = J M⁻¹ Jᵀ (3, 3) of one triangle; where it has lost half its area, a part of the reference's G is added.

    As a triangle collapses, J vanishes and the linearised constraint asks for moves that are far too long.
    """
    _frame(x, t, B, F)
    c0, c1, c2 = F[0, 0] ** 2 + F[0, 1] ** 2 + F[0, 2] ** 2, F[1, 0] ** 2 + F[1, 1] ** 2 + F[1, 2] ** 2, 0.0
    for c in range(3):
        c2 += F[0, c] * F[1, c]
    lost = max(0.0, 0.5 - (c0 * c1 - c2 * c2))
    J = np.empty((3, 3))
    for a in range(3):
        for b in range(3):
            G[a, b] = 0.0
    for i in range(3):
        b1 = B[0] if i == 1 else (B[2] if i == 2 else -B[0] - B[2])
        b2 = B[1] if i == 1 else (B[3] if i == 2 else -B[1] - B[3])
        for c in range(3):
            J[0, c], J[1, c], J[2, c] = b1 * F[0, c], b2 * F[1, c], b1 * F[1, c] + b2 * F[0, c]
        for a in range(3):
            for b in range(3):
                for c in range(3):
                    G[a, b] += w[t[i], c] * J[a, c] * J[b, c]
        G[0, 0] += lost * w[t[i], 0] * b1 * b1
        G[1, 1] += lost * w[t[i], 0] * b2 * b2
        G[2, 2] += lost * w[t[i], 0] * (b1 * b1 + b2 * b2)


@jit
def prepare_strain(x, tri, B, w, scale, D, S, E, least, K, h, inverse, limit):
    """Local matrices of the strain constraints, frozen for a block of substeps; returns the largest stiffness ratio.

    With ``κ = scale D G`` (``scale`` = area · dt²) and ``f = max(least, 1 - 1/κ_max)``:
    ``inverse = (I + f κ)⁻¹``, ``K = inverse · scale · D``, ``h = inverse · scale · (S - D E)``, so that
    ``Δλ = -(h + K E_now + inverse λ)``. Shapes (nt, 3, 3), (nt, 3). ``limit`` (nt, 2) holds 1.1 tr C (a triangle that has since
    grown beyond has a larger G than the one used, and its correction is reduced in that ratio) and a bound of
    |ΔF|² / (|Δλ|² tr C), so that long corrections are found cheaply.
    """
    F, G, A, R, P = np.empty((2, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 7)), np.empty((3, 3))
    worst = 0.0
    for e in range(tri.shape[0]):
        _strain_compliance(x, tri[e], B[e], w, F, G)
        for a in range(3):
            for b in range(3):
                P[a, b] = scale[e] * (D[e, a, 0] * G[0, b] + D[e, a, 1] * G[1, b] + D[e, a, 2] * G[2, b])
        trace, size = 0.0, 0.0
        for c in range(3):
            trace += F[0, c] ** 2 + F[1, c] ** 2
        for i in range(2):
            size += (B[e, i] ** 2 + B[e, 2 + i] ** 2 + (B[e, i] + B[e, 2 + i]) ** 2) * w[tri[e]].max()
        limit[e, 0], limit[e, 1] = 1.1 * trace, size * size
        top = _largest(P)
        worst = max(worst, top)
        f = max(least, 1.0 - 1.0 / max(top, 1e-30))
        for a in range(3):
            R[a, 6] = S[e, a]
            for b in range(3):
                A[a, b] = f * P[a, b] + (1.0 if a == b else 0.0)
                R[a, b], R[a, 3 + b] = scale[e] * D[e, a, b], 1.0 if a == b else 0.0
                R[a, 6] -= D[e, a, b] * E[e, b]
            R[a, 6] *= scale[e]
        _solve3(A, R, 7)
        for a in range(3):
            h[e, a] = R[a, 6]
            for b in range(3):
                K[e, a, b], inverse[e, a, b] = R[a, b], R[a, 3 + b]
    return worst


@jit
def _square(a, b, c):
    return a * a + b * b + c * c


@jit
def _sweep_strain(x, tri, B, w, K, h, inverse, limit, lam, many):
    """One Gauss–Seidel sweep over the triangles."""
    for e in range(tri.shape[0]):
        i, j, k = tri[e, 0], tri[e, 1], tri[e, 2]
        b0, b1, b2, b3 = B[e, 0], B[e, 1], B[e, 2], B[e, 3]
        p0, p1, p2 = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
        q0, q1, q2 = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
        f0, f1, f2 = p0 * b0 + q0 * b2, p1 * b0 + q1 * b2, p2 * b0 + q2 * b2
        g0, g1, g2 = p0 * b1 + q0 * b3, p1 * b1 + q1 * b3, p2 * b1 + q2 * b3
        e0, e1 = 0.5 * (f0 * f0 + f1 * f1 + f2 * f2 - 1.0), 0.5 * (g0 * g0 + g1 * g1 + g2 * g2 - 1.0)
        e2 = f0 * g0 + f1 * g1 + f2 * g2
        l0 = -(h[e, 0] + K[e, 0, 0] * e0 + K[e, 0, 1] * e1 + K[e, 0, 2] * e2)
        l1 = -(h[e, 1] + K[e, 1, 0] * e0 + K[e, 1, 1] * e1 + K[e, 1, 2] * e2)
        l2 = -(h[e, 2] + K[e, 2, 0] * e0 + K[e, 2, 1] * e1 + K[e, 2, 2] * e2)
        if many:
            m0, m1, m2 = lam[e, 0], lam[e, 1], lam[e, 2]
            l0 -= inverse[e, 0, 0] * m0 + inverse[e, 0, 1] * m1 + inverse[e, 0, 2] * m2
            l1 -= inverse[e, 1, 0] * m0 + inverse[e, 1, 1] * m1 + inverse[e, 1, 2] * m2
            l2 -= inverse[e, 2, 0] * m0 + inverse[e, 2, 1] * m1 + inverse[e, 2, 2] * m2
        trace = 2.0 * (e0 + e1 + 1.0)
        if trace > limit[e, 0]:
            less = limit[e, 0] / trace
            l0, l1, l2 = less * l0, less * l1, less * l2
        r0, r1, r2 = l0 * f0 + l2 * g0, l0 * f1 + l2 * g1, l0 * f2 + l2 * g2
        s0, s1, s2 = l1 * g0 + l2 * f0, l1 * g1 + l2 * f1, l1 * g2 + l2 * f2
        u0, u1, u2 = b0 * r0 + b1 * s0, b0 * r1 + b1 * s1, b0 * r2 + b1 * s2
        v0, v1, v2 = b2 * r0 + b3 * s0, b2 * r1 + b3 * s1, b2 * r2 + b3 * s2
        t0, t1, t2 = w[i, 0] * (u0 + v0), w[i, 1] * (u1 + v1), w[i, 2] * (u2 + v2)
        u0, u1, u2 = w[j, 0] * u0, w[j, 1] * u1, w[j, 2] * u2
        v0, v1, v2 = w[k, 0] * v0, w[k, 1] * v1, w[k, 2] * v2
        less, total = 1.0, abs(l0) + abs(l1) + abs(l2)
        if total * total * trace * limit[e, 1] > 0.25:  # no sweep changes F by more than a half (of its size, where stretched)
            change = (_square(b0 * (u0 + t0) + b2 * (v0 + t0), b0 * (u1 + t1) + b2 * (v1 + t1), b0 * (u2 + t2) + b2 * (v2 + t2))
                      + _square(b1 * (u0 + t0) + b3 * (v0 + t0), b1 * (u1 + t1) + b3 * (v1 + t1), b1 * (u2 + t2) + b3 * (v2 + t2)))
            if change > max(0.25, 0.125 * trace):
                less = math.sqrt(max(0.25, 0.125 * trace) / change)
        x[j, 0] += less * u0
        x[j, 1] += less * u1
        x[j, 2] += less * u2
        x[k, 0] += less * v0
        x[k, 1] += less * v1
        x[k, 2] += less * v2
        x[i, 0] -= less * t0
        x[i, 1] -= less * t1
        x[i, 2] -= less * t2
        if many:
            lam[e, 0], lam[e, 1], lam[e, 2] = m0 + less * l0, m1 + less * l1, m2 + less * l2


@jit
def _hinge(x, a, b, c, d, floor):
    """Angle between the normals of (a, b, c) and (b, a, d), gradients at the tips c and d, feet s and t of the tips on the edge.

    The gradient at a is ``-(1 - s) g_c - (1 - t) g_d``, at b ``-s g_c - t g_d``. Where a doubled area squared is below ``floor``
    the gradients are scaled down (they would grow without bound as a triangle collapses).
    """
    e0, e1, e2 = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    p0, p1, p2 = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
    q0, q1, q2 = x[d, 0] - x[a, 0], x[d, 1] - x[a, 1], x[d, 2] - x[a, 2]
    n0, n1, n2 = e1 * p2 - e2 * p1, e2 * p0 - e0 * p2, e0 * p1 - e1 * p0
    m0, m1, m2 = q1 * e2 - q2 * e1, q2 * e0 - q0 * e2, q0 * e1 - q1 * e0
    nn, mm, ee = n0 * n0 + n1 * n1 + n2 * n2, m0 * m0 + m1 * m1 + m2 * m2, e0 * e0 + e1 * e1 + e2 * e2
    if not (ee > 0.0 and nn > 1e-12 * floor and mm > 1e-12 * floor):
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    length, per_ee = math.sqrt(ee), 1.0 / ee
    sine = ((n1 * m2 - n2 * m1) * e0 + (n2 * m0 - n0 * m2) * e1 + (n0 * m1 - n1 * m0) * e2) * length * per_ee
    angle = math.atan2(sine, n0 * m0 + n1 * m1 + n2 * m2)
    size = -length / (nn * mm)
    if min(nn, mm) < floor:
        size *= min(nn, mm) / floor
    nf, mf = size * mm, size * nn
    return (angle, nf * n0, nf * n1, nf * n2, mf * m0, mf * m1, mf * m2,
            (p0 * e0 + p1 * e1 + p2 * e2) * per_ee, (q0 * e0 + q1 * e1 + q2 * e2) * per_ee)


@jit
def angles(x, patches, floor, out):
    """Angles (np, 3) across the three edges of all patches ``(3 vertices, 3 tips or -1)``; 0 where there is no tip."""
    for e in range(patches.shape[0]):
        six = patches[e]
        for r in range(3):
            out[e, r] = 0.0
            if six[3 + r] >= 0:
                out[e, r] = _hinge(x, six[r], six[(r + 1) % 3], six[(r + 2) % 3], six[3 + r], floor[e])[0]


@jit
def prepare_bending(x, patches, floor, w, Q, impulse, ratio, least, H, inverse):
    """Local matrices of the bending constraints at ``x``; returns the largest stiffness ratio.

    With ``κ = ratio Q G``, G = J M⁻¹ Jᵀ: ``inverse = (I + f κ)⁻¹`` and ``H = inverse · impulse · Q`` (both (np, 3, 3)), f as in
    `prepare_strain`; so ``Δλ = -(H θ + inverse λ)``.
    """
    J, G, P, R, worst = np.empty((3, 6, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 6)), 0.0
    for e in range(patches.shape[0]):
        six = patches[e]
        J[:] = 0.0
        for r in range(3):
            if six[3 + r] >= 0:
                i, j, k = r, (r + 1) % 3, (r + 2) % 3
                _, c0, c1, c2, d0, d1, d2, s, t = _hinge(x, six[i], six[j], six[k], six[3 + r], floor[e])
                gc, gd = np.array([c0, c1, c2]), np.array([d0, d1, d2])
                J[r, k], J[r, 3 + r] = gc, gd
                J[r, i], J[r, j] = -(1.0 - s) * gc - (1.0 - t) * gd, -s * gc - t * gd
        for a in range(3):
            for b in range(3):
                G[a, b] = 0.0
                for i in range(6):
                    if six[i] >= 0:
                        for c in range(3):
                            G[a, b] += w[six[i], c] * J[a, i, c] * J[b, i, c]
        for a in range(3):
            for b in range(3):
                P[a, b] = ratio * (Q[e, a, 0] * G[0, b] + Q[e, a, 1] * G[1, b] + Q[e, a, 2] * G[2, b])
        top = _largest(P)
        worst = max(worst, top)
        f = max(least, 1.0 - 1.0 / max(top, 1e-30))
        for a in range(3):
            for b in range(3):
                one = 1.0 if a == b else 0.0
                P[a, b] = f * P[a, b] + one
                R[a, b], R[a, 3 + b] = impulse * Q[e, a, b], one
        _solve3(P, R, 6)
        for a in range(3):
            for b in range(3):
                H[e, a, b], inverse[e, a, b] = R[a, b], R[a, 3 + b]
    return worst


@jit
def _sweep_bending(x, patches, floor, rest, H, inverse, w, lam, many):
    """One Gauss–Seidel sweep over the patches."""
    g, theta, step = np.empty((3, 8)), np.empty(3), np.empty(3)
    for e in range(patches.shape[0]):
        six = patches[e]
        for r in range(3):
            theta[r] = 0.0
            if six[3 + r] >= 0:
                turn, g[r, 0], g[r, 1], g[r, 2], g[r, 3], g[r, 4], g[r, 5], g[r, 6], g[r, 7] = _hinge(
                    x, six[r], six[(r + 1) % 3], six[(r + 2) % 3], six[3 + r], floor[e])
                turn -= rest[e, r]
                theta[r] = turn - 2.0 * math.pi * round(turn / (2.0 * math.pi)) if abs(turn) > math.pi else turn
        for r in range(3):
            step[r] = -(H[e, r, 0] * theta[0] + H[e, r, 1] * theta[1] + H[e, r, 2] * theta[2])
        if many:
            for r in range(3):
                step[r] -= inverse[e, r, 0] * lam[e, 0] + inverse[e, r, 1] * lam[e, 1] + inverse[e, r, 2] * lam[e, 2]
            for r in range(3):
                lam[e, r] += step[r]
        for r in range(3):
            if six[3 + r] < 0:
                continue
            a, b, c, d, l, s, t = six[r], six[(r + 1) % 3], six[(r + 2) % 3], six[3 + r], step[r], g[r, 6], g[r, 7]
            for k in range(3):
                gc, gd = l * g[r, k], l * g[r, 3 + k]
                x[c, k] += w[c, k] * gc
                x[d, k] += w[d, k] * gd
                x[a, k] -= w[a, k] * ((1.0 - s) * gc + (1.0 - t) * gd)
                x[b, k] -= w[b, k] * (s * gc + t * gd)


@jit
def _sweep_edges(x, edges, lengths, w):
    """One sweep of Δp_i = -w_i ∇_i C · C / Σ w_j ‖∇_j C‖², C = |x_b - x_a| - L."""
    d = np.empty(3)
    for e in range(edges.shape[0]):
        a, b = edges[e, 0], edges[e, 1]
        square, sum_w = 0.0, 0.0
        for c in range(3):
            d[c] = x[b, c] - x[a, c]
            square += d[c] * d[c]
        length = math.sqrt(square)
        if length < TINY:
            continue
        for c in range(3):
            d[c] /= length
            sum_w += (w[a, c] + w[b, c]) * d[c] * d[c]
        if sum_w > 0.0:
            s = (length - lengths[e]) / sum_w
            for c in range(3):
                x[a, c] += w[a, c] * s * d[c]
                x[b, c] -= w[b, c] * s * d[c]


@jit
def _contact(x, before, w, ids, normals, offsets, velocity, friction, thickness, elapsed, dt):
    """Push vertices out of tangent planes, to ``n · (x - u t) >= offset + thickness``; Coulomb friction on the displacement."""
    for k in range(ids.shape[0]):
        i = ids[k]
        n0, n1, n2 = normals[k, 0], normals[k, 1], normals[k, 2]
        u0, u1, u2 = velocity[k, 0], velocity[k, 1], velocity[k, 2]
        gap = n0 * (x[i, 0] - u0 * elapsed) + n1 * (x[i, 1] - u1 * elapsed) + n2 * (x[i, 2] - u2 * elapsed) - offsets[k]
        depth = thickness - gap
        if depth <= 0.0:
            continue
        t0, t1, t2 = x[i, 0] - before[i, 0] - u0 * dt, x[i, 1] - before[i, 1] - u1 * dt, x[i, 2] - before[i, 2] - u2 * dt
        along = n0 * t0 + n1 * t1 + n2 * t2
        t0, t1, t2 = t0 - along * n0, t1 - along * n1, t2 - along * n2
        slip = math.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
        hold = 1.0 if slip <= friction[k] * depth else friction[k] * depth / slip
        if w[i, 0] > 0.0:
            x[i, 0] += depth * n0 - hold * t0
        if w[i, 1] > 0.0:
            x[i, 1] += depth * n1 - hold * t1
        if w[i, 2] > 0.0:
            x[i, 2] += depth * n2 - hold * t2


@jit
def closest_on_triangle(p, a, b, c, bary):
    """Barycentric coordinates of the point of the triangle nearest to ``p`` (Ericson, Real-Time Collision Detection, 5.1.5)."""
    d1 = d2 = d3 = d4 = d5 = d6 = 0.0
    for k in range(3):
        ab, ac = b[k] - a[k], c[k] - a[k]
        d1 += ab * (p[k] - a[k])
        d2 += ac * (p[k] - a[k])
        d3 += ab * (p[k] - b[k])
        d4 += ac * (p[k] - b[k])
        d5 += ab * (p[k] - c[k])
        d6 += ac * (p[k] - c[k])
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0.0 and d2 <= 0.0:
        bary[0], bary[1], bary[2] = 1.0, 0.0, 0.0
    elif d3 >= 0.0 and d4 <= d3:
        bary[0], bary[1], bary[2] = 0.0, 1.0, 0.0
    elif d6 >= 0.0 and d5 <= d6:
        bary[0], bary[1], bary[2] = 0.0, 0.0, 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        s = d1 / max(d1 - d3, TINY)
        bary[0], bary[1], bary[2] = 1.0 - s, s, 0.0
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        s = d2 / max(d2 - d6, TINY)
        bary[0], bary[1], bary[2] = 1.0 - s, 0.0, s
    elif va <= 0.0 and d4 >= d3 and d5 >= d6:
        s = (d4 - d3) / max((d4 - d3) + (d5 - d6), TINY)
        bary[0], bary[1], bary[2] = 0.0, 1.0 - s, s
    else:
        s = 1.0 / max(va + vb + vc, TINY)
        bary[0], bary[1], bary[2] = va * s, vb * s, vc * s


@jit
def _repel(x, w, tri, pairs, distance):
    """Vertices nearer than ``distance`` to a triangle they do not belong to are pushed off, masses weighing."""
    bary, d = np.empty(3), np.empty(3)
    for k in range(pairs.shape[0]):
        v, t = pairs[k, 0], tri[pairs[k, 1]]
        closest_on_triangle(x[v], x[t[0]], x[t[1]], x[t[2]], bary)
        square = 0.0
        for c in range(3):
            d[c] = x[v, c] - bary[0] * x[t[0], c] - bary[1] * x[t[1], c] - bary[2] * x[t[2], c]
            square += d[c] * d[c]
        if square >= distance * distance or square < 1e-24:
            continue
        length, sum_w = math.sqrt(square), 0.0
        for c in range(3):
            d[c] /= length
            sum_w += d[c] * d[c] * (w[v, c] + bary[0] ** 2 * w[t[0], c] + bary[1] ** 2 * w[t[1], c] + bary[2] ** 2 * w[t[2], c])
        if sum_w <= 0.0:
            continue
        s = (distance - length) / sum_w
        for c in range(3):
            x[v, c] += w[v, c] * s * d[c]
            for i in range(3):
                x[t[i], c] -= w[t[i], c] * bary[i] * s * d[c]


@jit
def _predict(x, v, w, normals, wind, gravity, drag_n, drag_t, keep, dt):
    """Velocities under gravity, drag (exact for the drag alone) and mass damping; then positions."""
    for i in range(x.shape[0]):
        for c in range(3):
            if w[i, c] > 0.0:
                v[i, c] = keep * v[i, c] + dt * gravity[c]
    if drag_n > 0.0 or drag_t > 0.0:
        for i in range(x.shape[0]):
            r0, r1, r2 = v[i, 0] - wind[i, 0], v[i, 1] - wind[i, 1], v[i, 2] - wind[i, 2]
            vn = r0 * normals[i, 0] + r1 * normals[i, 1] + r2 * normals[i, 2]
            speed = math.sqrt(max(r0 * r0 + r1 * r1 + r2 * r2 - vn * vn, 0.0))
            a, b = 1.0 / (1.0 + dt * drag_n * abs(vn)), 1.0 / (1.0 + dt * drag_t * speed)
            for c in range(3):
                if w[i, c] > 0.0:
                    n = vn * normals[i, c]
                    v[i, c] = wind[i, c] + a * n + b * (v[i, c] - wind[i, c] - n)
    for i in range(x.shape[0]):
        for c in range(3):
            if w[i, c] > 0.0:
                x[i, c] += dt * v[i, c]


@jit
def advance(substeps, iterations, dt, x, v, w, pull, gravity, drag, keep, normals, wind, strain, bending, edges, contact,
            repel):
    """A block of substeps in place: ``x``, ``v`` (n, 3); ``pull`` (n, 3) is the velocity of what is held.

    ``strain`` = (tri, B, K, h, inverse, limit, λ), ``bending`` = (patches, floor, rest, H, inverse, λ), ``edges`` = (ends,
    lengths), ``contact`` = (ids, normals, offsets, velocity, friction, thickness), ``repel`` = (all triangles, pairs, distance);
    empty where a term is off. Bending acts once, at the first substep, with the impulse of the whole block.
    """
    tri, B, K, h, inverse, limit, lam = strain
    patches, floor, rest, H, inverse_b, lam_b = bending
    before = np.empty_like(x)
    many = iterations > 1
    for s in range(substeps):
        before[:] = x
        _predict(x, v, w, normals, wind, gravity, drag[0], drag[1], keep, dt)
        for i in range(x.shape[0]):
            for c in range(3):
                if w[i, c] == 0.0:
                    x[i, c] += dt * pull[i, c]
        lam[:] = 0.0
        lam_b[:] = 0.0
        for _ in range(iterations):
            if s == 0:
                _sweep_bending(x, patches, floor, rest, H, inverse_b, w, lam_b, many)
            _sweep_strain(x, tri, B, w, K, h, inverse, limit, lam, many)
            _sweep_edges(x, edges[0], edges[1], w)
            _repel(x, w, repel[0], repel[1], repel[2])
            _contact(x, before, w, contact[0], contact[1], contact[2], contact[3], contact[4], contact[5], (s + 1) * dt, dt)
        for i in range(x.shape[0]):
            for c in range(3):
                v[i, c] = (x[i, c] - before[i, c]) / dt


@jit
def vertex_normals(x, tri, out):
    """Unit normals (n, 3) of the vertices, triangles weighing by area; zero where they cancel."""
    out[:] = 0.0
    for e in range(tri.shape[0]):
        a, b, c = tri[e, 0], tri[e, 1], tri[e, 2]
        p, q = x[b] - x[a], x[c] - x[a]
        n = (p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0])
        for k in range(3):
            out[a, k] += n[k]
            out[b, k] += n[k]
            out[c, k] += n[k]
    for i in range(out.shape[0]):
        size = math.sqrt(out[i, 0] ** 2 + out[i, 1] ** 2 + out[i, 2] ** 2)
        for k in range(3):
            out[i, k] = out[i, k] / size if size > TINY else 0.0
