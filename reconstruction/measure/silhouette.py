"""The garment's silhouette: sub-pixel contour of a mask and lengths across it."""

from __future__ import annotations

import numpy as np

from mfar_fem.errors import DataFileError, InputError

SMOOTHING = 0.8
"""Standard deviation of the Gaussian that smooths a binary mask before its 0.5 level is traced, px."""


def read_mask(path, size: tuple[int, int] | None = None) -> np.ndarray:
    """Read a mask image as boolean array: non-zero is garment; of several channels the first, of an alpha channel alpha.

    Parameters
    ----------
    path : path-like
    size : (int, int), optional
        Width and height of the picture that it belongs to.

    Raises
    ------
    DataFileError
        It cannot be read, is empty, or has another size than its picture.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as image:
            data = np.asarray(image.getchannel("A") if "A" in image.getbands() else image.convert("L"))
    except (OSError, UnidentifiedImageError) as error:
        raise DataFileError(f"cannot be read as an image: {error}", path=path) from error
    if size is not None and data.shape != (size[1], size[0]):
        raise DataFileError(f"is a mask of {data.shape[1]} x {data.shape[0]} px; its picture has {size[0]} x {size[1]}", path=path)
    mask = data > 127 if data.max(initial=0) > 1 else data > 0
    if not mask.any():
        raise DataFileError("is empty: no pixel is garment", path=path)
    return mask


def contour(mask: np.ndarray, smoothing: float = SMOOTHING) -> np.ndarray:
    """Outer contour of the largest piece of a mask.

    Marching squares at the 0.5 level of the smoothed mask, so that a straight edge is found to a few hundredths of a pixel; corners
    are rounded over about two `smoothing`.

    Parameters
    ----------
    mask : (ny, nx) bool array
    smoothing : float
        px.

    Returns
    -------
    (n, 2) array
        Closed polygon (first point not repeated), px, anticlockwise as seen in the picture.

    Raises
    ------
    InputError
        No piece of the mask survives smoothing.
    """
    import contourpy
    from scipy.ndimage import gaussian_filter

    pad = 4
    level = np.pad(np.asarray(mask, dtype=float), pad)
    lines = contourpy.contour_generator(z=gaussian_filter(level, smoothing)).lines(0.5)
    loops = [np.asarray(line) for line in lines]
    closed = [line[:-1] - pad for line in loops if len(line) > 3 and np.allclose(line[0], line[-1])]
    if not closed:
        raise InputError("the mask has no piece large enough for a contour")
    best = max(closed, key=lambda line: abs(signed_area(line)))
    return best if signed_area(best) < 0 else best[::-1]  # y runs down: anticlockwise to the eye is negative


def signed_area(polygon: np.ndarray) -> float:
    """Shoelace area of a closed polygon (n, 2); positive if anticlockwise with y upwards."""
    x, y = np.asarray(polygon, dtype=float).T
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def crossings(polygon: np.ndarray, point, direction) -> np.ndarray:
    """Where a line crosses a closed polygon.

    Parameters
    ----------
    polygon : (n, 2) array
    point, direction : (2,) array
        The line; `direction` need not be a unit vector.

    Returns
    -------
    (m,) array
        Signed distances from `point` along the direction, ascending.
    """
    point, direction = np.asarray(point, dtype=float), np.asarray(direction, dtype=float)
    direction = direction / np.linalg.norm(direction)
    normal = np.array([-direction[1], direction[0]])
    side, along = (polygon - point) @ normal, (polygon - point) @ direction
    next_side, next_along = np.roll(side, -1), np.roll(along, -1)
    cut = (side < 0) != (next_side < 0)
    t = side[cut] / (side[cut] - next_side[cut])
    return np.sort(along[cut] + t * (next_along[cut] - along[cut]))


def chord(polygon: np.ndarray, point, direction) -> tuple[float, float] | None:
    """The stretch of a line inside a polygon that contains a point, or the one nearest to it.

    Returns
    -------
    (start, end) or None
        Signed distances from `point`; None if the line misses the polygon.
    """
    hits = crossings(polygon, point, direction)
    pairs = hits[: len(hits) // 2 * 2].reshape(-1, 2)
    if not len(pairs):
        return None
    gap = np.maximum(np.maximum(pairs[:, 0], -pairs[:, 1]), 0)
    start, end = pairs[int(np.argmin(gap))]
    return float(start), float(end)


def nearest(polygon: np.ndarray, point) -> int:
    """Index of the vertex nearest to a point."""
    return int(np.argmin(np.sum((polygon - np.asarray(point)) ** 2, axis=1)))


def stretch(polygon: np.ndarray, start: int, end: int) -> np.ndarray:
    """Vertices from index `start` to `end`, both included, in the polygon's order (past its last vertex if need be)."""
    n = len(polygon)
    return polygon[np.arange(start, start + (end - start) % n + 1) % n]


def between(polygon: np.ndarray, a, b, through) -> np.ndarray:
    """The one of the two ways along the polygon from near `a` to near `b` that passes closer to a point.

    Returns
    -------
    (m, 2) array
        From the vertex nearest to `a` to the one nearest to `b`.
    """
    i, j = nearest(polygon, a), nearest(polygon, b)
    ways = stretch(polygon, i, j), stretch(polygon, j, i)[::-1]
    through = np.asarray(through)
    return min(ways, key=lambda way: float(np.min(np.sum((way - through) ** 2, axis=1))))
