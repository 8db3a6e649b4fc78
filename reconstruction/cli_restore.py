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
    garment: Annotated[str, typer.Option("--type", help="round-collar-robe or half-sleeve.")] = "round-collar-robe",
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
