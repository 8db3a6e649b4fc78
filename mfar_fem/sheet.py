"""Sheets of a scene: what is cut out, where it lies, and how it is meshed at a level of effort."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from mfar_fem.errors import DataFileError, InputError
from mfar_fem.fidelity import Fidelity
from mfar_fem.surface import patterns
from mfar_fem.surface.mesh import Surface

KINDS = ("rectangle", "disc", "annulus", "mesh")
WARP, BOUNDARY = "warp", "boundary_"
"""Names of data in a mesh file (.vtu, .vtk, .msh): warp direction by triangle, and by vertex 1 on a named part of the boundary."""


class Cut(NamedTuple):
    """A sheet as a mesh in place: vertices (nv, 3) m, triangles (nt, 3), named boundaries (vertex ids), the pattern it comes from,
    and the warp direction, (3,) or (nt, 3)."""

    vertices: np.ndarray
    triangles: np.ndarray
    boundary: dict[str, np.ndarray]
    pattern: patterns.Pattern | None
    warp: np.ndarray


@dataclass(frozen=True)
class Sheet:
    """A piece of cloth, flat in its own x–y plane (or a mesh), then turned and moved into place.

    Attributes
    ----------
    kind : {'rectangle', 'disc', 'annulus', 'mesh'}
        ``rectangle`` 0 ≤ x ≤ a, 0 ≤ y ≤ b, centred if ``centred``; ``disc`` and ``annulus`` about the origin; ``mesh`` from a file.
    size : tuple of float
        (a, b); (radius,); (inner, outer radius), m.
    at : (3,) tuple
        Translation, m, after the turn.
    turn : (3,) tuple
        Rotation vector, rad.
    warp : (3,) tuple
        Warp direction in the sheet's own frame; a mesh file with data ``warp`` by triangle has its own instead.
    centred : bool
        Rectangle about the origin.
    path : str
        File of a mesh; ``scale`` metres per unit of it.
    pattern : str
        Triangles of a rectangle or annulus, see :func:`mfar_fem.surface.grid.triangulate`.
    grading : float
        Of an annulus: width of its outermost cells over that of the innermost.
    """

    kind: str
    size: tuple[float, ...] = ()
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    warp: tuple[float, float, float] = (1.0, 0.0, 0.0)
    centred: bool = False
    path: str = ""
    scale: float = 1.0
    pattern: str = "union"
    name: str = field(default="")
    grading: float = 1.0

    def __post_init__(self):
        if self.kind not in KINDS:
            raise InputError(f"unknown sheet '{self.kind}'; choose one of {', '.join(KINDS)}")
        wanted = {"rectangle": 2, "disc": 1, "annulus": 2, "mesh": 0}[self.kind]
        if len(self.size) != wanted or not all(math.isfinite(v) and v > 0 for v in self.size):
            text = {"rectangle": "two sides", "disc": "a radius", "annulus": "an inner and an outer radius", "mesh": "no size"}
            raise InputError(f"a {self.kind} needs {text[self.kind]} (m), got {list(self.size)}")
        if not (math.isfinite(self.grading) and self.grading > 0) or (self.grading != 1.0 and self.kind != "annulus"):
            raise InputError(f"a grading is positive and for an annulus, got {self.grading:g} for kind '{self.kind}'")

    @property
    def longest(self) -> float:
        """Longest side or diameter, m (of a mesh: not known before it is read)."""
        return {"rectangle": max(self.size, default=0.0), "mesh": math.nan}.get(self.kind, 2.0 * max(self.size, default=0.0))

    def cut(self, level: Fidelity) -> Cut:
        """The sheet as a mesh.

        Raises
        ------
        DataFileError
            The mesh file cannot be read, or its data have the wrong shape.
        """
        if self.kind == "mesh":
            return self._read()
        h = level.size(self.longest)
        if self.kind == "rectangle":
            length, width = self.size
            p = patterns.strip(length, width, max(1, round(length / h)), max(1, round(width / h)), self.pattern)
        elif self.kind == "disc":
            p = patterns.disc(self.size[0], max(2, round(self.size[0] / h)))
        else:
            r_in, r_out = self.size
            n_r = max(1, round((r_out - r_in) / h))
            n_theta = max(6, 2 * round(math.pi * (r_in + r_out) / h / 2))
            p = patterns.annulus(r_in, r_out, n_r, n_theta, pattern=self.pattern, grading=self.grading)
        return Cut(self.place(p.vertices), p.triangles, dict(p.boundary), p, self.warp_in_place())

    def _read(self) -> Cut:
        """The mesh of a file with what it knows of warp and boundaries."""
        from mfar_fem.surface.io import read_mesh

        mesh = read_mesh(self.path, self.scale)
        warp = self.warp_in_place()
        if (given := mesh.triangle_data.get(WARP)) is not None:
            if np.shape(given) != (len(mesh.triangles), 3) or not np.isfinite(given).all():
                raise DataFileError(f"the data '{WARP}' must be three finite numbers a triangle", self.path)
            warp = Rotation.from_rotvec(self.turn).apply(np.asarray(given, dtype=float))
        named = {k[len(BOUNDARY) :]: np.flatnonzero(v) for k, v in mesh.vertex_data.items() if k.startswith(BOUNDARY)}
        return Cut(self.place(mesh.vertices), mesh.triangles, named, None, warp)

    def place(self, points: np.ndarray) -> np.ndarray:
        """Points (n, 3) of the sheet's own frame in space."""
        points = points.copy()
        if self.kind == "rectangle" and self.centred:
            points[:, :2] -= 0.5 * np.asarray(self.size)
        return Rotation.from_rotvec(self.turn).apply(points) + np.asarray(self.at)

    def warp_in_place(self) -> np.ndarray:
        """Warp direction (3,) in space."""
        return Rotation.from_rotvec(self.turn).apply(np.asarray(self.warp, dtype=float))


def build_surface(sheets: Sequence[Sheet], level: Fidelity, order: int) -> Surface:
    """All sheets as one surface; boundaries of several sheets are ``sheet1.left``, ``sheet2.left`` … or ``name.left``."""
    vertices, triangles, warp, mids = [], [], [], []
    boundary: dict[str, np.ndarray] = {}
    offset = 0
    for number, sheet in enumerate(sheets, 1):
        v, t, named, pattern, direction = sheet.cut(level)
        prefix = "" if len(sheets) == 1 else f"{sheet.name or f'sheet{number}'}."
        boundary |= {prefix + key: ids + offset for key, ids in named.items()}
        mids.append((offset, len(v), sheet, pattern))
        vertices.append(v)
        triangles.append(t + offset)
        warp.append(np.broadcast_to(direction, (len(t), 3)))
        offset += len(v)
    V = np.vstack(vertices)

    def midpoint(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        out = 0.5 * (V[a] + V[b])
        for start, count, sheet, pattern in mids:
            own = (a >= start) & (a < start + count)
            if pattern is not None and own.any():
                out[own] = sheet.place(pattern.midpoints(np.column_stack([a[own] - start, b[own] - start])))
        return out

    return Surface(V, np.vstack(triangles), order, np.vstack(warp), midpoint, boundary)


def smooth_noise(surface: Surface, seed: int) -> np.ndarray:
    """Random displacement (nn, 3) along the normals with largest size 1: the same field for every mesh of one shape and seed.

    A sum of twelve plane waves with wavelengths from the size of the sheet down to a sixth of it.
    """
    rng = np.random.default_rng(seed)
    centre, extent = surface.nodes.mean(axis=0), float(np.ptp(surface.nodes, axis=0).max())
    waves = rng.standard_normal((12, 3))
    waves *= (2 * np.pi * rng.uniform(1.0, 6.0, 12) / extent / np.linalg.norm(waves, axis=1))[:, None]
    phase, weight = rng.uniform(0, 2 * np.pi, 12), rng.standard_normal(12)
    f = np.cos((surface.nodes - centre) @ waves.T + phase) @ weight
    f /= np.abs(f).max()
    t = surface.triangles
    n = np.cross(surface.vertices[t[:, 1]] - surface.vertices[t[:, 0]], surface.vertices[t[:, 2]] - surface.vertices[t[:, 0]])
    normals = np.zeros_like(surface.nodes)
    for column in surface.elements.T:
        np.add.at(normals, column, n)
    return f[:, None] * normals / np.linalg.norm(normals, axis=1, keepdims=True)
