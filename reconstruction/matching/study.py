"""What the matching is worth on photographs whose cameras are known: SIFT and ALIKED, RANSAC and MAGSAC, in one table.

Inliers say that matches agree with each other, not that they are right. Every pair is therefore judged twice: blindly, by inliers,
chance and degeneracy, and by the given cameras. A control repeats some pairs with every picture turned by a right angle under the
old cameras: the inliers stay, the distance to the cameras tells. The same test is made of the data: pairs whose matches agree with
the cameras much better once both pictures are turned by 180 degrees are named (a picture stored upside down).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import InputError
from reconstruction.illumination import correct
from reconstruction.images import grey, load
from reconstruction.matching.cameras import baseline_angle, fundamental, read_matrix, read_middlebury, scaled
from reconstruction.matching.epipolar import sampson_distance
from reconstruction.matching.features import Features, detect
from reconstruction.matching.nearest import flann_precision
from reconstruction.matching.pair import match_pair
from reconstruction.matching.settings import MatchSettings

SETS = ("alicevision_buddha", "middlebury_templeRing", "sceaux_castle")
SHORT = np.radians(20.0)
"""Angle between two views up to which a baseline counts as short, rad."""
VARIANTS: dict[str, MatchSettings] = {
    "SIFT + RANSAC": MatchSettings(),
    "SIFT + MAGSAC": MatchSettings(estimator="magsac"),
    "SIFT, formula (2) alone + RANSAC": MatchSettings(quantile=0.05, ratio=1.0, mutual=False),
}
LIT = "SIFT + RANSAC, light corrected"
ALIKED = "ALIKED + MAGSAC"


@dataclass(frozen=True, eq=False)
class View:
    """A photograph: name, file and, where it is known, its camera (3, 4)."""

    name: str
    path: Path
    camera: np.ndarray | None = None


def buddha(folder: Path) -> list[View]:
    """The AliceVision Buddha: pictures at half size, cameras of the full size (CC BY 4.0)."""
    files = sorted(folder.glob("*_half.jpg"))
    return [View(f.name[:5], f, scaled(read_matrix(folder / f"{f.name[:5]}_P.txt"), 0.5)) for f in files]


def temple(folder: Path) -> list[View]:
    """The Middlebury temple ring."""
    return [View(name[:-4], folder / name, camera) for name, camera in read_middlebury(folder / "templeR_par.txt").items()]


def sceaux(folder: Path) -> list[View]:
    """Sceaux castle, without cameras."""
    return [View(re.sub(r"_x0\.4$", "", f.stem), f) for f in sorted(folder.glob("*.jpg"))]


def study(data_dir, weights=None, sets: Sequence[str] = SETS, most_views: int | None = None,
          progress: Callable[[int, int, str], None] | None = None) -> dict[str, Any]:
    """Match neighbouring views of the sets with every variant.

    Parameters
    ----------
    data_dir : str or path-like
        Folder that holds those of ``alicevision_buddha``, ``middlebury_templeRing`` and ``sceaux_castle``.
    weights : str or path-like, optional
        ALIKED weights; without them that variant is left out (and ``notes`` says so).
    sets : sequence of str
        Which of them.
    most_views : int, optional
        First views of each set only.
    progress : callable, optional
        Called with steps done, of how many, and a label.

    Returns
    -------
    dict
        ``pairs``: a row a pair and variant; ``summary``: a row a set and variant; ``control``: pairs turned by a right angle;
        ``flann``: share of true nearest neighbours that FLANN finds; ``notes``.

    Raises
    ------
    InputError
        A folder of pictures is missing.
    """
    data_dir = Path(data_dir)
    for name in sets:
        if name not in SETS:
            raise InputError(f"there is no set '{name}'; known: {', '.join(SETS)}")
        if not (data_dir / name).is_dir():
            raise InputError(f"'{data_dir}' holds no folder '{name}'; give with --data the folder of {', '.join(SETS)}")
    variants = {**VARIANTS, LIT: MatchSettings()}
    notes = []
    if weights is not None:
        variants[ALIKED] = MatchSettings(detector="aliked", weights=str(weights), estimator="magsac")
    else:
        notes.append("ALIKED left out: no weights were given")
    views = {name: _READERS[name](data_dir / name)[:most_views] for name in sets}
    pairs, control, flann = [], [], []
    total, done = sum(len(v) for v in views.values()) * len(variants), 0
    for name, found in views.items():
        cached: dict[tuple, list[Features]] = {}
        for variant, settings in variants.items():
            look = (settings.detector, variant == LIT)
            if look not in cached:
                cached[look] = list(_features(found, settings, variant == LIT))
            for i, j in neighbours(found):
                row = pair_row(found[i], found[j], cached[look][i], cached[look][j], settings)
                pairs.append({"set": name, "variant": variant} | row)
            done += len(found)
            if progress is not None:
                progress(done, total, f"{name}, {variant}")
        if cached.get(("sift", False)):
            first, second = cached[("sift", False)][:2]
            flann.append({"set": name, "precision": flann_precision(first.descriptors, second.descriptors, MatchSettings())})
        control += [{"set": name} | row for row in turned(found)] if found and found[0].camera is not None else []
    return {"pairs": pairs, "summary": summary(pairs), "control": control, "flann": flann,
            "notes": notes + stored_upside_down(pairs)}  # fmt: skip


_READERS: dict[str, Callable[[Path], list[View]]] = dict(zip(SETS, (buddha, temple, sceaux), strict=True))


def neighbours(views: Sequence[View]) -> list[tuple[int, int]]:
    """Indices of views that follow one another."""
    return [(i, i + 1) for i in range(len(views) - 1)]


def _features(views: Sequence[View], settings: MatchSettings, lit: bool) -> Iterator[Features]:
    for view in views:
        rgb = load(view.path).rgb
        rgb = correct(rgb).rgb if lit else rgb
        yield detect(grey(rgb), settings, rgb)


def pair_row(a: View, b: View, features_a: Features, features_b: Features, settings: MatchSettings) -> dict:
    """Row of a pair; ``blind`` is the verdict that needs no cameras, ``right`` that of the cameras on it."""
    known = None if a.camera is None or b.camera is None else (a.camera, b.camera)
    result = match_pair(features_a, features_b, settings, (a.name, b.name), known)
    blind = result.matched or result.status == "failed: against the cameras"
    angle = float(np.degrees(baseline_angle(*known))) if known else float("nan")
    right = None if known is None else bool(result.inliers and result.sampson_cameras <= settings.camera_tolerance)
    over = float("nan")
    if known is not None and result.mask.any():
        over = upside_down(result.points[result.mask], fundamental(*known), (features_a.size, features_b.size))
    return {"angle_deg": angle, "blind": blind, "right": right, "median_sampson_upside_down_px": over} | result.row()


def upside_down(points: np.ndarray, matrix: np.ndarray, sizes: tuple[tuple[int, int], tuple[int, int]]) -> float:
    """Median Sampson distance of matches (m, 4) to a fundamental matrix once both pictures are turned by 180 degrees, px."""
    turned = np.array([*sizes[0], *sizes[1]]) - 1.0 - points
    return float(np.median(sampson_distance(matrix, turned[:, :2], turned[:, 2:])))


def stored_upside_down(pairs: Sequence[dict]) -> list[str]:
    """A sentence for each set with accepted pairs that agree with the cameras at least five times better upside down."""
    found: dict[str, list[str]] = {}
    for row in pairs:
        if row["blind"] and row["median_sampson_cameras_px"] > 5 * row["median_sampson_upside_down_px"]:
            label = f"{row['a']}-{row['b']}"
            if label not in found.setdefault(row["set"], []):
                found[row["set"]].append(label)
    return [f"{name}: {len(labels)} pairs agree with their cameras only when both pictures are turned by 180 degrees, so these are "
            f"stored upside down: {', '.join(labels)}" for name, labels in found.items()]  # fmt: skip


def summary(pairs: Sequence[dict]) -> list[dict]:
    """Per set and variant: pairs matched, degenerate, failed; false and missed ones by the cameras; medians over matched pairs."""
    rows = []
    for name, variant in dict.fromkeys((row["set"], row["variant"]) for row in pairs):
        chosen = [row for row in pairs if (row["set"], row["variant"]) == (name, variant)]
        matched = [row for row in chosen if row["blind"]]
        short = [row for row in matched if row["angle_deg"] <= np.degrees(SHORT)]
        rows.append({
            "set": name, "variant": variant, "pairs": len(chosen), "accepted_blindly": len(matched),
            "degenerate": sum(row["status"].startswith("degenerate") for row in chosen),
            "accepted_but_wrong": sum(row["right"] is False for row in matched),
            "putative": sum(row["putative"] for row in matched), "inliers": sum(row["inliers"] for row in matched),
            "median_rate": _median(row["rate"] for row in matched),
            "median_sampson_px": _median(row["median_sampson_px"] for row in matched),
            "median_sampson_cameras_px": _median(row["median_sampson_cameras_px"] for row in matched),
            "worst_short_baseline_px": max((row["median_sampson_cameras_px"] for row in short), default=float("nan")),
            "worst_either_way_up_px": max((min(row["median_sampson_cameras_px"], row["median_sampson_upside_down_px"])
                                           for row in short), default=float("nan")),
        })  # fmt: skip
    return rows


def turned(views: Sequence[View], pairs: Sequence[tuple[int, int]] | None = None) -> list[dict]:
    """The control: pairs as they are, and with both pictures turned by 90 degrees under the same cameras."""
    settings = replace(MatchSettings(), camera_tolerance=1000.0)  # the verdict is left to the reader
    rows = []
    for i, j in pairs or neighbours(views)[:: max(1, len(views) // 4)]:
        for turn in (0, 1):
            found = []
            for view in (views[i], views[j]):
                grey = np.rot90(load(view.path).grey, turn)
                found.append(detect(grey, settings))
            row = pair_row(views[i], views[j], found[0], found[1], settings)
            rows.append({"turned": bool(turn), **{key: row[key] for key in _CONTROL}})
    return rows


_CONTROL = ("a", "b", "angle_deg", "putative", "inliers", "log10_nfa", "median_sampson_px", "median_sampson_cameras_px")


def _median(values) -> float:
    found = [value for value in values if np.isfinite(value)]
    return float(np.median(found)) if found else float("nan")
