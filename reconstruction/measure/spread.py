"""How far what a picture shows may be from what was cut: relative standard deviations of the models, by kind and by length.

Assumptions, of the size of the errors seen on the synthetic benchmark (garments draped by another method): widths of skirts read
off figures came out 13-30 % too small because cloth lies in folds and is belted, widths at the chest 3-15 %, necklines 0-19 %, and
all lengths of murals with wrong foreshortening were off by up to 18 %. They are not corrected for, only stated; a textile has none
of them.
"""

from __future__ import annotations

import math

KIND_SPREAD = {"textile": 0.0, "figurine": 0.04, "mural": 0.10}
"""Of every length: perspective of a statue's photograph, foreshortening of a drawn figure."""
WORN_SPREAD = {
    "hem_width": 0.25, "waist_width": 0.20, "waist_circumference": 0.20, "body_width": 0.10, "armhole_depth": 0.15,
    "neck_width": 0.15, "shoulder_width": 0.10,
}
"""Besides, of lengths of a worn garment: folds, a lowered sleeve, a turned torso."""
NECK_CONTOUR_SPREAD = 0.01
"""Of the neckline's width read off the contour of a textile, besides the scatter of that contour."""


def model_spread(kind: str, name: str) -> float:
    """Relative standard deviation of a length by its kind of source and name."""
    worn = 0.0 if kind == "textile" else WORN_SPREAD.get(name, 0.0)
    return math.hypot(KIND_SPREAD[kind], worn)
