"""``mfar study``: longer studies of the calibration, each an object of numbers, tables and plain words."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from mfar_fem.cli.console import check_writable, emit, jsonable, progress

app = typer.Typer(help="Longer studies: synthetic round trip, every law on the cupro curves, sensitivities, meshes.", no_args_is_help=True)

Out = Annotated[Path | None, typer.Option("--out", "-o", help="Output folder; out/study-NAME by default.")]
WorkersOption = Annotated[int, typer.Option(min=1, help="Local worker processes (more than 1 needs the extra 'cluster').")]
Scheduler = Annotated[str | None, typer.Option(help="Address of a Dask scheduler to use instead of local workers.")]
Resume = Annotated[bool, typer.Option("--resume/--fresh", help="Go on from what the folder holds.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else there.")]


@app.command("round-trip")
def round_trip(
    seeds: Annotated[int, typer.Option(min=1, help="Noisy repetitions.")] = 20,
    noise: Annotated[float, typer.Option(help="Standard deviation of the noise, fraction of the range.")] = 0.01,
    truth: Annotated[str, typer.Option(help="Mesh that makes the data: draft, standard or reference.")] = "reference",
    fitted: Annotated[str, typer.Option(help="Mesh that fits them.")] = "standard",
    profiles: Annotated[bool, typer.Option(help="Trace the whole profiles of mu and nu for the first seed.")] = True,
    out: Out = None,
    workers: WorkersOption = 1,
    scheduler: Scheduler = None,
    resume: Resume = True,
    as_json: Json = False,
) -> None:
    """Find a known truth again from noisy synthetic strips and overhangs; do the intervals cover it?"""
    folder = _folder(out, "round-trip")
    from calibration.runs import Workers
    from calibration.studies.round_trip import Settings, run

    settings = Settings(noise=noise, truth=_fidelity(truth, "--truth"), fitted=_fidelity(fitted, "--fitted"))
    with _stages(as_json) as stage:
        payload = run(seeds, settings, with_profile=profiles, folder=folder / "runs", resume=resume,
                      where=Workers(workers, scheduler), progress=stage)
    _finish("round-trip", payload, folder, as_json, _show_round_trip)


def _folder(out: Path | None, name: str) -> Path:
    return check_writable(out if out is not None else Path("out") / f"study-{name}")


def _fidelity(name: str, option: str) -> str:
    from material_tests.strip.fe import CELLS
    from mfar_fem.errors import UnknownNameError

    if name not in CELLS:
        raise UnknownNameError(f"{option} {name}: unknown fidelity; known: {', '.join(CELLS)}")
    return name


@contextlib.contextmanager
def _stages(quiet: bool) -> Iterator:
    """A progress bar on stderr that starts again with every stage."""
    with progress("starting", quiet=quiet) as advance:

        def stage(name: str, done: int, total: int) -> None:
            advance(0, description=name, completed=done, total=total)

        yield stage


def _finish(name: str, payload: dict, folder: Path, as_json: bool, render) -> None:
    """Write NAME.json and print the result."""
    file = folder / f"{name}.json"
    payload = {"study": name} | payload | {"files": {"json": str(file)}}
    file.write_text(json.dumps(jsonable(payload), indent=2, allow_nan=False) + "\n", encoding="utf-8")
    emit(payload, as_json, lambda p: [*render(p), f"written: {file}"])


def _table(title: str, columns: Mapping[str, str], rows) -> Any:
    """A table from a heading -> side mapping and rows of text."""
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for heading, side in columns.items():
        table.add_column(heading, justify=side)
    for row in rows:
        table.add_row(*(escape(str(cell)) for cell in row))
    return table


def _show_round_trip(p) -> list:
    rows = []
    for r in p["per_seed"]:
        low, high = r["interval"]["mu"]
        covered = "yes" if r["covered_linear"]["mu"] else "no"
        rows.append((r["seed"], f"{r['parameters']['law.mu'] / 1e3:.2f}", f"{low / 1e3:.2f} to {high / 1e3:.2f}", covered,
                     f"{r['parameters']['law.nu']:.3g}", "open" if r["nu_without_upper_bound"] else "bounded"))
    columns = {"seed": "right", "mu kPa": "right", "95 % interval": "right", "covers": "left", "nu": "right", "nu above": "left"}
    verdict = "passed" if p["passed"] else "[bold red]not passed[/bold red]"
    return [_table("Synthetic round trip", columns, rows), *p["words"], f"{verdict} in {p['wall_s']:.1f} s"]
