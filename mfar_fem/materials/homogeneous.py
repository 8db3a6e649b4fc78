r"""Homogeneous deformations of any law: what a test would read if its specimen deformed uniformly.

Directions are given in the plane of the sheet, ``"warp"`` (0), ``"weft"`` (pi/2), ``"bias"`` (pi/4) or an angle from
the warp in rad; n is the direction, t the one 90 degrees counter-clockwise from it.

The stress returned is the *nominal* (engineering, first Piola–Kirchhoff) stress, force per undeformed section: Pa for a
law of basis ``volume``, N/m for basis ``area``. The true (Cauchy) stress is not returned.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..errors import InputError, NotConvergedError
from .law import Law

MODES = ("uniaxial", "planar", "equibiaxial", "simple-shear")
_NAMED = {"warp": 0.0, "weft": 0.5 * np.pi, "bias": 0.25 * np.pi}
_D = np.array([2.0, 2.0, 1.0])


@dataclass(frozen=True)
class Response:
    """Homogeneous response along a curve of m states.

    Attributes
    ----------
    mode : str
        One of ``uniaxial``, ``planar``, ``equibiaxial``, ``simple-shear``.
    angle : float
        Direction n from the warp, rad.
    stretch : (m,) array
        Prescribed stretch along n; for simple shear the amount of shear.
    stress : (m,) array
        Nominal stress along n (simple shear: the shear stress P_nt), in ``unit``.
    lateral : (m,) array
        Stretch of the line element t (free in ``uniaxial``).
    C : (m, 3) array
        ``[C11, C22, C12]`` in the warp/weft frame.
    converged : (m,) bool array
        False where the state could not be reached (locking, loss of stability); stress and C are then those of the
        last state reached on the way.
    unit : str
        ``Pa`` or ``N/m``.
    names : tuple of str
        Parameters of ``sensitivity``.
    sensitivity : (m, p) array
        Total derivative of ``stress`` with respect to the parameters, the free stretches following.
    """

    mode: str
    angle: float
    stretch: np.ndarray
    stress: np.ndarray
    lateral: np.ndarray
    C: np.ndarray
    converged: np.ndarray
    unit: str
    names: tuple[str, ...] = ()
    sensitivity: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))


def direction_angle(direction: str | float) -> float:
    """Angle from the warp, rad, of ``"warp"``, ``"weft"``, ``"bias"`` or a number in rad."""
    if isinstance(direction, str):
        if direction not in _NAMED:
            raise InputError(f"direction '{direction}' is unknown; give one of {', '.join(_NAMED)} or an angle in rad")
        return _NAMED[direction]
    angle = float(direction)
    if not np.isfinite(angle):
        raise InputError("the direction must be a finite angle in rad")
    return angle


def uniaxial(law: Law, direction, stretch, sensitivities=(), strict: bool = True) -> Response:
    """Uniaxial tension with free lateral contraction and free shear.

    Parameters
    ----------
    law : Law
    direction : str or float
        Pulling direction.
    stretch : (m,) array_like
        Stretches, > 0, in any order.
    sensitivities : sequence of str
        Parameters whose sensitivities are wanted.
    strict : bool
        Raise NotConvergedError if a state cannot be reached; otherwise see :attr:`Response.converged`.

    Returns
    -------
    Response
    """
    return respond(law, "uniaxial", direction, stretch, sensitivities, strict)


def planar(law: Law, direction, stretch, sensitivities=(), strict: bool = True) -> Response:
    """Planar tension ("pure shear"): lateral stretch held at 1, no shear. Arguments as for :func:`uniaxial`."""
    return respond(law, "planar", direction, stretch, sensitivities, strict)


def equibiaxial(law: Law, direction, stretch, sensitivities=(), strict: bool = True) -> Response:
    """Equal stretch in all directions; the stress is the one along `direction`. Arguments as for :func:`uniaxial`."""
    return respond(law, "equibiaxial", direction, stretch, sensitivities, strict)


def simple_shear(law: Law, direction, shear, sensitivities=(), strict: bool = True) -> Response:
    """Simple shear ``x = X + shear Y`` along `direction`; the stress is the nominal shear stress P_nt."""
    return respond(law, "simple-shear", direction, shear, sensitivities, strict)


def respond(law: Law, mode: str, direction, stretch, sensitivities=(), strict: bool = True) -> Response:
    """Any of the modes by name; see the functions of those names."""
    if mode not in MODES:
        raise InputError(f"unknown deformation mode '{mode}'; known: {', '.join(MODES)}")
    angle = direction_angle(direction)
    stretch = np.atleast_1d(np.asarray(stretch, dtype=float))
    if stretch.ndim != 1 or not np.isfinite(stretch).all() or (mode != "simple-shear" and (stretch <= 0.0).any()):
        raise InputError("the stretches must be a list of finite numbers, positive ones (1 is undeformed)")
    names = tuple(sensitivities)
    for name in names:
        law.parameter(name)
    M = _frame(angle)
    local = _prescribed(mode, stretch)
    converged = np.ones(len(stretch), dtype=bool)
    if mode == "uniaxial":
        local, converged = _release(law, M, stretch)
    else:
        converged = np.isfinite(law.energy(local @ M.T))
        local = np.where(converged[:, None], local, [1.0, 1.0, 0.0])
    if strict and not converged.all():
        bad = stretch[~converged]
        first = bad[np.argmin(np.abs(bad - 1.0))]
        raise NotConvergedError(
            f"{law.name}: {mode} at {np.degrees(angle):.4g} degrees cannot reach "
            f"{np.sum(~converged)} of {len(stretch)} states, the first at {first:.6g} (locked or unstable there)"
        )
    return _collect(law, mode, angle, stretch, local, M, converged, names)


def _frame(angle):
    """Matrix from [Cnn, Ctt, Cnt] to [C11, C22, C12]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c * c, s * s, -2.0 * c * s], [s * s, c * c, 2.0 * c * s], [c * s, -c * s, c * c - s * s]])


def _prescribed(mode, stretch):
    one, zero = np.ones_like(stretch), np.zeros_like(stretch)
    if mode == "equibiaxial":
        return np.stack([stretch**2, stretch**2, zero], axis=1)
    if mode == "simple-shear":
        return np.stack([one, 1.0 + stretch**2, stretch], axis=1)
    return np.stack([stretch**2, one, zero], axis=1)


def _derivatives(law, local, M):
    """Energy, gradient (n, 3) and Hessian (n, 3, 3) in [Cnn, Ctt, Cnt]."""
    energy, S, T = law.evaluate(local @ M.T, 2)
    return energy, (S / _D) @ M, M.T @ (T / (_D[:, None] * _D)) @ M


def _release(law, M, stretch):
    """Free Ctt and Cnt so that S_tt = S_nt = 0: continuation from the reference state, every point at its own pace."""
    n = len(stretch)
    goal = 2.0 * np.log(stretch)
    reached, step, failed = np.zeros(n), np.full(n, 0.25), np.full(n, np.inf)
    local = np.tile([1.0, 1.0, 0.0], (n, 1))
    while True:
        # given up: the next thousandth of the path failed
        todo = np.flatnonzero((reached < 1.0) & (failed - reached > 1e-3))
        if not len(todo):
            return local, reached >= 1.0
        now = local[todo]
        target = np.minimum(reached[todo] + step[todo], 1.0)
        square = np.exp(goal[todo] * target)
        _, _, h = _derivatives(law, now, M)
        rate = -_solve2(h[:, 1:, 1:], h[:, 1:, 0])[0]
        trial = np.column_stack([square, now[:, 1:] + rate * (square - now[:, 0])[:, None]])
        # the tangent predicts too much where C would all but collapse
        ok = np.isfinite(law.energy(trial @ M.T)) & (_det(trial) > 0.2 * _det(now))
        trial[~ok, 1:] = now[~ok, 1:]
        solved, good = _relax(law, trial, M)
        local[todo[good]] = solved[good]
        reached[todo[good]] = target[good]
        failed[todo[~good]] = target[~good]
        step[todo] *= np.where(good, 2.0, 0.25)
        step = np.where(np.isfinite(failed), np.clip(step, 2.5e-4, 0.5 * np.maximum(failed - reached, 5e-4)), step)


def _det(local):
    return local[:, 0] * local[:, 1] - local[:, 2] ** 2


def _relax(law, local, M, rtol=1e-11, iterations=40):
    """Minimise the energy over Ctt and Cnt at fixed Cnn: Newton with line search, batched."""
    local = local.copy()
    n = len(local)
    energy, g, h = _derivatives(law, local, M)
    alive = np.isfinite(energy)
    good = np.zeros(n, dtype=bool)
    scale = np.abs(h[:, 1:, 1:]).max(axis=(1, 2))
    for _ in range(iterations):
        todo = np.flatnonzero(alive & ~good)
        if not len(todo):
            break
        gx = g[todo][:, 1:]
        move, convex = _solve2(h[todo][:, 1:, 1:], gx)
        move = -move
        # relative to the smaller eigenvalue of C, so that a collapsing C does not pass for a solution
        length = np.abs(move).max(axis=1) * local[todo, :2].sum(axis=1) / _det(local[todo])
        done = (length <= rtol) & convex
        close = (length <= 1e-7) & convex  # the energy no longer resolves such a step
        t = np.ones(len(todo))
        slope = np.einsum("ij,ij->i", gx, move)
        noise = 1e-13 * (np.abs(energy[todo]) + scale[todo])
        pending = np.ones(len(todo), dtype=bool)
        trial = local[todo]
        for _ in range(40):
            rows = np.flatnonzero(pending)
            if not len(rows):
                break
            trial[rows, 1:] = local[todo[rows], 1:] + t[rows, None] * move[rows]
            value = law.energy(trial[rows] @ M.T)
            fine = value <= energy[todo[rows]] + 1e-4 * t[rows] * slope[rows] + noise[rows]
            fine |= close[rows] & np.isfinite(value)
            pending[rows[fine]] = False
            t[rows[~fine]] *= 0.5
        alive[todo[pending]] = False
        kept = todo[~pending]
        local[kept] = trial[~pending]
        good[todo[done & ~pending]] = True
        if len(kept):
            energy[kept], g[kept], h[kept] = _derivatives(law, local[kept], M)
    return local, good


def _solve2(h, g):
    """Solve the symmetric 2x2 systems, shifted to positive definite where they are not; also says where they were."""
    scale = np.maximum(np.abs(h).max(axis=(1, 2)), 1e-300)
    h, g = h / scale[:, None, None], g / scale[:, None]
    a, b, d = h[:, 0, 0], h[:, 0, 1], h[:, 1, 1]
    mean, radius = 0.5 * (a + d), np.hypot(0.5 * (a - d), b)
    largest = np.maximum(np.abs(mean) + radius, 1e-8)
    convex = mean - radius > 1e-14 * largest
    shift = np.where(convex, 0.0, radius - mean + 1e-3 * largest)
    a, d = a + shift, d + shift
    det = a * d - b * b
    return np.stack([(d * g[:, 0] - b * g[:, 1]) / det, (a * g[:, 1] - b * g[:, 0]) / det], axis=1), convex


def _collect(law, mode, angle, stretch, local, M, converged, names):
    C = local @ M.T
    _, g, h = _derivatives(law, local, M)
    # P = F S in the frame (n, t); S = D g
    if mode == "simple-shear":
        amount = local[:, 2]
        weights = np.stack([np.zeros_like(amount), 2.0 * amount, np.ones_like(amount)], axis=1)
    else:
        weights = np.zeros((len(stretch), 3))
        weights[:, 0] = 2.0 * np.sqrt(local[:, 0])
    stress = np.einsum("ij,ij->i", weights, g)
    sensitivity = np.zeros((len(stretch), len(names)))
    if names:
        dg = np.einsum("ijp,jk->ikp", law.stress_sensitivity(C, names) / _D[:, None], M)
        if mode == "uniaxial":
            for p in range(len(names)):
                dx = -_solve2(h[:, 1:, 1:], dg[:, 1:, p])[0]
                dg[:, 0, p] += h[:, 0, 1] * dx[:, 0] + h[:, 0, 2] * dx[:, 1]
        sensitivity = np.einsum("ij,ijp->ip", weights, dg)
    lateral = np.sqrt(local[:, 1])
    return Response(mode, angle, stretch, stress, lateral, C, converged, law.stress_unit, names, sensitivity)
