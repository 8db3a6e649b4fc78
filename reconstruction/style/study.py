"""Does style alignment help? Every method on scenes that no network was trained on, with the truth known to the pixel.

B is another rendering of the scene of A, in another kind and under a known homography. Judged are the look of the result against
A (colours, texture by fixed filters), what is left of B's structure, and the matches between A and the result, counted as right by
the homography. ``oracle kind`` is B drawn in A's kind, with colours of its own: what a perfect change of kind would give.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import permutations
from typing import Any

import numpy as np

from reconstruction.landmarks import KINDS
from reconstruction.style.bootstrap import mean_interval, ratio_interval
from reconstruction.style.match_rate import Matcher, MatchScore, score, sift_matches
from reconstruction.style.scenes import draw_scene, random_homography, view
from reconstruction.style.structure import edge_score, gradient_correlation, ssim
from reconstruction.style.style_distance import colour_distance, filter_statistics, network_distance, statistics_distance

Method = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""``method(image B, like A)``: the aligned B, pictures (h, w, 3) uint8."""
NONE, ORACLE = "none", "oracle kind"
HELD_OUT = 900_000
"""Seed of the scenes of the study; training never uses it."""


@dataclass(frozen=True)
class Record:
    """One method on one pair."""

    method: str
    scene: int
    like: str
    image: str
    colour: float
    texture: float
    network: float
    ssim: float
    edge: float
    gradient: float
    match: MatchScore


@dataclass(frozen=True, eq=False)
class Pair:
    """A, B, the homography from A to B, and B drawn in A's kind."""

    scene: int
    like_kind: str
    image_kind: str
    like: np.ndarray
    image: np.ndarray
    homography: np.ndarray
    oracle: np.ndarray


def pairs(scenes: int, size: int = 256, seed: int = HELD_OUT, kinds: Sequence[str] = KINDS) -> list[Pair]:
    """All ordered pairs of different kinds of each scene."""
    found = []
    for number in range(scenes):
        scene = draw_scene(np.random.default_rng([seed, number]))
        homography = random_homography(np.random.default_rng([seed, number, 1]), size)
        for a, b in permutations(kinds, 2):
            rngs = [np.random.default_rng([seed, number, 2 + k, KINDS.index(kind)]) for k, kind in enumerate((a, b, a))]
            found.append(Pair(number, a, b, view(scene, a, rngs[0], size), view(scene, b, rngs[1], size, homography),
                              homography, view(scene, a, rngs[2], size, homography)))
    return found


def evaluate(methods: Mapping[str, Method], compared: Sequence[Pair], features: Any = None, matcher: Matcher = sift_matches,
             progress: Callable[[int, str], None] | None = None) -> list[Record]:
    """Apply every method, and none, to every pair.

    Parameters
    ----------
    methods : mapping of name to callable
        See :data:`Method`.
    compared : sequence of Pair
    features : feature network, optional
        For a third distance in look; one that no method was trained with. NaN without.
    matcher : callable
        See :data:`reconstruction.style.match_rate.Matcher`.
    progress : callable, optional
        ``progress(pairs done, method)``.
    """
    records = []
    for done, pair in enumerate(compared):
        wanted = filter_statistics(pair.like)
        for name in (NONE, *methods, ORACLE):
            made = pair.image if name == NONE else pair.oracle if name == ORACLE else methods[name](pair.image, pair.like)
            records.append(Record(
                name, pair.scene, pair.like_kind, pair.image_kind,
                colour_distance(pair.like, made), statistics_distance(wanted, filter_statistics(made)),
                np.nan if features is None else network_distance(features, pair.like, made),
                ssim(pair.image, made), edge_score(pair.image, made), gradient_correlation(pair.image, made),
                score(pair.like, made, pair.homography, matcher),
            ))
            if progress is not None:
                progress(done + 1, name)
    return records


def summary(records: Sequence[Record]) -> dict[str, dict[str, dict[str, float]]]:
    """Mean and 95 % interval over scenes of every quantity, by method.

    ``matches`` and ``correct`` are means a pair; ``precision`` is right over all matches proposed; ``consistent`` the mean number
    of RANSAC's inliers and ``consistent_right`` the share of them that is right; ``registered`` the share of pairs whose estimated
    homography is right to 10 px at the corners; ``correct_gain`` the paired difference in right matches to doing nothing.
    """
    table = {}
    base = {(r.scene, r.like, r.image): r for r in records if r.method == NONE}
    for method in dict.fromkeys(r.method for r in records):
        own = [r for r in records if r.method == method]
        groups = np.array([r.scene for r in own])
        plain = {f.name for f in fields(Record)} - {"method", "scene", "like", "image", "match"}
        row = {name: mean_interval(np.array([getattr(r, name) for r in own]), groups) for name in sorted(plain)}
        count = {name: np.array([getattr(r.match, name) for r in own], dtype=float)
                 for name in ("proposed", "correct", "inliers", "correct_inliers")}
        row["matches"] = mean_interval(count["proposed"], groups)
        row["correct"] = mean_interval(count["correct"], groups)
        row["precision"] = ratio_interval(count["correct"], count["proposed"], groups)
        row["consistent"] = mean_interval(count["inliers"], groups)
        row["consistent_right"] = ratio_interval(count["correct_inliers"], count["inliers"], groups)
        row["registered"] = mean_interval(np.array([float(r.match.registered()) for r in own]), groups)
        gain = np.array([r.match.correct - base[r.scene, r.like, r.image].match.correct for r in own])
        row["correct_gain"] = mean_interval(gain, groups)
        table[method] = {name: {"value": x.value, "low": x.low, "high": x.high} for name, x in row.items()}
    return table


def by_kinds(records: Sequence[Record]) -> list[dict[str, Any]]:
    """Means of matches, right matches and their ratio for each pair of kinds and method."""
    rows = []
    for like, image in permutations(KINDS, 2):
        for method in dict.fromkeys(r.method for r in records):
            own = [r.match for r in records if (r.method, r.like, r.image) == (method, like, image)]
            if own:
                proposed, correct = sum(m.proposed for m in own), sum(m.correct for m in own)
                rows.append({"like": like, "image": image, "method": method,
                             "matches": proposed / len(own), "correct": correct / len(own),
                             "precision": correct / proposed if proposed else 0.0,
                             "registered": float(np.mean([m.registered() for m in own]))})
    return rows


def verdict(table: Mapping[str, Mapping[str, Mapping[str, float]]]) -> list[str]:
    """Plain words on whether a method gives more right matches than doing nothing, and the networks more than the best baseline."""
    words = []
    for method, row in table.items():
        if method in (NONE, ORACLE):
            continue
        gain = row["correct_gain"]
        claim = "helps" if gain["low"] > 0 else "harms" if gain["high"] < 0 else "makes no significant difference"
        words.append(f"{method} {claim}: right matches a pair {gain['value']:+.2f} [{gain['low']:+.2f}, {gain['high']:+.2f}] "
                     f"against doing nothing; SSIM with B {row['ssim']['value']:.2f}; texture distance to A "
                     f"{row['texture']['value']:.2f} ({table[NONE]['texture']['value']:.2f} before)")
    return words
