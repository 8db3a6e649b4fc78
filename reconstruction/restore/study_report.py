"""The report of a study: the paper's Figures 4 to 7 and Table 2 from its rows, and a form for experts."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from reconstruction.benchmark.splits import HELD_OUT
from reconstruction.landmarks import LANDMARKS
from reconstruction.metrics import features
from reconstruction.metrics.experts import write_form
from reconstruction.report.content import ReportContent, Section, Table
from reconstruction.report.estimates import Estimate
from reconstruction.report.figures import benchmark_section
from reconstruction.report.still import still
from reconstruction.report.write import write_report
from reconstruction.style.bootstrap import mean_interval
from reconstruction.surface.triangles import TriangleMesh

SHOWN = ("restored", "template only", "MVS", "Pix2Vex", "Pix2Vex from template", "true depth")
"""Methods of the figures, in their order: as many as there are colours and marks. The others are in ``summary.csv``."""
PAPER = {"restored": "MFAR"}
"""Names under which the paper's values stand beside."""


def _estimate(of: str, method: str, values: Sequence[float], groups: Sequence[int]) -> Estimate:
    found = mean_interval(np.asarray(values), np.asarray(groups))
    low, high = min(found.low, found.value), max(found.high, found.value)
    return Estimate(of, PAPER.get(method, method), found.value, low, high, len(set(groups)))


def distance_estimates(rows: Sequence[Mapping[str, Any]]) -> list[Estimate]:
    """Figure 4: mean distance both ways, mm, by garment and method."""
    out = []
    for garment in dict.fromkeys(r["garment"] for r in rows):
        for method in SHOWN:
            mine = [r for r in rows if r["garment"] == garment and r["method"] == method and not r["why"]]
            if mine:
                out.append(_estimate(garment, method, [r["mean"] for r in mine], [r["seed"] for r in mine]))
    return out


def keypoint_estimates(scored: Sequence[Mapping[str, Any]]) -> list[Estimate]:
    """Figure 5: RMSE by point, garments of types that the detector knows and of the held-out one apart; intervals over the garments
    of the mean square."""
    out = []
    for name in LANDMARKS:
        for method, held_out in (("MFAR", False), ("MFAR, held-out type", True)):
            mine = [s for s in scored if (s["garment"] == HELD_OUT) == held_out]
            squares = [(i, e**2) for i, s in enumerate(mine) for n, e in s["keypoints"] if n == name]
            if not squares:
                continue
            found = mean_interval(np.array([v for _, v in squares]), np.array([i for i, _ in squares]))
            root = [float(np.sqrt(max(v, 0.0))) for v in (found.value, found.low, found.high)]
            count = len({i for i, _ in squares})
            out.append(Estimate(name, method, root[0], min(root[0], root[1]), max(root[0], root[2]), count))
    return out


def fold_estimates(scored: Sequence[Mapping[str, Any]], key: str) -> tuple[list[Estimate], dict[str, tuple[float, float]]]:
    """Figure 6: similarity (``spectrum`` or ``agreement``) by garment and method, and the nulls' 5 to 95 % bands."""
    out = []
    for garment in dict.fromkeys(s["garment"] for s in scored):
        for method in SHOWN:
            found = [(s["seed"], m[key]) for s in scored if s["garment"] == garment
                     for n, m in s["methods"].items() if n == method.replace(" ", "-") and m[key] is not None]  # fmt: skip
            if found:
                out.append(_estimate(garment, method, [v for _, v in found], [i for i, _ in found]))
    nulls = {}
    for name in dict.fromkeys(n for s in scored for n in s["null"]):
        values = [v for s in scored for v in s["null"][name][key]]
        if values:
            low, high = np.quantile(values, [0.05, 0.95])
            nulls[name] = (float(low), float(high))
    return out, nulls


def feature_estimates(scored: Sequence[Mapping[str, Any]]) -> tuple[list[Estimate], dict[str, float]]:
    """Figure 7: share of features that agree, %, by group and method, and the chance level: other garments of the same type."""
    out = []
    for group in features.GROUPS:
        for method in SHOWN:
            found = [(i, 100 * m["features"][group][0] / m["features"][group][1]) for i, s in enumerate(scored)
                     for n, m in s["methods"].items() if n == method.replace(" ", "-") and m["features"][group][1]]  # fmt: skip
            if found:
                out.append(_estimate(group, method, [v for _, v in found], [i for i, _ in found]))
    levels = []
    for garment in dict.fromkeys(s["garment"] for s in scored):
        truths = [s["truth"] for s in scored if s["garment"] == garment]
        if len(truths) > 1:
            levels.append(features.chance(truths))
    chance = {g: 100 * float(np.mean([level[g] for level in levels if g in level])) for g in features.GROUPS
              if any(g in level for level in levels)}  # fmt: skip
    return [e for e in out if e.of in chance], chance


def write_study_report(out: Path, rows: Sequence[Mapping[str, Any]], scored: Sequence[Mapping[str, Any]]) -> Path:
    """Write ``report.html`` of a study, and the experts' form with its pictures.

    Parameters
    ----------
    out : Path
    rows : sequence of mapping
        Of :func:`reconstruction.restore.study.study`.
    scored : sequence of mapping
        Of :func:`reconstruction.restore.scores.scores`.

    Returns
    -------
    Path
    """
    spectra, nulls = fold_estimates(scored, "spectrum")
    places, place_nulls = fold_estimates(scored, "agreement")
    rates, chance = feature_estimates(scored)
    times = {}
    for method in ("restored", "MVS", "Pix2Vex", "Pix2Vex from template"):
        seconds = [r["seconds"] for r in rows if r["method"] == method and not r["why"]]
        if seconds:
            times[PAPER.get(method, method)] = (float(np.mean(seconds)), None)
    failed = [r for r in rows if r["why"]]
    notes = [
        "MFAR is this project's method on this project's synthetic garments; the paper's values are of other garments.",
        "Texture is not judged: the meshes have no colours. The chance level is that of another garment of the same type.",
    ]
    section = benchmark_section(distance_estimates(rows), keypoint_estimates(scored), spectra, nulls, rates, chance, times,
                                f"{os.cpu_count()} cores; shape only", "", notes)  # fmt: skip
    body = [[e.of, e.method, f"{e.value:.2f}", "" if e.low is None else f"{e.low:.2f} to {e.high:.2f}"] for e in places]
    bands = [[name, "null, 5 to 95 %", "", f"{low:.2f} to {high:.2f}"] for name, (low, high) in place_nulls.items()]
    more = [Table(["garment", "method", "agreement", "95 %"], body + bands, "Folds place by place: correlation of their heights")]
    if failed:
        more.append(Table(["garment", "seed", "method", "why"], [[r["garment"], r["seed"], r["method"], r["why"]] for r in failed],
                          "What failed"))  # fmt: skip
    count = len({(r["garment"], r["seed"]) for r in rows})
    content = ReportContent(
        "Restored garments against the truth",
        f"{count} synthetic garments",
        f"Mean distances, keypoints, folds and features of {count} synthetic garments whose shape is known, by method.",
        sections=[section, Section("Folds in place, failures", "", [], more, [])],
    )
    _experts(out)
    return write_report(content, out / "report.html")


def _experts(out: Path) -> None:
    """Form, key and pictures of all meshes for experts; an existing form is left alone, it may be filled in."""
    folder = out / "experts"
    if (folder / "form.csv").exists():
        return
    every = sorted((out / "meshes").glob("*/*.ply"))
    files = {f"{f.parent.name}/{f.stem}": f for f in every if f.stem in ("restored", "MVS", "Pix2Vex")}
    if not files:
        return
    folder.mkdir(parents=True, exist_ok=True)
    key = write_form(folder / "form.csv", list(files))
    for letter, name in key.items():
        (folder / f"{letter}.png").write_bytes(still(TriangleMesh.read(files[name])))
    (folder / "key.json").write_text(json.dumps(key, indent=1), encoding="utf-8")
