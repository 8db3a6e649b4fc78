"""Picture of a wrinkled sheet."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np


def plot_wrinkles(payload: Mapping[str, Any]):
    """Heights over the sheet, and energy against wavelength where several starts were tried; a matplotlib Figure."""
    from matplotlib.figure import Figure

    surface, branches = payload["surface"], payload["branches"]
    x, y, z = (1e3 * np.asarray(surface[key]) for key in ("x_m", "y_m", "z_m"))
    several = len(branches) > 1
    figure = Figure(figsize=(9.0 if several else 6.5, 3.6), layout="constrained")
    axes = figure.subplots(1, 2 if several else 1, squeeze=False, width_ratios=(2, 1) if several else (1,))[0]
    size = max(np.abs(z).max(), 1e-12)
    picture = axes[0].tripcolor(x, y, np.asarray(surface["triangles"]), z, cmap="RdBu_r", vmin=-size, vmax=size, shading="gouraud")
    axes[0].set_aspect("equal")
    axes[0].set_xlabel("mm")
    axes[0].set_title(f"{payload['case']}, strain {payload['strain']:.3g}: wavelength {1e3 * payload['wavelength_m']:.3g} mm, "
                      f"law {1e3 * payload['law_wavelength_m']:.3g} mm", fontsize=9)
    figure.colorbar(picture, ax=axes[0], label="height, mm", shrink=0.8)
    if several:
        axes[1].plot([1e3 * b["wavelength_m"] for b in branches], [1e3 * b["energy_J"] for b in branches], "ko")
        axes[1].axvline(1e3 * payload["law_wavelength_m"], color="C3", ls="--", label="scaling law")
        axes[1].set_xlabel("wavelength found, mm")
        axes[1].set_ylabel("energy, mJ")
        axes[1].legend(fontsize=8)
    return figure


def save_pictures(folder: Path, payload: Mapping[str, Any]) -> list[str]:
    """Write ``wrinkles_<case>.png``; returns its path in a list."""
    path = Path(folder) / f"wrinkles_{payload['case']}.png"
    plot_wrinkles(payload).savefig(path, dpi=150)
    return [str(path)]
