"""How far the look of a picture is from that of another: colours, and texture by a filter bank that nobody trained.

Measuring with the network that the generator was trained on would measure the training. The filters here are fixed: Gaussian
derivatives at four scales and four directions on the three channels of CIELAB.

References
----------
Leung, Malik: Representing and recognizing the visual appearance of materials using three-dimensional textons. IJCV 43 (2001) 29,
doi:10.1023/A:1011126920638 (filter bank). Portilla, Simoncelli: IJCV 40 (2000) 49, doi:10.1023/A:1026553619983 (texture as joint
statistics of filter responses). Bonneel, Rabin, Peyré, Pfister: Sliced and Radon Wasserstein barycenters of measures. JMIV 51
(2015) 22, doi:10.1007/s10851-014-0506-3.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import ndimage

from reconstruction.style import colour
from reconstruction.style.colour_transfer import sorted_quantiles

SCALES = (0.7, 1.4, 2.8, 5.6)
"""Of the filters, px."""
DIRECTIONS = 4
MOST_PIXELS = 20_000


def filter_responses(image: np.ndarray) -> np.ndarray:
    """Sizes of the first derivatives along four directions and of the Laplacian, at four scales, for L*, a*, b*.

    Parameters
    ----------
    image : (h, w, 3) uint8 array

    Returns
    -------
    (60, h, w) array
        Derivatives are multiplied by their scale, so that scales compare; CIELAB units.
    """
    lab, found = colour.lab_from_srgb(colour.to_float(image)), []
    for c in range(3):
        for scale in SCALES:
            dy = scale * ndimage.gaussian_filter(lab[..., c], scale, order=(1, 0))
            dx = scale * ndimage.gaussian_filter(lab[..., c], scale, order=(0, 1))
            for k in range(DIRECTIONS):
                angle = np.pi * k / DIRECTIONS
                found.append(np.abs(np.cos(angle) * dx + np.sin(angle) * dy))
            found.append(np.abs(scale**2 * ndimage.gaussian_laplace(lab[..., c], scale)))
    return np.array(found)


def filter_statistics(image: np.ndarray) -> np.ndarray:
    """Logarithms of mean and root mean square of every response: the texture of a picture as a vector of 120 numbers."""
    responses = filter_responses(image).reshape(3 * len(SCALES) * (DIRECTIONS + 1), -1)
    return np.log(np.concatenate([responses.mean(1), np.sqrt((responses**2).mean(1))]) + 0.05)


def texture_distance(image: np.ndarray, other: np.ndarray) -> float:
    """Root mean square difference of :func:`filter_statistics` of two pictures: 0.1 is about 10 % in the strength of a response."""
    return statistics_distance(filter_statistics(image), filter_statistics(other))


def statistics_distance(a: np.ndarray, b: np.ndarray) -> float:
    """Root mean square difference of two vectors of :func:`filter_statistics`."""
    return float(np.sqrt(np.mean((a - b) ** 2)))


def colour_distance(image: np.ndarray, other: np.ndarray, directions: int = 32, seed: int = 0) -> float:
    """Sliced 2-Wasserstein distance of the colour clouds in CIELAB, in its units (1 is about a just noticeable difference).

    Root mean square over `directions` of the distances of the projections (of at most :data:`MOST_PIXELS` pixels, drawn by `seed`),
    times √3, so that a shift by d measures about |d|.
    """
    rng = np.random.default_rng(seed)
    axes = rng.standard_normal((directions, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    at = (np.arange(512) + 0.5) / 512
    clouds = []
    for picture in (image, other):
        lab = colour.lab_from_srgb(colour.to_float(picture)).reshape(-1, 3)
        if len(lab) > MOST_PIXELS:
            lab = lab[rng.choice(len(lab), MOST_PIXELS, replace=False)]
        clouds.append(np.array([sorted_quantiles(lab @ axis, at) for axis in axes]))
    return float(np.sqrt(3.0 * np.mean((clouds[0] - clouds[1]) ** 2)))


def network_distance(features: Any, image: np.ndarray, other: np.ndarray, statistics: str = "moments") -> float:
    """Mean of :func:`losses.style_distance` over the layers of a feature network that no loss was trained on."""
    from reconstruction.style.losses import style_distance
    from reconstruction.torch_library import torch

    with torch.no_grad():
        a, b = (features(torch.from_numpy(x / 255.0).float().permute(2, 0, 1)[None]) for x in (image, other))
        return float(np.mean([float(style_distance(a[k], b[k], statistics)) for k in a]))
