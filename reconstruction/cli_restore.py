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
        str,
        typer.Option(
            help="Mesh of the solver: template (the fitted pattern) or poisson (a new surface; it is refused for most robes)."
        ),
    ] = "template",
    weights: Annotated[str, typer.Option(help="A detector of `mfar train keypoints` instead of the shipped one.")] = "shipped",
    vote: Annotated[str, typer.Option(help="Weights of the kinds: precision, or paper (0.5, 0.3, 0.2).")] = "precision",
    drape: Annotated[bool, typer.Option(help="Settle the garment by the solver; without it the fitted shape is the end.")] = True,
    fresh: Annotated[bool, typer.Option("--fresh", help="Compute every stage again.")] = False,
    seed: Annotated[int, typer.Option(help="Of the matching.")] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """From pictures to a draped garment and its report; goes on after the last finished stage."""
    from mfar_fem.errors import NotConvergedError
    from reconstruction.restore.pipeline import RestoreSettings, stages_of
    from reconstruction.restore.pipeline import restore as run

    settings = RestoreSettings(garment=garment, fabric=fabric, fidelity=fidelity, weights=weights, vote=vote, surface=surface,
                               drape=drape, seed=seed)  # fmt: skip
    folder, names = check_writable(out), stages_of(settings)
    try:
        with progress("restore", total=len(names), quiet=as_json) as advance:

            def tell(name: str, share: float) -> None:
                advance(0, description=f"{name}, {names.index(name) + 1} of {len(names)}", completed=names.index(name) + share)

            payload = run(sources, folder, settings, fresh, tell)
    except NotConvergedError as error:
        if error.result is not None:
            emit(error.result, as_json, _show)
        raise
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
    methods: Annotated[
        str,
        typer.Option(
            help="Methods, with commas; all by default: restored, draped, template only, outlines only, true points, true depth, "
            "poisson, "
            "poisson without ARAP, poisson adaptive, poisson uniform (8 to 20 s a garment each), MVS (32 to 119 s), Pix2Vex, "
            "Pix2Vex from template (about 120 s each)."
        ),
    ] = "",
    edge: Annotated[str, typer.Option(help="Edges of the fitted mesh.")] = "30 mm",
    around: Annotated[int, typer.Option(min=0, max=72, help="Take the figurines from so many sides.")] = 0,
    out: Annotated[Path, typer.Option("--out", "-o", help="Output folder; what it holds is kept.")] = Path("out/study-restore"),
    fresh: Annotated[bool, typer.Option("--fresh", help="Make garments, keypoints and rows again.")] = False,
    experts: Annotated[
        Path | None,
        typer.Option(
            help="Only read a form that experts filled in (OUT/experts/form.csv): how often they say the same of a method's "
            "garments as of the true ones, by two of three votes."
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Restored shapes of synthetic garments against the truth, controls, oracles and multi-view stereo.

    Rows are kept, also of failures, as long as garment, detector, settings and the study's version stay the same.
    """
    import csv
    import json

    if experts is not None:
        emit(_experts(experts, out), as_json, _show_experts)
        return

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
    with progress("garments", total=seeds * len(garments) * len(chosen), quiet=as_json) as advance:
        length = units.parse(edge, "m", name="--edge")
        payload = study(folder, garments, range(first, first + seeds), length, chosen,
                        lambda done, text: advance(done, description=text), around, fresh)  # fmt: skip
    with progress("folds, features, report", quiet=as_json):
        cases = [(garment, seed) for seed in range(first, first + seeds) for garment in garments]
        scored = scores(folder, cases, length, around, payload["rows"])
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

    def words(r: Mapping[str, Any], name: str, sign: str = "") -> str:
        ends = f"{r[f'{name}_low']:{sign}.1f} to {r[f'{name}_high']:{sign}.1f}" if r[f"{name}_low"] is not None else "-"
        return f"{r[name]:{sign}.1f} ({ends})"

    tables: dict[str, Any] = {}
    for r in payload["summary"]:
        if (table := tables.get(r["garment"])) is None:
            table = tables[r["garment"]] = Table(title=f"{r['garment']}: distance from the true surface, mm (95 % over garments)")
            for column in ("method", "n", "both ways", "worse than restored", "s"):  # the others are in summary.csv
                table.add_column(column, justify="left" if column == "method" else "right", no_wrap=column == "method")
        count = f"{r['n']}/{r['cases']}"
        if "mean" not in r:
            table.add_row(r["method"], count, "-", "-", "-")
            continue
        worse = words(r, "worse_by", "+") if "worse_by" in r else ""
        table.add_row(r["method"], count, words(r, "mean"), worse, f"{r['seconds']:.0f}")
    notes = ["(-): no interval over fewer than three garments."]
    if any(r["n"] < r["cases"] for r in payload["summary"]):
        notes.append("A mean over fewer garments is of other garments: compare by the paired differences.")
    held = [f"{r['garment']} {100 * r['within_2_sigma']:.0f} %" for r in payload["summary"]
            if r["method"] == "restored" and r.get("within_2_sigma") is not None]  # fmt: skip
    if held:
        notes.append(f"Points of *restored* within twice their standard deviation: {', '.join(held)}.")
    files = "rows.csv, summary.csv, study.json, report.html, experts/ (to hand out), experts-key.json (not to)"
    return [*tables.values(), *notes, f"written to {payload['out']}: {files}"]


def _experts(form: Path, out: Path) -> dict[str, Any]:
    import json

    from mfar_fem.errors import DataFileError
    from reconstruction.metrics.experts import rates, read_form
    from reconstruction.restore.study_report import KEY

    try:
        key = json.loads((out / KEY).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        hint = "give the --out of the study that made the form"
        raise DataFileError(f"the key of the experts' form cannot be read ({error}); {hint}", path=out / KEY) from error
    return {"form": form} | rates(read_form(form), key)


def _show_experts(payload: Mapping[str, Any]) -> list[Any]:
    from rich.table import Table

    table = Table(title="Features on which experts say the same as of the true garment, % (two of three votes; 95 % over garments)")
    for column in ("method", "group", "agree", "rate", "95 %", "chance", "garments"):
        table.add_column(column, justify="left" if column in ("method", "group") else "right")
    for r in payload["rates"]:
        ends = "-" if r["low"] is None else f"{r['low']:.0f} to {r['high']:.0f}"
        table.add_row(r["method"], r["group"], f"{r['agree']} of {r['asked']}", f"{r['rate']:.0f}", ends,
                      "-" if r["chance"] is None else f"{r['chance']:.0f}", str(r["garments"]))  # fmt: skip
    notes = [f"{payload['garments']} garments with answers"]
    if not payload["rates"]:
        notes.append("no garment and its true one both have answers that two experts agree on: there is no rate yet")
    if payload["unknown"]:
        notes.append(f"left out, for they are not in the key (of earlier meshes): {', '.join(payload['unknown'])}")
    return [table, *notes]


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
               "q75_px": "75 %, px", "within_2px": "≤ 2 px", "plane_median_px": "by a plane, px",
               "surface": "surface", "why": "why not"}  # fmt: skip
    for shown in columns.values():
        table.add_column(shown, justify="left" if shown in ("held out", "surface", "why not") else "right")
    for row in payload["rows"]:
        values = [row.get(key, "") for key in columns]
        table.add_row(*(f"{v:.2f}" if isinstance(v, float) else str(v) for v in values))
    pairs = f"{payload['matched_pairs']} matched pairs of {payload['views']} views"
    return [table, f"{pairs}; written to {payload['out']}: photographs.csv"]
