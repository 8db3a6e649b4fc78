"""Pictures of a restoration that a person can judge by."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from reconstruction.report.strokes import warp_strokes
from reconstruction.shape.evidence import STRIDE, Caster, draw
from reconstruction.shape.fit import Shape
from reconstruction.shape.points import SOURCES
from reconstruction.shape.warp import WarpField
from reconstruction.stereo.view import View
from reconstruction.surface.triangles import TriangleMesh

COLOURS = {"stereo": "#0072b2", "outline": "#009e73", "landmark": "#e69f00", "template": "#b8b8b8"}
"""By what supports a point (Okabe and Ito's palette, told apart by the colour-blind)."""
_MARGIN = 12


def _figure(columns: int, height: float, rows: int = 1):
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    fig = Figure(figsize=(3.0 * columns, height), layout="constrained")
    FigureCanvasAgg(fig)
    return fig, np.ravel(fig.subplots(rows, columns))


def outlines_picture(path: Path, views: Sequence[View], shape: Shape) -> None:
    """The fitted shape's outline on every calibrated picture, beside the mask's."""
    mesh = shape.sewn.mesh(shape.vertices)
    local = shape.body.mesh()
    figure = TriangleMesh(shape.frame.to_world(local.vertices), local.faces)
    wide = min(3, len(views))
    high = -(-len(views) // wide)
    garment, body = Caster(mesh), Caster(figure)
    fig, axes = _figure(wide, 3.4 * high, high)
    for ax in axes[len(views) :]:
        ax.set_axis_off()
    axes = axes[: len(views)]
    for ax, view in zip(axes, views, strict=True):
        drawn = draw(view, garment, body.cast(view)[1])
        ax.imshow(view.image)
        h, w = drawn.outer.shape
        x, y = STRIDE * np.arange(w), STRIDE * np.arange(h)
        ax.contour(
            np.arange(view.size[1]), np.arange(view.size[0]), view.mask.astype(float), [0.5], colors="#e69f00", linewidths=1.0
        )
        if drawn.outer.any():
            ax.contour(x, y, drawn.outer.astype(float), [0.5], colors="#0072b2", linewidths=1.0)
        rows, columns = np.nonzero(view.mask)
        if len(rows):
            ax.set_xlim(columns.min() - _MARGIN, columns.max() + _MARGIN)
            ax.set_ylim(rows.max() + _MARGIN, rows.min() - _MARGIN)
        ax.set_title(Path(view.name).stem, fontsize=8)
        ax.set_axis_off()
    fig.suptitle("orange: mask, blue: fitted shape", fontsize=9)
    fig.savefig(path, dpi=110)


def support_picture(path: Path, mesh: TriangleMesh, source) -> None:
    """Front and back, each triangle in the colour of what supports it least."""
    from matplotlib.lines import Line2D

    code = np.array([SOURCES.index(name) for name in source])[mesh.faces].max(axis=1)
    fig, axes = _figure(2, 3.4)
    for ax, turn, name in zip(axes, (1.0, -1.0), ("front", "back"), strict=True):
        _paint(ax, mesh, np.array([_rgb(COLOURS[s]) for s in SOURCES])[code], turn)
        ax.set_title(name, fontsize=9)
    marks = [Line2D([], [], marker="s", ls="", color=COLOURS[s], label=s) for s in SOURCES]
    fig.legend(handles=marks, loc="outside lower center", ncols=len(marks), fontsize=8, frameon=False)
    fig.savefig(path, dpi=110)


def warp_picture(path: Path, mesh: TriangleMesh, warp: WarpField) -> None:
    """Front and back with strokes along the warp; singular vertices as dots."""
    from matplotlib.collections import LineCollection

    fig, axes = _figure(2, 3.4)
    strokes = warp_strokes(mesh, warp.directions, 2500)
    face = cKDTree(mesh.vertices[mesh.faces].mean(axis=1)).query(strokes.mean(axis=1))[1]
    outwards = mesh.face_normals[face, 1]
    for ax, turn, name in zip(axes, (1.0, -1.0), ("front", "back"), strict=True):
        _paint(ax, mesh, np.tile(_rgb("#d8b98c"), (len(mesh.faces), 1)), turn)
        near = strokes[turn * outwards < 0]
        lines = near[:, :, [0, 2]] * (turn, 1.0)
        ax.add_collection(LineCollection(list(lines), colors="#333333", linewidths=0.4))
        for vertex in warp.singular:
            p = mesh.vertices[vertex]
            if turn * mesh.vertex_normals[vertex, 1] < 0:
                ax.plot(turn * p[0], p[2], "o", ms=4, mfc="none", mec="#d55e00")
        ax.set_title(name, fontsize=9)
    fig.suptitle(f"warp; {len(warp.singular)} singular vertices", fontsize=9)
    fig.savefig(path, dpi=110)


def _paint(ax, mesh: TriangleMesh, colours: np.ndarray, turn: float) -> None:
    """Shaded triangles, the furthest first; `turn` -1 looks from behind."""
    from matplotlib.collections import PolyCollection

    corners, normal = mesh.vertices[mesh.faces] * (turn, turn, 1.0), mesh.face_normals * (turn, turn, 1.0)
    order = np.argsort(-corners[:, :, 1].mean(axis=1))
    light = 0.45 + 0.55 * np.abs(normal @ np.array([-0.35, -0.8, 0.45]) / 0.98)
    shade = np.clip(colours * light[:, None], 0, 1)[order]
    ax.add_collection(PolyCollection(list(corners[order][:, :, [0, 2]]), facecolors=shade, edgecolors=shade, linewidths=0.2))
    ax.set_aspect("equal")
    ax.autoscale_view()
    ax.set_axis_off()


def _rgb(colour: str) -> np.ndarray:
    from matplotlib.colors import to_rgb

    return np.array(to_rgb(colour))
