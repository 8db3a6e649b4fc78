"""Models as the viewer takes them: coordinates in 16 bits, base64."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np

from mfar_fem.errors import InputError
from reconstruction.report.content import Model, Scalar
from reconstruction.report.simplify import carried, simplified
from reconstruction.surface.triangles import TriangleMesh

MAX_FACES = 120_000
"""Faces of a model in the page; larger ones are shown simplified, and that is said below them."""
MAX_LINES = 40_000
NONE = 65535
"""Stored for a value that is NaN; others take 0 to 65534."""
TOGETHER = 1.6
"""Models share one frame if all of them together are at most so many times as large as the largest."""
COLOURS = 17
"""Stops of the colour map; between them the viewer is linear."""


def quantised(points, low, size) -> np.ndarray:
    """Points (n, 3) of the box from `low` with edges `size` as (n, 3) uint16; off by at most size / 131070."""
    size = np.where(np.asarray(size) > 0, size, 1.0)
    return np.rint(np.clip((np.asarray(points) - low) / size, 0, 1) * 65535).astype("<u2")


def _text(array: np.ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")


def _scalar(s: Scalar, values: np.ndarray, name: str) -> dict[str, Any]:
    finite = values[np.isfinite(values)]
    low = float(s.low if s.low is not None else finite.min() if len(finite) else 0.0)
    high = float(s.high if s.high is not None else finite.max() if len(finite) else 1.0)
    if not (np.isfinite(low) and np.isfinite(high) and low <= high):
        raise InputError(f"the scale of '{s.label}' of the model '{name}' goes from {low} to {high}; it must rise and be finite")
    with np.errstate(invalid="ignore"):
        step = np.rint(np.clip((values - low) / (high - low if high > low else 1.0), 0, 1) * (NONE - 1))
    stored = np.where(np.isfinite(values), step, NONE).astype("<u2")
    return {
        "label": s.label, "unit": s.unit, "low": low, "high": high, "gaps": bool(len(finite) < len(values)),
        "below": bool(len(finite) and finite.min() < low), "above": bool(len(finite) and finite.max() > high),
        "values": _text(stored),
    }  # fmt: skip


def packed_mesh(mesh: TriangleMesh) -> dict[str, Any]:
    """Positions and faces of a mesh."""
    low = mesh.vertices.min(axis=0)
    size = np.ptp(mesh.vertices, axis=0)
    wide = len(mesh.vertices) > 65535
    return {
        "low": low.tolist(), "size": size.tolist(), "wide": wide, "vertices": len(mesh.vertices), "faces": len(mesh.faces),
        "positions": _text(quantised(mesh.vertices, low, size)), "triangles": _text(mesh.faces.astype("<u4" if wide else "<u2")),
    }  # fmt: skip


def packed_model(model: Model, most: int = MAX_FACES) -> dict[str, Any]:
    """A model of at most `most` faces with its scalars and lines; plain data for JSON.

    A mesh of more faces is simplified by :func:`reconstruction.report.simplify.simplified` and its note says so; of more lines
    than :data:`MAX_LINES` every k-th is kept.
    """
    mesh, to, cell = simplified(model.mesh, most)
    note = model.note
    if cell:
        note += (f"{' ' if note else ''}Shown with {len(mesh.faces)} of {len(model.mesh.faces)} triangles (vertices within cells "
                 f"of {1000 * cell:.1f} mm joined for this page).")  # fmt: skip
    out = packed_mesh(mesh) | {"name": model.name, "note": note, "all_faces": len(model.mesh.faces)}
    out["scalars"] = [
        _scalar(s, carried(s.values, to) if cell else np.asarray(s.values, dtype=float), model.name) for s in model.scalars
    ]
    out["lines"], out["lines_label"] = None, model.lines_label
    if model.lines is not None and len(model.lines):
        lines = np.asarray(model.lines, dtype=float)[:: -(-len(model.lines) // MAX_LINES)].reshape(-1, 3)
        low, size = lines.min(axis=0), np.ptp(lines, axis=0)
        out["lines"] = {"low": low.tolist(), "size": size.tolist(), "n": len(lines), "ends": _text(quantised(lines, low, size))}
    return out


def frames(meshes: Sequence[TriangleMesh], backdrop: TriangleMesh | None = None) -> list[dict[str, Any]]:
    """Centre and radius of the view of every mesh: the same for all where they lie together, so that one can flick between them;
    the backdrop is in it unless it would make them small."""
    if backdrop is not None:
        with_it = frames([*meshes, backdrop])
        if all(f == with_it[-1] for f in with_it):
            return with_it[:-1]
    boxes = [(m.vertices[np.unique(m.faces)].min(axis=0), m.vertices[np.unique(m.faces)].max(axis=0)) for m in meshes]
    own = [(0.5 * (a + b), 0.5 * float(np.linalg.norm(b - a))) for a, b in boxes]
    low, high = np.min([a for a, _ in boxes], axis=0), np.max([b for _, b in boxes], axis=0)
    radius = 0.5 * float(np.linalg.norm(high - low))
    if radius <= TOGETHER * max(r for _, r in own):
        own = [(0.5 * (low + high), radius)] * len(boxes)
    return [{"centre": c.tolist(), "radius": max(r, 1e-6)} for c, r in own]


def packed(models: Sequence[Model], backdrop: TriangleMesh | None = None, most: int = MAX_FACES) -> dict[str, Any]:
    """All that the viewer needs, plain data for JSON: ``models``, ``backdrop`` or None, ``colours`` (stops of viridis, 0 to 1)."""
    import matplotlib

    stops = matplotlib.colormaps["viridis"](np.linspace(0, 1, COLOURS))[:, :3]
    return {
        "models": [packed_model(m, most) | f for m, f in zip(models, frames([m.mesh for m in models], backdrop), strict=True)],
        "backdrop": None if backdrop is None else packed_mesh(simplified(backdrop, most)[0]),
        "colours": np.round(stops, 4).tolist(),
    }
