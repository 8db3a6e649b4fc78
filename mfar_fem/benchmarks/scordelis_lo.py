"""Scordelis-Lo roof, small displacements: R 25, L 50, half angle 40°, h 0.25, E 4.32e8, ν 0, weight 90 per area, one quarter."""

from __future__ import annotations

import numpy as np

from mfar_fem.benchmarks.case import Case, final, sheet
from mfar_fem.loads import area_load
from mfar_fem.solve import Problem
from mfar_fem.supports import Hinge, Symmetry
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import cylinder

DEFAULT_MESH = (8, 8)


def build(order: int, nx: int, ny: int, **triangulation) -> Case:
    """The benchmark: nx cells round 40°, ny along half the length."""
    pattern = cylinder(25.0, 25.0, (0.0, np.radians(40.0)), nx, ny, **triangulation)
    surface = Surface.from_pattern(pattern, order, (0.0, 1.0, 0.0), size=None)
    supports = [Symmetry("left", 0), Symmetry("bottom", 1), Hinge("top", (0, 2))]
    problem = Problem(surface, sheet(4.32e8, 0.0, 0.25), supports, [area_load((0.0, 0.0, -90.0))])
    edge = surface.boundary["right"][0]

    def measure(shell, state):
        return {"-w": surface.nodes[edge, 2] - shell.positions(state)[edge, 2]}

    def references():
        others = {"converged Kirchhoff-Love shell (Kiendl et al. 2009, from memory)": final("scordelis-lo", "kiendl2009-memory")}
        return final("scordelis-lo", "obstacle-course"), others

    return Case(problem, measure, references, "customary value of the obstacle course", linear=True,
                note="one linear step; w at the middle of the free edge")
