"""The report of a study: the paper's Figures 4 to 7 and Table 2 from its rows, and a form for experts."""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.files import replace_bytes
from reconstruction.benchmark.splits import HELD_OUT
from reconstruction.landmarks import LANDMARKS
from reconstruction.metrics import features
from reconstruction.metrics.experts import TRUE, letter, write_form
from reconstruction.report.content import ReportContent, Section, Table
from reconstruction.report.estimates import Estimate
from reconstruction.report.figures import benchmark_section
from reconstruction.report.still import still
from reconstruction.report.write import write_report
from reconstruction.restore.cache import file_digest
from reconstruction.restore.scores import true_mesh
from reconstruction.restore.study import LEAST, interval, mesh_file, summary
from reconstruction.style.bootstrap import mean_interval
from reconstruction.surface.triangles import TriangleMesh

log = logging.getLogger(__name__)

SHOWN = ("restored", "template only", "MVS", "Pix2Vex", "Pix2Vex from template", "true depth")
"""Methods of the figures, in their order: as many as there are colours and marks. The others are in ``summary.csv``."""
PAPER = {"restored": "MFAR"}
"""Names under which the paper's values stand beside."""
TIMED = {
    "restored": "MFAR: keypoints, template and fit of the shape; no drape",
    "MVS": "MVS: sweep to Poisson surface",
    "Pix2Vex": "Pix2Vex: from a sphere",
    "Pix2Vex from template": "Pix2Vex: hanging of the template and from there; no keypoints",
}
"""Rows of Table 2: what the seconds are of."""
DRAPED_TOO = "MFAR: keypoints, template and fit of the shape; drape at standard"
"""Of ``restored`` where all of its garments were settled too."""
PCK = 0.1
"""Share of the torso within which a point counts as found."""
JUDGED = ("restored", "MVS", "Pix2Vex")
"""Methods that experts judge, beside the true garments."""
KEY = "experts-key.json"
"""Which letter of the experts' form is what; beside the folder that is handed out, not in it."""


def _estimate(of: str, method: str, values: Sequence[float], groups: Sequence[Any]) -> Estimate:
    found = interval("mean", values, groups)
    assert found["mean"] is not None
    return Estimate(of, PAPER.get(method, method), found["mean"], found["mean_low"], found["mean_high"], len(set(groups)))


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
    of the mean square. Points that the detector left out have no error: :func:`keypoint_table` counts them."""
    out = []
    for name in LANDMARKS:
        for method, held_out in (("MFAR", False), ("MFAR, held-out type", True)):
            mine = [s for s in scored if (s["garment"] == HELD_OUT) == held_out]
            squares = [(i, e**2) for i, s in enumerate(mine) for n, e, _ in s["keypoints"] if n == name and e is not None]
            if not squares:
                continue
            found = mean_interval(np.array([v for _, v in squares]), np.array([i for i, _ in squares]))
            root = [float(np.sqrt(max(v, 0.0))) for v in (found.value, found.low, found.high)]
            count = len({i for i, _ in squares})
            low, high = (min(root[0], root[1]), max(root[0], root[2])) if count >= LEAST else (None, None)
            out.append(Estimate(name, method, root[0], low, high, count))
    return out


def keypoint_table(scored: Sequence[Mapping[str, Any]]) -> Table:
    """To Figure 5: points in sight, how many the detector left out, and PCK over all in sight (left out: not within)."""
    rows: list[list[object]] = []
    for name in (*LANDMARKS, "all points"):
        for method, held_out in (("MFAR", False), ("MFAR, held-out type", True)):
            mine = [s for s in scored if (s["garment"] == HELD_OUT) == held_out]
            points = [p for s in mine for p in s["keypoints"] if name in (p[0], "all points")]
            if points:
                near = sum(share is not None and share <= PCK for _, _, share in points)
                gone = sum(error is None for _, error, _ in points)
                rows.append([name, method, len(points), gone, f"{100 * near / len(points):.0f}"])
    caption = (
        "Points in sight that the detector left out, and share near the truth among all in sight (PCK). Torso by the points in "
        "sight: middle of the shoulders to middle of the waist, else width of the shoulders, else half the diagonal of all"
    )
    return Table(["of", "method", "in sight", "not found", f"within {PCK:g} of the torso, %"], rows, caption)


def distance_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    """To Figure 4: of how many cases every mean is, and differences over the cases that a method shares with *restored*."""

    def words(entry: Mapping[str, Any], name: str, sign: str = "") -> object:
        if name not in entry:
            return None
        if entry[f"{name}_low"] is None:
            return f"{entry[name]:{sign}.1f} (-)"
        return f"{entry[name]:{sign}.1f} ({entry[f'{name}_low']:{sign}.1f} to {entry[f'{name}_high']:{sign}.1f})"

    body = [[e["garment"], e["method"], f"{e['n']} of {e['cases']}", words(e, "mean"), words(e, "worse_by", "+"), e.get("paired"),
             None if e.get("faces") is None else round(e["faces"])] for e in summary(rows)]  # fmt: skip
    columns = ["garment", "method", "cases", "mean distance, mm (95 %)", "worse than restored by, mm (95 %)", "pairs", "triangles"]
    caption = (
        "Distance by method. Compare methods by the paired differences: a mean over fewer cases is of other garments. "
        f"(-): no interval over fewer than {LEAST} cases"
    )
    return Table(columns, body, caption)


def times_of(rows: Sequence[Mapping[str, Any]]) -> dict[str, tuple[float, float | None]]:
    """Table 2: mean seconds by what they are of (:data:`TIMED`), and of the drape by the solver, where it was done of all."""
    times: dict[str, tuple[float, float | None]] = {}
    settled = {(r["garment"], r["seed"]): r["seconds"] for r in rows if r["method"] == "draped" and not r["why"]}
    for method, label in TIMED.items():
        mine = [r for r in rows if r["method"] == method and not r["why"]]
        if not mine:
            continue
        total = [r["seconds"] for r in mine]
        if method == "restored":
            if all("keypoints_s" in r and "template_s" in r for r in mine):
                total = [r["seconds"] + r["keypoints_s"] + r["template_s"] for r in mine]
            else:
                label = "MFAR: fit of the shape alone; no keypoints, template, drape"
        drape = None
        if label == TIMED["restored"] and all((r["garment"], r["seed"]) in settled for r in mine):
            drape = float(np.mean([settled[r["garment"], r["seed"]] for r in mine]))
            label = DRAPED_TOO
        times[label] = (float(np.mean(total)), drape)
    return times


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
    failed = [r for r in rows if r["why"]]
    points = [p for s in scored for p in s["keypoints"]]
    gone = sum(error is None for _, error, _ in points)
    fewer = [f"{e['method']} on {e['garment']}: {e['n']} of {e['cases']}" for e in summary(rows)
             if e["n"] < e["cases"] and e["method"] in SHOWN]  # fmt: skip
    notes = [
        "MFAR is this project's method on this project's synthetic garments; the paper's values are of other garments.",
        "Texture is not judged: the meshes have no colours. The chance level is that of another garment of the same type.",
    ]
    if points:
        notes.append(f"Figure 5 is of points that were found: of {len(points)} in sight the detector left {gone} out.")
    if fewer:
        notes.append(f"Means over fewer cases than there are, not to be compared with others but by pairs: {'; '.join(fewer)}.")
    section = benchmark_section(distance_estimates(rows), keypoint_estimates(scored), spectra, nulls, rates, chance, times_of(rows),
                                f"{os.cpu_count()} cores", "", notes)  # fmt: skip
    folds: list[list[object]] = [
        [e.of, e.method, f"{e.value:.2f}", None if e.low is None else f"{e.low:.2f} to {e.high:.2f}"] for e in places
    ]
    folds += [[name, "null, 5 to 95 %", "", f"{low:.2f} to {high:.2f}"] for name, (low, high) in place_nulls.items()]
    more = [distance_table(rows)]
    if points:
        more.append(keypoint_table(scored))
    more.append(Table(["garment", "method", "agreement", "95 %"], folds, "Folds place by place: correlation of their heights"))
    if failed:
        more.append(Table(["garment", "seed", "method", "why"], [[r["garment"], r["seed"], r["method"], r["why"]] for r in failed],
                          "What failed"))  # fmt: skip
    count = len({(r["garment"], r["seed"]) for r in rows})
    content = ReportContent(
        "Restored garments against the truth",
        f"{count} synthetic garments",
        f"Mean distances, keypoints, folds and features of {count} synthetic garments whose shape is known, by method.",
        sections=[section, Section("Pairs, points, folds in place, failures", "", [], more, [])],
    )
    path = write_report(content, out / "report.html")
    write_experts(out, rows)
    return path


def write_experts(out: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write or extend ``experts/form.csv`` with a picture a letter, and the key beside that folder.

    Judged are the meshes of :data:`JUDGED` and the true garments of their cases. Letters follow from the meshes: what was filled
    in stays; a mesh that was made anew is asked for anew, and its earlier letter leaves the key (and, if nothing was answered of
    it, the form).
    """
    folder, place = out / "experts", out / KEY
    files = {(r["case"], r["method"]): (r["garment"], mesh_file(out, r)) for r in rows
             if r["method"] in JUDGED and not r["why"] and "case" in r and mesh_file(out, r).exists()}  # fmt: skip
    for (case, _), (garment, _) in list(files.items()):
        files[case, TRUE] = (garment, out / "cases" / case / "truth" / "geometry.npz")
    if not files:
        return
    key: dict[str, dict[str, str]] = {}
    if place.exists():
        try:
            key = json.loads(place.read_text(encoding="utf-8"))
        except ValueError as error:
            log.warning("%s is damaged and is made again from this study's meshes: %s", place, error)
    key = {name: e for name, e in key.items() if (e["case"], e["method"]) not in files}  # of other cases
    meshes = {}
    for (case, method), (garment, file) in files.items():
        name = letter(f"{case}/{method}", file_digest(file))
        key[name] = {"case": case, "garment": garment, "method": method}
        meshes[name] = true_mesh(out / "cases" / case) if method == TRUE else TriangleMesh.read(file)
    folder.mkdir(parents=True, exist_ok=True)
    if (folder / "key.json").exists():  # of versions that put it there
        (folder / "key.json").replace(out / "experts-key-earlier.json")
    replace_bytes(place, json.dumps(dict(sorted(key.items())), indent=1).encode())
    earlier = write_form(folder / "form.csv", list(key))
    if earlier:
        log.warning("%s: answers of earlier meshes are kept but count no more: %s", folder / "form.csv", ", ".join(earlier))
    for picture in folder.glob("G*.png"):
        if picture.stem not in {*key, *earlier}:
            picture.unlink()
    for name, mesh in meshes.items():
        if not (folder / f"{name}.png").exists():
            replace_bytes(folder / f"{name}.png", still(mesh))
