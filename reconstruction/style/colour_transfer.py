"""Colours of one picture given to another without any network: the baselines that a network has to beat.

All take (h, w, 3) uint8 pictures (sizes may differ) and optional masks (h, w) bool of the pixels whose colours count; all pixels of
`image` are changed. Statistics are taken in CIELAB unless said otherwise.

References
----------
Reinhard, Ashikhmin, Gooch, Shirley: Color transfer between images. IEEE CG&A 21 (2001) 34, doi:10.1109/38.946629.
Pitié, Kokaram: The linear Monge-Kantorovitch linear colour mapping for example-based colour transfer. CVMP 2007,
doi:10.1049/cp:20070055; the map of two Gaussians: Olkin, Pukelsheim, LAA 48 (1982) 257, doi:10.1016/0024-3795(82)90112-4.
Pitié, Kokaram, Dahyot: Automated colour grading using colour distribution transfer. CVIU 107 (2007) 123,
doi:10.1016/j.cviu.2006.11.011 (one-dimensional transports along rotated axes).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mfar_fem.errors import ParameterError, UnknownNameError
from mfar_fem.tomlfile import suggest
from reconstruction.style import colour

_SPACES: dict[str, tuple[Callable, Callable]] = {
    "lab": (colour.lab_from_srgb, colour.srgb_from_lab),
    "lalphabeta": (colour.lalphabeta_from_srgb, colour.srgb_from_lalphabeta),
}
_FEWEST = 16


def reinhard(image, like, mask=None, like_mask=None, space: str = "lab") -> np.ndarray:
    """Mean and deviation of each channel.

    Parameters
    ----------
    image, like : (h, w, 3) uint8 arrays
        B, and A whose look is wanted.
    mask, like_mask : (h, w) bool arrays, optional
    space : str
        "lab", or "lalphabeta", the space of the paper by Reinhard et al.

    Raises
    ------
    ParameterError, UnknownNameError
        A mask that does not fit or leaves fewer than 16 pixels; another space.
    """
    if space not in _SPACES:
        raise UnknownNameError(f"no colour space '{space}'{suggest(space, _SPACES)}")
    forward, back = _SPACES[space]
    values, own, wanted = _samples(image, like, mask, like_mask, forward)
    scale = wanted.std(0) / np.maximum(own.std(0), 1e-9)
    return _picture((values - own.mean(0)) * scale + wanted.mean(0), image, back)


def monge_kantorovich(image, like, mask=None, like_mask=None) -> np.ndarray:
    """The linear optimal transport between the Gaussians of both colour clouds: mean and full covariance (see :func:`reinhard`)."""
    values, own, wanted = _samples(image, like, mask, like_mask)
    transport = gaussian_transport(np.cov(own.T), np.cov(wanted.T))
    return _picture((values - own.mean(0)) @ transport + wanted.mean(0), image)


def gaussian_transport(own: np.ndarray, wanted: np.ndarray, ridge: float = 1e-6) -> np.ndarray:
    """Symmetric T with T own T = wanted, the optimal map from N(0, own) to N(0, wanted): A^-½ (A^½ B A^½)^½ A^-½.

    Parameters
    ----------
    own, wanted : (n, n) arrays
        Covariances.
    ridge : float
        Added to both diagonals, relative to the mean variance, so that grey pictures can be moved.
    """
    scale = ridge * (np.trace(own) + np.trace(wanted)) / (2 * len(own)) + 1e-12
    a, b = own + scale * np.eye(len(own)), wanted + scale * np.eye(len(own))
    root = _root(a)
    inverse = np.linalg.inv(root)
    return inverse @ _root(root @ b @ root) @ inverse


def histogram_matching(image, like, mask=None, like_mask=None) -> np.ndarray:
    """Each sRGB channel's cumulative histogram made that of the other picture's (see :func:`reinhard`)."""
    values, own, wanted = _samples(image, like, mask, like_mask, lambda rgb: rgb)
    moved = [quantile_map(own[:, c], wanted[:, c])(values[:, c]) for c in range(3)]
    return _picture(np.column_stack(moved), image, lambda rgb: rgb)


def sliced_transport(image, like, mask=None, like_mask=None, rounds: int = 12, strength: float = 1.0, seed: int = 0) -> np.ndarray:
    """Whole colour distributions matched by one-dimensional transports along the axes of random rotations.

    Parameters
    ----------
    image, like, mask, like_mask
        See :func:`reinhard`.
    rounds : int
        Rotations.
    strength : float
        Part of the way, 0 to 1.
    seed : int
        Of the rotations.
    """
    values, own, wanted = _samples(image, like, mask, like_mask)
    rng = np.random.default_rng(seed)
    moved = values
    for k in range(rounds):
        rotation = np.eye(3) if k == 0 else np.linalg.qr(rng.standard_normal((3, 3)))[0]
        turned, turned_own, turned_wanted = moved @ rotation, own @ rotation, wanted @ rotation
        for c in range(3):
            step = quantile_map(turned_own[:, c], turned_wanted[:, c])
            turned[:, c], turned_own[:, c] = step(turned[:, c]), step(turned_own[:, c])
        moved, own = turned @ rotation.T, turned_own @ rotation.T
    return _picture(values + strength * (moved - values), image)


def quantile_map(own: np.ndarray, wanted: np.ndarray, levels: int = 256) -> Callable[[np.ndarray], np.ndarray]:
    """The increasing map that takes the quantiles of one sample to those of another, linear in between, constant beyond."""
    at = (np.arange(levels) + 0.5) / levels
    x, y = sorted_quantiles(own, at), sorted_quantiles(wanted, at)
    x, first = np.unique(x, return_index=True)
    ends = np.append(first[1:], levels)
    y = np.array([y[i:j].mean() for i, j in zip(first, ends, strict=True)])  # a value of several quantiles: their mean
    return lambda values: np.interp(values, x, y)


def sorted_quantiles(values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Quantiles with linear interpolation; one sort is faster than numpy's many partitions."""
    return np.interp(at * (len(values) - 1), np.arange(len(values)), np.sort(values))


METHODS: dict[str, Callable[..., np.ndarray]] = {
    "reinhard": reinhard,
    "monge-kantorovich": monge_kantorovich,
    "sliced": sliced_transport,
    "histogram": histogram_matching,
}
"""Baselines by name."""


def transfer(method: str, image, like, mask=None, like_mask=None) -> np.ndarray:
    """One of :data:`METHODS` by name.

    Raises
    ------
    UnknownNameError
    """
    if method not in METHODS:
        raise UnknownNameError(f"no colour transfer '{method}'{suggest(method, METHODS)}")
    return METHODS[method](image, like, mask, like_mask)


def _samples(image, like, mask, like_mask, forward=colour.lab_from_srgb):
    """All values of the image (n, 3), those that count (m, 3), and those of the other picture (k, 3)."""
    values = forward(colour.to_float(_checked(image, "image"))).reshape(-1, 3)
    wanted = forward(colour.to_float(_checked(like, "like"))).reshape(-1, 3)
    return values, _masked(values, mask, image, "mask"), _masked(wanted, like_mask, like, "like_mask")


def _checked(image, name: str):
    if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8:
        raise ParameterError(f"{name} must be an RGB picture of 8 bits, (h, w, 3) uint8, not {image.shape} {image.dtype}")
    return image


def _masked(values, mask, image, name: str):
    if mask is None:
        return values
    if mask.shape != image.shape[:2] or mask.dtype != bool:
        raise ParameterError(f"{name} must be bool of shape {image.shape[:2]}, not {mask.dtype} {mask.shape}")
    if mask.sum() < _FEWEST:
        raise ParameterError(f"{name} leaves {int(mask.sum())} pixels; colours need at least {_FEWEST}")
    return values[mask.ravel()]


def _picture(values, image, back=colour.srgb_from_lab):
    return colour.to_uint8(back(values.reshape(image.shape)))


def _root(matrix):
    value, vector = np.linalg.eigh(matrix)
    return (vector * np.sqrt(np.maximum(value, 0))) @ vector.T
