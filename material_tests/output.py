"""Curves, shapes and plots of the virtual tests as files."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from material_tests.elastica import STANDARD_ANGLE

_STYLE = {"fe": "-", "free": "-.", "held": "--"}


def save_strip(folder: Path, payload: Mapping[str, Any]) -> list[str]:
    """Write ``strip.csv`` (one row a point and curve) and ``strip.png``; returns the paths."""
    from matplotlib.figure import Figure

    target = folder / "strip.csv"
    with target.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(["curve", "strain_-", "line_force_N_per_m", "force_N"])
        for name, curve in payload["curves"].items():
            columns = zip(curve["strain"], curve["line_force_N_per_m"], curve["force_N"], strict=True)
            writer.writerows([name, *(repr(float(value)) for value in row)] for row in columns)
    figure = Figure(figsize=(6.0, 4.2), layout="constrained")
    axes = figure.add_subplot()
    for name, curve in payload["curves"].items():
        axes.plot(curve["strain"], curve["line_force_N_per_m"], _STYLE.get(name, "-."), label=_label(name))
    largest = [max(map(float, curve["line_force_N_per_m"]), default=0.0) for curve in payload["curves"].values()]
    if min(largest) > 0 and max(largest) > 50 * min(largest):
        axes.set_yscale("log")
    axes.set_xlabel("engineering strain")
    axes.set_ylabel("force per undeformed width, N/m")
    axes.set_title(f"{payload['fabric']}, {payload['angle_deg']:.4g}° from the warp")
    axes.grid(alpha=0.3)
    axes.legend()
    picture = folder / "strip.png"
    figure.savefig(picture, dpi=150)
    return [str(target), str(picture)]


def save_cantilever(folder: Path, payload: Mapping[str, Any]) -> list[str]:
    """Write ``cantilever.csv`` (the shape) and ``cantilever.png``; returns the paths."""
    from matplotlib.figure import Figure

    shape, loop = payload["shape"], payload["option"] == "B"
    target = folder / "cantilever.csv"
    with target.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(["s_m", "x_m", "y_m"])
        writer.writerows([repr(float(v)) for v in row] for row in zip(*shape.values(), strict=True))
    figure = Figure(figsize=(5.2, 4.4), layout="constrained")
    axes = figure.add_subplot()
    x, y = ([1e3 * float(value) for value in shape[key]] for key in ("x_m", "y_m"))
    axes.plot(x, y, color="C0", lw=2, label="strip")
    if loop:
        axes.plot([-value for value in x], y, color="C0", lw=2)
        axes.plot([0], [0], "ks", ms=6, label="clamp")
    else:
        reach = 1.15 * max(x)
        axes.plot([0, reach], [0, -reach * math.tan(STANDARD_ANGLE)], "k--", lw=1, label="41.5°")
        axes.plot([-0.4 * max(x), 0], [0, 0], color="k", lw=4)
    axes.set_aspect("equal")
    axes.set_xlabel("mm")
    axes.set_ylabel("mm")
    axes.set_title(f"{payload['fabric']}, {payload['standard']}, {payload['angle_deg']:.4g}°", fontsize=10)
    axes.grid(alpha=0.3)
    axes.legend(loc="center" if loop else "upper right")
    picture = folder / "cantilever.png"
    figure.savefig(picture, dpi=150)
    return [str(target), str(picture)]


def _label(name: str) -> str:
    meaning = {"fe": "finite elements (grips)",
               "free": "free width and shear (long strip)", "held": "width and shear held (short strip)"}
    return meaning.get(name, name)
