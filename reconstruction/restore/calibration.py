"""Whether cameras can give a shape: enough of them, near enough to each other for depths, and in metres."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mfar_fem.errors import InputError
from reconstruction.landmarks import INDEX
from reconstruction.shape.landmarks3d import SpacePoints
from reconstruction.sources import SourceSet
from reconstruction.stereo.view import ANGLE, View

QUARTER = 0.25
"""Between the shoulders, and from the neckline down to the waist, over the stature: 0.22 to 0.31 on twenty garments of the
benchmark (seeds 1 to 5 of each type)."""
UNITS = {1000.0: "millimetres", 100.0: "centimetres", 1 / 0.3048: "feet", 1 / 0.0254: "inches", 0.001: "kilometres"}
"""How many make a metre."""
DOUBTFUL, FACTOR = 1.5, 2.5
"""Sizes of the landmarks further off than the first are worth a look: badly found landmarks (of hats by the shipped detector 1.6)
or an uncommon figure; further than the second they are another unit, the nearest to a metre being the foot."""


def check_pictures(sources: SourceSet) -> None:
    """Two pictures at least need both camera and mask.

    Raises
    ------
    InputError
        Names what each of the others lacks.
    """
    lacks = {x.name: [what for what, there in (("camera", x.camera), ("mask", x.mask)) if there is None] for x in sources.sources}
    complete = sum(not what for what in lacks.values())
    if complete < 2:
        missing = "; ".join(f"'{name}' lacks {' and '.join(what)}" for name, what in lacks.items() if what)
        raise InputError(
            f"{sources.path}: a shape in space needs two pictures at least that have both 'camera' and 'mask'; "
            f"{complete} of {len(lacks)} {'has' if complete == 1 else 'have'}" + (f": {missing}" if missing else "")
        )


def depth_findings(views: Sequence[View]) -> list[str]:
    """What a user must know if no two views are near enough for depths."""
    if any(view.neighbours(views) for view in views):
        return []
    return [f"No two pictures with cameras look within {np.degrees(ANGLE):.0f}° of each other: there is no depth from pictures, "
            "the shape rests on outlines and landmarks alone."]  # fmt: skip


def scale_of(points: SpacePoints, stature: float) -> float | None:
    """Size of the landmarks over that of a figure of this stature (m); None where no length can be measured.

    Two lengths are known of every wearer, :data:`QUARTER`. One alone may come of a mistaken landmark: where there are both, the
    one nearer to what is expected counts.
    """
    spans = [_between(points, "left_shoulder", "right_shoulder")]
    necks, waists = (_middle(points, part) for part in ("neckline", "waist"))
    if necks is not None and waists is not None:
        spans.append(float(np.linalg.norm(necks - waists)))
    ratios = [span / (QUARTER * stature) for span in spans if span is not None and span > 0]
    return min(ratios, key=lambda r: abs(np.log(r)), default=None)


def check_scale(points: SpacePoints, stature: float) -> list[str]:
    """Landmarks must have about the size of a figure.

    Returns
    -------
    list of str
        What a user must know if they are more than :data:`DOUBTFUL` times too large or too small.

    Raises
    ------
    InputError
        They are more than :data:`FACTOR` times too large or too small: cameras not in metres.
    """
    scale = scale_of(points, stature)
    if scale is None or 1 / DOUBTFUL <= scale <= DOUBTFUL:
        return []
    times, size = (scale, "large") if scale > 1 else (1 / scale, "small")
    if times <= FACTOR:
        return [f"The landmarks in space are {times:.2g} times too {size} for a figure of {stature:g} m: look at the keypoints, "
                "and at 'height' and the cameras' unit (metres) in sources.toml."]  # fmt: skip
    factor, unit = min(UNITS.items(), key=lambda known: abs(np.log(known[0] / scale)))
    likely = abs(np.log(factor / scale)) < np.log(FACTOR)
    raise InputError(
        f"the landmarks in space are about {times:.3g} times too {size} for a figure of {stature:g} m: the cameras are likely not "
        f"in metres{f' but in {unit}' if likely else ''}. A camera must take points in metres to pixels: multiply the left 3x3 "
        f"block of every matrix by {factor if likely else scale:.3g}, or correct 'height' in sources.toml"
    )


def _between(points: SpacePoints, first: str, second: str) -> float | None:
    length = float(np.linalg.norm(points.points[INDEX[first]] - points.points[INDEX[second]]))
    return length if np.isfinite(length) else None


def _middle(points: SpacePoints, part: str) -> np.ndarray | None:
    middle = 0.5 * (points.points[INDEX[f"left_{part}"]] + points.points[INDEX[f"right_{part}"]])
    return middle if np.isfinite(middle).all() else None
