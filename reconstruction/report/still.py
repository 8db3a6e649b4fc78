"""A still picture of a model from the front and the back: for browsers without WebGL, and for print."""

from __future__ import annotations

import io

import numpy as np

from reconstruction.report.simplify import simplified
from reconstruction.surface.triangles import TriangleMesh

FACES = 12_000
"""Of the model at most, and of what is behind it."""
CLOTH, INSIDE, BODY = (0.847, 0.725, 0.549), (0.62, 0.71, 0.78), (0.79, 0.80, 0.82)
LIGHT = np.array([-0.35, 0.45, 0.85]) / np.linalg.norm([-0.35, 0.45, 0.85])


def still(mesh: TriangleMesh, backdrop: TriangleMesh | None = None, dpi: int = 90) -> bytes:
    """Paint the triangles from the furthest to the nearest, in parallel projection.

    Parameters
    ----------
    mesh : TriangleMesh
        z up, front towards -y.
    backdrop : TriangleMesh, optional
    dpi : int

    Returns
    -------
    bytes
        PNG.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure

    parts = [(simplified(mesh, FACES)[0], CLOTH, INSIDE)]
    if backdrop is not None:
        parts.append((simplified(backdrop, FACES)[0], BODY, BODY))
    fig = Figure(figsize=(8, 5), layout="constrained")
    FigureCanvasAgg(fig)
    for ax, turn, name in zip(fig.subplots(1, 2), (1.0, -1.0), ("front", "back"), strict=True):
        polygons, colours, depths = [], [], []
        for part, outside, inside in parts:
            view = part.vertices * (turn, turn, 1)  # half a turn about z for the back
            corners, normal = view[part.faces], part.face_normals * (turn, turn, 1)
            facing = normal[:, 1] < 0
            n = np.where(facing[:, None], normal, -normal)
            # right, up, towards the viewer
            light = 0.38 + 0.62 * np.maximum(0, n[:, [0, 2, 1]] * (1, 1, -1) @ LIGHT)
            colours.append(np.where(facing[:, None], outside, inside) * light[:, None])
            polygons.append(corners[:, :, [0, 2]])
            depths.append(corners[:, :, 1].mean(axis=1))
        order = np.argsort(-np.concatenate(depths), kind="stable")
        faces = np.concatenate(polygons)[order]
        shade = np.concatenate(colours)[order]
        ax.add_collection(PolyCollection(list(faces), facecolors=shade, edgecolors=shade, linewidths=0.3))
        ax.set_aspect("equal")
        ax.autoscale_view()
        ax.set_axis_off()
        ax.set_title(name, fontsize=9, color="#515c66")
    out = io.BytesIO()
    fig.savefig(out, format="png", dpi=dpi, metadata={"Software": None})
    return out.getvalue()
