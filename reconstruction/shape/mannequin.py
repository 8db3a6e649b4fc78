"""A figure for a garment to hang on, from the landmarks: an elliptic trunk, a head and two arms, as one signed distance.

What lies under the cloth is not seen. The trunk's half widths and half depths are fractions of the stature that look like an
adult's (assumptions, near what anthropometric surveys give: chest 0.18 and 0.14 of the stature,
waist 0.16 and 0.12, hip 0.20 and 0.14, rounded); the arms follow the fold of the sleeves. This is prior, not evidence.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from reconstruction.libraries import optional
from reconstruction.shape.polyline import along
from reconstruction.surface.triangles import TriangleMesh

NECK = 0.835
"""Height of the neckline over the stature."""
TRUNK = np.array(
    [
        (0.90, 0.030, 0.033),
        (0.855, 0.031, 0.034),
        (0.825, 0.080, 0.042),
        (0.80, 0.100, 0.055),
        (0.74, 0.092, 0.068),
        (0.63, 0.080, 0.060),
        (0.53, 0.098, 0.068),
        (0.46, 0.096, 0.062),
        (0.28, 0.070, 0.045),
        (0.03, 0.060, 0.045),
    ]
)
"""Height, half width and half depth of the trunk over the stature; the legs are one."""
HEAD = (0.935, 0.044, 0.056, 0.066)
"""Height of its middle, half width, half depth, half height over the stature."""
UPPER_ARM, FOREARM, HAND = (0.186, 0.027), (0.146, 0.021), (0.095, 0.018)
"""Length and radius over the stature (lengths: Drillis & Contini 1966, see the benchmark's sources)."""


@dataclass(frozen=True, eq=False)
class Mannequin:
    """A figure in the wearer's axes (see :mod:`reconstruction.shape.frame`).

    Attributes
    ----------
    stature : float
        m.
    centre : (2,) array
        x and y of the trunk's axis, m.
    arms : tuple of ((n, 3) array, (n,) array)
        Points and radii along each arm, m.
    """

    stature: float
    centre: np.ndarray
    arms: tuple[tuple[np.ndarray, np.ndarray], ...] = ()

    def distance(self, points) -> np.ndarray:
        """Approximate signed distance (n,), m, negative inside."""
        p = np.asarray(points, dtype=float).reshape(-1, 3) - (*self.centre, 0.0)
        h = p[:, 2] / self.stature + NECK
        table = TRUNK[::-1]
        a, b = (self.stature * np.interp(h, table[:, 0], table[:, i]) for i in (1, 2))
        out = _ellipse(p[:, 0], p[:, 1], a, b)
        over = self.stature * np.maximum(h - TRUNK[0, 0], TRUNK[-1, 0] - h)
        out = np.where(over > 0, np.hypot(over, np.maximum(out, 0.0)), out)
        middle, wide, deep, high = HEAD
        q = np.stack([p[:, 0] / wide, p[:, 1] / deep, (p[:, 2] + self.stature * (NECK - middle)) / high], axis=1) / self.stature
        k0 = np.linalg.norm(q, axis=1)
        k1 = np.linalg.norm(q / (self.stature * np.array([wide, deep, high])), axis=1)
        out = np.minimum(out, k0 * (k0 - 1) / np.maximum(k1, 1e-9))
        for line, radii in self.arms:
            _cones(np.ascontiguousarray(points, dtype=float).reshape(-1, 3), line, radii, out)
        return out

    def outwards(self, points, step: float = 1e-3) -> np.ndarray:
        """Unit gradients (n, 3) of the distance, by central differences."""
        points = np.asarray(points, dtype=float)
        moved = [self.distance(points + s * step * axis) for axis in np.eye(3) for s in (1, -1)]
        gradient = np.stack([moved[2 * i] - moved[2 * i + 1] for i in range(3)], axis=1)
        return gradient / np.maximum(np.linalg.norm(gradient, axis=1), 1e-12)[:, None]

    def mesh(self, spacing: float = 0.015) -> TriangleMesh:
        """Closed surface by marching cubes, m."""
        measure = optional("skimage.measure", "drawing a figure needs")
        reach = [np.abs(line).max() + 0.1 for line, _ in self.arms]
        low = np.array([-max(0.3 * self.stature, *reach, 0.0), -0.5 * self.stature, -NECK * self.stature - 0.03])
        high = np.array([-low[0], 0.5 * self.stature, (1.03 - NECK) * self.stature])
        if self.arms:
            ends = np.concatenate([line for line, _ in self.arms])
            low[1], high[1] = (min(-0.15 * self.stature, ends[:, 1].min() - 0.1), max(0.15 * self.stature, ends[:, 1].max() + 0.1))
        axes = [np.arange(a, b + spacing, spacing) for a, b in zip(low, high, strict=True)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        field = self.distance(grid.reshape(-1, 3)).reshape(grid.shape[:3])
        vertices, faces, _, _ = measure.marching_cubes(field, 0.0, spacing=(spacing,) * 3)
        return TriangleMesh(vertices + low, np.asarray(faces, dtype=np.int64)).outwards()


def _ellipse(x, y, a, b) -> np.ndarray:
    """First-order distance from an ellipse."""
    k0 = np.hypot(x / a, y / b)
    k1 = np.hypot(x / a**2, y / b**2)
    return np.where(k1 > 1e-9, k0 * (k0 - 1) / np.maximum(k1, 1e-9), -np.minimum(a, b))


@njit(cache=True)
def _cones(points, line, radii, out):  # pragma: no cover - compiled
    """Lower `out` (n,) to the distance from a chain of capsules whose radius changes along them."""
    for i in range(len(points)):
        for k in range(len(line) - 1):
            dot, length = 0.0, 1e-12
            for c in range(3):
                along = line[k + 1, c] - line[k, c]
                dot += (points[i, c] - line[k, c]) * along
                length += along * along
            t = min(max(dot / length, 0.0), 1.0)
            square = 0.0
            for c in range(3):
                square += (points[i, c] - line[k, c] - t * (line[k + 1, c] - line[k, c])) ** 2
            out[i] = min(out[i], np.sqrt(square) - radii[k] - t * (radii[k + 1] - radii[k]))


def mannequin(stature: float, folds: tuple[np.ndarray, ...], centre=(0.0, 0.0)) -> Mannequin:
    """A figure whose arms lie under the folds of two sleeves.

    Parameters
    ----------
    stature : float
        m.
    folds : tuple of (n, 3) array
        From each shoulder along the top of the sleeve, m, the wearer's axes.
    centre : (2,) array
        Of the trunk, m.
    """
    arms = []
    whole = np.cumsum([0.0, UPPER_ARM[0], FOREARM[0], HAND[0]]) * stature
    for fold in folds:
        at = np.linspace(0.0, whole[-1], 13)
        line = along(fold, at)
        radius = stature * np.interp(at, whole, [0.034, UPPER_ARM[1], FOREARM[1], HAND[1]])
        way = np.gradient(line, axis=0)
        way /= np.linalg.norm(way, axis=1)[:, None]
        down = np.array([0.0, 0.0, -1.0]) + way * way[:, 2:]
        line = line + radius[:, None] * down / np.maximum(np.linalg.norm(down, axis=1), 0.2)[:, None]
        arms.append((line, radius))
    return Mannequin(stature, np.asarray(centre, dtype=float), tuple(arms))
