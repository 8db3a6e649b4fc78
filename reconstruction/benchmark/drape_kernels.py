"""Loops of the position-based drape: stretch, bending, contact with the figure, contact of the cloth with itself.

Extended position-based dynamics (Macklin, Mueller & Chentanez 2016, doi:10.1145/2994258.2994272) with one pass a small step
(Macklin et al. 2019, doi:10.1145/3309486.3340247).
"""

from __future__ import annotations

import numba
import numpy as np

from .body_field import field_at


@numba.njit(cache=True)
def advance(
    x,
    v,
    free,
    steps,
    dt,
    gravity,
    drag,
    links,
    lengths,
    compliance,
    capsules,
    softness,
    grid,
    frame,
    margin,
    friction,
    belt,
    belt_gap,
):
    """Advance the cloth in place by `steps` steps against a figure at rest.

    Parameters
    ----------
    x, v : (n, 3) arrays
        Positions (m) and velocities (m/s), changed.
    free : (n,) array
        1 for free vertices, 0 for held ones.
    links, lengths, compliance : (k, 2), (k,), (k,) arrays
        Distance constraints, their rest lengths (m) and compliances (m per unit force and mass).
    capsules, softness, grid, frame
        The figure, see :class:`reconstruction.benchmark.body_field.Field`.
    margin, friction : float
        Distance kept from the figure, m, and Coulomb's coefficient.
    belt : (b,) array of int
        Vertices held within `belt_gap` (m) of the figure.
    """
    n = x.shape[0]
    old = np.empty((n, 3))
    grad = np.zeros(3)
    work = np.empty((capsules.shape[0], 4))
    bound = np.full(n, -1.0)  # lower bound of the distance: the field changes by about 1 m a metre
    for _ in range(steps):
        keep = 1.0 - drag * dt
        for i in range(n):
            for k in range(3):
                old[i, k] = x[i, k]
            if free[i] > 0:
                v[i, 2] -= gravity * dt
                speed = np.sqrt(v[i, 0] ** 2 + v[i, 1] ** 2 + v[i, 2] ** 2)
                slow = keep * min(1.0, 6.0 / (speed + 1e-12))
                for k in range(3):
                    v[i, k] *= slow
                    x[i, k] += dt * v[i, k]
        for j in range(links.shape[0]):
            a, b = links[j, 0], links[j, 1]
            w = free[a] + free[b]
            if w == 0:
                continue
            dx, dy, dz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
            length = np.sqrt(dx * dx + dy * dy + dz * dz) + 1e-12
            s = (length - lengths[j]) / (length * (w + compliance[j] / (dt * dt)))
            x[a, 0] += free[a] * s * dx
            x[a, 1] += free[a] * s * dy
            x[a, 2] += free[a] * s * dz
            x[b, 0] -= free[b] * s * dx
            x[b, 1] -= free[b] * s * dy
            x[b, 2] -= free[b] * s * dz
        for j in range(belt.shape[0]):
            i = belt[j]
            d = field_at(x[i, 0], x[i, 1], x[i, 2], capsules, softness, grid, frame, grad, work)
            if d > belt_gap:
                pull = min(d - belt_gap, 0.004)
                x[i, 0] -= pull * grad[0]
                x[i, 1] -= pull * grad[1]
        for i in range(n):
            if free[i] == 0:
                continue
            if x[i, 2] < 0.002:
                x[i, 2] = 0.002
            mx, my, mz = x[i, 0] - old[i, 0], x[i, 1] - old[i, 1], x[i, 2] - old[i, 2]
            bound[i] -= 1.02 * np.sqrt(mx * mx + my * my + mz * mz)
            if bound[i] > margin:
                continue
            d = field_at(x[i, 0], x[i, 1], x[i, 2], capsules, softness, grid, frame, grad, work)
            bound[i] = d - 0.001
            if d < margin:
                push = min(margin - d, 0.01)
                bound[i] = -1.0
                along = mx * grad[0] + my * grad[1] + mz * grad[2]
                tx, ty, tz = mx - along * grad[0], my - along * grad[1], mz - along * grad[2]
                slide = np.sqrt(tx * tx + ty * ty + tz * tz) + 1e-12
                hold = min(1.0, friction * push / slide)
                x[i, 0] += push * grad[0] - hold * tx
                x[i, 1] += push * grad[1] - hold * ty
                x[i, 2] += push * grad[2] - hold * tz
        for i in range(n):
            for k in range(3):
                v[i, k] = (x[i, k] - old[i, k]) / dt


@numba.njit(cache=True)
def separate(x, v, free, start, thickness):
    """Push vertices of the cloth apart that are nearer than `thickness` (m) and than they were in `start`, in place.

    Their relative velocity is halved, which damps the rubbing of layers.
    """
    n = x.shape[0]
    size = 2 * n + 1
    inv = 1.0 / thickness
    head = np.zeros(size + 1, dtype=np.int64)
    cell = np.empty((n, 3), dtype=np.int64)
    key = np.empty(n, dtype=np.int64)
    for i in range(n):
        for k in range(3):
            cell[i, k] = np.int64(np.floor(x[i, k] * inv))
        key[i] = _key(cell[i, 0], cell[i, 1], cell[i, 2], size)
        head[key[i]] += 1
    total = 0
    for c in range(size + 1):
        total += head[c]
        head[c] = total
    order = np.empty(n, dtype=np.int64)
    for i in range(n):
        head[key[i]] -= 1
        order[head[key[i]]] = i
    for i in range(n):
        for ox in range(-1, 2):
            for oy in range(-1, 2):
                for oz in range(-1, 2):
                    c = _key(cell[i, 0] + ox, cell[i, 1] + oy, cell[i, 2] + oz, size)
                    for at in range(head[c], head[c + 1]):
                        j = order[at]
                        if j > i:
                            _push(x, v, free, start, thickness, i, j)


@numba.njit(cache=True)
def _key(a, b, c, size):
    return abs((a * 92837111) ^ (b * 689287499) ^ (c * 283923481)) % size


@numba.njit(cache=True)
def _push(x, v, free, start, thickness, i, j):
    dx, dy, dz = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
    d2 = dx * dx + dy * dy + dz * dz
    if d2 >= thickness * thickness or d2 < 1e-16:
        return
    sx, sy, sz = start[j, 0] - start[i, 0], start[j, 1] - start[i, 1], start[j, 2] - start[i, 2]
    wanted = min(thickness, np.sqrt(sx * sx + sy * sy + sz * sz))
    w = free[i] + free[j]
    d = np.sqrt(d2)
    if d >= wanted or w == 0:
        return
    s = 0.5 * (wanted - d) / (d * w)
    x[i, 0] -= free[i] * s * dx
    x[i, 1] -= free[i] * s * dy
    x[i, 2] -= free[i] * s * dz
    x[j, 0] += free[j] * s * dx
    x[j, 1] += free[j] * s * dy
    x[j, 2] += free[j] * s * dz
    for k in range(3):
        mean = 0.5 * (v[i, k] + v[j, k])
        if free[i] > 0:
            v[i, k] += 0.5 * (mean - v[i, k])
        if free[j] > 0:
            v[j, k] += 0.5 * (mean - v[j, k])
