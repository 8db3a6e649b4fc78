"""Triangles on a flat panel: points on its edges and folds, a hexagonal grid inside, Delaunay."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay, cKDTree

from mfar_fem.errors import SurfaceError

from .panels import Panel


@dataclass(frozen=True)
class PanelMesh:
    """A meshed panel.

    Parameters
    ----------
    uv : (n, 2) array
        Panel coordinates of the vertices, m.
    faces : (m, 3) array of int
        Counter-clockwise in (u, v).
    edges : dict of str to int array
        Vertices along every named edge, in its direction.
    """

    uv: np.ndarray
    faces: np.ndarray
    edges: dict[str, np.ndarray]


def inside(polygon, points) -> np.ndarray:
    """Even-odd test.

    Parameters
    ----------
    polygon : (k, 2) array
    points : (n, 2) array

    Returns
    -------
    (n,) bool array
    """
    polygon, points = np.asarray(polygon), np.asarray(points)
    ax, ay = polygon.T
    bx, by = np.roll(polygon, -1, axis=0).T
    x, y = points[:, :1], points[:, 1:]
    crosses = (ay > y) != (by > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = ax + (y - ay) / (by - ay) * (bx - ax)
    return (crosses & (x < at)).sum(axis=1) % 2 == 1


def mesh_panel(panel: Panel, size: float, pieces: dict[str, int]) -> PanelMesh:
    """Triangulate a panel.

    Parameters
    ----------
    panel : Panel
    size : float
        Edge length aimed at, m.
    pieces : dict of str to int
        Number of mesh edges along each named edge (equal on both sides of a seam).

    Raises
    ------
    SurfaceError
        The panel is too narrow for the mesh size: an outline edge is missing, or area is lost.
    """
    line, named, start = [], {}, 0
    total = sum(pieces[e.name] for e in panel.edges)
    for edge in panel.edges:
        n = pieces[edge.name]
        line.append(edge.sample(n)[:-1])
        named[edge.name] = (start + np.arange(n + 1)) % total
        start += n
    outline = np.concatenate(line)
    fixed = [outline]
    for fold in panel.folds:
        length = float(np.linalg.norm(fold[1] - fold[0]))
        n = max(2, round(length / size))
        fixed.append(fold[0] + np.linspace(0, 1, n + 1)[1:-1, None] * (fold[1] - fold[0]))
    held = np.concatenate(fixed)
    low, high = outline.min(axis=0), outline.max(axis=0)
    rows = np.arange(low[1], high[1], size * np.sqrt(0.75))
    grid = np.concatenate(
        [
            np.stack(
                [
                    np.arange(low[0] + (i % 2) * size / 2, high[0], size),
                    np.full(len(np.arange(low[0] + (i % 2) * size / 2, high[0], size)), v),
                ],
                axis=1,
            )
            for i, v in enumerate(rows)
        ]
    )
    grid = grid[inside(outline, grid)]
    grid = grid[cKDTree(held).query(grid)[0] > 0.62 * size] if len(grid) else grid
    uv = np.concatenate([held, grid])
    faces = Delaunay(uv).simplices.astype(np.int64)
    a, b, c = (uv[faces[:, k]] for k in range(3))
    area = 0.5 * ((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))
    faces[area < 0] = faces[area < 0][:, ::-1]
    keep = (np.abs(area) > 1e-4 * size**2) & inside(outline, (a + b + c) / 3)
    faces = faces[keep]
    _check(panel, uv, faces, len(outline), float(np.abs(area[keep]).sum()), outline)
    return PanelMesh(uv, faces, named)


def _check(panel: Panel, uv, faces, outline_points: int, area: float, outline) -> None:
    sides = {tuple(sorted(e)) for e in np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).tolist()}
    missing = [i for i in range(outline_points) if tuple(sorted((i, (i + 1) % outline_points))) not in sides]
    x, y = outline.T
    wanted = 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
    if missing or abs(area - wanted) > 1e-6 * wanted or len(np.unique(faces)) != len(uv):
        raise SurfaceError(
            f"panel '{panel.name}': the mesh does not fill its outline ({len(missing)} outline edges missing, area "
            f"{area:.5f} of {wanted:.5f} m²); use a smaller mesh size",
            missing,
        )
