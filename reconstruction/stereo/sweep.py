"""Depth of one view by sweeping a surface through space and comparing the pictures on it.

R. T. Collins, A space-sweep approach to true multi-image matching, CVPR 1996, doi:10.1109/CVPR.1996.517097. The surface that is
swept is a plane across the view's axis, or whatever is expected to be there, moved along the rays: with a good expectation
slanted cloth is compared without distortion. Likeness is the normalised cross-correlation of windows over all three colours,
which does not mind a change of the light.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mfar_fem.errors import InputError
from reconstruction.libraries import optional
from reconstruction.stereo.semiglobal import smooth
from reconstruction.stereo.view import View

NOISE = 3e-4
"""Variance of a window (three colours, 0 to 1) below which nothing can be told: it damps the correlation."""
PIXEL_SIGMA = 0.6
"""Standard deviation of a match, pixels: with 0.3 twice it held 54 to 65 % of the confirmed points of two benchmark garments."""
SMALL, LARGE = 0.04, 0.35
"""Penalties of semi-global smoothing, units of 1 - correlation."""


@dataclass(frozen=True, eq=False)
class DepthMap:
    """Depths along a view's axis.

    Attributes
    ----------
    view : View
    depth : (h, w) array
        m; NaN where nothing is known.
    score : (h, w) array
        Correlation there, -1 to 1.
    sigma : (h, w) array
        Standard deviation, m.
    """

    view: View
    depth: np.ndarray
    score: np.ndarray
    sigma: np.ndarray


class Compared:
    """A picture that others are compared with: what its windows have of their own is computed once.

    Parameters
    ----------
    image : (h, w, c) float32 array
        0 to 1.
    window : int
        Width, pixels.
    """

    def __init__(self, image, window: int = 9):
        cv2 = optional("cv2", "comparing pictures needs")
        self._blur = lambda v: cv2.blur(v, (window, window))
        self.image = np.asarray(image, dtype=np.float32)
        self._mean = self._blur(self.image)
        self._variance = (self._blur(self.image**2) - self._mean**2).sum(axis=2).clip(0)

    def with_(self, other) -> np.ndarray:
        """Normalised cross-correlation (h, w) with another picture of the same size, over all colours."""
        mean = self._blur(other)
        cross = (self._blur(self.image * other) - self._mean * mean).sum(axis=2)
        variance = (self._blur(other * other) - mean**2).sum(axis=2).clip(0)
        return cross / np.sqrt((self._variance + NOISE) * (variance + NOISE))


def correlation(a, b, window: int = 9) -> np.ndarray:
    """Normalised cross-correlation (h, w) of windows around every pixel, over all colours.

    Parameters
    ----------
    a, b : (h, w, c) float32 arrays
        0 to 1.
    window : int
        Width, pixels.
    """
    return Compared(a, window).with_(np.asarray(b, dtype=np.float32))


def sweep(view: View, others: Sequence[View], base, offsets, window: int = 9, least: float = 0.5) -> DepthMap:
    """Find the depth of every pixel of the mask.

    Parameters
    ----------
    view : View
    others : sequence of View
        Compared with it; the two most alike at a pixel count (one may not see it).
    base : float or (h, w) array
        Expected depth, m; NaN: not looked for.
    offsets : (n,) array
        Hypotheses: what is added to it, m, ascending and equally spaced.
    window : int
        Of the correlation, pixels.
    least : float
        Correlation below which a depth is thrown away.

    Returns
    -------
    DepthMap
        Half the pixel grid of a step fine (parabola through the best three).

    Raises
    ------
    InputError
        No other view, or less than three hypotheses.
    """
    cv2 = optional("cv2", "comparing pictures needs")
    offsets = np.asarray(offsets, dtype=float)
    if not others or len(offsets) < 3:
        raise InputError(
            f"a sweep compares a view with others at three depths at least; there are {len(others)} and {len(offsets)}"
        )
    base = np.array(np.broadcast_to(np.asarray(base, dtype=float), view.size))
    known = view.mask & np.isfinite(base)
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if not len(rows):
        nothing = np.full(view.size, np.nan)
        return DepthMap(view, nothing, nothing, nothing)
    top, left = max(rows[0] - window, 0), max(columns[0] - window, 0)
    box = (slice(top, rows[-1] + window + 1), slice(left, columns[-1] + window + 1))
    part, base = view.cropped(box), base[box]
    mask = part.mask & np.isfinite(base)
    start, rays = np.nan_to_num(base, nan=float(np.nanmean(base))), part.grid_rays()
    pictures = [np.dstack([other.image, other.mask.astype(np.float32)]) for other in others]
    compared = Compared(part.image, window)
    cost = np.ones((*part.size, len(offsets)), dtype=np.float32)
    for k, offset in enumerate(offsets):
        points = part.centre + (start + offset)[..., None] * rays
        likeness = []
        for other, picture in zip(others, pictures, strict=True):
            pixels, depth = other.project(points)
            moved = cv2.remap(picture, pixels.astype(np.float32), None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
            found = compared.with_(moved[..., :3])
            likeness.append(np.where((moved[..., 3] > 0.5) & (depth > 0), found, -1.0))
        cost[..., k] = 1 - np.clip(_best_two(likeness), -1, 1)
    chosen = _choose(part, others, base, offsets, cost, mask, least)
    whole = [np.full(view.size, np.nan) for _ in range(3)]
    for array, values in zip(whole, (chosen.depth, chosen.score, chosen.sigma), strict=True):
        array[box] = values
    return DepthMap(view, *whole)


def _best_two(likeness: Sequence[np.ndarray]) -> np.ndarray:
    """Mean of the two largest at every pixel."""
    first, second = likeness[0], np.full_like(likeness[0], -np.inf)
    for value in likeness[1:]:
        second = np.maximum(second, np.minimum(first, value))
        first = np.maximum(first, value)
    return first if len(likeness) == 1 else 0.5 * (first + second)


def _choose(view, others, base, offsets, cost, mask, least) -> DepthMap:
    """Winner of the smoothed cost, refined by a parabola."""
    total = smooth(cost, SMALL, LARGE, mask)
    best = total.argmin(axis=2)
    inner = (best > 0) & (best < len(offsets) - 1)
    k = best.clip(1, len(offsets) - 2)
    take = lambda volume, at: np.take_along_axis(volume, at[..., None], axis=2)[..., 0]  # noqa: E731
    left, middle, right = (take(total, k + i) for i in (-1, 0, 1))
    bend = (left + right - 2 * middle).clip(1e-6)
    shift = np.clip(0.5 * (left - right) / bend, -0.5, 0.5)
    step = offsets[1] - offsets[0]
    depth = base + offsets[k] + shift * step
    score = 1 - take(cost, k)
    good = mask & inner & (score >= least)
    middle_depth = float(np.median(depth[good])) if good.any() else float(np.nanmean(base))
    parallax = max(view.parallax(other, middle_depth) for other in others)
    sigma = np.where(good, PIXEL_SIGMA / parallax / np.sqrt(score.clip(0.05)), np.nan)
    return DepthMap(view, np.where(good, depth, np.nan), np.where(mask, score, np.nan), sigma)


def planes(view: View, points, others: Sequence[View], margin: float = 0.1, pixels: float = 0.5) -> tuple[float, np.ndarray]:
    """Base depth and offsets of planes that go through a box of points, a given parallax apart.

    Parameters
    ----------
    points : (n, 3) array
        What lies in the object or about it, m.
    margin : float
        Beyond them, part of their extent in depth.
    pixels : float
        Movement in the other views from one plane to the next.

    Raises
    ------
    InputError
        No other view, an empty mask, points that are not before the camera, or no parallax.
    """
    if not others:
        raise InputError(f"there is no other view to compare '{view.name}' with")
    if not view.mask.any():
        raise InputError(f"the mask of '{view.name}' is empty")
    depth = view.project(points)[1]
    low, high = depth.min(), depth.max()
    if not low > 0:
        raise InputError(f"what is looked for reaches {-low:.3g} m behind the camera of '{view.name}'")
    extra = margin * max(high - low, 1e-6)
    middle = 0.5 * (low + high)
    parallax = max(view.parallax(other, middle) for other in others)
    if not parallax > 1e-6:
        raise InputError(f"'{view.name}' and the others look from the same place: depth moves nothing")
    step = pixels / parallax
    n = int(np.ceil((high - low + 2 * extra) / 2 / step))
    return float(middle), step * np.arange(-n, n + 1)
