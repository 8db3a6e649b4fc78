"""How far the points of a fitted garment may be from the true one: by type, and by what supports them."""

from __future__ import annotations

import numpy as np

from reconstruction.shape.cloth import Cloth
from reconstruction.shape.evidence import FIRM, SIGMA, Targets

TEMPLATE_SIGMA, MESH_SIGMA = 0.03, 6e-3
"""Standard deviation of a point that only the template places, and what a mesh of 30 mm with its stiffness adds to the pictures',
m."""
SLEEVED = {"template": 0.0, "stereo": 6e-3, "outline": 27e-3, "landmark": 27e-3}
SPREAD: dict[str, dict[str, float]] = {
    "flying-ribbon": {"template": 54e-3, "stereo": 37e-3, "outline": 63e-3, "landmark": 63e-3},
    "veil-hat": {"template": 109e-3, "stereo": 55e-3, "outline": 130e-3, "landmark": 130e-3},
}
"""What neighbouring points have in common (a wrong neighbour of the sweep, an outline taken for another, a rule that does not
hold), m, for types other than :data:`SLEEVED`: half of the distance from the truth that 95 % of the points do not exceed, on
two garments of each type (cases of seeds 6 and 7, which the study of restored garments does not use)."""


def uncertainty(cloth: Cloth, targets: Targets, garment: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Uncertainty and support of every vertex.

    Parameters
    ----------
    cloth : Cloth
    targets : Targets
        Of the last step.
    garment : str
        Type.

    Returns
    -------
    sigma : (nv,) array
        Standard deviation, m: twice it should hold 95 % of the points.
    noise : (nv,) array
        The part of it that is independent from point to point: what smoothing can take away.
    source : (nv,) array of str
        What holds the vertex most.
    """
    names = np.full(len(cloth.x), "template", dtype=object)
    best = np.zeros(len(cloth.x))
    for name, weight in targets.support.items():
        more = weight > best
        names[more], best[more] = name, weight[more]
    evidence = targets.weight - targets.support.get("template", 0.0)  # a belt is no evidence
    information = evidence / (FIRM * SIGMA**2 * cloth.vertex_area)  # 1/m²
    noise = np.sqrt(1.0 / (information + TEMPLATE_SIGMA**-2) + MESH_SIGMA**2)
    spread = SPREAD.get(garment, SLEEVED)
    return np.hypot(noise, [spread[name] for name in names]), noise, names.astype(str)
