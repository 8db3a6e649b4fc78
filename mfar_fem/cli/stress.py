"""``mfar stress-test``: random extreme cases; each converges and is verified, or fails by name."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from mfar_fem.cli.console import check_writable, emit, progress


def stress_test(
    count: Annotated[int, typer.Option(help="Cases.", min=1)] = 40,
    seed: Annotated[int, typer.Option(help="Of the cases.")] = 0,
    only: Annotated[int | None, typer.Option(help="Run the case of this number alone.", min=0)] = None,
    workers: Annotated[int, typer.Option(help="Processes.", min=1)] = 2,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for cases, failure map and last states.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Solve random extreme cases: never NaN, never a hang; every result verified by code that shares nothing with the solver."""
    from mfar_fem.stress import run_stress_test

    folder = check_writable(out) if out is not None else None
    total = count if only is None else 1
    with progress("stress test", total) as advance:
        payload = run_stress_test(count, seed, workers, folder, only=only, progress=lambda done, row: advance(0, completed=done))
    if folder is not None:
        payload["files"] = sorted(str(p) for p in folder.glob("*.[cjp][sn]*"))
    emit(payload, as_json, _render)


def _render(payload: Mapping[str, Any]) -> list:
    from rich.table import Table

    table = Table(title="stress test", title_justify="left", show_header=False)
    for key in ("cases", "converged", "nan", "hangs", "unverified", "crashes", "warnings"):
        table.add_row(key, str(payload[key]))
    for name, number in payload["named_failures"].items():
        table.add_row(f"failed by name: {name}", str(number))
    return [table, *(f"written: {name}" for name in payload.get("files", ()))]
