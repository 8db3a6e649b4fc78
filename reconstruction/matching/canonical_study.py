"""Does the canonical frame make pictures of different kinds match? Counted on synthetic garments, whose every point is known."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mfar_fem.errors import NotConvergedError
from reconstruction.keypoints_file import ImageKeypoints
from reconstruction.libraries import opencv
from reconstruction.matching.canonical import REACH, canonical_features, matches
from reconstruction.matching.features import detect
from reconstruction.matching.settings import MatchSettings
from reconstruction.measure.canonical import PIXELS_PER_METRE
from reconstruction.measure.frame import TooFewPointsError

TOLERANCE = 0.03
"""Distance on the worn garment within which a match is right, m."""
VARIANTS = ("as they are", "canonical frame", f"canonical frame, within {100 * REACH:.0f} cm")


def study(kinds: Sequence[str] = ("round-collar-robe", "half-sleeve"), seeds: int = 3, size: float = 0.03,
          progress: Callable[..., None] | None = None) -> dict[str, Any]:
    """Match all pairs of pictures of synthetic garments with SIFT in three ways, the true landmarks given.

    Parameters
    ----------
    kinds : sequence of str
        Types of garment.
    seeds : int
        Garments of each type.
    size : float
        Edge length of the cloth's mesh, m.
    progress : callable, optional
        Called after each garment.

    Returns
    -------
    dict
        ``rows``: by kinds of picture and variant the pairs, mean matches, mean right ones (within :data:`TOLERANCE` on the worn
        garment), their share and what it would be with partners drawn at random, pairs with at least 8 right ones.
    """
    counts: dict[tuple[str, str], list[tuple[int, int, float]]] = {}
    left_out, failed = 0, 0
    for kind in kinds:
        for seed in range(seeds):
            try:
                pictures, few = _pictures(kind, seed, size)
            except NotConvergedError:
                failed += 1
                continue
            left_out += few
            for a, b in itertools.combinations(pictures, 2):
                pair = " – ".join(sorted((a["style"], b["style"])))
                for variant, reach in zip(VARIANTS, (None, None, REACH), strict=True):
                    what = "plain" if variant == VARIANTS[0] else "canonical"
                    found = matches(a[what], b[what], reach)
                    apart = np.linalg.norm(a[f"{what} world"][found[:, 0]] - b[f"{what} world"][found[:, 1]], axis=1)
                    luck = _chance(a, b, what, found[:, 0], reach)
                    counts.setdefault((pair, variant), []).append((len(found), int((apart <= TOLERANCE).sum()), luck))
            if progress is not None:
                progress()
    rows = []
    for (pair, variant), each in sorted(counts.items(), key=lambda item: (item[0][0], VARIANTS.index(item[0][1]))):
        n = np.array(each)
        rows.append({"kinds": pair, "variant": variant, "pairs": len(n), "matches": float(n[:, 0].mean()),
                     "right": float(n[:, 1].mean()), "precision": float(n[:, 1].sum() / max(1, n[:, 0].sum())),
                     "chance": float(n[:, 2].sum() / max(1, n[:, 0].sum())),
                     "pairs_with_8": int((n[:, 1] >= 8).sum())})  # fmt: skip
    return {"rows": rows, "garments": len(kinds) * seeds - failed, "pictures_left_out": left_out, "tolerance_m": TOLERANCE,
            "landmarks": "true ones in sight"}


def _chance(a: dict[str, Any], b: dict[str, Any], what: str, chosen: np.ndarray, reach: float | None) -> float:
    """Right matches to be expected of the chosen points of A if any point of B that counts were as good as another."""
    if not len(chosen):
        return 0.0
    right = np.linalg.norm(a[f"{what} world"][chosen, None] - b[f"{what} world"], axis=2) <= TOLERANCE
    counts = np.ones_like(right)
    if reach is not None:
        counts = np.linalg.norm(a[what].points[chosen, None] - b[what].points, axis=2) <= reach * PIXELS_PER_METRE
    return float(((right & counts).sum(axis=1) / np.maximum(counts.sum(axis=1), 1)).sum())


def _pictures(kind: str, seed: int, size: float) -> tuple[list[dict[str, Any]], int]:
    """Features of every picture of a garment, with the place on the worn garment of each (NaN off the cloth)."""
    from reconstruction.benchmark import keypoints
    from reconstruction.benchmark.case import KINDS, PICTURES
    from reconstruction.benchmark.identity import model, shoot, shots
    from reconstruction.benchmark.splits import Identity, seeds_of

    made = model(Identity(f"C{seed:04d}", kind, "test", 0, *seeds_of(seed, 2, KINDS.index(kind))), size)
    settings, out, few = MatchSettings(), [], 0
    for shot in shots(made.identity)[:PICTURES]:
        rgb, _, camera, scene = shoot(made, shot)
        hits = scene.caster.image(camera)
        cloth = (hits.face >= 0) & (hits.face < len(made.mesh.faces))
        world = np.full((*hits.face.shape, 3), np.nan)
        at = made.draped.vertices[made.mesh.faces[hits.face[cloth]]]
        weights = np.zeros((*hits.face.shape, 3))
        weights[hits.face >= 0] = hits.weights[hits.face >= 0]
        world[cloth] = np.einsum("nk,nkj->nj", weights[cloth], at)
        points = made.arrays["flat_keypoints" if shot.style == "textile" else "keypoints"]
        seen = made.arrays["present"] & np.asarray(keypoints.visible(points, camera, scene.caster))
        pixels = np.full((len(points), 2), np.nan)
        pixels[seen] = camera.project(points[seen])[0]
        image = ImageKeypoints.of(shot.label, shot.style, pixels, figure=None if shot.style == "textile" else made.spec.sex)
        plain = detect(opencv().cvtColor(rgb, opencv().COLOR_RGB2GRAY), settings)
        try:
            canonical, back = canonical_features(rgb, image, settings)
        except TooFewPointsError:
            few += 1
            continue
        out.append({"style": shot.style, "plain": plain, "plain world": _at(world, plain.points), "canonical": canonical,
                    "canonical world": _at(world, back)})  # fmt: skip
    return out, few


def _at(field: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Values at the nearest pixels, NaN outside."""
    x, y = np.round(points).astype(int).T if len(points) else (np.zeros(0, int),) * 2
    inside = (x >= 0) & (y >= 0) & (x < field.shape[1]) & (y < field.shape[0])
    out = np.full((len(points), 3), np.nan)
    out[inside] = field[y[inside], x[inside]]
    return out
