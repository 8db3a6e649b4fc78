r"""Values with their first and second derivatives, in plain numpy: what the twin of the shell kernels is written with.

A jet of a quantity q carries :math:`q,\; q_{,i} = \partial q/\partial u_i` and :math:`q_{,ij}`; the rules are

.. math:: (pq)_{,ij} = p_{,ij} q + p_{,i} q_{,j} + p_{,j} q_{,i} + p\, q_{,ij}, \qquad
          f(q)_{,ij} = f'(q)\, q_{,ij} + f''(q)\, q_{,i} q_{,j} .
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Jet:
    """``value`` (...), ``first`` (..., n) and ``second`` (..., n, n); leading axes broadcast."""

    value: np.ndarray
    first: np.ndarray
    second: np.ndarray

    def __getitem__(self, index) -> Jet:
        return Jet(self.value[index], self.first[index], self.second[index])

    def __add__(self, other) -> Jet:
        if not isinstance(other, Jet):
            return Jet(self.value + other, self.first, self.second)
        return Jet(self.value + other.value, self.first + other.first, self.second + other.second)

    def __sub__(self, other) -> Jet:
        return self + other * -1.0 if isinstance(other, Jet) else self + (-other)

    def __mul__(self, other) -> Jet:
        if not isinstance(other, Jet):
            other = np.asarray(other, dtype=float)
            return Jet(self.value * other, self.first * other[..., None], self.second * other[..., None, None])
        p, q = self, other
        mixed = p.first[..., :, None] * q.first[..., None, :]
        return Jet(p.value * q.value, p.first * q.value[..., None] + p.value[..., None] * q.first,
                   p.second * q.value[..., None, None] + p.value[..., None, None] * q.second + mixed + np.swapaxes(mixed, -1, -2))

    def apply(self, value, slope, curvature) -> Jet:
        """The jet of f(q) from f, f' and f'' at q."""
        square = self.first[..., :, None] * self.first[..., None, :]
        return Jet(value, slope[..., None] * self.first,
                   slope[..., None, None] * self.second + curvature[..., None, None] * square)


def linear(weights: np.ndarray, x: np.ndarray, n: int) -> Jet:
    """The vector ``Σ_i weights_i x_i`` of nodes x (nt, nn, 3), whose components are the first unknowns of n."""
    first = np.zeros((len(x), 3, n))
    for c in range(3):
        first[:, c, c: 3 * len(weights): 3] = weights
    return Jet(np.einsum("i,eic->ec", weights, x), first, np.zeros((len(x), 3, n, n)))


def constant(vector: np.ndarray, n: int) -> Jet:
    """A jet (nt, 3) that does not depend on the unknowns."""
    return Jet(vector, np.zeros((*vector.shape, n)), np.zeros((*vector.shape, n, n)))


def stack(jets: list[Jet]) -> Jet:
    """Scalar jets (nt,) side by side: (nt, m)."""
    return Jet(*(np.stack([getattr(j, part) for j in jets], axis=1) for part in ("value", "first", "second")))


def dot(p: Jet, q: Jet) -> Jet:
    """Scalar product over the last component axis."""
    product = p * q
    return Jet(product.value.sum(-1), product.first.sum(-2), product.second.sum(-3))


def cross(p: Jet, q: Jet) -> Jet:
    """Vector product of (nt, 3) jets."""
    p0, p1, p2 = (p[:, i] for i in range(3))
    q0, q1, q2 = (q[:, i] for i in range(3))
    return stack([p1 * q2 - p2 * q1, p2 * q0 - p0 * q2, p0 * q1 - p1 * q0])


def unit(p: Jet) -> Jet:
    """p / |p| of (nt, 3) jets."""
    square = dot(p, p)
    s = square.value
    inverse = square.apply(s**-0.5, -0.5 * s**-1.5, 0.75 * s**-2.5)
    return stack([p[:, c] * inverse for c in range(3)])


def angle(sine: Jet, cosine: Jet) -> Jet:
    """atan2 of scalar jets."""
    s, c = sine.value, cosine.value
    r2 = s * s + c * c
    mixed = sine.first[:, :, None] * cosine.first[:, None, :]
    squares = (cosine.first[:, :, None] * cosine.first[:, None, :] - sine.first[:, :, None] * sine.first[:, None, :])
    second = ((c / r2)[:, None, None] * sine.second - (s / r2)[:, None, None] * cosine.second
              + (2 * s * c / r2**2)[:, None, None] * squares
              + ((s * s - c * c) / r2**2)[:, None, None] * (mixed + np.swapaxes(mixed, 1, 2)))
    return Jet(np.arctan2(s, c), (c / r2)[:, None] * sine.first - (s / r2)[:, None] * cosine.first, second)
