"""Drape of a sewn garment on a figure: it is put on in T-pose, the figure moves to its pose, the cloth settles."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mfar_fem.errors import NotConvergedError

from . import body
from .body import BodySpec
from .body_field import Field
from .drape_kernels import advance, separate
from .sewing import SewnMesh
from .wearing import Worn

log = logging.getLogger(__name__)
DT = 1.0 / 800
"""Time step, s."""
BLOCK = 6
"""Steps for which the figure stands still, and between two passes of self-contact."""
MARGIN = 0.007
"""Distance of the mid-surface's vertices from the skin, m (the flat faces between them come nearer)."""
APART = 0.85
"""Distance kept between vertices of the cloth, edge lengths: at 0.55 two to three times as many edges pass through other faces, at
0.95 the cloth is stretched by half as much again."""
MAX_STRETCH, MAX_DEPTH = 0.05, 0.02
"""Mean stretch and depth inside the figure (m) over which a drape is refused."""
WARM, MOVE, SETTLE = 0.3, 0.9, 0.9
"""Durations of dressing, moving and settling, s."""


@dataclass(frozen=True)
class Draped:
    """A garment at rest on a figure.

    Parameters
    ----------
    vertices : (n, 3) array
        Mid-surface, m.
    mean_stretch, max_penetration : float
        Mean of ``|l / l0 - 1|`` over the edges outside gathered seams, and the deepest point of the cloth (vertices,
        quarter points of edges, middles of faces) inside the figure, m.
    speed : float
        Root mean square speed when stopped, m/s.
    """

    vertices: np.ndarray
    mean_stretch: float
    max_penetration: float
    speed: float


def drape(
    mesh: SewnMesh, worn: Worn, spec: BodySpec, seed: int = 0, bending: float = 1.0, progress: Callable[[float], None] | None = None
) -> Draped:
    """Let a garment hang.

    Parameters
    ----------
    mesh : SewnMesh
    worn : Worn
        From :func:`reconstruction.benchmark.wearing.put_on`.
    spec : BodySpec
    seed : int
        Of the order of the constraints and of a breath of 1 mm that starts the folds.
    bending : float
        Stiffness against bending relative to the default.
    progress : callable, optional
        Called with the fraction done.

    Raises
    ------
    NotConvergedError
        The cloth is not finite, stretched by more than :data:`MAX_STRETCH` or deeper than :data:`MAX_DEPTH` in the figure.
    """
    rng = np.random.default_rng([seed, 31])
    links, lengths, compliance = _links(mesh, worn, rng, bending)
    x = worn.start + rng.normal(0, 0.001, worn.start.shape)
    v = np.zeros_like(x)
    free = np.ones(len(x))
    free[worn.held] = 0.0
    blocks = round((WARM + MOVE + SETTLE) / (DT * BLOCK))
    thickness = APART * float(np.median(mesh.rest_lengths))
    for block in range(blocks):
        t = block * DT * BLOCK
        inflate = float(np.clip(0.3 + 0.9 * t / WARM, 0.3, 1.0))
        s = float(np.clip((t - WARM) / MOVE, 0.0, 1.0))
        blend = s * s * (3 - 2 * s)
        shape = body.field(spec, blend, inflate)
        if len(worn.held):
            x[worn.held] = worn.targets(blend)
        settling = t > WARM + MOVE
        gap = 0.02 + max(0.0, 0.25 - 0.4 * max(0.0, t - WARM))
        advance(
            x,
            v,
            free,
            BLOCK,
            DT,
            5.0 if t > WARM else 0.0,
            4.0 if settling else 2.0 if t > WARM else 40.0,
            links,
            lengths,
            compliance,
            shape.capsules,
            shape.softness,
            shape.grid,
            shape.frame,
            MARGIN,
            0.35 if settling else 0.2,
            worn.belt,
            gap,
        )
        separate(x, v, free, worn.start, thickness)
        if progress is not None and block % 16 == 0:
            progress(block / blocks)
    shape = body.field(spec)
    speed = float(np.sqrt((v**2).sum(axis=1).mean()))
    if not np.isfinite(x).all():
        raise NotConvergedError("the drape is not finite", x)
    x = _clear(mesh, x, free, shape)
    strain = np.linalg.norm(x[mesh.edges[:, 0]] - x[mesh.edges[:, 1]], axis=1) / mesh.rest_lengths - 1
    strain = np.abs(strain[~mesh.eased[mesh.edges].any(axis=1)])
    result = Draped(x, float(strain.mean()), penetration(mesh, x, shape), speed)
    if result.mean_stretch > MAX_STRETCH or result.max_penetration > MAX_DEPTH:
        found = f"mean stretch {result.mean_stretch:.3f}, {1000 * result.max_penetration:.1f} mm inside the figure"
        raise NotConvergedError(f"the drape failed: {found}; limits {MAX_STRETCH} and {1000 * MAX_DEPTH:.0f} mm", result)
    return result


def penetration(mesh: SewnMesh, vertices: np.ndarray, shape: Field) -> float:
    """Deepest vertex, quarter point of an edge or middle of a face inside the figure, m (0 if all are outside)."""
    a, b = vertices[mesh.edges[:, 0]], vertices[mesh.edges[:, 1]]
    probes = np.concatenate([vertices, *(a + t * (b - a) for t in (0.25, 0.5, 0.75)), vertices[mesh.faces].mean(axis=1)])
    return float(max(0.0, -shape(probes).min()))


def _links(mesh: SewnMesh, worn: Worn, rng, bending: float):
    """Edges (stiff) and, across every inner edge, the opposite vertices at their flat distance (compliant: bending)."""
    corners = np.array([[1, 2, 0], [2, 0, 1], [0, 1, 2]])
    faces = mesh.faces
    ends = np.sort(np.concatenate([faces[:, c[:2]] for c in corners]), axis=1)
    apex = np.concatenate([faces[:, c[2]] for c in corners])
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    ends, apex = ends[order], apex[order]
    pair = np.flatnonzero((ends[1:] == ends[:-1]).all(axis=1))
    across = np.stack([apex[pair], apex[pair + 1]], axis=1)
    table = {(int(a), int(b)): float(r) for (a, b), r in zip(mesh.edges, mesh.rest_lengths, strict=True)}
    get = lambda a, b: table[(a, b) if a < b else (b, a)]  # noqa: E731
    flat = np.array(
        [
            _flat_distance(get(a, b), get(a, p), get(b, p), get(a, q), get(b, q))
            for (a, b), (p, q) in zip(ends[pair].tolist(), across.tolist(), strict=True)
        ]
    )
    links = np.concatenate([mesh.edges, across])
    lengths = np.concatenate([mesh.rest_lengths, flat])
    compliance = np.concatenate([np.full(len(mesh.edges), 1e-8), np.full(len(across), 1.5e-4 / bending)])
    mix = rng.permutation(len(links))
    return np.ascontiguousarray(links[mix]), lengths[mix], compliance[mix]


def _flat_distance(base, ap, bp, aq, bq) -> float:
    """Distance of the apexes p, q of two triangles on the edge ab unfolded flat."""
    xp, xq = (ap**2 - bp**2 + base**2) / (2 * base), (aq**2 - bq**2 + base**2) / (2 * base)
    yp, yq = np.sqrt(max(ap**2 - xp**2, 0.0)), np.sqrt(max(aq**2 - xq**2, 0.0))
    return float(np.hypot(xp - xq, yp + yq))


def _clear(mesh: SewnMesh, x, free, shape: Field, passes: int = 30):
    """Move faces out of the figure whose middles, or whose edges' middles, are inside it."""
    x = x.copy()
    groups = (np.arange(len(x))[:, None], mesh.edges, mesh.faces)
    for _ in range(passes):
        moved = False
        for group in groups:
            d, g = shape.with_gradient(x[group].mean(axis=1))
            near = np.flatnonzero(d < 0.001)
            if len(near):
                moved = True
                push = np.zeros_like(x)
                count = np.zeros(len(x))
                for k in range(group.shape[1]):
                    np.add.at(push, group[near, k], (0.0015 - d[near])[:, None] * g[near])
                    np.add.at(count, group[near, k], 1.0)
                x += free[:, None] * push / np.maximum(count, 1.0)[:, None]
        if not moved:
            break
    return x
