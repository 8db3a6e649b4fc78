r"""Known postures: where a point lies on figures whose other points lie as these do.

A heat map that is lost (paint gone, an arm behind the back) has its highest pixel anywhere; single points that are half a picture
off make most of a root mean square distance. The postures of the training pictures know better. Given the other points
:math:`x_j`, a point's density is

.. math:: p(x_k \mid x) \propto \sum_i w_i\, N(x_k; x_k^i, s^2), \qquad
          \log w_i = -\tfrac12 \sum_{j \ne k} t_j \min(|x_j - x_j^i|^2 / s^2, c)

over training pictures :math:`i` of garments with the same points (a kernel estimate; :math:`c` keeps one wrong point from
deciding, :math:`t_j` trusts low peaks less). Of the peaks of its heat map, and of the mean of this density with the height of a
floor, the point takes the one with the largest height times density, round after round, the lowest peaks first. A point whose own
peak wins is not touched: this chooses between peaks, it draws nothing towards a mean. It is the reverse of a knowledge term in
training: the network stays as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from reconstruction.keypoints.baselines import sample_matrix
from reconstruction.keypoints.crops import apply
from reconstruction.keypoints.data import Sample
from reconstruction.keypoints.heatmaps import peaks, to_input
from reconstruction.landmarks import LANDMARKS

SPREAD = 15.0
"""Standard deviation of the kernel, s, px of 256 × 192 (as the other numbers here it was set on validation pictures)."""
CAP = 9.0
"""c."""
FLOOR = 0.05
"""Height of a peak that the mean of the density is worth."""
LOWEST = 0.08
"""Peaks below this are noise."""
FAR = 20.0
"""Peaks nearer than this to a point's own are the same peak, px of 256 × 192."""
BACKGROUND = 1e-6
"""Density of what no training figure does."""
ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Postures:
    """Points of training pictures.

    Attributes
    ----------
    points : (n, 12, 2) array
        Px of 256 × 192; zero where absent.
    present : (n, 12) bool array
    """

    points: np.ndarray
    present: np.ndarray

    @classmethod
    def of(cls, samples: Sequence[Sample], margin: float = 0.0) -> Postures:
        """Those of samples, as a detector with this margin sees them."""
        points = np.zeros((len(samples), len(LANDMARKS), 2), dtype=np.float32)
        for row, s in zip(points, samples, strict=True):
            row[s.present] = apply(sample_matrix(s, margin), s.keypoints[s.present])
        return cls(points, np.array([s.present for s in samples], dtype=bool).reshape(-1, len(LANDMARKS)))

    def to_dict(self) -> dict[str, Any]:
        """Arrays for a file: points rounded to a pixel."""
        return {"points": np.rint(self.points).astype(np.int16), "present": self.present}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Postures:
        """The inverse of :meth:`to_dict`."""
        return cls(np.asarray(values["points"]).astype(np.float32), np.asarray(values["present"]).astype(bool))

    def settle(
        self, points: np.ndarray, score: np.ndarray, heatmaps: np.ndarray, present: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Let the points of one picture agree.

        Parameters
        ----------
        points : (12, 2) array
            As decoded one by one, px of 256 × 192.
        score : (12,) array
            Heights of their peaks.
        heatmaps : (12, 64, 48) array
        present : (12,) bool array
            Points that the garment has; of a kind that no training picture has nothing moves.

        Returns
        -------
        points, score, moved : (12, 2), (12,), (12,) bool arrays
        """
        ids = np.flatnonzero(present)
        known = self.points[(self.present == present).all(axis=1)][:, ids].astype(float)
        x, height = points[ids].astype(float), np.clip(score[ids].astype(float), 0.01, 1.0)
        moved = np.zeros(len(LANDMARKS), dtype=bool)
        if not len(known):
            return points, score, moved
        choices = [_choices(x[a], height[a], heatmaps[k]) for a, k in enumerate(ids)]
        taken = np.zeros(len(ids), dtype=int)
        for _ in range(ROUNDS):
            before = taken.copy()
            for a in np.argsort(height):
                weight = _weights(known, x, height, a)
                where = np.vstack([choices[a][0], weight @ known[:, a]])
                high = np.append(choices[a][1], FLOOR)
                apart = ((where[:, None] - known[:, a]) ** 2).sum(axis=2)
                density = np.exp(-0.5 * apart / SPREAD**2) @ weight
                best = int((np.log(high) + np.log(density + BACKGROUND)).argmax())
                if np.linalg.norm(where[best] - where[0]) < FAR:
                    best = 0
                x[a], height[a], taken[a] = where[best], high[best], best
            if (taken == before).all():
                break
        other = taken > 0
        moved[ids] = other
        points, score = np.array(points, dtype=float), np.array(score, dtype=float)
        points[ids[other]], score[ids[other]] = x[other], height[other]
        return points, score, moved


def _choices(point: np.ndarray, height: float, heatmap: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places (n, 2) and heights (n,) of a point: its own peak first, then all of its heat map."""
    found = peaks(heatmap, threshold=LOWEST, limit=6)
    places = to_input(np.array([[p.x, p.y] for p in found]).reshape(-1, 2))
    return np.vstack([point[None], places]), np.append(height, [p.score for p in found])


def _weights(known: np.ndarray, x: np.ndarray, height: np.ndarray, a: int) -> np.ndarray:
    """Weights (n,) of postures (n, k, 2) for point a of points (k, 2), by the others; they sum to 1."""
    trust = np.where(height > 0.5, 1.0, np.where(height > 0.2, 0.5, 0.2))
    trust[a] = 0.0
    log = -0.5 * np.minimum(((known - x) ** 2).sum(axis=2) / SPREAD**2, CAP) @ trust
    weight = np.exp(log - log.max())
    return weight / weight.sum()
