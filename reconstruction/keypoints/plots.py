"""Pictures: points over images, heat maps, reliability, loss curves, and the table of a study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from reconstruction.keypoints.calibration import Reliability
from reconstruction.keypoints.crops import warp
from reconstruction.keypoints.predict import Predictions
from reconstruction.landmarks import INDEX, LANDMARKS

BONES = tuple(
    (INDEX[a], INDEX[b])
    for side in ("left", "right")
    for a, b in (
        (f"{side}_neckline", f"{side}_shoulder"), (f"{side}_shoulder", f"{side}_elbow"), (f"{side}_elbow", f"{side}_wrist"),
        (f"{side}_shoulder", f"{side}_waist"), (f"{side}_waist", f"{side}_ankle"),
    )
) + tuple((INDEX[f"left_{p}"], INDEX[f"right_{p}"]) for p in ("neckline", "waist"))
"""Lines of the drawn skeleton, index pairs."""
SIDE_COLOURS = ("#d1495b", "#00798c")  # the wearer's left and right


def _figure(*args, **options):
    import matplotlib

    matplotlib.use("Agg", force=False)
    import matplotlib.pyplot as plt

    return plt.subplots(*args, **options)


def _save(figure, path: str | Path) -> None:
    import matplotlib.pyplot as plt

    figure.savefig(path, dpi=130, bbox_inches="tight")
    plt.close(figure)


def draw_points(ax, image: np.ndarray, points: np.ndarray, confidence: np.ndarray | None = None, truth: np.ndarray | None = None,
                least: float = 0.2) -> None:
    """Draw an image with points (12, 2) and skeleton: filled discs, more transparent the less sure; below `least` hollow and
    without bones. Truth (12, 2), NaN where absent, as black crosses joined to the points by thin lines."""
    sure = np.ones(len(LANDMARKS)) if confidence is None else confidence
    h, w = image.shape[:2]
    ax.imshow(image, extent=(-0.5, w - 0.5, h - 0.5, -0.5))
    for a, b in BONES:
        if min(sure[a], sure[b]) >= least:
            ax.plot(*points[[a, b]].T, color="white", lw=2.6, alpha=0.8, solid_capstyle="round")
            ax.plot(*points[[a, b]].T, color="#444444", lw=1.2, solid_capstyle="round")
    for k, (x, y) in enumerate(points):
        colour = SIDE_COLOURS[k % 2]
        if truth is not None and np.isfinite(truth[k]).all():
            ax.plot([x, truth[k, 0]], [y, truth[k, 1]], color=colour, lw=0.8)
            ax.plot(*truth[k], "x", color="black", ms=4, mew=1.1, zorder=4)
        hollow = sure[k] < least
        ax.scatter(x, y, s=30, facecolor="none" if hollow else colour, edgecolor=colour if hollow else "white", linewidth=1.0,
                   alpha=0.4 + 0.6 * float(np.clip(sure[k], 0, 1)), zorder=3)
    ax.set(xlim=(-0.5, w - 0.5), ylim=(h - 0.5, -0.5), xticks=[], yticks=[])


def save_predictions(images: Sequence[np.ndarray], predictions: Predictions, path: str | Path, titles: Sequence[str] | None = None,
                     truth: Sequence[np.ndarray] | None = None, columns: int = 4) -> None:
    """Sheet of images with their predictions."""
    columns = min(columns, len(images))
    rows = -(-len(images) // columns)
    aspect = max(i.shape[0] / i.shape[1] for i in images)
    figure, axes = _figure(rows, columns, figsize=(2.6 * columns, 3.1 * aspect * rows + 0.4), layout="constrained", squeeze=False)
    for ax in axes.flat[len(images) :]:
        ax.axis("off")
    for i, (ax, image) in enumerate(zip(axes.flat, images, strict=False)):
        there = np.where((predictions.present[i] >= 0.5)[:, None], predictions.points[i], np.nan)
        draw_points(ax, image, there, predictions.confidence[i], None if truth is None else truth[i])
        low = LANDMARKS[int(np.argmin(predictions.confidence[i]))].replace("_", " ")
        text = f"least sure: {low} {predictions.confidence[i].min():.2f}"
        ax.set_title((f"{_short(titles[i])}\n" if titles else "") + text, fontsize=7)
    marks = [axes.flat[0].scatter([], [], color=c, s=30) for c in SIDE_COLOURS]
    labels = ["wearer's left", "wearer's right"]
    if truth is not None:
        marks.append(axes.flat[0].plot([], [], "x", color="black")[0])
        labels.append("truth")
    figure.legend(marks, labels, loc="outside lower center", ncol=3, fontsize=8, frameon=False)
    _save(figure, path)


def _short(title: str, longest: int = 34) -> str:
    """A long name without its middle."""
    half = (longest - 1) // 2
    return title if len(title) <= longest else f"{title[:half]}…{title[-half:]}"


def save_heatmaps(image: np.ndarray, matrix: np.ndarray, heatmaps: np.ndarray, path: str | Path) -> None:
    """The crop of an image with each of its heat maps (12, 64, 48) over it."""
    crop = warp(image, matrix)
    h, w = crop.shape[:2]
    grey = np.repeat(crop.mean(axis=2, keepdims=True), 3, axis=2).astype(np.uint8)
    figure, axes = _figure(2, 6, figsize=(12, 5.6), layout="constrained")
    extent = (-0.5, w - 0.5, h - 0.5, -0.5)
    shown = None
    for k, name in enumerate(LANDMARKS):
        ax = axes[k % 2, k // 2]  # left points above their right ones
        ax.imshow(grey, extent=extent)
        value = np.clip(heatmaps[k], 0, 1)
        shown = ax.imshow(value, extent=extent, cmap="magma", vmin=0, vmax=1, alpha=np.clip(0.25 + value, 0, 0.9))
        ax.set_title(f"{name.replace('_', ' ')}: {heatmaps[k].max():.2f}", fontsize=8)
        ax.set(xticks=[], yticks=[])
    figure.colorbar(shown, ax=axes, shrink=0.8, label="heat map")
    _save(figure, path)


def save_reliability(before: Reliability, after: Reliability, path: str | Path, within: float) -> None:
    """Reliability diagram before and after calibration, with the expected calibration errors."""
    figure, (ax, below) = _figure(2, 1, figsize=(4.6, 5.6), sharex=True, height_ratios=(3, 1))
    ax.plot([0, 1], [0, 1], color="0.6", lw=1)
    for r, label, colour in ((before, "height of the peak", "#edae49"), (after, "calibrated", "#00798c")):
        ax.plot(r.confidence, r.fraction, color=colour, lw=1, label=f"{label}: calibration error {r.error:.3f}")
        ax.scatter(r.confidence, r.fraction, s=10 + 150 * r.count / r.count.sum(), color=colour)  # the area shows the number
        below.bar(r.confidence, r.count, width=0.035, color=colour, alpha=0.7)
    ax.set(ylabel=f"fraction within {within:g} px of 256 × 192", xlim=(0, 1), ylim=(0, 1))
    ax.legend(fontsize=8, frameon=False, loc="lower right")
    below.set(xlabel="confidence", ylabel="points")
    _save(figure, path)


def save_curves(history: Sequence[Mapping[str, float]], path: str | Path, best: int | None = None) -> None:
    """Loss curves of a run: error of the heat maps, knowledge term, validation, and the validation RMSE."""
    epoch = [row["epoch"] + 1 for row in history]
    figure, (ax, right) = _figure(1, 2, figsize=(9, 3.4))
    for key, label, colour in (("mse", "training, heat maps", "#00798c"), ("validation_mse", "validation, heat maps", "#d1495b"),
                               ("knowledge", "training, knowledge", "#edae49")):
        values = np.array([row[key] for row in history])
        if values.any():
            ax.plot(epoch, values, label=label, color=colour)
    ax.set(xlabel="epoch", ylabel="error", yscale="log")
    ax.legend(fontsize=8, frameon=False)
    right.plot(epoch, [row["validation_rmse_px"] for row in history], color="#d1495b")
    right.set(xlabel="epoch", ylabel="validation RMSE, px of 256 × 192", ylim=(0, None))
    for a in (ax, right):
        if best is not None and best >= 0:
            a.axvline(best + 1, color="0.7", lw=0.8, ls="--")
    _save(figure, path)


def save_study(rows: Sequence[Mapping[str, object]], path: str | Path) -> None:
    """Bars of RMSE and PCK@0.1 with their 95 % intervals, one row a method."""
    names = [str(r["method"]) for r in rows]
    place = np.arange(len(rows))[::-1]
    figure, axes = _figure(1, 2, figsize=(9, 0.42 * len(rows) + 1.2), sharey=True)
    shown = {"rmse_input_px": "RMSE, px of 256 × 192", "pck@0.1": "PCK at 0.1 of the torso"}
    for ax, (key, label) in zip(axes, shown.items(), strict=True):
        value = np.array([r[key] for r in rows], float)
        low, high = (np.array([r[f"{key}_{side}"] for r in rows], float) for side in ("low", "high"))
        colours = ["#00798c" if r.get("kind") == "network" else "#b8b8b8" for r in rows]
        ax.barh(place, value, color=colours, height=0.65)
        ax.hlines(place, low, high, color="black", lw=1.2)
        ax.set(xlabel=label, xlim=(0, None))
    axes[0].set_yticks(place, names)
    _save(figure, path)
