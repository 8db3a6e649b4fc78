"""Numba kernels of :mod:`mfar_fem.drag`: dissipation potential, force and its derivative, element by element."""

from __future__ import annotations

import numpy as np
from numba import njit

jit = njit(cache=True, nogil=True, error_model="numpy")


@jit
def potential(velocity, conn, N, weights, normals, wind, gamma_n, gamma_t):
    """Sum over the points of ``weights (γ_n |v_n|³ + γ_t |v_t|³) / 3``, W; ``velocity`` (nn, 3) of the nodes."""
    total, v = 0.0, np.empty(3)
    for el in range(conn.shape[0]):
        for q in range(N.shape[0]):
            for c in range(3):
                v[c] = -wind[el, q, c]
                for i in range(N.shape[1]):
                    v[c] += N[q, i] * velocity[conn[el, i], c]
            vn = v[0] * normals[el, q, 0] + v[1] * normals[el, q, 1] + v[2] * normals[el, q, 2]
            vt2 = max(v[0] * v[0] + v[1] * v[1] + v[2] * v[2] - vn * vn, 0.0)
            total += weights[el, q] * (gamma_n * abs(vn) ** 3 + gamma_t * vt2 * np.sqrt(vt2)) / 3.0
    return total


@jit
def assemble(velocity, conn, N, weights, normals, wind, gamma_n, gamma_t, scale, want, positions, force, data):
    """Add minus the drag to ``force`` (nn, 3) and, if ``want``, ``scale`` times its derivative by the velocity to ``data``."""
    nn = N.shape[1]
    v, vt, block, K = np.empty(3), np.empty(3), np.empty((3, 3)), np.empty((nn, 3, nn, 3))
    for el in range(conn.shape[0]):
        K[:] = 0.0
        for q in range(N.shape[0]):
            w = weights[el, q]
            for c in range(3):
                v[c] = -wind[el, q, c]
                for i in range(nn):
                    v[c] += N[q, i] * velocity[conn[el, i], c]
            n0, n1, n2 = normals[el, q, 0], normals[el, q, 1], normals[el, q, 2]
            vn = v[0] * n0 + v[1] * n1 + v[2] * n2
            vt[0], vt[1], vt[2] = v[0] - vn * n0, v[1] - vn * n1, v[2] - vn * n2
            speed = np.sqrt(vt[0] ** 2 + vt[1] ** 2 + vt[2] ** 2)
            for c in range(3):
                p = w * (gamma_n * abs(vn) * vn * normals[el, q, c] + gamma_t * speed * vt[c])
                for i in range(nn):
                    force[conn[el, i], c] += N[q, i] * p
            if not want:
                continue
            for a in range(3):
                for b in range(3):
                    nab = normals[el, q, a] * normals[el, q, b]
                    block[a, b] = 2.0 * gamma_n * abs(vn) * nab - gamma_t * speed * nab
                    if speed > 0.0:
                        block[a, b] += gamma_t * vt[a] * vt[b] / speed
                block[a, a] += gamma_t * speed
            for i in range(nn):
                for j in range(i, nn):
                    k = scale * w * N[q, i] * N[q, j]
                    for a in range(3):
                        for b in range(3):
                            K[i, a, j, b] += k * block[a, b]
        if not want:
            continue
        for i in range(nn):
            for j in range(i, nn):
                for a in range(3):
                    for b in range(3):
                        k = K[i, a, j, b]
                        data[positions[el, (3 * i + a) * 3 * nn + 3 * j + b]] += k
                        if j > i:
                            data[positions[el, (3 * j + b) * 3 * nn + 3 * i + a]] += k
