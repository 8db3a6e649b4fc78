"""Pictures of the inflation tests."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np


def plot_inflation(payload: Mapping[str, Any]):
    """Computed beside exact: the membrane's or balloon's profile, or pressure against stretch; a matplotlib Figure."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0, 4.0), layout="constrained")
    axes = figure.add_subplot()
    case = payload["case"]
    if case == "hencky":
        from material_tests.inflation.hencky import exact

        solution = exact(payload["nu"])
        axes.plot(solution.rho, solution.deflection, "k-", lw=1, label=f"Föppl, integrated: {solution.centre:.4f}")
        axes.plot(payload["rho"], payload["deflection"], "C0.", ms=3, label=f"finite elements: {payload['centre']:.4f}")
        axes.set_xlabel("r / a")
        axes.set_ylabel("w / a (p a / E h)$^{1/3}$")
    elif case == "mylar":
        profile, closed = payload["profile"], payload["exact"]
        axes.plot(profile["r"], profile["z"], "C0-", lw=2, label="finite elements, one meridian")
        axes.plot([closed["radius"], 0.0], [0.0, 0.5 * closed["thickness"]], "kx", label="exact rim and pole")
        axes.plot([0.0, 1.0], [0.0, 0.0], "0.7", lw=1, label="flat disc")
        axes.set_aspect("equal")
        axes.set_xlabel("r / a")
        axes.set_ylabel("z / a")
    else:
        from material_tests.inflation.sphere import exact as pressure

        stretch = np.linspace(1.0, max(payload["stretch"]), 200)
        axes.plot(stretch, pressure(stretch), "k-", lw=1, label="exact")
        axes.plot(payload["stretch"], payload["pressure"], "C0o", ms=4, label="finite elements")
        axes.set_xlabel("stretch")
        axes.set_ylabel("p R / (μ h)")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    axes.set_title(f"{case}, order {payload['order']}", fontsize=10)
    return figure


def save_pictures(folder: Path, payload: Mapping[str, Any]) -> list[str]:
    """Write ``inflation_<case>.png``; returns its path in a list."""
    path = Path(folder) / f"inflation_{payload['case']}.png"
    plot_inflation(payload).savefig(path, dpi=150)
    return [str(path)]
