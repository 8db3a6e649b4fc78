"""What a detector is worth on the test pictures of a benchmark, beside methods that do not look and one that others trained."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from reconstruction.keypoints.data import Sample
from reconstruction.keypoints.evaluate import Errors, errors, paired_difference, summary
from reconstruction.keypoints.predict import Detector
from reconstruction.keypoints.study import baselines_of, outside, split
from reconstruction.landmarks import PARTS

TEST = "test"
"""The split of held-out identities of known types; "test-…" are held-out types."""


def score(samples: Sequence[Sample], detector: Detector, *, mask_boxes=None, blazepose: str | Path | None = None,
          replicates: int = 1000, progress: Callable[..., None] | None = None) -> dict[str, Any]:
    """Errors of a detector by what is seen, style, damage and point, with baselines and paired differences from them.

    Parameters
    ----------
    samples : sequence of Sample
        With the splits train (for the baselines) and test. Levels of damage that only test pictures have count as held out.
    detector : Detector
        Looked with as it is and without the mirrored picture.
    mask_boxes : callable, optional
        Boxes of the garments' masks (see :func:`reconstruction.keypoints.study.run`).
    blazepose : path-like, optional
        Weights of BlazePose.
    replicates : int
        Of the bootstrap over identities.
    progress : callable, optional
        ``progress(total=n)`` at the start, ``progress(number of pictures done)``.

    Returns
    -------
    dict
        ``rows`` (``method``, ``group`` and what :func:`reconstruction.keypoints.evaluate.summary` gives; held-out identities and
        points in sight if the group does not say otherwise), ``differences`` (detector minus each baseline, points in sight).
    """
    training, _, test = split(samples)
    if progress is not None:
        progress(0, total=2 * len(test))
    found = {}
    for flip in (True, False):
        p = replace(detector, flip=flip).predict_samples(test, progress=progress)
        found[flip] = errors(p.points, test, p.scale)
    ours, rows = found[True], []

    def add(method: str, group: str, where: np.ndarray, e: Errors = ours) -> None:
        if (np.isfinite(e.pixels) & where).any():
            rows.append({"method": method, "group": group, **summary([e], lambda _: where, replicates=replicates)})

    held_out = sorted({s.damage for s in test} - {s.damage for s in training})
    groups = _groups(ours, held_out)
    seen = groups["in sight"]
    for group, where in groups.items():
        add("detector", group, where)
    add("detector, without the mirrored picture", "in sight", seen, found[False])
    differences = {}
    for name, e in baselines_of(training, test, mask_boxes).items():
        add(name, "in sight", seen, e)
        differences[name] = paired_difference([ours], [e], lambda _: seen, replicates=replicates)
    if blazepose is not None:
        theirs, shared = outside(training, test, blazepose)
        both = seen & shared(ours)
        add("detector", "in sight, points of BlazePose on figures", both)
        for name, e in theirs.items():
            add(name, "in sight, points of BlazePose on figures", both, e)
            differences[name] = paired_difference([ours], [e], lambda _: both, replicates=replicates)
    return {"rows": rows, "differences": differences}


def _groups(e: Errors, held_out_damage: Sequence[int]) -> dict[str, np.ndarray]:
    """Which of the distances (n, 12) count, by name of the group."""
    test = np.broadcast_to((e.split == TEST)[:, None], e.pixels.shape)
    seen, hidden = test & e.visible, test & ~e.visible
    groups = {"in sight": seen}
    if held_out_damage:
        groups["in sight, damage seen in training"] = seen & ~np.isin(e.damage, held_out_damage)[:, None]
    for style in np.unique(e.style):
        groups[f"in sight, {style}"] = seen & (e.style == style)[:, None]
    for level in np.unique(e.damage):
        held = ", held out" if level in held_out_damage else ""
        groups[f"in sight, damage {level}{held}"] = seen & (e.damage == level)[:, None]
    groups |= {"hidden": hidden, "in sight and hidden": test}
    for i, part in enumerate(PARTS):
        of_part = np.arange(2 * len(PARTS)) // 2 == i  # left and right lie beside each other
        groups |= {f"in sight, {part}": seen & of_part, f"hidden, {part}": hidden & of_part}
    for held_out in np.unique(e.split[e.split != TEST]):
        groups[f"in sight, held-out {str(held_out).removeprefix('test-')}"] = e.visible & (e.split == held_out)[:, None]
    return groups
