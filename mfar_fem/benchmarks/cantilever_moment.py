"""Roll-up of a strip to a full circle: L 12, b 1, h 0.1, E 1.2e6, ν 0, M 2π EI/L (Sze, Liu, Lo 2004, section 3.2)."""

from __future__ import annotations

import numpy as np

from mfar_fem.benchmarks.case import Case, final, sheet
from mfar_fem.loads import edge_moment
from mfar_fem.solve import Problem
from mfar_fem.supports import Clamp, Support
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import strip

DEFAULT_MESH = (8, 1)
LENGTH, WIDTH, H, E = 12.0, 1.0, 0.1, 1.2e6
NOTE = ("plane problem: the lateral position y of every node is held (ν = 0, so no force comes of it); a strip rolled up beyond "
        "about 90 % of the circle is near a lateral instability, which an unsymmetric mesh would trigger")


def build(order: int, nx: int, ny: int, **triangulation) -> Case:
    """The benchmark."""
    surface = Surface.from_pattern(strip(LENGTH, WIDTH, nx, ny, **triangulation), order)
    moment = 2 * np.pi * E * H**3 / 12.0 / LENGTH
    plane = Support(np.arange(len(surface.nodes)), (1,), by_node=True)
    problem = Problem(surface, sheet(E, 0.0, H), [Clamp("left"), plane], [edge_moment("right", moment, axis=[0.0, -1.0, 0.0])])
    tip = surface.boundary["right"][0]

    def measure(shell, state):
        d = shell.positions(state)[tip] - surface.nodes[tip]
        return {"-U": -d[0], "W": d[2]}

    def references():
        return {"-U": LENGTH, "W": 0.0}, {"Sze, Liu, Lo 2004": final("cantilever-moment", "sze2004")}

    return Case(problem, measure, references, "exact: R = EI/M, a full circle (inextensible); errors in % of the length",
                scale={"-U": LENGTH, "W": LENGTH},
                initial_step=0.1, quick=12, note=NOTE)
