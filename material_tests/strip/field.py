"""Strain field of a stretched strip: Green, engineering and logarithmic strain at the interior points of the elements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class StrainField:
    """Deformation of a strip at one grip displacement; ``nt`` elements with ``nq`` points each.

    Attributes
    ----------
    strain : float
        Engineering strain of the grips.
    C : (nt, nq, 3) array
        Right Cauchy–Green tensor [C11, C22, C12] in the warp/weft frame, 1 = warp.
    reference, deformed : (nn, 3) arrays
        Nodes, m; x along the strip.
    triangles : (nt, 3) int array
        Vertex ids.
    weights : (nt, nq) array
        Reference area of every point, m².
    angle : float
        Of the strip's axis from the warp, rad.
    """

    strain: float
    C: np.ndarray
    reference: np.ndarray
    deformed: np.ndarray
    triangles: np.ndarray
    weights: np.ndarray
    angle: float

    @property
    def green(self) -> np.ndarray:
        """Green strain [E11, E22, 2 E12] in the warp/weft frame, (nt, nq, 3)."""
        return np.stack([0.5 * (self.C[..., 0] - 1.0), 0.5 * (self.C[..., 1] - 1.0), self.C[..., 2]], axis=-1)

    @property
    def engineering(self) -> np.ndarray:
        """Elongation of warp and of weft (dl/l) and their shear angle (rad, loss of the right angle), (nt, nq, 3)."""
        warp, weft = np.sqrt(self.C[..., 0]), np.sqrt(self.C[..., 1])
        return np.stack([warp - 1.0, weft - 1.0, np.arcsin(np.clip(self.C[..., 2] / (warp * weft), -1.0, 1.0))], axis=-1)

    @property
    def logarithmic(self) -> np.ndarray:
        """Hencky strain ½ ln C [H11, H22, 2 H12] in the warp/weft frame, (nt, nq, 3)."""
        mean = 0.5 * (self.C[..., 0] + self.C[..., 1])
        half, shear = 0.5 * (self.C[..., 0] - self.C[..., 1]), self.C[..., 2]
        radius = np.hypot(half, shear)
        high, low = 0.5 * np.log(mean + radius), 0.5 * np.log(mean - radius)
        centre, part = 0.5 * (high + low), 0.5 * (high - low) / np.where(radius > 0, radius, 1.0)
        return np.stack([centre + part * half, centre - part * half, 2.0 * part * shear], axis=-1)

    @property
    def longitudinal(self) -> np.ndarray:
        """Elongation dl/l of a line along the strip, (nt, nq)."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.sqrt(self.C @ np.array([c * c, s * s, 2 * c * s])) - 1.0

    @property
    def lateral(self) -> np.ndarray:
        """Elongation dl/l of a line across the strip, (nt, nq)."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.sqrt(self.C @ np.array([s * s, c * c, -2 * c * s])) - 1.0

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Element means (nt, ...) of values (nt, nq, ...) at the points."""
        w = self.weights / self.weights.sum(axis=1, keepdims=True)
        return np.einsum("eq,eq...->e...", w, values)

    def to_dict(self) -> dict:
        """Element means for a report: nodes, triangles, elongations, shear angle."""
        return {
            "strain": self.strain,
            "x_m": self.deformed[:, 0],
            "y_m": self.deformed[:, 1],
            "triangles": self.triangles,
            "longitudinal_strain": self.mean(self.longitudinal),
            "lateral_strain": self.mean(self.lateral),
            "warp_strain": self.mean(self.engineering[..., 0]),
            "weft_strain": self.mean(self.engineering[..., 1]),
            "shear_angle_rad": self.mean(self.engineering[..., 2]),
        }
