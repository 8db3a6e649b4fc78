"""What the meshes of a study are worth besides their distances: folds, features, keypoints."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.cli.console import jsonable
from mfar_fem.errors import InputError
from reconstruction.keypoints_file import read_keypoints
from reconstruction.landmarks import LANDMARKS
from reconstruction.metrics import features
from reconstruction.metrics.distance import distances
from reconstruction.metrics.folds import agreement, height_map, null_values, spectrum_similarity
from reconstruction.restore.study import case_name
from reconstruction.surface.triangles import TriangleMesh

NORMAL_SIZE = 256.0
"""Height of the pictures that errors of keypoints are given for, px."""


def true_mesh(case: Path) -> TriangleMesh:
    """The true surface of a case."""
    with np.load(case / "truth" / "geometry.npz") as stored:
        return TriangleMesh(stored["vertices"], stored["faces"])


def score(meshes: Mapping[str, TriangleMesh], truth: TriangleMesh, others: Sequence[TriangleMesh]) -> dict[str, Any]:
    """Scores of the meshes of one case.

    Parameters
    ----------
    meshes : mapping of str to TriangleMesh
        By method.
    truth : TriangleMesh
    others : sequence of TriangleMesh
        True garments of the same type, for the null values; they are moved so that their tops meet.

    Returns
    -------
    dict
        ``methods``: by method distances, ``spectrum`` and ``agreement`` of the folds (None where the surfaces hardly overlap) and
        ``features``; ``truth``: its features; ``null``: similarities that mean nothing, by null.
    """
    low, high = truth.vertices.min(axis=0) - 0.05, truth.vertices.max(axis=0) + 0.05
    mapped = height_map(truth, low, high)
    known = features.extract(truth)
    rows = {}
    for name, mesh in meshes.items():
        heights = height_map(mesh, low, high)
        try:
            alike: dict[str, Any] = {"spectrum": spectrum_similarity(heights, mapped), "agreement": agreement(heights, mapped)}
        except InputError:
            alike = {"spectrum": None, "agreement": None}
        rows[name] = distances(mesh, truth) | alike | {"features": features.agreement(features.extract(mesh), known)}
    unrelated = [height_map(_top_to_top(o, truth), low, high) for o in others]
    return {"methods": rows, "truth": known, "null": null_values(mapped, unrelated, np.random.default_rng(0))}


def _top_to_top(mesh: TriangleMesh, truth: TriangleMesh) -> TriangleMesh:
    def place(m):
        a, b = m.vertices.min(axis=0), m.vertices.max(axis=0)
        return np.array([0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), b[2]])

    return TriangleMesh(mesh.vertices + place(truth) - place(mesh), mesh.faces)


def keypoint_errors(case: Path, detected: Path) -> list[tuple[str, float]]:
    """Landmark and error of every point in sight of the pictures of a case, px of pictures 256 px high."""
    truth, found = read_keypoints(case / "truth" / "keypoints.json").images, read_keypoints(detected).images
    out = []
    for t, f in zip(truth, found, strict=True):
        assert f.size is not None
        away = np.linalg.norm(t.points - f.points, axis=1) * NORMAL_SIZE / f.size[1]
        out += [(name, float(e)) for name, e in zip(LANDMARKS, away, strict=True) if np.isfinite(e)]
    return out


def scores(out: Path, cases: Sequence[tuple[str, int]], edge: float, around: int = 0) -> list[dict[str, Any]]:
    """Scores of every case of a study (garment, seed), kept beside its rows; computed again when a mesh is newer, or when there are
    other unrelated garments."""
    truths = {case: true_mesh(out / "cases" / case_name(*case, around)) for case in cases}
    found = []
    for garment, seed in cases:
        case = case_name(garment, seed, around)
        name = f"{case}-{1e3 * edge:g}mm"
        unrelated = sorted(s for kind, s in cases if kind == garment and s != seed)
        files = sorted((out / "meshes" / name).glob("*.ply"))
        kept = out / "scores" / f"{name}.json"
        known = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {}
        if known.get("unrelated") != unrelated or any(f.stat().st_mtime > kept.stat().st_mtime for f in files):
            others = [truths[garment, s] for s in unrelated]
            meshes = {f.stem: TriangleMesh.read(f) for f in files}
            made = score(meshes, truths[garment, seed], others)
            made["unrelated"] = unrelated
            made["keypoints"] = keypoint_errors(out / "cases" / case, out / "keypoints" / case / "keypoints.json")
            kept.parent.mkdir(parents=True, exist_ok=True)
            known = jsonable(made)
            kept.write_text(json.dumps(known), encoding="utf-8")
        found.append({"garment": garment, "seed": seed} | known)
    return found
