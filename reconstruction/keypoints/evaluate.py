"""How far predicted points are from the truth: RMSE, PCK, by group, with bootstrap intervals over identities and seeds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mfar_fem.errors import ParameterError
from reconstruction.keypoints.crops import crop_matrix, image_box, read_image
from reconstruction.keypoints.data import Sample
from reconstruction.landmarks import INDEX, LANDMARKS

THRESHOLDS = (0.05, 0.1, 0.2)
WITHIN = 8.0
"""Distance that confidences are about, pixels of the 256 × 192 input (a 32nd of its height)."""


@dataclass(frozen=True)
class Errors:
    """Distances of predictions from the truth for n images.

    Attributes
    ----------
    pixels : numpy.ndarray, shape (n, 12)
        In image pixels; NaN where a point is absent.
    input_pixels : numpy.ndarray, shape (n, 12)
        In pixels of the 256 × 192 crop of the image.
    relative : numpy.ndarray, shape (n, 12)
        Over the figure's torso (see :func:`torso`).
    visible : numpy.ndarray of bool, shape (n, 12)
    style, split, identity : numpy.ndarray of str, shape (n,)
    damage : numpy.ndarray of int, shape (n,)
    """

    pixels: np.ndarray
    input_pixels: np.ndarray
    relative: np.ndarray
    visible: np.ndarray
    style: np.ndarray
    split: np.ndarray
    identity: np.ndarray
    damage: np.ndarray

    def select(self, rows: np.ndarray) -> Errors:
        """Some of the images."""
        return Errors(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


def torso(sample: Sample) -> float:
    """The length that PCK is relative to, image pixels: from the middle of the shoulders to the middle of the waist, else the
    width of the shoulders, else half the diagonal of the box of the present points."""
    p, here = sample.keypoints, sample.present

    def has(*names):
        return all(here[INDEX[n]] for n in names)

    def at(name):
        return p[INDEX[name]]

    length = 0.0
    if has("left_shoulder", "right_shoulder", "left_waist", "right_waist"):
        length = float(np.linalg.norm(at("left_shoulder") + at("right_shoulder") - at("left_waist") - at("right_waist")) / 2)
    if not length and has("left_shoulder", "right_shoulder"):
        length = float(np.linalg.norm(at("left_shoulder") - at("right_shoulder")))
    if not length and here.sum() > 1:
        length = 0.5 * float(np.linalg.norm(np.ptp(p[here], axis=0)))
    return length if length > 0 else float("nan")


def errors(points: np.ndarray, samples: Sequence[Sample], scales: np.ndarray | None = None) -> Errors:
    """Distances of points (n, 12, 2), image pixels, from the truth.

    Parameters
    ----------
    points : numpy.ndarray
    samples : sequence of Sample
    scales : numpy.ndarray, shape (n,), optional
        Input pixels per image pixel (from the detector's matrices); else found from the boxes or, opening them, the images.
    """
    wanted = (len(samples), len(LANDMARKS), 2)
    if points.shape != wanted:
        raise ParameterError(f"points have shape {points.shape}; for {len(samples)} samples they need {wanted}")
    present = np.array([s.present for s in samples])
    truth = np.where(present[..., None], np.array([s.keypoints for s in samples]), np.nan)
    pixels = np.linalg.norm(points - truth, axis=-1)
    if scales is None:
        scales = np.array([crop_matrix(s.box if s.box else image_box(read_image(s.image_path).shape), 0.0)[0, 0] for s in samples])
    size = np.array([torso(s) for s in samples])
    visible = np.array([s.visible for s in samples]) & present
    known = (np.array([getattr(s, name) for s in samples]) for name in ("style", "split", "identity", "damage"))
    return Errors(pixels, pixels * scales[:, None], pixels / size[:, None], visible, *known)


def join(parts: Sequence[Errors]) -> Errors:
    """Errors of several sets of images as one."""
    return Errors(*(np.concatenate([getattr(p, name) for p in parts]) for name in Errors.__dataclass_fields__))


def _statistics(squares, input_squares, hits, count, thresholds) -> dict[str, np.ndarray]:
    """RMSE and PCK from sums over distances, for any number of replicates."""
    with np.errstate(invalid="ignore", divide="ignore"):
        out = {"rmse_px": np.sqrt(squares / count), "rmse_input_px": np.sqrt(input_squares / count)}
        return out | {f"pck@{t:g}": hits[..., i] / count for i, t in enumerate(thresholds)}


def summary(
    runs: Sequence[Errors], mask: Callable[[Errors], np.ndarray] | None = None, *, thresholds=THRESHOLDS, replicates: int = 1000,
    seed: int = 0,
) -> dict[str, float]:
    """RMSE and PCK over several runs (seeds) of the same images, with 95 % percentile intervals.

    Parameters
    ----------
    runs : sequence of Errors
        One a seed.
    mask : callable, optional
        ``mask(errors)``: which of the (n, 12) distances count; all of present points without it.
    thresholds : sequence of float
        Of PCK, fractions of the torso.
    replicates : int
        Bootstrap samples; identities and runs are both drawn with replacement. 0 for no intervals.
    seed : int

    Returns
    -------
    dict
        ``n`` (distances a run), ``within`` (share within :data:`WITHIN`), ``rmse_px``, ``rmse_input_px``, ``median_px``,
        ``median_input_px``, ``pck@…``, and each but ``n``, ``within`` and the medians with ``…_low`` and ``…_high``.
    """
    names = np.unique(np.concatenate([r.identity for r in runs]))
    shape = (len(runs), len(names))
    squares, input_squares, count = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    hits, all_pixels, all_input = np.zeros((*shape, len(thresholds))), [], []
    for i, run in enumerate(runs):
        use = np.isfinite(run.pixels) & (mask(run) if mask is not None else True)
        who = np.broadcast_to(np.searchsorted(names, run.identity)[:, None], use.shape)[use]
        squares[i] = np.bincount(who, run.pixels[use] ** 2, len(names))
        input_squares[i] = np.bincount(who, run.input_pixels[use] ** 2, len(names))
        count[i] = np.bincount(who, minlength=len(names))
        for k, t in enumerate(thresholds):
            hits[i, :, k] = np.bincount(who, run.relative[use] <= t, len(names))
        all_pixels.append(run.pixels[use])
        all_input.append(run.input_pixels[use])
    pixels = np.concatenate(all_pixels)
    overall = _statistics(squares.sum(), input_squares.sum(), hits.sum((0, 1)), count.sum(), thresholds)
    result: dict[str, float] = {"n": int(count[0].sum())}
    for name, parts in (("median_px", all_pixels), ("median_input_px", all_input)):
        result[name] = float(np.median(np.concatenate(parts))) if pixels.size else float("nan")
    result["within"] = float(np.mean(np.concatenate(all_input) <= WITHIN)) if pixels.size else float("nan")
    result |= {k: float(v) for k, v in overall.items()}
    if replicates and pixels.size:
        rng = np.random.default_rng(seed)
        people = rng.multinomial(len(names), np.full(len(names), 1 / len(names)), replicates).astype(float)
        seeds = rng.multinomial(len(runs), np.full(len(runs), 1 / len(runs)), replicates).astype(float)
        sums = [np.einsum("rs,sp,rp->r", seeds, a, people) for a in (squares, input_squares, count)]
        many = _statistics(sums[0], sums[1], np.einsum("rs,spk,rp->rk", seeds, hits, people), sums[2], thresholds)
        for name, values in many.items():
            result[f"{name}_low"], result[f"{name}_high"] = (float(q) for q in np.nanquantile(values, [0.025, 0.975]))
    return result


def _where(field: str, value: object) -> Callable[[Errors], np.ndarray]:
    """Mask of the images of a style or a level of damage."""
    return lambda e: np.broadcast_to((getattr(e, field) == value)[:, None], e.pixels.shape)


def seen_in(split: str) -> Callable[[Errors], np.ndarray]:
    """Mask of the visible points of a split."""
    return lambda e: e.visible & (e.split == split)[:, None]


def _point(index: int) -> Callable[[Errors], np.ndarray]:
    """Mask of one point."""
    return lambda e: np.broadcast_to(np.arange(len(LANDMARKS)) == index, e.pixels.shape)


def table(runs: Sequence[Errors], replicates: int = 1000, seed: int = 0) -> list[dict[str, object]]:
    """:func:`summary` of all points, visible and hidden ones, every style, level of damage and point; rows with ``group``,
    ``value``."""
    groups: list[tuple[str, str, Callable[[Errors], np.ndarray]]] = [
        ("all", "all", lambda e: np.isfinite(e.pixels)),
        ("seen", "visible", lambda e: e.visible),
        ("seen", "hidden", lambda e: ~e.visible),
    ]
    groups += [("style", str(v), _where("style", v)) for v in np.unique(np.concatenate([r.style for r in runs]))]
    for v in np.unique(np.concatenate([r.split for r in runs])):
        groups += [("split", str(v), _where("split", v)), ("split", f"{v}, visible", seen_in(v))]
    groups += [("damage", str(v), _where("damage", v)) for v in np.unique(np.concatenate([r.damage for r in runs]))]
    groups += [("point", name, _point(k)) for k, name in enumerate(LANDMARKS)]
    return [{"group": g, "value": v, **summary(runs, mask, replicates=replicates, seed=seed)} for g, v, mask in groups]


def paired_difference(a: Sequence[Errors], b: Sequence[Errors], mask: Callable[[Errors], np.ndarray] | None = None, *,
                      replicates: int = 2000, seed: int = 0) -> dict[str, float]:
    """RMSE (input pixels) of `a` minus that of `b` on the same images, with a paired bootstrap over identities and runs.

    Parameters
    ----------
    a, b : sequence of Errors
        Runs over the same images.
    mask : callable, optional
        As of :func:`summary`.
    replicates, seed : int
        Of the bootstrap.

    Returns
    -------
    dict
        ``difference``, ``low``, ``high`` (95 %), and ``share_below_zero`` of the replicates (`a` better).
    """
    if len(a) != len(b) or any(not np.array_equal(x.identity, y.identity) for x, y in zip(a, b, strict=True)):
        raise ParameterError("the two sides are not paired: they need the same number of runs over the same images")
    names = np.unique(np.concatenate([r.identity for r in a]))
    squares, count = np.zeros((2, len(a), len(names))), np.zeros((len(a), len(names)))
    for side, runs in enumerate((a, b)):
        for i, run in enumerate(runs):
            use = np.isfinite(run.pixels) & (mask(run) if mask is not None else True)
            who = np.broadcast_to(np.searchsorted(names, run.identity)[:, None], use.shape)[use]
            squares[side, i] = np.bincount(who, run.input_pixels[use] ** 2, len(names))
            count[i] = np.bincount(who, minlength=len(names))
    rng = np.random.default_rng(seed)
    people = rng.multinomial(len(names), np.full(len(names), 1 / len(names)), replicates).astype(float)
    seeds = rng.multinomial(len(a), np.full(len(a), 1 / len(a)), replicates).astype(float)
    weight = np.einsum("rs,sp,rp->r", seeds, count, people)
    rmse = np.sqrt(np.einsum("rs,tsp,rp->tr", seeds, squares, people) / weight)
    change = rmse[0] - rmse[1]
    point = np.sqrt(squares.sum((1, 2)) / count.sum())
    low, high = np.nanquantile(change, [0.025, 0.975])
    return {"difference": float(point[0] - point[1]), "low": float(low), "high": float(high),
            "share_below_zero": float(np.mean(change < 0))}
