"""Pictures of the strip test: the curve beside the shortcuts, and the strain field on the deformed mesh."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

_FIELDS = {"shear_angle_rad": ("shear angle, °", 180.0 / np.pi, "viridis"),
           "longitudinal_strain": ("strain along the strip, %", 100.0, "magma"),
           "lateral_strain": ("strain across the strip, %", 100.0, "cividis")}


def plot_field(field: Mapping[str, Any], title: str = ""):
    """Deformed mesh coloured by shear angle, longitudinal and lateral strain; a matplotlib Figure.

    Parameters
    ----------
    field : mapping
        `material_tests.strip.field.StrainField.to_dict`.
    """
    from matplotlib.figure import Figure

    x, y = 1e3 * np.asarray(field["x_m"]), 1e3 * np.asarray(field["y_m"])
    triangles = np.asarray(field["triangles"])
    shape = min(1.6, np.ptp(y) / np.ptp(x))
    figure = Figure(figsize=(11.0, 1.7 + 3.2 * shape), layout="constrained")
    for axes, (key, (label, factor, colours)) in zip(figure.subplots(1, len(_FIELDS)), _FIELDS.items(), strict=True):
        values = factor * np.asarray(field[key])
        flat = np.ptp(values) < 1e-9 * max(1.0, np.abs(values).max())
        limits = (values.mean() - 0.5, values.mean() + 0.5) if flat else (values.min(), values.max())
        picture = axes.tripcolor(x, y, triangles, values, cmap=colours, vmin=limits[0], vmax=limits[1], edgecolors="face",
                                 linewidth=0.2)
        axes.triplot(x, y, triangles, color="k", lw=0.15, alpha=0.35)
        axes.set_aspect("equal")
        axes.set_xlabel("mm")
        axes.set_title(label, fontsize=10)
        figure.colorbar(picture, ax=axes, orientation="horizontal", shrink=0.9)
    figure.suptitle(title or f"strip stretched by {100 * field['strain']:.3g} %", fontsize=11)
    return figure


def plot_levels(payload: Mapping[str, Any], measured: tuple | None = None):
    """Force by width against strain: finite elements, the two shortcuts and, if given, measured (strain, N/m)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    axes = figure.add_subplot()
    styles = {"fe": ("C0-", "finite elements (grips)"), "free": ("C1--", "homogeneous, width and shear free"),
              "held": ("C2:", "homogeneous, width and shear held")}
    curves = payload["curves"]
    for name, (style, label) in styles.items():
        if name in curves and len(curves[name]["strain"]):
            axes.plot(100 * np.asarray(curves[name]["strain"]), curves[name]["line_force_N_per_m"], style, lw=1.8, label=label)
    if measured is not None:
        axes.plot(100 * np.asarray(measured[0]), measured[1], "ko", ms=4, mfc="none", label="measured")
    top = np.asarray(curves["fe" if "fe" in curves else "free"]["line_force_N_per_m"]).max(initial=0.0)
    if measured is not None:
        top = max(top, np.max(measured[1]))
    axes.set_ylim(0.0, 1.15 * top if top > 0 else 1.0)
    axes.set_xlabel("engineering strain, %")
    axes.set_ylabel("force per undeformed width, N/m")
    axes.set_title(f"{payload['fabric']}, {payload['law']}, {payload['angle_deg']:.4g}° from the warp", fontsize=10)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=9)
    return figure


def save_pictures(folder: Path, payload: Mapping[str, Any]) -> list[str]:
    """Write ``strip_levels.png`` and, where a field is there, ``strip_field.png``; returns the paths."""
    figures = {"strip_levels.png": plot_levels(payload)}
    if payload.get("field"):
        title = (f"{payload['fabric']}, {payload['angle_deg']:.4g}° from the warp, stretched by "
                 f"{100 * payload['field']['strain']:.3g} %")
        figures["strip_field.png"] = plot_field(payload["field"], title)
    paths = []
    for name, figure in figures.items():
        figure.savefig(folder / name, dpi=150)
        paths.append(str(folder / name))
    return paths
