"""Pix2Vex: a mesh moved until its smooth pictures are the given ones, coarse to fine.

After F. Petersen et al., arXiv:1903.11149. Theirs compares shaded pictures of untextured objects under known light; historical
pictures are painted under light that nobody knows, so each triangle has a colour of its own, found along with the shape, and the
silhouettes carry most of the weight. The surface starts as a sphere (or a given mesh) and keeps its topology: what starts closed
has no openings.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mfar_fem.errors import InputError, NotConvergedError
from reconstruction.baselines.mvs import around
from reconstruction.baselines.soft_render import Softness, render
from reconstruction.libraries import optional
from reconstruction.stereo.view import View
from reconstruction.surface.subdivision import uniform_loop
from reconstruction.surface.triangles import TriangleMesh


@dataclass(frozen=True)
class Level:
    """Longer side of the pictures (px), softness of edges (px), steps, rate of Adam over the size of the object.

    Thin triangles at the limb add up: a surface looks larger than it is by about twice the softness, so it is kept well below a
    pixel, and small pictures take the place of soft ones at the start.
    """

    height: int
    edge: float
    steps: int
    rate: float


LEVELS = (Level(16, 0.3, 300, 1e-2), Level(32, 0.3, 300, 4e-3), Level(64, 0.3, 300, 2e-3))


@dataclass(frozen=True)
class Pix2VexSettings:
    """Weights of colours, of the Laplacian and of even edges beside the silhouettes'; limit of the time, s; levels."""

    colour: float = 0.3
    smooth: float = 3.0
    even: float = 0.1
    seconds: float = 120.0
    levels: tuple[Level, ...] = LEVELS


@dataclass(frozen=True, eq=False)
class Pix2VexResult:
    """Surface and plain facts: steps, seconds, loss and the silhouettes' mean intersection over union at the end."""

    mesh: TriangleMesh
    facts: dict[str, Any] = field(default_factory=dict)


def sphere(centre, radii, level: int = 1) -> TriangleMesh:
    """An icosahedron divided `level` times on an ellipsoid."""
    ball = optional("trimesh", "Pix2Vex needs").creation.icosphere(level)
    return TriangleMesh(np.asarray(ball.vertices) * radii + centre, np.asarray(ball.faces))


def pix2vex(
    views: Sequence[View], start: TriangleMesh | None = None, settings: Pix2VexSettings | None = None,
    progress: Callable[[int], None] | None = None,
) -> Pix2VexResult:  # fmt: skip
    """Reconstruct a surface.

    Parameters
    ----------
    views : sequence of View
    start : TriangleMesh, optional
        By default a sphere in the box about what the masks leave room for, divided once a level; a given mesh keeps its triangles.
    settings : Pix2VexSettings, optional
    progress : callable, optional
        ``progress(1)`` after each step.

    Raises
    ------
    InputError
        No views, or an empty mask.
    NotConvergedError
        The surface left the numbers.
    MissingDependencyError
        torch is not installed.
    """
    from reconstruction.torch_library import torch as th

    s = settings or Pix2VexSettings()
    box = around(views)
    size = float(np.linalg.norm(box[-1] - box[0]) / 2)
    given = start is not None
    mesh = start if start is not None else sphere(box.mean(axis=0), 0.35 * (box[-1] - box[0]), 1)
    clock = time.perf_counter()
    done, loss_value, overlap = 0, float("nan"), [0.0]
    tone = np.mean([v.image[v.mask].mean(axis=0) for v in views], axis=0)
    for number, level in enumerate(s.levels):
        if number and not given:
            mesh = uniform_loop(mesh)
        shown = [_shrunk(v, level.height) for v in views]
        x = th.tensor(mesh.vertices, dtype=th.float32, requires_grad=True)
        faces = th.tensor(np.array(mesh.faces))
        colours = th.tensor(np.tile(tone, (len(mesh.faces), 1)), dtype=th.float32).logit(1e-3).requires_grad_(True)
        edges = th.tensor(np.array(mesh.edges))
        optimiser = th.optim.Adam([{"params": [x], "lr": level.rate * size}, {"params": [colours], "lr": 0.05}])
        softness = Softness(level.edge, 0.03 * size)
        overlap = [0.0] * len(shown)
        for step in range(level.steps):
            if time.perf_counter() - clock > s.seconds:
                break
            k = step % len(shown)
            camera, mask, image = shown[k]
            picture, coverage = render(x, faces, th.sigmoid(colours), camera, mask.shape, softness, closed=not given)
            both = (coverage * mask).sum()
            union = (coverage + mask - coverage * mask).sum()
            seen = (mask * coverage.detach())[..., None]
            difference = (seen * (picture - image).abs()).sum() / (3 * seen.sum() + 1e-9)
            loss = 1 - both / union + s.colour * difference + _regular(th, x, edges, s)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            overlap[k] = float((both / union).detach())
            loss_value = float(loss.detach())
            done += 1
            if progress is not None:
                progress(1)
        moved = x.detach().numpy().astype(float)
        if not np.isfinite(moved).all():
            raise NotConvergedError("Pix2Vex: the surface left the numbers; try smaller rates")
        mesh = TriangleMesh(moved, mesh.faces)
    facts = {"steps": done, "seconds": time.perf_counter() - clock, "loss": loss_value,
             "overlap": float(np.mean([o for o in overlap if o > 0] or [0.0])), "triangles": len(mesh.faces)}  # fmt: skip
    return Pix2VexResult(mesh, facts)


def _shrunk(view: View, height: int):
    """Camera, mask and picture about the mask, so many pixels high, as tensors."""
    from reconstruction.torch_library import torch as th

    at = np.argwhere(view.mask)
    if not len(at):
        raise InputError(f"the mask of '{view.name}' is empty")
    low, high = at.min(axis=0), at.max(axis=0) + 1
    margin = np.ceil(0.15 * (high - low)).astype(int)
    low, high = np.maximum(low - margin, 0), np.minimum(high + margin, view.size)
    part = view.cropped((slice(low[0], high[0]), slice(low[1], high[1]))).shrunk(height)
    return tuple(th.tensor(a, dtype=th.float32) for a in (part.camera, part.mask, part.image))


def _regular(th, x, edges, s: Pix2VexSettings):
    """Uniform Laplacian and spread of the edges' lengths, both without unit."""
    along = x[edges[:, 1]] - x[edges[:, 0]]
    length = along.norm(dim=1)
    mean = length.mean()
    total = th.zeros_like(x).index_add(0, edges[:, 0], along).index_add(0, edges[:, 1], -along)
    degree = th.zeros(len(x), dtype=x.dtype).index_add(0, edges.reshape(-1), th.ones(edges.numel(), dtype=x.dtype))
    smooth = ((total / degree[:, None].clamp(min=1)) ** 2).sum(dim=1).mean() / mean**2
    even = ((length / mean - 1) ** 2).mean()
    return 0.1 * s.smooth * smooth + s.even * even
