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
    """Warp, weft, bias and simple-shear curves up to `strain` or the largest stretch the law reaches below it.

    Parameters
    ----------
    law : Law
    strain : float, optional
        Largest strain; 0.25 if omitted. A curve that locks before stops at 96 % of the strain it can reach.
    count : int
        Points a curve.
    """
    out = {}
    for label, (mode, direction) in _CASES.items():
        end = 0.25 if strain is None else strain
        end = _reach(law, mode, direction, end)
        x = np.linspace(0.0, end, count)
        r = respond(law, mode, direction, x if mode == "simple-shear" else 1.0 + x, strict=False)
        out[label] = DrawnCurve(x[r.converged], r.stress[r.converged])
    return out


def _reach(law, mode, direction, end):
    """The largest strain up to `end` the law reaches, a little short of locking."""
    x = np.linspace(0.0, end, 201)
    r = respond(law, mode, direction, x if mode == "simple-shear" else 1.0 + x, strict=False)
    last = len(x) - 1 if r.converged.all() else max(int(np.argmin(r.converged)) - 1, 1)
    return float(x[last]) if last == len(x) - 1 else 0.96 * float(x[last])


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
    fig, axes = plt.subplots(1, 2, figsize=(10.0, 4.0), layout="constrained")
    for label, c in drawn.items():
        ax = axes[1] if label == "shear" else axes[0]
        colour, dash = _STYLE[label]
        ax.plot(100.0 * c.strain, c.stress / factor, dash, color=colour, lw=2.0, label=label)
    axes[0].set(xlabel="engineering strain / %", ylabel=f"nominal stress / {unit}", title="uniaxial tension")
    axes[1].set(xlabel="amount of shear / %", ylabel=f"nominal shear stress / {unit}", title="simple shear along the warp")
    axes[0].legend(frameon=False)
    for ax in axes:
        ax.set_xlim(left=0.0)
        ax.grid(True, lw=0.5, alpha=0.4)
        ax.spines[["top", "right"]].set_visible(False)
    fig.suptitle(repr(law), fontsize=9, wrap=True)
    fig.savefig(path, dpi=150)
    plt.close(fig)
