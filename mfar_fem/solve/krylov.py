"""Conjugate gradients that say why they stop: negative curvature is a finding here, not a breakdown."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Operator = Callable[[np.ndarray], np.ndarray]


def dot(a: np.ndarray, b: np.ndarray) -> float:
    """Scalar product, summed in one thread: the same bits on every machine load, and no threads to wait for."""
    return float(np.einsum("i,i->", a, b))


def conjugate_gradients(A, b: np.ndarray, preconditioner: Operator, rtol: float,
                        max_iterations: int) -> tuple[np.ndarray, int, str]:
    """Solve ``A x = b`` from ``x = 0`` with a symmetric preconditioner (Hestenes, Stiefel, J. Res. NBS 49 (1952) 409).

    Parameters
    ----------
    A : (n, n) sparse matrix
    b : (n,) array
    preconditioner : callable
        Approximates ``A⁻¹``.
    rtol : float
        Residual over ``|b|`` at which to stop.

    Returns
    -------
    x : (n,) array
    iterations : int
    status : str
        ``converged``, ``iteration limit``, ``negative curvature`` (of the matrix, or of the preconditioner), ``not finite``.
    """
    x, r = np.zeros_like(b), b.copy()
    target = rtol**2 * dot(b, b)
    if target == 0.0:
        return x, 0, "converged"
    p, old = None, 1.0
    for iteration in range(1, max_iterations + 1):
        z = preconditioner(r)
        rz = dot(r, z)
        if not np.isfinite(rz):
            return x, iteration - 1, "not finite"
        if rz <= 0.0:
            return x, iteration - 1, "negative curvature"
        p = z.copy() if p is None else z + (rz / old) * p
        old = rz
        Ap = A @ p
        curvature = dot(p, Ap)
        if curvature <= 0.0:
            return x, iteration - 1, "negative curvature"
        step = rz / curvature
        x += step * p
        r -= step * Ap
        if dot(r, r) <= target:
            return x, iteration, "converged"
    return x, max_iterations, "iteration limit"
