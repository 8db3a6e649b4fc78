"""Semi-global smoothing of a cost volume: H. Hirschmueller, Stereo processing by semiglobal matching and mutual information,
IEEE TPAMI 30 (2008) 328-341, doi:10.1109/TPAMI.2007.1166. OpenCV has it for rectified pairs only; a sweep has its own volume.
"""

from __future__ import annotations

import numpy as np
from numba import njit

DIRECTIONS = ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (-1, -1), (1, -1), (-1, 1))


@njit(cache=True)
def _path(cost, total, dy, dx, small, large, mask):  # pragma: no cover - compiled
    h, w, n = cost.shape
    previous = np.zeros((h, w, n), dtype=np.float32)
    rows = range(h) if dy >= 0 else range(h - 1, -1, -1)
    for y in rows:
        for i in range(w):
            x = i if (dx > 0 or (dx == 0)) else w - 1 - i
            if not mask[y, x]:
                continue
            py, px = y - dy, x - dx
            inside = 0 <= py < h and 0 <= px < w and mask[py, px]
            if not inside:
                for k in range(n):
                    previous[y, x, k] = cost[y, x, k]
            else:
                best = previous[py, px, 0]
                for k in range(1, n):
                    if previous[py, px, k] < best:
                        best = previous[py, px, k]
                for k in range(n):
                    low = min(previous[py, px, k], best + large)
                    if k > 0:
                        low = min(low, previous[py, px, k - 1] + small)
                    if k + 1 < n:
                        low = min(low, previous[py, px, k + 1] + small)
                    previous[y, x, k] = cost[y, x, k] + low - best
            for k in range(n):
                total[y, x, k] += previous[y, x, k]


def smooth(cost: np.ndarray, small: float, large: float, mask: np.ndarray) -> np.ndarray:
    """Sum over eight directions of the cheapest path to each pixel and hypothesis.

    Parameters
    ----------
    cost : (h, w, n) array
    small, large : float
        Penalties of a step of one hypothesis and of more, in units of the cost.
    mask : (h, w) bool array
        Paths stay inside.

    Returns
    -------
    (h, w, n) float32 array
        Divided by the number of directions.
    """
    cost = np.ascontiguousarray(cost, dtype=np.float32)
    total = np.zeros_like(cost)
    for dy, dx in DIRECTIONS:
        _path(cost, total, dy, dx, np.float32(small), np.float32(large), mask)
    return total / len(DIRECTIONS)
