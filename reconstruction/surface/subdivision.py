r"""Adaptive Loop subdivision where a mesh is too coarse for its curvature, conforming by red-green closure.

The paper refines where \|H\| > κ_th, a number it does not give and that cannot be right at two sizes at once. Here a face of
mean edge h is split where h \|H\| > θ: the angle (rad) by which the surface turns along one edge. That is κ_th = θ / h; a
fixed κ_th may be given instead.

All positions come from one hierarchy of uniform Loop steps and lie on its limit surface, so an adaptive mesh is part of the
uniform one and neighbours at different levels fit. Red: four children. Green: a face with one split edge is halved (R. Bank,
A. Sherman, A. Weiser, Refinement algorithms and data structures for regular local mesh refinement, 1983); with two or more it
becomes red. Green faces are never split again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mfar_fem.errors import ParameterError, SurfaceError
from reconstruction.surface.connectivity import face_edges
from reconstruction.surface.curvature import mean_curvature
from reconstruction.surface.loop_rules import interpolating_controls, limit_matrix, loop_step
from reconstruction.surface.triangles import TriangleMesh

ANGLE = 0.20
"""θ, rad (11.5°): the sagitta of an edge is then at most h θ / 8, 2.5 % of its length."""
LARGEST = 4_000_000
"""Triangles of the uniform hierarchy that are allowed."""


@dataclass(frozen=True, eq=False)
class Subdivided:
    """An adaptively subdivided mesh.

    Attributes
    ----------
    mesh : TriangleMesh
        Conforming; the vertices of the input come first, in their order.
    levels : (nf,) array of int
        Red level of every face (a green half has that of its parent).
    green : (nf,) array of bool
    marked : tuple of int
        Faces that the rule marked, by level.
    refined : tuple of int
        Faces split in four after closure, by level.
    moved : float
        Largest distance by which a vertex of the input moved, m.
    """

    mesh: TriangleMesh
    levels: np.ndarray
    green: np.ndarray
    marked: tuple[int, ...]
    refined: tuple[int, ...]
    moved: float


def too_coarse(
    mesh: TriangleMesh, angle: float = ANGLE, kappa: float | None = None, method: str = "cotangent", smoothing: int = 1
) -> np.ndarray:
    """(nf,) faces to split.

    Parameters
    ----------
    mesh : TriangleMesh
    angle : float
        θ, rad: split where (mean edge) · |H| exceeds it at a corner.
    kappa : float, optional
        κ_th, 1/m: split where |H| exceeds it, whatever the edge.
    method, smoothing
        Of :func:`reconstruction.surface.curvature.mean_curvature`.
    """
    curvature = np.abs(mean_curvature(mesh, method, smoothing=smoothing))[mesh.faces].max(axis=1)
    if kappa is not None:
        return curvature > kappa
    corner = mesh.vertices[mesh.faces]
    return curvature * np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).mean(axis=1) > angle


def adaptive_loop(mesh: TriangleMesh, rule=None, levels: int = 2, creases=None, interpolate: bool = True, **options) -> Subdivided:
    """Split the faces that a rule marks, level by level.

    Parameters
    ----------
    mesh : TriangleMesh
        Manifold.
    rule : callable, optional
        From a TriangleMesh (uniform of one level, on the limit surface) to (nf,) bool; default :func:`too_coarse` with
        ``options``. Faces of a level whose parents are not marked are not asked for.
    levels : int
        Most splits of a face.
    creases : (nc, 2) array of int, optional
        Edges that stay sharp. The boundary always does, as a cubic B-spline of its own.
    interpolate : bool
        Choose controls so that the limit passes through the given vertices; otherwise Loop's rule as it is, which shrinks.

    Raises
    ------
    ParameterError
        Levels outside 0 to 5, or more triangles than :data:`LARGEST`.
    SurfaceError
        An edge of more than two faces, or creases that are no edges.
    """
    if not 0 <= levels <= 5:
        raise ParameterError(f"{levels} levels; 0 to 5 are possible")
    if len(mesh.faces) * 4**levels > LARGEST:
        raise ParameterError(
            f"{len(mesh.faces)} triangles at {levels} levels make more than {LARGEST}: fewer levels, or a coarser mesh"
        )
    if rule is None:
        rule = lambda m: too_coarse(m, **options)  # noqa: E731
    hard = _checked(mesh, creases)
    controls = interpolating_controls(mesh.vertices, mesh.faces, hard) if interpolate else mesh.vertices
    faces, marks = [mesh.faces], []
    place = limit_matrix(mesh.faces, len(mesh.vertices), hard) @ controls
    asked = np.ones(len(mesh.faces), bool)
    for _ in range(levels):
        mark = np.asarray(rule(TriangleMesh(place, faces[-1])), dtype=bool) & asked
        if not mark.any():
            break
        marks.append(mark)
        matrix, children, hard = loop_step(faces[-1], len(place), hard)
        controls = matrix @ controls
        asked = np.repeat(marks[-1], 4)
        faces.append(children)
        place = limit_matrix(children, len(controls), hard) @ controls
    red = close_red(faces, marks)
    out, level, green = _leaves(faces, red, [int(f.max()) + 1 for f in faces])
    used, inverse = np.unique(np.r_[np.arange(len(mesh.vertices)), out.ravel()], return_inverse=True)
    result = TriangleMesh(place[used], inverse[len(mesh.vertices) :].reshape(-1, 3))
    moved = float(np.linalg.norm(place[: len(mesh.vertices)] - mesh.vertices, axis=1).max())
    return Subdivided(result, level, green, tuple(int(m.sum()) for m in marks), tuple(int(r.sum()) for r in red), moved)


def uniform_loop(mesh: TriangleMesh, levels: int = 1, creases=None, interpolate: bool = True) -> TriangleMesh:
    """Every face split ``levels`` times; vertices on the limit surface."""
    return adaptive_loop(mesh, lambda m: np.ones(len(m.faces), bool), levels, creases, interpolate).mesh


def _checked(mesh: TriangleMesh, creases) -> np.ndarray | None:
    edges, of_face = face_edges(mesh.faces)
    many = np.bincount(of_face.ravel(), minlength=len(edges)) > 2
    if many.any():
        raise SurfaceError(
            f"{many.sum()} edges have more than two triangles: repair the mesh first", [tuple(e) for e in edges[many].tolist()]
        )
    if creases is None or not len(creases):
        return None
    low = np.sort(np.asarray(creases, dtype=np.int64).reshape(-1, 2), axis=1)
    known = {tuple(e) for e in edges.tolist()}
    lost = [e for e in low.tolist() if tuple(e) not in known]
    if lost:
        raise SurfaceError(f"crease {lost[0]} is no edge of the mesh", lost)
    return low


def close_red(faces: list[np.ndarray], marks: list[np.ndarray]) -> list[np.ndarray]:
    """Grow the marked faces until what remains has at most one split edge and neighbours differ by one level at most."""
    red = [m.copy() for m in marks]
    for k in range(len(red) - 1, -1, -1):
        edges, of_face = face_edges(faces[k])
        while True:
            split = np.zeros(len(edges), bool)
            split[of_face[red[k]]] = True
            more = (split[of_face].sum(axis=1) >= 2) & ~red[k]
            if not more.any():
                break
            red[k] |= more
        if k:
            near = split[of_face].any(axis=1)  # the red faces and all that share an edge with them exist at this level
            red[k - 1] |= near.reshape(-1, 4).any(axis=1)
    return red


def _leaves(faces: list[np.ndarray], red: list[np.ndarray], counts: list[int]):
    out, level, green = [], [], []
    there = np.ones(len(faces[0]), bool)
    for k, f in enumerate(faces):
        leaf = there & ~red[k] if k < len(red) else there
        if k < len(red):
            edges, of_face = face_edges(f)
            split = np.zeros(len(edges), bool)
            split[of_face[red[k]]] = True
            count = (split[of_face] & leaf[:, None]).sum(axis=1)
            whole = leaf & (count == 0)
            for i in range(3):
                half = leaf & (count == 1) & split[of_face[:, i]]
                a, b, c, m = f[half, i], f[half, (i + 1) % 3], f[half, (i + 2) % 3], counts[k] + of_face[half, i]
                for triangle in ((a, m, c), (m, b, c)):
                    out.append(np.stack(triangle, axis=1))
                    level.append(np.full(len(a), k))
                    green.append(np.ones(len(a), bool))
            there = np.repeat(red[k], 4)
        else:
            whole = leaf
        out.append(f[whole])
        level.append(np.full(whole.sum(), k))
        green.append(np.zeros(whole.sum(), bool))
    return np.vstack(out), np.concatenate(level), np.concatenate(green)
