"""Flat panels of any outline, straight or curved, meshed by gmsh with a size field.

gmsh is imported only here, and only when a panel is meshed: its wheel needs system libraries a bare machine lacks.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from mfar_fem.errors import MissingDependencyError, SurfaceError
from mfar_fem.surface.patterns import Pattern, plane

SYSTEM_PACKAGES = "libgl1 libglu1-mesa libxcursor1 libxft2 libxinerama1 libgomp1"
"""Debian/Ubuntu packages that provide every library gmsh's wheel links to (the others come as their dependencies)."""


def polygon(corners: Sequence) -> dict[str, np.ndarray]:
    """Straight sides ``side0``, ``side1``, ... between successive corners (k, 2), the last back to the first."""
    points = np.asarray(corners, dtype=float)
    return {f"side{i}": np.array([points[i], points[(i + 1) % len(points)]]) for i in range(len(points))}


def panel(
    outline: Mapping[str, Sequence],
    size: float | Callable[[float, float], float],
    holes: Sequence[Mapping[str, Sequence]] = (),
) -> Pattern:
    """Mesh a flat panel.

    Parameters
    ----------
    outline : mapping of str to (k, 2) points
        Sides in order round the panel, m: each starts where the one before ended, the last ends where the first
        started. Two points are a straight side, more a spline through all of them. `polygon` makes it from corners.
    size : float or callable
        Edge length wanted, m, or ``size(x, y)``.
    holes : sequence of outlines
        Cut out of the panel, sides named like those of the outline, all names different.

    Returns
    -------
    Pattern
        Vertices (n, 3) with z = 0, triangles counter-clockwise seen from +z, ``boundary`` with the vertices of every
        named side in order, (u, v) = (x, y). Curved sides are followed by straight edges: the mapping is the identity.

    Raises
    ------
    SurfaceError
        Sides that do not join, a repeated name, an outline without area or crossing itself, or a size that is not
        positive.
    MissingDependencyError
        gmsh or a system library it needs is not installed.
    """
    loops = [_checked(outline, "outline"), *(_checked(hole, f"hole {i}") for i, hole in enumerate(holes))]
    names = [name for loop in loops for name in loop]
    if len(set(names)) < len(names):
        raise SurfaceError(f"every side of a panel needs a name of its own, got {', '.join(names)}")
    if not callable(size) and not (np.isfinite(size) and size > 0):
        raise SurfaceError(f"the edge length of a panel must be positive, not {size}")
    _check_crossings(loops)
    gmsh = _gmsh()
    with _session(gmsh):
        try:
            sides = _build(gmsh, loops, size)
            gmsh.model.mesh.generate(2)
        except Exception as error:
            raise SurfaceError(f"gmsh cannot mesh this panel: {error}") from error
        return _extract(gmsh, sides)


def _gmsh():
    try:
        import gmsh
    except (ImportError, OSError) as error:
        raise MissingDependencyError(
            f"meshing a panel needs gmsh and its system libraries ({error}): `pip install gmsh`, and on Debian "
            f"or Ubuntu `apt-get install {SYSTEM_PACKAGES}`; strips, discs and annuli do without"
        ) from error
    return gmsh


@contextlib.contextmanager
def _session(gmsh) -> Iterator[None]:
    """A silent, single-threaded, repeatable gmsh model of our own, removed afterwards."""
    ours = not gmsh.isInitialized()
    if ours:
        gmsh.initialize(interruptible=False)
    try:
        for option, value in (("General.Terminal", 0), ("General.NumThreads", 1), ("Mesh.RandomSeed", 1)):
            gmsh.option.setNumber(option, value)
        gmsh.model.add("mfar panel")
        yield
    finally:
        gmsh.model.remove()
        if ours:
            gmsh.finalize()


def _checked(outline: Mapping[str, Sequence], where: str) -> dict[str, np.ndarray]:
    sides = {name: np.asarray(points, dtype=float) for name, points in outline.items()}
    for name, points in sides.items():
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2 or not np.isfinite(points).all():
            raise SurfaceError(f"{where}, side '{name}': two or more finite points (k, 2), not shape {points.shape}")
    if not sides:
        raise SurfaceError(f"{where}: no sides")
    every = np.vstack(list(sides.values()))
    extent = np.ptp(every, axis=0).max()
    ordered = list(sides.items())
    for (name, points), (following, others) in zip(ordered, ordered[1:] + ordered[:1], strict=True):
        gap = float(np.linalg.norm(points[-1] - others[0]))
        if gap > 1e-6 * extent:
            raise SurfaceError(f"{where}: side '{following}' starts {gap:g} m away from the end of side '{name}'")
    ring = np.vstack([points[:-1] for points in sides.values()])
    ahead = np.roll(ring, -1, axis=0)
    area = 0.5 * float(np.sum(ring[:, 0] * ahead[:, 1] - ring[:, 1] * ahead[:, 0]))
    if abs(area) < 1e-9 * extent**2:
        raise SurfaceError(f"{where}: encloses no area")
    return {name: _smooth(points) for name, points in sides.items()}


def _smooth(points: np.ndarray, finer: int = 8) -> np.ndarray:
    """Cubic spline through the points by chord length, sampled; gmsh's own spline bends badly at its ends."""
    if len(points) == 2:
        return points
    from scipy.interpolate import CubicSpline

    s = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
    if not (np.diff(s) > 0).all():
        raise SurfaceError(f"a side has the same point twice in a row: {points[np.flatnonzero(np.diff(s) <= 0)[0]]}")
    fine = np.interp(np.arange(finer * (len(s) - 1) + 1) / finer, np.arange(len(s)), s)
    curve = CubicSpline(s, points)(fine)
    curve[[0, -1]] = points[[0, -1]]
    return curve


def _check_crossings(loops) -> None:
    """Outlines must not cross themselves or each other (gmsh would not come back from some of them)."""
    parts, owners = [], []
    for loop in loops:
        for name, points in loop.items():
            parts.append(np.stack([points[:-1], points[1:]], axis=1))
            owners += [name] * (len(points) - 1)
    segments = np.concatenate(parts)
    first, second = np.triu_indices(len(segments), 1)
    (a, b), (c, d) = (segments[ids].transpose(1, 0, 2) for ids in (first, second))

    def side(p, q, r):
        return (q[:, 0] - p[:, 0]) * (r[:, 1] - p[:, 1]) - (q[:, 1] - p[:, 1]) * (r[:, 0] - p[:, 0])

    tiny = 1e-9 * np.ptp(segments.reshape(-1, 2), axis=0).max() ** 2

    def across(s, t):
        return ((s > tiny) & (t < -tiny)) | ((s < -tiny) & (t > tiny))

    hit = np.flatnonzero(across(side(a, b, c), side(a, b, d)) & across(side(c, d, a), side(c, d, b)))
    if len(hit):
        one, other = owners[first[hit[0]]], owners[second[hit[0]]]
        raise SurfaceError(f"the outline of the panel crosses itself: side '{one}' and side '{other}'")


def _build(gmsh, loops, size):
    """Points, curves and the surface; returns the curve tag of every named side."""
    geo, tags, curves = gmsh.model.geo, {}, []
    for loop in loops:
        joints = [geo.addPoint(*points[0], 0.0) for points in loop.values()]
        lines = []
        for i, (name, points) in enumerate(loop.items()):
            inner = [geo.addPoint(*point, 0.0) for point in points[1:-1]]
            ids = [joints[i], *inner, joints[(i + 1) % len(joints)]]
            tags[name] = geo.addSpline(ids) if inner else geo.addLine(*ids)
            lines.append(tags[name])
        curves.append(geo.addCurveLoop(lines))
    geo.addPlaneSurface(curves)
    geo.synchronize()
    for option in ("MeshSizeFromPoints", "MeshSizeFromCurvature", "MeshSizeExtendFromBoundary"):
        gmsh.option.setNumber(f"Mesh.{option}", 0)
    if callable(size):
        gmsh.model.mesh.setSizeCallback(lambda dim, tag, x, y, z, lc: float(size(x, y)))
    else:
        gmsh.option.setNumber("Mesh.MeshSizeMin", size)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    return tags


def _extract(gmsh, sides) -> Pattern:
    node_tags, coordinates, _ = gmsh.model.mesh.getNodes()
    triangle_nodes = gmsh.model.mesh.getElementsByType(2)[1]
    used = np.unique(triangle_nodes)
    number = np.full(int(max(node_tags)) + 1, -1, dtype=np.int64)
    number[used.astype(np.int64)] = np.arange(len(used))
    vertices = np.zeros((len(used), 3))
    position = number[node_tags.astype(np.int64)]
    vertices[position[position >= 0]] = coordinates.reshape(-1, 3)[position >= 0]
    triangles = number[triangle_nodes.astype(np.int64).reshape(-1, 3)]
    a, b, c = (vertices[triangles[:, i], :2] for i in range(3))
    clockwise = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] < 0
    triangles[clockwise] = triangles[clockwise][:, ::-1]
    boundary = {}
    for name, tag in sides.items():
        tags, _, parameters = gmsh.model.mesh.getNodes(1, tag, includeBoundary=True)
        boundary[name] = number[tags.astype(np.int64)[np.argsort(parameters, kind="stable")]]
    vertices[:, 2] = 0.0
    return Pattern(vertices, triangles, boundary, vertices[:, :2].copy(), plane)
