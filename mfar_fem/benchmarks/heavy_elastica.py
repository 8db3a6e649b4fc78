"""Heavy elastica: a horizontal clamp, the strip's own weight, w L³/B = 8.004197, where the chord has drooped to 41.5°.

The geometry of ASTM D1388 option A (bending length L/2). Exact figure: B θ'' = -w (L - s) cos θ, θ(0) = θ'(L) = 0.
"""

from __future__ import annotations

import numpy as np

from mfar_fem.benchmarks.case import Case, sheet
from mfar_fem.loads import area_load
from mfar_fem.solve import Problem
from mfar_fem.supports import Clamp
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import strip

DEFAULT_MESH = (8, 2)
GAMMA = 8.004197033
LENGTH, WIDTH, WEIGHT, THICKNESS = 0.1, 0.025, 1.0, 1e-4


def fabric():
    """Isotropic strip (ν 0) of the rigidity that goes with GAMMA, thin enough to be inextensible (h/L 1e-3)."""
    B = WEIGHT * LENGTH**3 / GAMMA
    return sheet(12.0 * B / THICKNESS**3, 0.0, THICKNESS)


def build(order: int, nx: int, ny: int, **triangulation) -> Case:
    """The benchmark."""
    surface = Surface.from_pattern(strip(LENGTH, WIDTH, nx, ny, **triangulation), order)
    problem = Problem(surface, fabric(), [Clamp("left")], [area_load((0.0, 0.0, -WEIGHT))])
    tip = surface.boundary["right"]

    def measure(shell, state):
        x = shell.positions(state)[tip].mean(axis=0)
        return {"chord angle": float(np.degrees(np.arctan2(-x[2], x[0])))}

    return Case(problem, measure, lambda: ({"chord angle": 41.5}, {}), "exact heavy elastica (inextensible)", initial_step=0.25)
