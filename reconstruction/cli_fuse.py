"""``mfar fuse`` and ``mfar study matching``."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from mfar_fem.cli.console import check_writable, emit, jsonable, progress
from reconstruction.measure.vote import DEFAULT_WEIGHTING, check_weighting

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else there.")]


def fuse(
    folder: Annotated[Path, typer.Argument(metavar="SOURCES", help="Folder of the pictures with its sources.toml.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Output folder; what it holds is gone on with.")] = Path("out/fusion"),
    template: Annotated[bool, typer.Option("--template", help="Write a sources.toml to fill in, and leave.")] = False,
    detector: Annotated[str, typer.Option(help="sift or aliked.")] = "sift",
    weights: Annotated[Path | None, typer.Option(help="Published ALIKED weights (aliked-t16.pth or aliked-n16rot.pth).")] = None,
    estimator: Annotated[str, typer.Option(help="ransac or magsac.")] = "ransac",
    root_sift: Annotated[bool, typer.Option("--root-sift", help="Square roots of the SIFT descriptors.")] = False,
    threshold: Annotated[float, typer.Option(help="Distance of an inlier to its epipolar line, px.")] = 3.5,
    seed: Annotated[int, typer.Option(help="Of the search trees and samples.")] = 0,
    filter_shape: Annotated[str, typer.Option("--filter", help="Of the light: gaussian or butterworth.")] = "gaussian",
    cutoff: Annotated[float, typer.Option(help="Variations of the light up to so many cycles per image width.")] = 3.0,
    gamma_low: Annotated[float, typer.Option(help="Share of the slow variations that stays; 1 leaves the light alone.")] = 0.3,
    gamma_high: Annotated[float, typer.Option(help="Gain of the fast ones.")] = 2.0,
    longest: Annotated[int, typer.Option(help="Longest side of the pictures that are matched, px.")] = 2000,
    weighting: Annotated[str, typer.Option("--vote", help="Weights of the kinds in the vote on lengths: precision (inverse \
variances) or paper (0.5, 0.3, 0.2).")] = DEFAULT_WEIGHTING,
    as_json: Json = False,
) -> None:
    """Even out the light of historical pictures, match all pairs, and say which fit together and which do not."""
    from reconstruction import sources

    if template:
        path = sources.write_template(folder)
        emit({"template": path}, as_json, lambda p: f"wrote {p['template']}: replace every '?' and run again")
        return
    from reconstruction.illumination import HighEmphasis
    from reconstruction.matching.fusion import fuse as run
    from reconstruction.matching.fusion import steps
    from reconstruction.matching.settings import MatchSettings
    from reconstruction.measure.stage import measurements

    check_weighting(weighting)
    settings = MatchSettings(detector=detector, weights=None if weights is None else str(weights), estimator=estimator,
                             root_sift=root_sift, threshold=threshold, seed=seed)  # fmt: skip
    light = HighEmphasis(shape=filter_shape, cutoff=cutoff, gamma_low=gamma_low, gamma_high=gamma_high)
    count = len(sources.read(folder).sources)
    with progress("fuse", steps(count), quiet=as_json) as advance:
        fusion = run(folder, out, settings, light, longest, {"measurements": partial(measurements, weighting=weighting)},
                     lambda label: advance(1, description=label))  # fmt: skip
    graph = fusion.graph
    payload = {"out": fusion.folder, "sources": [p.source.facts() | {"notes": p.notes, **p.light} for p in fusion.pictures],
               "pairs": [r.row() for r in graph.results], "by_kinds": graph.by_kinds(), "statuses": graph.statuses(),
               "components": graph.components(), "stages": fusion.stages}  # fmt: skip
    emit(payload, as_json, _show_fusion)


def matching(
    data: Annotated[Path, typer.Option(help="Folder of alicevision_buddha, middlebury_templeRing and sceaux_castle.")],
    weights: Annotated[Path | None, typer.Option(help="ALIKED weights; without them that variant is left out.")] = None,
    only: Annotated[list[str] | None, typer.Option("--set", help="One of the sets (repeatable); all by default.")] = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="Output folder.")] = Path("out/study-matching"),
    as_json: Json = False,
) -> None:
    """Match neighbouring views whose cameras are known: SIFT, ALIKED, RANSAC, MAGSAC against the given epipolar lines."""
    import json

    from reconstruction.matching.graph import write_csv
    from reconstruction.matching.study import SETS, study

    out = check_writable(out)
    with progress("study", quiet=as_json) as advance:
        payload = study(data, weights, only or SETS,
                        progress=lambda done, total, label: advance(description=label, completed=done, total=total))  # fmt: skip
    for name in ("pairs", "summary", "control"):
        write_csv(out / f"{name}.csv", payload[name])
    (out / "study.json").write_text(json.dumps(jsonable(payload), indent=1), encoding="utf-8")
    emit(payload | {"out": out}, as_json, _show_study)


def canonical(
    seeds: Annotated[int, typer.Option(min=1, help="Garments of each type.")] = 3,
    out: Annotated[Path, typer.Option("--out", "-o", help="Output folder.")] = Path("out/study-canonical"),
    as_json: Json = False,
) -> None:
    """Match kinds of pictures in the frame of the canonical body, on synthetic garments whose every point is known."""
    from reconstruction.matching.canonical_study import study
    from reconstruction.matching.graph import write_csv

    out = check_writable(out)
    kinds = ("round-collar-robe", "half-sleeve")
    with progress("garments", total=seeds * len(kinds), quiet=as_json) as advance:
        payload = study(kinds, seeds, progress=advance)
    write_csv(out / "canonical.csv", payload["rows"])
    columns = {"kinds": "kinds", "variant": "SIFT on the pictures", "pairs": "pairs", "matches": "matches", "right": "right",
               "precision": "share right", "chance": "by chance", "pairs_with_8": "pairs with 8 right"}  # fmt: skip
    title = f"{payload['garments']} garments; right: within {100 * payload['tolerance_m']:g} cm on the worn garment; means a pair"
    emit(payload | {"out": out}, as_json, lambda p: [_table(title, p["rows"], columns), f"written to {out}: canonical.csv"])


def _table(title: str, rows: list[dict], columns: dict[str, str]) -> Any:
    """A rich table of some keys of rows."""
    from rich.table import Table

    table = Table(title=title)
    for key, shown in columns.items():
        table.add_column(shown, justify="right" if rows and isinstance(rows[0].get(key), int | float) else "left", overflow="fold")
    for row in rows:
        table.add_row(*(_cell(row[key]) for key in columns))
    return table


def _cell(value: Any) -> str:
    from rich.markup import escape

    if isinstance(value, float):
        return "–" if value != value else f"{value:.2f}"
    return escape(str(value))


def _show_fusion(payload) -> list:
    kinds = {"kinds": "kinds", "pairs": "pairs", "matched": "matched", "degenerate": "degenerate", "failed": "failed",
             "median_rate": "rate", "inliers": "inliers", "median_sampson_px": "own F, px"}  # fmt: skip
    shown: list[Any] = [f"{s['name']}: {'; '.join(s['notes'])}" for s in payload["sources"] if s["notes"]]
    if payload["by_kinds"]:
        shown.append(_table("Pairs by kinds of sources", payload["by_kinds"], kinds))
    shown += [f"  {count} {status}" for status, count in payload["statuses"].items()]
    from reconstruction.matching.graph import joined

    groups = payload["components"]
    shown.append(joined(groups))
    measured = payload["stages"]["measurements"]
    if measured["votes"]:
        rows = [{"length": v["name"], "cm": 100 * v["value_m"], "sigma": 100 * v["sigma_m"], "kinds": ", ".join(v["weights"])}
                for v in measured["votes"]]  # fmt: skip
        columns = {"length": "length", "cm": "vote, cm", "sigma": "± cm", "kinds": "kinds that vote"}
        shown.append(_table("Measurements, one system for all sources", rows, columns))
    for c in measured["conflicts"]:
        first, second = (f"{c[k]} {100 * c[f'{k}_value_m']:.1f} cm" for k in ("first", "second"))
        shown.append(f"conflict: {c['name']}: {first}, {second}")
    if measured["note"]:
        shown.append(measured["note"])
    shown.append(f"written to {payload['out']}: fusion.json, pairs.csv, kinds.csv, graph.png, matrix.png, corrected/, pairs/")
    return shown


def _show_study(payload) -> list:
    columns = {"set": "set", "variant": "variant", "pairs": "pairs", "accepted_blindly": "accepted blindly",
               "accepted_but_wrong": "of these wrong by the cameras", "degenerate": "degenerate", "putative": "putative",
               "inliers": "inliers", "median_sampson_px": "own F, px", "median_sampson_cameras_px": "cameras, px",
               "worst_short_baseline_px": "worst short baseline, px",
               "worst_either_way_up_px": "same, either way up"}  # fmt: skip
    turned = {"set": "set", "a": "a", "b": "b", "turned": "turned", "putative": "putative", "inliers": "inliers",
              "median_sampson_px": "own F, px", "median_sampson_cameras_px": "cameras, px"}  # fmt: skip
    shown: list[Any] = [_table("Neighbouring views; medians of median Sampson distances", payload["summary"], columns)]
    if payload["control"]:
        shown.append(_table("Control: pictures turned by 90° under the old cameras", payload["control"], turned))
    shown += [f"FLANN finds {100 * row['precision']:.1f} % of the nearest neighbours ({row['set']})" for row in payload["flann"]]
    return [*shown, *payload["notes"], f"written to {payload['out']}: pairs.csv, summary.csv, control.csv, study.json"]
