"""Pictures of the shear tests."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any


def plot_shear(payload: Mapping[str, Any]):
    """Force and recovered shear moment against the shear angle, beside the law's; a matplotlib Figure."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.5, 3.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    angle = payload["angle_deg"]
    frame = payload["method"] == "frame"
    left.plot(angle, payload["force_N"], "C0o-", ms=4, label="finite elements")
    left.plot(angle, payload["expected_force_N"], "k--", lw=1, label="homogeneous shear" if frame else "inextensible yarns")
    left.set_ylabel("force, N")
    right.plot(angle, payload["shear_moment_N_per_m"], "C0o-", ms=4, label="recovered by the kinematics")
    right.plot(angle, payload["law_moment_N_per_m"], "k--", lw=1, label="the law's")
    right.set_ylabel("shear moment per area, N/m")
    for axes in (left, right):
        axes.set_xlabel("shear angle of the kinematics, °")
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    figure.suptitle(f"{payload['fabric']}, {'picture frame' if frame else 'bias extension'}", fontsize=10)
    return figure


def save_pictures(folder: Path, payload: Mapping[str, Any]) -> list[str]:
    """Write ``shear_<method>.png`` and, for the bias strip, ``shear_field.png``; returns the paths."""
    figures = {f"shear_{payload['method']}.png": plot_shear(payload)}
    if "field" in payload:
        from material_tests.strip.plots import plot_field

        figures["shear_field.png"] = plot_field(payload["field"], f"{payload['fabric']}, bias extension, last angle")
    paths = []
    for name, figure in figures.items():
        figure.savefig(Path(folder) / name, dpi=150)
        paths.append(str(Path(folder) / name))
    return paths
