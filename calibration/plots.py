"""Pictures of a calibration, as matplotlib figures without a window system."""

from __future__ import annotations

import base64
import functools
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from calibration.experiments import KINDS, Experiment
from calibration.words import short

COLOURS = {"warp": "#0072B2", "weft": "#D55E00", "bias": "#009E73"}
OTHERS = ("#CC79A7", "#E69F00", "#56B4E9", "#666666")
STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "svg.fonttype": "none",
    "figure.dpi": 100,
}


def styled(function):
    """Runs a plotting function in the house style."""

    @functools.wraps(function)
    def inside(*args, **settings):
        import matplotlib

        with matplotlib.rc_context(STYLE):
            return function(*args, **settings)

    return inside


def colour(e: Experiment, index: int = 0) -> str:
    """Colour of a direction."""
    return COLOURS.get(e.direction_name, OTHERS[index % len(OTHERS)])


def figure(rows: int = 1, columns: int = 1, width: float = 7.0, height: float = 4.0):
    """A figure with axes, shape (rows, columns)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    fig = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(fig)
    return fig, fig.subplots(rows, columns, squeeze=False)


def save(fig, folder: Path, name: str) -> list[str]:
    """Write NAME.png and NAME.svg; returns the file names."""
    import matplotlib

    with matplotlib.rc_context(STYLE | {"svg.hashsalt": name}):
        fig.savefig(folder / f"{name}.png", dpi=150)
        fig.savefig(folder / f"{name}.svg", metadata={"Date": None})
    return [f"{name}.png", f"{name}.svg"]


@styled
def as_data_uri(fig) -> str:
    """The figure as a PNG data URI, for a page that needs no other file."""
    stream = io.BytesIO()
    fig.savefig(stream, format="png", dpi=110)
    return "data:image/png;base64," + base64.b64encode(stream.getvalue()).decode("ascii")


@styled
def curves(experiments: Sequence[Experiment], predictions: Mapping[str, Sequence[np.ndarray]], title: str = ""):
    """Measured points and predicted lines, one panel an experiment.

    ``predictions`` maps a label (fit, homogeneous, ...) to one array an experiment; the first is drawn solid.
    """
    columns = min(3, len(experiments))
    rows = -(-len(experiments) // columns)
    fig, axes = figure(rows, columns, 3.1 * columns, 2.7 * rows)
    for k, (e, ax) in enumerate(zip(experiments, axes.flat, strict=False)):
        x = 100 * e.x if e.kind == "strip" else np.arange(1, len(e) + 1)
        ax.plot(x, e.y, "o", ms=3.6, mfc="white", mec=colour(e, k), label="measured", zorder=3)
        for j, (label, arrays) in enumerate(predictions.items()):
            y = np.where(np.isfinite(arrays[k]), arrays[k], np.nan)
            ax.plot(x, y, ("-", "--", ":")[j % 3], color=colour(e, k) if j == 0 else "#444444", lw=1.5, label=label)
        top = max(np.nanmax(e.y), 1e-12)
        ax.set_ylim(min(0.0, 1.1 * e.y.min()), 1.35 * top)
        ax.set_title(e.name, fontsize=9)
        ax.set_xlabel("engineering strain (%)" if e.kind == "strip" else "specimen")
        ax.set_ylabel(f"{KINDS[e.kind][2]} ({KINDS[e.kind][3]})")
        ax.legend(fontsize=7.5, loc="upper left")
    for ax in list(axes.flat)[len(experiments) :]:
        ax.set_visible(False)
    if title:
        fig.suptitle(title, fontsize=10)
    return fig


@styled
def residual_plot(experiments: Sequence[Experiment], predicted: Sequence[np.ndarray]):
    """Prediction minus measurement in % of the range, over strain as a fraction of each curve's largest."""
    fig, axes = figure(1, 1, 7.0, 2.8)
    ax = axes[0, 0]
    ax.axhline(0, color="#888888", lw=0.8)
    for k, (e, y) in enumerate(zip(experiments, predicted, strict=True)):
        x = e.x / e.x.max() if e.kind == "strip" else (np.arange(len(e)) + 0.5) / len(e)
        ax.plot(x, 100 * (np.asarray(y) - e.y) / e.scale, "o-", ms=3, lw=1, color=colour(e, k), label=e.name)
    ax.set_xlabel("strain / largest strain of the curve")
    ax.set_ylabel("predicted − measured (% of range)")
    ax.legend(fontsize=7.5, ncols=min(3, len(experiments)))
    return fig


@styled
def correlation_map(names: Sequence[str], correlation: np.ndarray):
    """Heat map of the parameters' correlation with its numbers."""
    p = len(names)
    fig, axes = figure(1, 1, 2.2 + 0.55 * p, 1.2 + 0.5 * p)
    ax = axes[0, 0]
    ax.grid(False)
    image = ax.imshow(np.nan_to_num(correlation), cmap="RdBu_r", vmin=-1, vmax=1)
    labels = [short(n) for n in names]
    ax.set_xticks(range(p), labels, rotation=45, ha="right")
    ax.set_yticks(range(p), labels)
    for i in range(p):
        for j in range(p):
            c = correlation[i, j]
            text = f"{c:.2f}" if np.isfinite(c) else "?"
            ax.text(j, i, text, ha="center", va="center", fontsize=7.5, color="white" if abs(c) > 0.65 else "black")
    fig.colorbar(image, ax=ax, shrink=0.8, label="correlation")
    return fig


@styled
def profile_plots(profiles: Mapping, units: Mapping[str, str], scales: Mapping[str, str]):
    """Profiles: sqrt(delta) over the parameter, with the level of the interval."""
    shown = {k: p for k, p in profiles.items() if np.isfinite(p.threshold)}
    if not shown:
        return None
    columns = min(4, len(shown))
    rows = -(-len(shown) // columns)
    fig, axes = figure(rows, columns, 2.4 * columns, 2.1 * rows)
    for (name, p), ax in zip(shown.items(), axes.flat, strict=False):
        root = np.sqrt(np.maximum(p.delta, 0.0))
        ok = np.isfinite(root)
        limit = np.sqrt(p.threshold)
        ax.plot(p.values[ok], root[ok], "o-", ms=2.6, lw=1.1, color="#0072B2")
        ax.axhline(limit, color="#D55E00", lw=1, ls="--")
        ax.axvline(p.best, color="#888888", lw=0.8)
        ax.set_ylim(0, 1.6 * limit)
        near = ok & (root <= 1.6 * limit)
        if scales.get(name) == "log" and p.values[near].min() > 0 and p.values[near].max() > 20 * p.values[near].min():
            ax.set_xscale("log")
        elif near.sum() > 1:
            ax.set_xlim(p.values[near].min(), p.values[near].max())
        unit = units.get(name, "")
        ax.set_xlabel(short(name) + (f" ({unit})" if unit not in ("", "dimensionless") else ""))
        ax.tick_params(labelsize=7)
        if ax.get_xscale() == "linear":
            ax.locator_params(axis="x", nbins=4)
    for ax in list(axes.flat)[len(shown) :]:
        ax.set_visible(False)
    fig.supylabel("√(ΔSSR / s²)", fontsize=9)
    return fig


@styled
def law_bars(rows: Sequence[Mapping]):
    """RMSE of every fitted law, overall and by experiment."""
    rows = [r for r in rows if "rmse_by_experiment" in r]
    names = list(rows[0]["rmse_by_experiment"])
    fig, axes = figure(1, 1, 7.4, 0.8 + 0.5 * len(rows))
    ax = axes[0, 0]
    y = np.arange(len(rows))[::-1]
    height = 0.8 / (len(names) + 1)
    for j, name in enumerate([*names, "all"]):
        values = [r["rmse_percent_of_range"] if name == "all" else r["rmse_by_experiment"][name] for r in rows]
        key = name.split(",")[0]
        shade = "#222222" if name == "all" else COLOURS.get(key, OTHERS[j % len(OTHERS)])
        ax.barh(y + 0.4 - (j + 0.5) * height, values, height * 0.9, color=shade, label=name)
    ax.set_yticks(y, [r["law"] for r in rows])
    ax.set_xlabel("RMSE (% of force range)")
    ax.grid(axis="y", visible=False)
    ax.legend(fontsize=7.5)
    return fig


@styled
def interval_bars(rows: Sequence[Mapping]):
    """Error by strain interval, one group an experiment (rows of `calibration.validation.by_interval`)."""
    names = list(dict.fromkeys(r["experiment"] for r in rows))
    bins = list(dict.fromkeys(r["interval"] for r in rows))
    fig, axes = figure(1, 1, 7.4, 3.0)
    ax = axes[0, 0]
    width = 0.8 / len(names)
    for j, name in enumerate(names):
        found = {r["interval"]: r["rmse_percent_of_range"] for r in rows if r["experiment"] == name}
        x = np.array([bins.index(b) for b in found]) + (j - (len(names) - 1) / 2) * width
        values = [np.nan if v is None else v for v in found.values()]
        shade = COLOURS.get(name.split(",")[0], OTHERS[j % len(OTHERS)])
        ax.bar(x, values, 0.9 * width, color=shade, alpha=1.0 if j < 3 else 0.5, label=name)
    ax.set_xticks(range(len(bins)), bins)
    ax.set_xlabel("strain interval")
    ax.set_ylabel("RMSE (% of range)")
    ax.grid(axis="x", visible=False)
    ax.legend(fontsize=7.5, ncols=2)
    return fig
