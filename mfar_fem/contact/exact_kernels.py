"""Numba kernels of :mod:`mfar_fem.contact.exact`: nodes and facets against planes, spheres and round cylinders.

A body is a row of ``kinds`` (0 plane, 1 sphere, 2 cylinder without ends), ``centres`` (3), ``axes`` (3; a plane's normal) and
``radii``. Distances are positive outside.
"""

from __future__ import annotations

import numpy as np
from numba import njit

jit = njit(cache=True, error_model="numpy")

PLANE, SPHERE, CYLINDER = 0, 1, 2
LEFT = 0.1
"""Share of a distance that a step must leave."""
ADVANCES = 200
"""Conservative advances along a step at most."""


@jit
def _across(kind, centre, axis, x, out):
    """Vector ``out`` from the nearest point of the centre (line) to x; a plane's lies along its normal."""
    along = 0.0
    for c in range(3):
        out[c] = x[c] - centre[c]
        along += out[c] * axis[c]
    if kind == PLANE:
        for c in range(3):
            out[c] = along * axis[c]
    elif kind == CYLINDER:
        for c in range(3):
            out[c] -= along * axis[c]
    return along


@jit
def _distance(kind, centre, axis, radius, x, out):
    """Signed distance; ``out`` becomes the outward unit normal."""
    along = _across(kind, centre, axis, x, out)
    if kind == PLANE:
        for c in range(3):
            out[c] = axis[c]
        return along
    r = np.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    for c in range(3):
        out[c] = out[c] / r if r > 0.0 else axis[c]
    return r - radius


@jit
def node_distances(kinds, centres, axes, radii, x, distance, normal):
    """Fill ``distance`` (n, nb) and ``normal`` (n, nb, 3) at the points x (n, 3)."""
    for i in range(len(x)):
        for b in range(len(kinds)):
            distance[i, b] = _distance(kinds[b], centres[b], axes[b], radii[b], x[i], normal[i, b])


@jit
def _segment(a, b):
    """Squared distance of the origin from the segment between a and b."""
    length, along = 0.0, 0.0
    for c in range(3):
        e = b[c] - a[c]
        length += e * e
        along -= a[c] * e
    t = min(1.0, max(0.0, along / length)) if length > 0.0 else 0.0
    squared = 0.0
    for c in range(3):
        squared += (a[c] + t * (b[c] - a[c])) ** 2
    return squared


@jit
def origin_from_triangle(p, q, r):
    """Distance of the origin from a triangle, thin and flattened ones included."""
    u, w, n = q - p, r - p, np.empty(3)
    n[0], n[1], n[2] = u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]
    area = n[0] ** 2 + n[1] ** 2 + n[2] ** 2
    best = min(_segment(p, q), min(_segment(q, r), _segment(r, p)))
    size = max(u[0] ** 2 + u[1] ** 2 + u[2] ** 2, w[0] ** 2 + w[1] ** 2 + w[2] ** 2)
    if area > 1e-20 * size * size:
        # barycentric coordinates of the foot of the perpendicular: -p · (w × n), p · (u × n)
        along_w = -(p[0] * (w[1] * n[2] - w[2] * n[1]) + p[1] * (w[2] * n[0] - w[0] * n[2]) + p[2] * (w[0] * n[1] - w[1] * n[0]))
        along_u = p[0] * (u[1] * n[2] - u[2] * n[1]) + p[1] * (u[2] * n[0] - u[0] * n[2]) + p[2] * (u[0] * n[1] - u[1] * n[0])
        if along_w >= 0.0 and along_u >= 0.0 and along_w + along_u <= area:
            height = (p[0] * n[0] + p[1] * n[1] + p[2] * n[2]) ** 2 / area
            best = min(best, height)
    return np.sqrt(best)


@jit
def _facet(kind, centre, axis, radius, x, triangle, v):
    """Distance of a triangle from a body; negative only from a plane and where a round body's centre line is not pierced."""
    if kind == PLANE:
        least = np.inf
        for k in range(3):
            least = min(least, _across(kind, centre, axis, x[triangle[k]], v[k]))
        return least
    for k in range(3):
        _across(kind, centre, axis, x[triangle[k]], v[k])
    return origin_from_triangle(v[0], v[1], v[2]) - radius


@jit
def _longest(x, triangle):
    """Longest of the two edges at a triangle's first corner."""
    longest = 0.0
    for k in range(1, 3):
        squared = 0.0
        for c in range(3):
            squared += (x[triangle[k], c] - x[triangle[0], c]) ** 2
        longest = max(longest, squared)
    return np.sqrt(longest)


@jit
def facet_distances(kinds, centres, axes, radii, x, triangles, distance, within, out):
    """Fill ``out`` (k, nb): exact distance of the facets nearer than ``within``; a lower bound beyond.

    ``distance`` (n, nb) is that of the nodes.
    """
    v = np.empty((3, 3))
    for f in range(len(triangles)):
        longest = -1.0
        for b in range(len(kinds)):
            first = distance[triangles[f, 0], b]
            if first <= within:
                longest = np.inf
            elif longest < 0.0:
                longest = _longest(x, triangles[f])
            if first - longest > within:
                out[f, b] = first - longest
            else:
                out[f, b] = _facet(kinds[b], centres[b], axes[b], radii[b], x, triangles[f], v)


@jit
def free_fraction(kinds, centres, axes, radii, x, step, triangles, distance, clearance):
    """Largest fraction of ``step`` (n, 3) that leaves a tenth of every distance: of facets, and of nodes beyond ``clearance``.

    Conservative advancement: a distance shrinks by no more than the longest displacement. ``distance`` (n, nb), ``clearance``
    (n, nb) belong to x (n, 3).
    """
    n, free = len(x), 1.0
    moves, out, y = np.empty(n), np.empty(3), np.empty((3, 3))
    for i in range(n):
        moves[i] = np.sqrt(step[i, 0] ** 2 + step[i, 1] ** 2 + step[i, 2] ** 2)
    for b in range(len(kinds)):
        for i in range(n):
            start = distance[i, b] - clearance[i, b]
            if moves[i] * free <= (1.0 - LEFT) * start:
                continue
            t, d = 0.0, start
            for _ in range(ADVANCES):
                t += (d - 0.99 * LEFT * start) / moves[i]
                if t >= free:
                    break
                for c in range(3):
                    y[0, c] = x[i, c] + t * step[i, c]
                d = _distance(kinds[b], centres[b], axes[b], radii[b], y[0], out) - clearance[i, b]
                if d <= LEFT * start:
                    break
            free = min(free, t)
    corners, v = np.arange(3), np.empty((3, 3))
    for f in range(len(triangles)):
        i, j, k = triangles[f]
        move = max(moves[i], max(moves[j], moves[k]))
        longest = -1.0
        for b in range(len(kinds)):
            first = distance[i, b]
            if first <= move * free:
                longest = np.inf
            elif longest < 0.0:
                longest = _longest(x, triangles[f])
            if move * free <= (1.0 - LEFT) * (first - longest):
                continue
            start = _facet(kinds[b], centres[b], axes[b], radii[b], x, triangles[f], v)
            if move * free <= (1.0 - LEFT) * start:
                continue
            t, d = 0.0, start
            for _ in range(ADVANCES):
                t += (d - 0.99 * LEFT * start) / move
                if t >= free:
                    break
                for a in range(3):
                    for c in range(3):
                        y[a, c] = x[triangles[f, a], c] + t * step[triangles[f, a], c]
                d = _facet(kinds[b], centres[b], axes[b], radii[b], y, corners, v)
                if d <= LEFT * start:
                    break
            free = min(free, t)
    return free


@jit
def barrier(d, reach):
    """-(q - 1)² ln q, q = (d/reach)², and its first two derivatives by d, for 0 < d < reach."""
    q = (d / reach) ** 2
    log, s = np.log(q), 2.0 * d / reach**2
    first = -(2.0 * (q - 1.0) * log + (q - 1.0) ** 2 / q)
    second = -(2.0 * log + 4.0 * (q - 1.0) / q - ((q - 1.0) / q) ** 2)
    return -((q - 1.0) ** 2) * log, first * s, second * s * s + first * 2.0 / reach**2


@jit
def friction_slope(y, eps):
    """f0, f0'/y and (f0'' - f0'/y)/y² of ipctk's mollified |y|: quadratic slope up to ``eps``."""
    if y >= eps:
        return y, 1.0 / y, -1.0 / y**3
    rest = 0.0 if y == 0.0 else -1.0 / (eps * eps * y)
    return -(y**3) / (3.0 * eps * eps) + y * y / eps + eps / 3.0, 2.0 / eps - y / (eps * eps), rest


@jit
def potential(room, reach, weights, stiffness):
    """Sum over nodes and bodies of weight · κ · reach · b, J; inf where a node is too near."""
    total = 0.0
    for i in range(len(room)):
        for b in range(room.shape[1]):
            d = room[i, b]
            if d <= 0.0:
                return np.inf
            if d < reach:
                total += weights[i] * stiffness * reach * barrier(d, reach)[0]
    return total


@jit
def forces(room, reach, weights, stiffness):
    """Normal force of every body on every node, N (n, nb), outward."""
    out = np.zeros(room.shape)
    for i in range(len(room)):
        for b in range(room.shape[1]):
            d = room[i, b]
            if 0.0 < d < reach:
                out[i, b] = -weights[i] * stiffness * reach * barrier(d, reach)[1]
    return out


@jit
def friction(pressed, slid, reach, eps, dt, total, gradient, blocks):
    """Friction of a step: energy into ``total`` (1,), gradient (n, 3) and blocks (n, 3, 3) added to.

    ``pressed`` (n, nb): coefficient times normal force, N. ``slid`` (n, nb, 3): normals of the contacts. ``reach`` (n, 3): the
    displacement since the start of the step, of ``dt`` s.
    """
    v = np.empty(3)
    for i in range(len(pressed)):
        for b in range(pressed.shape[1]):
            if pressed[i, b] == 0.0:
                continue
            n = slid[i, b]
            along = reach[i, 0] * n[0] + reach[i, 1] * n[1] + reach[i, 2] * n[2]
            for c in range(3):
                v[c] = (reach[i, c] - along * n[c]) / dt
            y = np.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
            f, slope, bend = friction_slope(y, eps)
            total[0] += pressed[i, b] * dt * f
            for c in range(3):
                gradient[i, c] += pressed[i, b] * slope * v[c]
                for e in range(3):
                    same = 1.0 if c == e else 0.0
                    blocks[i, c, e] += pressed[i, b] / dt * (slope * (same - n[c] * n[e]) + bend * v[c] * v[e])


@jit
def derivatives(kinds, radii, axes, distance, normal, room, reach, weights, stiffness, definite, gradient, blocks):
    """Add the gradient (n, 3) and second derivatives (n, 3, 3) of the barrier; ``definite`` leaves out the bodies' curvature."""
    for i in range(len(room)):
        for b in range(room.shape[1]):
            d = room[i, b]
            if not 0.0 < d < reach:
                continue
            scale = weights[i] * stiffness * reach
            _, first, second = barrier(d, reach)
            n, bent = normal[i, b], 0.0
            if kinds[b] != PLANE and not definite:
                bent = scale * first / (distance[i, b] + radii[b])
            for c in range(3):
                gradient[i, c] += scale * first * n[c]
                for e in range(3):
                    same = 1.0 if c == e else 0.0
                    across = same - n[c] * n[e]
                    if kinds[b] == CYLINDER:
                        across -= axes[b, c] * axes[b, e]
                    blocks[i, c, e] += scale * second * n[c] * n[e] + bent * across
