"""What the meshes of a study are worth besides their distances: folds, features, keypoints."""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.cli.console import jsonable
from mfar_fem.errors import InputError
from mfar_fem.files import replace_bytes
from reconstruction.keypoints.data import Sample
from reconstruction.keypoints.evaluate import torso
from reconstruction.keypoints_file import read_keypoints
from reconstruction.landmarks import LANDMARKS
from reconstruction.metrics import features
from reconstruction.metrics.distance import distances
from reconstruction.metrics.folds import agreement, height_map, null_values, spectrum_similarity
from reconstruction.restore.study import case_name
from reconstruction.surface.triangles import TriangleMesh

log = logging.getLogger(__name__)
VERSION = 2
"""Of the scores: others are computed again."""
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


def keypoint_errors(case: Path, detected: Path) -> list[tuple[str, float, float]]:
    """Every point in sight of the pictures of a case: landmark, error in px of pictures 256 px high, and over the torso.

    Both errors are NaN where the detector left the point out. The torso is that of
    :func:`reconstruction.keypoints.evaluate.torso` from the points in sight.
    """
    truth, found = read_keypoints(case / "truth" / "keypoints.json").images, read_keypoints(detected).images
    out = []
    for t, f in zip(truth, found, strict=True):
        assert f.size is not None
        there = np.isfinite(t.points).all(axis=1)
        size = torso(Sample(t.path, t.points, there, there))
        away = np.linalg.norm(t.points - f.points, axis=1)
        out += [(name, float(e) * NORMAL_SIZE / f.size[1], float(e) / size)
                for name, e, here in zip(LANDMARKS, away, there, strict=True) if here]  # fmt: skip
    return out


def scores(out: Path, cases: Sequence[tuple[str, int]], edge: float, around: int = 0,
           rows: Sequence[Mapping[str, Any]] | None = None) -> list[dict[str, Any]]:  # fmt: skip
    """Scores of every case of a study (garment, seed), kept beside its rows; computed again when a mesh, the truth or the detected
    points are newer, or when there are other unrelated garments.

    With `rows` (of :func:`reconstruction.restore.study.study`) only their meshes count: others may be of an earlier detector.
    ``keypoints`` is empty where no method of the study needed them.
    """
    truths = {case: true_mesh(out / "cases" / case_name(*case, around)) for case in cases}
    found = []
    for garment, seed in cases:
        case = case_name(garment, seed, around)
        name = f"{case}-{1e3 * edge:g}mm"
        unrelated = sorted(s for kind, s in cases if kind == garment and s != seed)
        files = {f.stem: f for f in sorted((out / "meshes" / name).glob("*.ply"))}
        if rows is not None:
            stems = {row["method"].replace(" ", "-") for row in rows
                     if (row["garment"], row["seed"]) == (garment, seed) and not row["why"]}  # fmt: skip
            files = {stem: f for stem, f in files.items() if stem in stems}
        points = out / "keypoints" / case / "keypoints.json"
        inputs = [*files.values(), out / "cases" / case / "truth" / "geometry.npz", *([points] if points.exists() else [])]
        kept = out / "scores" / f"{name}.json"
        known = _kept(kept)
        stale = (
            (known.get("version"), known.get("unrelated")) != (VERSION, unrelated)
            or not files.keys() <= known["methods"].keys()
            or bool(known["keypoints"]) != points.exists()
            or any(f.stat().st_mtime > kept.stat().st_mtime for f in inputs)
        )
        if stale:
            made = score({k: TriangleMesh.read(f) for k, f in files.items()}, truths[garment, seed],
                         [truths[garment, s] for s in unrelated])  # fmt: skip
            made |= {"version": VERSION, "unrelated": unrelated}
            made["keypoints"] = keypoint_errors(out / "cases" / case, points) if points.exists() else []
            known = jsonable(made)
            replace_bytes(kept, json.dumps(known).encode())
        methods = {stem: value for stem, value in known["methods"].items() if stem in files}
        found.append({"garment": garment, "seed": seed} | known | {"methods": methods})
    return found


def _kept(path: Path) -> dict[str, Any]:
    """Scores that were kept; nothing if there are none or they are damaged."""
    try:
        known = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except ValueError as error:
        log.warning("%s is damaged and is computed again: %s", path, error)
        return {}
    return known if isinstance(known, dict) and {"methods", "keypoints"} <= known.keys() else {}
