"""A measured length with its uncertainty, split into what caused it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

NAMES = {
    "shoulder_width": "left to right shoulder point",
    "neck_width": "left to right point of the neckline",
    "neck_depth": "line of the neckline points to the lowest point of the collar",
    "back_neck_depth": "the same of the back, where a shallow opening shows it",
    "sleeve_length": "shoulder - elbow - wrist, mean of both sides",
    "cross_sleeve_width": "cuff to cuff across the shoulders",
    "garment_length": "neckline points to the hem",
    "body_width": "flat width between the armpits",
    "waist_width": "flat width at the waist",
    "waist_circumference": "round the waist",
    "hem_width": "flat width of the hem",
    "armhole_depth": "shoulder line to the armpit",
    "cuff_width": "flat opening of the sleeve's end",
    "overlap_neck": "centre to the upper end of the lapel",
    "overlap_hem": "centre to the lower end of the lapel",
    "ribbon_length": "long side of the smallest rectangle around a ribbon laid flat",
    "ribbon_width": "short side of it",
    "crown_width": "left to right point of the hat's crown at its base (neckline points)",
    "brim_width": "left to right edge of the hat's brim (shoulder points)",
    "crown_height": "base of the crown to its top",
    "veil_length": "base of the crown to the veil's hem",
}
"""Names of the measurements and what they mean; all in metres."""


@dataclass(frozen=True)
class Measurement:
    """One length from one image.

    Attributes
    ----------
    name : str
        One of :data:`NAMES`.
    value : float
        m.
    point_sigma, scale_sigma, model_sigma : float
        Standard deviations (m) from the points and the contour, from the scale, and from the model that turned what is seen into
        what is cut (foreshortening, ellipse). They are taken as independent.
    source, kind : str
        Image and its kind.
    method : str
        How it was measured.
    """

    name: str
    value: float
    point_sigma: float
    scale_sigma: float
    model_sigma: float
    source: str
    kind: str
    method: str

    @property
    def sigma(self) -> float:
        """Standard deviation of the value, m."""
        return math.sqrt(self.point_sigma**2 + self.scale_sigma**2 + self.model_sigma**2)

    def to_dict(self) -> dict[str, Any]:
        """A row of ``measurements.csv``."""
        return {
            "name": self.name, "source": self.source, "kind": self.kind, "value_m": self.value, "sigma_m": self.sigma,
            "point_sigma_m": self.point_sigma, "scale_sigma_m": self.scale_sigma, "model_sigma_m": self.model_sigma,
            "method": self.method,
        }
