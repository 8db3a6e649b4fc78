"""Quality of the triangles of a mesh, as numbers, rows of a table, and a picture (the paper's Figure 2)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from reconstruction.surface.connectivity import boundary_loops
from reconstruction.surface.triangles import TriangleMesh

BINS = np.arange(0.0, 61.0, 5.0)
"""Of the histogram of smallest angles, degrees."""
FLAT = 1e-6
"""A triangle with a height below this part of its longest edge is degenerate (as in `mfar_fem.surface.quality`)."""


def smallest_angles(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(nf,) smallest angle of every triangle, rad; 0 where it is degenerate."""
    corner = vertices[faces]
    out = np.full(len(faces), np.pi)
    for i in range(3):
        a, b = corner[:, (i + 1) % 3] - corner[:, i], corner[:, (i + 2) % 3] - corner[:, i]
        np.minimum(out, np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b)), out=out)
    sides = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2)
    return np.where(sides.min(axis=1) > 0, out, 0.0)


def aspect_ratios(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(nf,) longest edge over twice the radius of the inscribed circle, divided by √3 so that an equilateral triangle has 1."""
    corner = vertices[faces]
    sides = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2)
    double = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(double > 0, sides.max(axis=1) * sides.sum(axis=1) / (2 * np.sqrt(3) * double), np.inf)


@dataclass(frozen=True)
class Quality:
    """Quality of one mesh.

    Attributes
    ----------
    stage : str
    vertices, faces : int
    least_angle, angle_1, median_angle : float
        Smallest, 1st percentile and median of the triangles' smallest angles, degrees.
    below_20 : float
        Share of triangles with an angle below 20°.
    aspect_95, largest_aspect : float
        Of :func:`aspect_ratios`; None where a triangle has no area.
    degenerate : int
        Triangles without height, see :data:`FLAT`.
    loops : int
        Boundary loops.
    mean_edge : float
        m.
    histogram : tuple of int
        Triangles by smallest angle in bins of 5°.
    """

    stage: str
    vertices: int
    faces: int
    least_angle: float
    angle_1: float
    median_angle: float
    below_20: float
    aspect_95: float | None
    largest_aspect: float | None
    degenerate: int
    loops: int
    mean_edge: float
    histogram: tuple[int, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def quality(mesh: TriangleMesh, stage: str = "") -> Quality:
    """Quality of a mesh of at least one triangle."""
    angle = np.degrees(smallest_angles(mesh.vertices, mesh.faces))
    aspect = aspect_ratios(mesh.vertices, mesh.faces)
    corner = mesh.vertices[mesh.faces]
    longest2 = ((corner - np.roll(corner, 1, axis=1)) ** 2).sum(axis=2).max(axis=1)
    edges = mesh.vertices[mesh.edges[:, 0]] - mesh.vertices[mesh.edges[:, 1]]
    finite = [float(v) if np.isfinite(v) else None for v in (np.percentile(aspect, 95, method="higher"), aspect.max())]
    return Quality(
        stage, len(mesh.vertices), len(mesh.faces), float(angle.min()), float(np.percentile(angle, 1)), float(np.median(angle)),
        float((angle < 20).mean()), finite[0], finite[1], int((~(2 * mesh.areas > FLAT * longest2)).sum()),
        len(boundary_loops(mesh.faces)), float(np.linalg.norm(edges, axis=1).mean()),
        tuple(int(v) for v in np.histogram(np.clip(angle, 0, 59.999), BINS)[0]),
    )  # fmt: skip


def quality_table(meshes: Mapping[str, TriangleMesh]) -> tuple[Quality, ...]:
    """One row a stage."""
    return tuple(quality(mesh, stage) for stage, mesh in meshes.items())


def quality_picture(path: str | Path, meshes: Sequence[tuple[str, TriangleMesh]], focus=None, reach: float | None = None) -> Path:
    """Meshes coloured by smallest angle, the same place of each enlarged, and their histograms.

    Parameters
    ----------
    path : str or Path
        PNG.
    meshes : sequence of (str, TriangleMesh)
        One column each.
    focus : (3,) array, optional
        Centre of the enlarged place, m; default: a point of the longest boundary of the last mesh.
    reach : float, optional
        Half its width, m; default 8 % of the largest extent.
    """
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    last = meshes[-1][1]
    loops = boundary_loops(last.faces)
    view = np.array([0.35, -0.85, 0.4]) / np.linalg.norm([0.35, -0.85, 0.4])
    if focus is None:
        candidates = last.vertices[loops[0]] if loops else last.vertices
        focus = candidates[np.argmax(candidates @ view)]
    reach = 0.08 * float(np.ptp(last.vertices, axis=0).max()) if reach is None else reach
    figure = Figure(figsize=(4.4 * len(meshes), 11), dpi=110)
    figure.subplots_adjust(left=0.06, right=0.94, bottom=0.05, top=0.95, hspace=0.12, wspace=0.15)
    colours = colormaps["RdYlGn"]
    for column, (name, mesh) in enumerate(meshes):
        row = quality(mesh)
        for line in range(2):
            axes = figure.add_subplot(3, len(meshes), line * len(meshes) + column + 1)
            _draw(axes, mesh, view, colours, None if line == 0 else (np.asarray(focus), reach))
            if line == 0:
                axes.set_title(f"{name}: {row.faces} triangles, smallest angle {row.least_angle:.1f}°", fontsize=9)
        axes = figure.add_subplot(3, len(meshes), 2 * len(meshes) + column + 1)
        axes.bar(BINS[:-1] + 2.5, 100 * np.array(row.histogram) / row.faces, 4.6, color=colours((BINS[:-1] + 2.5) / 60))
        axes.set_xlabel("smallest angle, degrees")
        axes.set_ylabel("triangles, %" if column == 0 else "")
    figure.savefig(path)
    return Path(path)


def save_before_after(path: str | Path, before: TriangleMesh, after: TriangleMesh) -> Path:
    """Two meshes side by side, as in the paper's Figure 2; see :func:`quality_picture`."""
    return quality_picture(path, [("before", before), ("after", after)])


def _draw(axes, mesh: TriangleMesh, view: np.ndarray, colours, window) -> None:
    from matplotlib.collections import PolyCollection

    right = np.cross([0.0, 0.0, 1.0], view)
    right /= np.linalg.norm(right)
    up = np.cross(view, right)
    flat = np.stack([mesh.vertices @ right, mesh.vertices @ up], axis=1)
    chosen = np.arange(len(mesh.faces))
    if window is not None:
        middle = mesh.vertices[mesh.faces].mean(axis=1) - window[0]
        chosen = chosen[(np.abs(middle @ right) < 1.3 * window[1]) & (np.abs(middle @ up) < 1.3 * window[1])]
    chosen = chosen[np.argsort((mesh.vertices[mesh.faces[chosen]] @ view).mean(axis=1))]
    shade = 0.65 + 0.35 * np.abs(mesh.face_normals[chosen] @ view)[:, None]
    rgb = colours(np.degrees(smallest_angles(mesh.vertices, mesh.faces[chosen])) / 60)[:, :3] * shade
    axes.add_collection(
        PolyCollection(
            list(flat[mesh.faces[chosen]]), facecolors=rgb, edgecolors="0.15", linewidths=0.08 if window is None else 0.4
        )
    )
    axes.set_aspect("equal")
    if window is None:
        axes.autoscale_view()
    else:
        centre = np.array([window[0] @ right, window[0] @ up])
        axes.set_xlim(centre[0] - window[1], centre[0] + window[1])
        axes.set_ylim(centre[1] - window[1], centre[1] + window[1])
    axes.set_xticks([])
    axes.set_yticks([])
