r"""Starts of the relaxation: the ring drooped into n folds, or nearly flat.

An n-fold start bends every radius into an arc that ends at the slope :math:`\varphi_0 - \varphi_1 \cos n(\theta -
\theta_0)`. The rim of a sheet that does not stretch keeps its length, which fixes :math:`\varphi_1` for a given mean slope
(few folds cannot hold all of it, then the swing is as large as the slope).
"""

from __future__ import annotations

import math

import numpy as np

from material_tests.drape.geometry import GRADING
from mfar_fem.shell import State
from mfar_fem.shell.geometry import edge_points_of_elements, mean_directors
from mfar_fem.shell.tables import tables
from mfar_fem.surface.patterns import ungraded

SLOPE = math.radians(70.0)
"""Mean slope at the rim of an n-fold start."""


def polar(surface) -> tuple[np.ndarray, np.ndarray]:
    """Radius (m) and angle (rad) of the nodes of a flat ring round the origin."""
    return np.hypot(surface.nodes[:, 0], surface.nodes[:, 1]), np.arctan2(surface.nodes[:, 1], surface.nodes[:, 0])


def folds(surface, disc_radius: float, specimen_radius: float, n: int, slope: float = SLOPE, phase: float = 0.0) -> np.ndarray:
    """Nodes (nn, 3) of the ring drooped into ``n`` folds; n = 0: without folds.

    Parameters
    ----------
    surface : Surface
        The flat ring.
    disc_radius, specimen_radius : float
        m.
    n : int
    slope : float
        Mean slope at the rim, rad.
    phase : float
        Polar angle of a ridge (largest radius), rad.
    """
    r, theta = polar(surface)
    length = specimen_radius - disc_radius
    ripple = 0.0 if n == 0 else _ripple(disc_radius, length, n, slope)
    angle = slope - ripple * np.cos(n * (theta - phase))
    x, z = _arc(disc_radius, np.maximum(r - disc_radius, 0.0), length, angle)
    return np.column_stack([x * np.cos(theta), x * np.sin(theta), z])


def _arc(disc_radius: float, s: np.ndarray, length: float, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Radius and height at the length s of a radius that bends evenly to ``angle`` at its end."""
    t = np.where(np.abs(angle) < 1e-9, 1e-9, angle) * s / length
    half = 0.5 * t
    chord = s * np.sinc(half / math.pi)
    return disc_radius + chord * np.cos(half), -chord * np.sin(half)


def _ripple(disc_radius: float, length: float, n: int, slope: float) -> float:
    """Swing of the slope with which the rim keeps its length."""
    from scipy.optimize import brentq

    theta = np.linspace(0.0, 2 * math.pi, 64 * n, endpoint=False)
    rim = 2 * math.pi * (disc_radius + length)

    def excess(swing):
        x, z = _arc(disc_radius, np.full_like(theta, length), length, slope + swing * np.cos(n * theta))
        p = np.column_stack([x * np.cos(theta), x * np.sin(theta), z])
        return np.linalg.norm(np.roll(p, -1, axis=0) - p, axis=1).sum() - rim

    top = min(slope, math.pi - slope)  # no radius rises, none turns under
    return top if excess(top) < 0.0 else float(brentq(excess, 0.0, top, xtol=1e-4))


def nearly_flat(surface, disc_radius: float, specimen_radius: float, seed: int, amplitude: float = 1e-3) -> np.ndarray:
    """Nodes (nn, 3) of the flat ring with a random, smooth height: waves 0 … 12 round it, growing outwards.

    Parameters
    ----------
    seed : int
        Of the random generator.
    amplitude : float
        Largest height, m.
    """
    r, theta = polar(surface)
    random = np.random.default_rng(seed)
    waves = np.arange(13)
    c, s = random.normal(size=(2, len(waves)))
    shape = np.cos(np.outer(theta, waves)) @ c + np.sin(np.outer(theta, waves)) @ s
    shape *= (np.maximum(r - disc_radius, 0.0) / (specimen_radius - disc_radius)) ** 2
    x = surface.nodes.copy()
    x[:, 2] += amplitude * shape / np.abs(shape).max()
    return x


def start(problem, x: np.ndarray) -> State:
    """The state of nodes ``x`` (nn, 3) with mean normals on the edges; supports keep their directors."""
    surface, shell, t = problem.surface, problem.shell, tables(problem.surface.order)
    directors = mean_directors(surface, x, t, edge_points_of_elements(surface, t.ng)[0])
    clamped = problem.start().directors
    held = problem.fixed[problem.fixed >= shell.alpha_offset] - shell.alpha_offset
    directors[held] = clamped[held]
    return State(np.concatenate([x.ravel(), np.zeros(shell.n_alpha)]), directors)


def prolong(surface, x: np.ndarray, cells: tuple[int, int], finer, grading: float = GRADING) -> np.ndarray:
    """A drape carried to another mesh of the same ring, to start from: the same branch there.

    Parameters
    ----------
    surface : Surface
        Order-2 ring of ``cells`` (across, round): its nodes are a grid of radius and angle.
    x : (nn, 3) array
        Deformed nodes, m.
    finer : Surface
        The other ring.
    grading : float
        Of the first ring, see :func:`mfar_fem.surface.patterns.annulus`.

    Returns
    -------
    (nn', 3) array, interpolated biquadratically within every cell (a spline overshoots at sharp folds).
    """
    r, theta = polar(surface)
    low, span = r.min(), r.max() - r.min()
    i = np.rint(ungraded((r - low) / span, grading) * 2 * cells[0]).astype(int)
    j = np.rint(theta / math.pi * cells[1]).astype(int) % (2 * cells[1])
    grid = np.empty((2 * cells[0] + 1, 2 * cells[1], 3))
    grid[i, j] = x
    s, t = polar(finer)
    u = ungraded(np.clip((s - low) / span, 0.0, 1.0), grading) * cells[0]
    v = (t % (2 * math.pi)) / (2 * math.pi) * cells[1]
    row, column = np.minimum(u.astype(int), cells[0] - 1), np.minimum(v.astype(int), cells[1] - 1)
    across, along = _quadratic(u - row), _quadratic(v - column)
    rows = 2 * row[:, None] + np.arange(3)
    columns = (2 * column[:, None] + np.arange(3)) % (2 * cells[1])
    return np.einsum("ka,kb,kabc->kc", across, along, grid[rows[:, :, None], columns[:, None, :]])


def _quadratic(s: np.ndarray) -> np.ndarray:
    """Lagrange polynomials (k, 3) of the points 0, 1/2 and 1."""
    return np.stack([(1 - s) * (1 - 2 * s), 4 * s * (1 - s), s * (2 * s - 1)], axis=1)


def admissible(problem, x: np.ndarray, rounds: int = 200) -> np.ndarray:
    """Nodes ``x`` (nn, 3), displacements of the free ones averaged with their neighbours' until the energy is finite.

    A coarse sheet is not stretched where its strain is sampled, but may be between the samples, at sharp folds: there a finer mesh
    would start from elements turned over.
    """
    from scipy.sparse import coo_matrix

    elements = problem.surface.elements
    count = elements.shape[1]
    rows, columns = np.repeat(elements, count, axis=1).ravel(), np.tile(elements, (1, count)).ravel()
    mean = coo_matrix((np.ones(len(rows)), (rows, columns))).tocsr()
    mean = mean.multiply(1.0 / np.asarray(mean.sum(axis=1))).tocsr()
    held = np.unique(problem.fixed[problem.fixed < problem.shell.alpha_offset] // 3)
    for _ in range(rounds):
        if np.isfinite(problem.energy(start(problem, x), 1.0)):
            break
        kept, rest = x[held], problem.surface.nodes  # averaged places would wander towards the wider cells
        x = rest + 0.8 * (x - rest) + 0.2 * (mean @ (x - rest))
        x[held] = kept
    return x
