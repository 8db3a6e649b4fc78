"""Pictures of the spectrum test."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np


def plot_spectrum(payload: Mapping[str, Any]):
    """Radial spectra beside the similarity on its nulls; a matplotlib Figure."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    radial, unit = payload["radial"], payload["length_unit"]
    for key, colour in (("first", "C0"), ("second", "C1")):
        left.loglog(radial["frequency"], radial[f"{key}_amplitude"], color=colour, label=payload[key]["name"])
        left.axvline(1.0 / payload[key]["wavelength"], color=colour, ls=":")
    left.set_xlabel(f"frequency, 1/{unit}")
    left.set_ylabel("amplitude (root mean square over a ring)")
    left.legend(fontsize=8)
    names = list(payload["nulls"])
    for row, name in enumerate(names):
        null = payload["nulls"][name]
        right.plot([null["low_95"], null["high_95"]], [row, row], color="0.5", lw=6, solid_capstyle="butt")
        right.plot(null["mean"], row, "k|", ms=14)
    right.axvline(payload["similarity"], color="C3", label=f"measured {payload['similarity']:.3f}")
    right.axvspan(0.936, 0.964, color="C2", alpha=0.2, label="the paper's range, without nulls")
    right.set_yticks(np.arange(len(names)), names)
    right.set_xlim(0.0, 1.02)
    right.set_ylim(-0.6, len(names) - 0.4)
    right.set_xlabel("similarity (bars: 95 % of the null)")
    right.legend(fontsize=8, loc="lower left")
    return figure


def save_pictures(folder: Path, payload: Mapping[str, Any]) -> list[str]:
    """Write ``spectrum.png``; returns its path in a list."""
    path = Path(folder) / "spectrum.png"
    plot_spectrum(payload).savefig(path, dpi=150)
    return [str(path)]
