"""``mfar restore``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from mfar_fem.cli.console import check_writable, emit, progress


def restore(
    sources: Annotated[
        Path,
        typer.Argument(metavar="SOURCES", help="Folder of the pictures with its sources.toml; two with camera and mask at least."),
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="Output folder; finished stages in it are kept.")] = Path("out/restored"),
    garment: Annotated[
        str, typer.Option("--type", help="round-collar-robe, half-sleeve, flying-ribbon or veil-hat.")
    ] = "round-collar-robe",
    fabric: Annotated[str, typer.Option(help="Fabric preset, or a file of `mfar calibrate`.")] = "silk-charmeuse",
    fidelity: Annotated[str, typer.Option(help="draft, standard or reference.")] = "standard",
    surface: Annotated[
        str, typer.Option(help="Mesh of the solver: template (the fitted pattern) or poisson (a new surface).")
    ] = "template",
    weights: Annotated[str, typer.Option(help="A detector of `mfar train keypoints` instead of the shipped one.")] = "shipped",
    vote: Annotated[str, typer.Option(help="Weights of the kinds: precision, or paper (0.5, 0.3, 0.2).")] = "precision",
    drape: Annotated[bool, typer.Option(help="Settle the garment by the solver.")] = True,
    fresh: Annotated[bool, typer.Option("--fresh", help="Compute every stage again.")] = False,
    seed: Annotated[int, typer.Option(help="Of the matching.")] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """From pictures to a draped garment and its report; goes on after the last finished stage."""
    from reconstruction.restore.pipeline import ORDER, RestoreSettings
    from reconstruction.restore.pipeline import restore as run

    settings = RestoreSettings(garment=garment, fabric=fabric, fidelity=fidelity, weights=weights, vote=vote, surface=surface,
                               drape=drape, seed=seed)  # fmt: skip
    folder = check_writable(out)
    with progress("restore", total=len(ORDER), quiet=as_json) as advance:
        first = True

        def tell(name: str) -> None:
            nonlocal first
            advance(0 if first else 1, description=name)
            first = False

        payload = run(sources, folder, settings, fresh, tell)
    emit(payload, as_json, _show)


def _show(payload: Mapping[str, Any]) -> list[Any]:
    from rich.table import Table

    table = Table(title="Stages")
    for name, justify in (("stage", "left"), ("s", "right"), ("processor, s", "right"), ("peak, MB", "right"), ("", "left")):
        table.add_column(name, justify=justify)  # type: ignore[arg-type]
    for row in payload["stages"]:
        table.add_row(
            row["stage"], f"{row['seconds']:.1f}", f"{row['cpu_s']:.1f}", f"{row['peak_MB']:.0f}", "kept" if row["cached"] else ""
        )
    table.add_row("all", f"{payload['seconds']:.1f}", "", f"{payload['peak_MB']:.0f}", "paper: 161.0 s (18 cores and a P100)")
    shares = payload["facts"]["points"]["shares"]
    seen = ", ".join(f"{name} {100 * share:.0f} %" for name, share in shares.items())
    return [table, f"surface supported by: {seen}", f"report: {payload['report']}"]


def study_restore(
    seeds: Annotated[int, typer.Option(min=1, help="Garments of each type.")] = 5,
    first: Annotated[int, typer.Option(min=0, help="Seed of the first one.")] = 1,
    types: Annotated[str, typer.Option(help="Types, with commas.")] = "round-collar-robe,half-sleeve,flying-ribbon,veil-hat",
    methods: Annotated[str, typer.Option(help="Methods, with commas; all by default.")] = "",
    edge: Annotated[str, typer.Option(help="Edges of the fitted mesh.")] = "30 mm",
    around: Annotated[int, typer.Option(min=0, max=72, help="Take the figurines from so many sides.")] = 0,
    out: Annotated[Path, typer.Option("--out", "-o", help="Output folder; what it holds is kept.")] = Path("out/study-restore"),
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Restored shapes of synthetic garments against the truth, controls, oracles and multi-view stereo."""
    import csv
    import json

    from mfar_fem import units
    from mfar_fem.cli.console import jsonable
    from mfar_fem.errors import UnknownNameError
    from mfar_fem.tomlfile import suggest
    from reconstruction.restore.scores import scores
    from reconstruction.restore.study import METHODS, study
    from reconstruction.restore.study_report import write_study_report
    from reconstruction.template.dimensions import garment_type

    garments = [garment_type(name.strip()) for name in types.split(",") if name.strip()]
    chosen = [name.strip() for name in methods.split(",") if name.strip()] or list(METHODS)
    for name in chosen:
        if name not in METHODS:
            raise UnknownNameError(f"unknown method '{name}'{suggest(name, METHODS)}")
    folder = check_writable(out)
    with progress("garments", total=seeds * len(garments), quiet=as_json) as advance:
        length = units.parse(edge, "m", name="--edge")
        payload = study(folder, garments, range(first, first + seeds), length, chosen, advance, around)
    with progress("folds, features, report", quiet=as_json):
        scored = scores(folder, [(garment, seed) for seed in range(first, first + seeds) for garment in garments], length, around)
        payload["report"] = write_study_report(folder, payload["rows"], scored)
    (folder / "study.json").write_text(json.dumps(jsonable(payload), indent=1) + "\n", encoding="utf-8")
    for name in ("rows", "summary"):
        columns = list(dict.fromkeys(key for row in payload[name] for key in row))
        with (folder / f"{name}.csv").open("w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, columns, restval="")
            writer.writeheader()
            writer.writerows(payload[name])
    emit(payload | {"out": folder}, as_json, _show_study)


def _show_study(payload: Mapping[str, Any]) -> list[Any]:
    from rich.table import Table

    tables: dict[str, Any] = {}
    for r in payload["summary"]:
        if (table := tables.get(r["garment"])) is None:
            table = tables[r["garment"]] = Table(title=f"{r['garment']}: distance from the true surface, mm (95 % over garments)")
            for column in ("method", "both ways", "worse than restored by", "off", "missing", "rims", "failed", "s"):
                table.add_column(column, justify="left" if column == "method" else "right")
        if "mean" not in r:
            table.add_row(r["method"], *["-"] * 5, f"{r['failed']}/{r['cases']}", "-")
            continue
        worse = f"{r['worse_by']:+.1f} ({r['worse_by_low']:+.1f} to {r['worse_by_high']:+.1f})" if "worse_by" in r else ""
        rim = "-" if r["rim_mean"] is None else f"{r['rim_mean']:.1f}"
        table.add_row(r["method"], f"{r['mean']:.1f} ({r['mean_low']:.1f} to {r['mean_high']:.1f})", worse, f"{r['off_mean']:.1f}",
                      f"{r['missing_mean']:.1f}", rim, f"{r['failed']}/{r['cases']}", f"{r['seconds']:.0f}")  # fmt: skip
    return [*tables.values(), f"written to {payload['out']}: rows.csv, summary.csv, study.json, report.html, experts/"]


def study_photographs(
    data: Annotated[Path, typer.Option(help="Folder of alicevision_buddha and middlebury_templeRing.")],
    name: Annotated[str, typer.Option("--set", help="alicevision_buddha or middlebury_templeRing.")] = "alicevision_buddha",
    held_out: Annotated[int, typer.Option(min=0, help="Views that are held out, those with most matches; 0: all.")] = 0,
    out: Annotated[Path, typer.Option("--out", "-o", help="Output folder: a mesh for each.")] = Path("out/study-photographs"),
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Real photographs through matching, stereo and surface, judged by reprojection into views that were held out."""
    from reconstruction.matching.graph import write_csv
    from reconstruction.restore.photographs import study

    folder = check_writable(out)
    with progress("photographs", quiet=as_json) as advance:
        payload = study(data, name, folder, held_out, lambda text: advance(1, description=text))
    columns = list(dict.fromkeys(key for row in payload["rows"] for key in row))
    write_csv(folder / "photographs.csv", [{key: row.get(key, "") for key in columns} for row in payload["rows"]])
    emit(payload | {"out": folder}, as_json, _show_photographs)


def _show_photographs(payload: Mapping[str, Any]) -> list[Any]:
    from rich.table import Table

    table = Table(title=f"{payload['set']}: matched points by way of the mesh in a held-out view")
    columns = {"held_out": "held out", "matches": "matches", "on_mesh": "meet the mesh", "median_px": "median, px",
               "q75_px": "75 %, px", "within_2px": "≤ 2 px", "plane_median_px": "by a plane, px", "why": "why not"}  # fmt: skip
    for shown in columns.values():
        table.add_column(shown, justify="left" if shown in ("held out", "why not") else "right")
    for row in payload["rows"]:
        values = [row.get(key, "") for key in columns]
        table.add_row(*(f"{v:.2f}" if isinstance(v, float) else str(v) for v in values))
    pairs = f"{payload['matched_pairs']} matched pairs of {payload['views']} views"
    return [table, f"{pairs}; written to {payload['out']}: photographs.csv"]
