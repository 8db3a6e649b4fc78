"""``mfar benchmark-data``: make the synthetic benchmark of garments in images."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from mfar_fem.cli.console import check_writable, emit, progress
from mfar_fem.errors import InputError, NotConvergedError


def benchmark_data(
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder; what is complete in it is kept.")],
    identities: Annotated[
        int, typer.Option(min=1, help="Garment and body pairs of three types; a seventh more of the held-out type.")
    ] = 70,
    seed: Annotated[int, typer.Option(min=0, help="Of everything.")] = 0,
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = 1,
    light: Annotated[bool, typer.Option("--light", help="Without depth, normals and labels.")] = False,
    pictures: Annotated[int, typer.Option(min=0, help="Of each identity, at most; 0: all. Few of many identities train best.")] = 0,
    body: Annotated[Path | None, typer.Option(help="OBJ of a body to dress instead of drawn figures.")] = None,
    body_keypoints: Annotated[Path | None, typer.Option(help="JSON with that body's joints.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Make images of synthetic Tang garments (figurine, mural, textile) with keypoints, depth, cameras and cutting panels."""
    from reconstruction.benchmark.body_file import load_body
    from reconstruction.benchmark.build import build
    from reconstruction.benchmark.contact_sheet import contact_sheet
    from reconstruction.benchmark.index import load_index

    if (body is None) != (body_keypoints is None):
        raise InputError("--body and --body-keypoints belong together: give both or neither")
    figure = None if body is None or body_keypoints is None else (str(body), str(body_keypoints))
    if figure is not None:
        load_body(*figure)  # a wrong file is reported before anything is made
    folder = check_writable(out)
    with progress("identities", quiet=as_json) as advance:
        report = build(
            folder,
            identities,
            seed,
            workers,
            light,
            figure=figure,
            pictures=pictures,
            progress=lambda done, total, name: advance(description=f"identity {name}", completed=done, total=total),
        )
    report["contact_sheet"] = contact_sheet(load_index(folder))
    emit({"folder": folder, **report}, as_json, _show)
    if report["failed"]:
        raise NotConvergedError(
            f"{len(report['failed'])} identities could not be draped and are left out: {', '.join(report['failed'])}"
        )


def benchmark_case(
    out: Annotated[Path, typer.Option("--out", "-o", help="New folder for pictures, masks, cameras, sources.toml and truth/.")],
    garment: Annotated[str, typer.Option(help="round-collar-robe, half-sleeve, flying-ribbon or veil-hat.")] = "round-collar-robe",
    seed: Annotated[int, typer.Option(min=0, help="Of garment, body and textures.")] = 0,
    around: Annotated[
        int, typer.Option(min=0, max=72, help="Take the figurine from so many sides; 0: three in front and one behind.")
    ] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Make ten pictures of one synthetic garment as a folder of sources, to try fuse, keypoints and template on."""
    from reconstruction.benchmark.case import PICTURES, make_case

    with progress("pictures", total=around + 6 if around else PICTURES, quiet=as_json) as advance:
        made = make_case(out, garment, seed, progress=advance, around=around)
    emit(made, as_json, _show_case)


def stages(
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder; its case/ is made if it is not there.")] = Path("out/stages"),
    garment: Annotated[str, typer.Option(help="round-collar-robe, half-sleeve, flying-ribbon or veil-hat.")] = "round-collar-robe",
    weights: Annotated[str | None, typer.Option(help="A trained detector instead of the shipped one.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Time and memory of fuse, keypoints and template on ten pictures of one garment."""
    from reconstruction.stages import make_and_measure

    folder = check_writable(out)
    with progress("stages", total=3, quiet=as_json) as advance:
        payload = make_and_measure(folder, garment, weights, advance)
    emit(payload | {"out": folder}, as_json, _show_stages)


def _show_stages(payload: Mapping[str, Any]) -> list[Any]:
    from rich.table import Table

    table = Table(title=f"{payload['images']} pictures of a {payload['garment']}, {payload['cores']} cores", title_justify="left")
    for heading in ("stage", "s", "CPU s", "peak MB"):
        table.add_column(heading, justify="left" if heading == "stage" else "right")
    for r in payload["rows"]:
        table.add_row(r["stage"], f"{r['seconds']:.1f}", f"{r['cpu_s']:.1f}", f"{r['peak_MB']:.0f}")
    return [table, f"{payload['seconds']:.1f} s in all; the silk paper gives {payload['paper_s']} s for this (on other hardware)"]


def _show_case(made: Mapping[str, Any]) -> list[str]:
    folder = made["folder"]
    return [
        f"[bold]{len(made['pictures'])} pictures[/bold] in {folder}",
        f"{made['garment']} on a {made['sex']} figure of {made['stature']:.2f} m",
        f"next: mfar fuse {folder} --out OUT; mfar keypoints {folder} --out OUT; mfar template OUT --out OUT",
        f"truth, for comparison only: mfar template {folder}/truth --out OUT/truth",
    ]


def _show(report: Mapping[str, Any]) -> list[str]:
    splits = ", ".join(f"{name} {number}" for name, number in report["splits"].items())
    return [
        f"[bold]{report['images']} images[/bold] of {report['identities']} identities ({splits}) in {report['folder']}",
        f"made {len(report['made'])}, kept {len(report['kept'])}, failed {len(report['failed'])}",
        f"mean stretch {100 * report['mean_stretch']:.2f} % (worst garment {100 * report['worst_mean_stretch']:.2f} %), deepest "
        f"penetration {1000 * report['max_penetration']:.2f} mm, edges through other cloth at most "
        f"{100 * report['worst_crossing_edges']:.2f} %",
        f"look at {report['contact_sheet']}",
    ]
