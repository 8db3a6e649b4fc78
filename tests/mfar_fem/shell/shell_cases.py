"""Small shells for the tests of the element: flat and curved, both orders, in deformed states."""

from __future__ import annotations

import numpy as np

from mfar_fem.assembly import Pattern
from mfar_fem.materials import Bending, EightChainSilk, Fabric, StVenantKirchhoff
from mfar_fem.shell import Shell, State
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import cylinder, sphere, strip

PATTERNS = {
    "flat": strip(0.3, 0.2, 3, 2, jitter=0.3),
    "cylinder": cylinder(0.2, 0.3, (0.0, 1.0), 3, 2, jitter=0.2),
    "sphere": sphere(0.2, (0.0, 1.0), (0.0, 1.0), 2, 3),
}
SHAPES = [(shape, order) for shape in PATTERNS for order in (1, 2)]
SILK = Fabric("silk", EightChainSilk(), 1e-4, 0.06, Bending(2e-6, 1e-6, 1.5e-6, 0.3e-6))
PLATE = Fabric("plate", StVenantKirchhoff.isotropic(1e6, 0.3), 2e-3, 1.0, Bending.isotropic(1e6, 0.3, 2e-3))


def surface(shape: str, order: int) -> Surface:
    return Surface.from_pattern(PATTERNS[shape], order, warp=(0.3, 1.0, 0.2))


def shell(shape: str, order: int, fabric=SILK, **options) -> Shell:
    return Shell(surface(shape, order), fabric, **options)


def moved(s: Shell, displacement: float, rotation: float, seed: int = 0) -> State:
    """A random state: nodes by ``displacement`` (m), edge rotations by ``rotation`` (rad), standard deviations."""
    rng = np.random.default_rng(seed)
    state = s.reference_state()
    u, k = state.u.copy(), s.alpha_offset
    u[:k] += displacement * rng.normal(size=k)
    u[k:] += rotation * rng.normal(size=len(u) - k)
    return state.with_u(u)


def turned(s: Shell, state: State, R: np.ndarray, shift=(0.0, 0.0, 0.0)) -> State:
    """The state after a rigid motion x -> R x + shift."""
    u = state.u.copy()
    u[: s.alpha_offset] = (s.positions(state) @ R.T + np.asarray(shift)).ravel()
    return State(u, state.directors @ R.T)


def rotation(axis, angle: float) -> np.ndarray:
    a = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    A = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    return np.eye(3) + np.sin(angle) * A + (1 - np.cos(angle)) * A @ A


def gradient(s: Shell, state: State) -> np.ndarray:
    g = np.zeros(s.n)
    s.gradient(state, g)
    return g


def tangent(s: Shell, state: State, exact: bool = True) -> np.ndarray:
    """Dense tangent (n, n)."""
    pattern = Pattern(s.n, [s.element_dofs])
    data = np.zeros(pattern.nnz)
    s.hessian(state, np.zeros(s.n), data, pattern.positions[0], exact)
    return pattern.matrix(data).toarray()
