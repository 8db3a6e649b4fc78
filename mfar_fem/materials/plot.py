"""Stress–strain curves of a law, to look at before any mesh exists."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .homogeneous import respond
from .law import Law

_CASES = {
    "warp": ("uniaxial", "warp"),
    "weft": ("uniaxial", "weft"),
    "bias": ("uniaxial", "bias"),
    "shear": ("simple-shear", "warp"),
}
#: Okabe–Ito colours and dashes, distinguishable without colour vision and in grey.
_STYLE = {
    "warp": ("#0072B2", "-"),
    "weft": ("#D55E00", "--"),
    "bias": ("#009E73", "-."),
    "shear": ("#CC79A7", ":"),
}


@dataclass(frozen=True)
class DrawnCurve:
    """Nominal stress against strain (stretch - 1, or amount of shear). *Shape:* (m,) each."""

    strain: np.ndarray
    stress: np.ndarray


def curves(law: Law, strain: float | None = None, count: int = 101) -> dict[str, DrawnCurve]:
    """Warp, weft, bias and simple-shear curves.

    Parameters
    ----------
    law : Law
    strain : float, optional
        Largest strain, or what the law reaches below it. If omitted: 0.25, or for a curve that locks before 0.5, 85 %
        of the strain it reaches.
    count : int
        Points a curve.
    """
    out = {}
    for label, (mode, direction) in _CASES.items():
        x = np.linspace(0.0, _end(law, mode, direction, strain), count)
        r = _respond(law, mode, direction, x)
        out[label] = DrawnCurve(x[r.converged], r.stress[r.converged])
    return out


def _respond(law, mode, direction, x):
    return respond(law, mode, direction, x if mode == "simple-shear" else 1.0 + x, strict=False)


def _end(law, mode, direction, strain):
    if strain is not None:
        return strain
    x = np.linspace(0.0, 0.5, 201)
    r = _respond(law, mode, direction, x)
    if r.converged.all():
        return 0.25
    return 0.85 * float(x[max(int(np.argmin(r.converged)) - 1, 1)])


def plot_curves(law: Law, drawn: dict[str, DrawnCurve], path: str | Path) -> None:
    """Write the curves to an image file."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    largest = max(float(np.abs(c.stress).max()) for c in drawn.values())
    factor, unit = 1.0, law.stress_unit
    if unit == "Pa":
        factor, unit = next((f, u) for f, u in ((1e9, "GPa"), (1e6, "MPa"), (1e3, "kPa"), (0.0, "Pa")) if largest >= f)
        factor = factor or 1.0
    panels = {"along the yarns": ("warp", "weft"), "on the bias (45 degrees)": ("bias",), "simple shear": ("shear",)}
    fig, axes = plt.subplots(1, 3, figsize=(11.0, 3.6), layout="constrained")
    for ax, (title, labels) in zip(axes, panels.items(), strict=True):
        for label in labels:
            colour, dash = _STYLE[label]
            ax.plot(100.0 * drawn[label].strain, drawn[label].stress / factor, dash, color=colour, lw=2.0, label=label)
        ax.set(xlabel="amount of shear / %" if labels == ("shear",) else "engineering strain / %", title=title)
        ax.set_xlim(left=0.0)
        ax.grid(True, lw=0.5, alpha=0.4)
        ax.spines[["top", "right"]].set_visible(False)
    axes[0].set_ylabel(f"nominal stress / {unit}")
    axes[0].legend(frameon=False)
    fig.suptitle(repr(law), fontsize=9, wrap=True)
    fig.savefig(path, dpi=150)
    plt.close(fig)
