"""Tables, files and picture of the swing test."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

_NAMES = {"plate": "rigid plate", "plate_free_frequency": "rigid plate, frequency free", "fe": "finite elements"}


def render(payload: Mapping[str, Any]) -> list:
    """What a console shows of the payload: rich tables and lines."""
    from rich.table import Table

    title = f"{payload['fabric']}: swing from {payload['angle_deg']:.4g}°, {1e3 * payload['length_m']:.4g} mm below the axis"
    swings = Table(title=title)
    for name in ("turning point", "swatch: °", "ratio", "rigid plate: °", "ratio"):
        swings.add_column(name, justify="right")
    columns = [("amplitudes_deg", "decay"), ("plate_amplitudes_deg", "plate_decay")]
    for i in range(max(len(payload[key]) for key, _ in columns)):
        row = [str(i)]
        for amplitude, decay in columns:
            row.append(f"{payload[amplitude][i]:.4g}" if i < len(payload[amplitude]) else "–")
            row.append(f"{payload[decay][i - 1]:.3g}" if 0 < i < len(payload[amplitude]) else "–")
        swings.add_row(*row)
    lines: list = [swings, *_facts(payload)]
    if "estimates" in payload:
        lines.append(_estimates(payload))
    return lines + [f"written: {path}" for path in payload.get("files", [])]


def _facts(payload: Mapping[str, Any]) -> list[str]:
    paper, period = payload["paper"], payload["period_s"]
    return [
        f"period {'–' if period is None else f'{period:.4g} s'}; largest bow {100 * payload['largest_bow']:.3g} % of the length",
        f"drag took {100 * payload['dissipated_share']:.4g} % of the energy, the integrator {100 * payload['defect_share']:.2g} %",
        f"drag {payload['gamma_normal']:.4g} N·s²/m⁴ is a drag coefficient of {payload['drag_coefficient']:.3g}",
        f"the paper's {paper['total_N_s2_per_m2']:.3g} N·s²/m² as the total of this swatch: {paper['per_area_N_s2_per_m4']:.3g} "
        f"N·s²/m⁴, a drag coefficient of {paper['drag_coefficient']:.3g}",
        f"air that swings along, left out: about {100 * payload['added_mass_share']:.2g} % of the swatch's mass",
    ]


def _estimates(payload: Mapping[str, Any]):
    from rich.table import Table

    title = f"drag recovered; truth {payload['truth']:.4g} N·s²/m⁴, noise {payload['noise_deg']:.3g}°, seed {payload['seed']}"
    table = Table(title=title)
    for name in ("model", "γ: N·s²/m⁴", "95 % interval", "error: %", "residual: °", "runs"):
        table.add_column(name, justify="left" if name == "model" else "right")
    for name, e in payload["estimates"].items():
        low, high = e["interval"]
        table.add_row(_NAMES[name], f"{e['gamma']:.4g}", f"{low:.4g} to {high:.4g}", f"{e['error_percent']:+.2g}",
                      f"{e['residual_deg']:.3g}", str(e["runs"]))
    return table


def plot_swing(payload: Mapping[str, Any]):
    """Angle against time: swatch, rigid plate, record; a matplotlib Figure."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes, curve = figure.add_subplot(), payload["curve"]
    if "record" in payload:
        axes.plot(payload["record"]["time_s"], payload["record"]["angle_deg"], "k.", ms=3, alpha=0.5, label="synthetic record")
    axes.plot(curve["time_s"], curve["angle_deg"], "C0", lw=2, label="swatch")
    axes.plot(curve["time_s"], curve["plate_deg"], "C1--", label="rigid plate")
    axes.axhline(0.0, color="0.7", lw=0.8)
    axes.set_xlabel("time, s")
    axes.set_ylabel("angle of the chord, °")
    axes.set_title(f"{payload['fabric']}, {payload['gamma_normal']:.4g} N·s²/m⁴ along the normal", fontsize=10)
    axes.grid(alpha=0.3)
    axes.legend()
    return figure


def save(folder: Path, payload: Mapping[str, Any]) -> list[str]:
    """Write ``swing.csv``, ``swing_record.csv`` (where there is one) and ``swing.png``; returns the paths."""
    folder = Path(folder)
    curve = payload["curve"]
    columns = {"time_s": curve["time_s"], "angle_deg": curve["angle_deg"], "plate_deg": curve["plate_deg"], "bow_-": curve["bow"]}
    files = [_table(folder / "swing.csv", columns)]
    if "record" in payload:
        files.append(_table(folder / "swing_record.csv", payload["record"]))
    picture = folder / "swing.png"
    plot_swing(payload).savefig(picture, dpi=150)
    return [*files, str(picture)]


def _table(path: Path, columns: Mapping[str, Any]) -> str:
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        writer.writerows([repr(float(v)) for v in row] for row in zip(*columns.values(), strict=True))
    return str(path)
