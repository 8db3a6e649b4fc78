"""Cantilever under an end shear force: L 10, b 1, h 0.1, E 1.2e6, ν 0, P 4 = 4 EI/L² (Sze, Liu, Lo 2004, section 3.1)."""

from __future__ import annotations

import numpy as np

from mfar_fem.benchmarks.case import Case, final, sheet
from mfar_fem.benchmarks.extensible_elastica import cantilever
from mfar_fem.loads import edge_load
from mfar_fem.solve import Problem
from mfar_fem.supports import Clamp
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import strip

DEFAULT_MESH = (8, 1)
LENGTH, WIDTH, E = 10.0, 1.0, 1.2e6


def build(order: int, nx: int, ny: int, slenderness: float = 0.01, **triangulation) -> Case:
    """The benchmark; ``slenderness`` h/L changes the thickness at the same P L²/EI = 4 (thin limit).

    Rounding of the positions makes membrane forces of ``ε EA``, which no iteration can remove: thin strips end there.
    """
    h = slenderness * LENGTH
    EI = E * WIDTH * h**3 / 12.0
    load = 4.0 * EI / LENGTH**2
    surface = Surface.from_pattern(strip(LENGTH, WIDTH, nx, ny, **triangulation), order)
    problem = Problem(surface, sheet(E, 0.0, h), [Clamp("left")], [edge_load("right", [0.0, 0.0, load / WIDTH])])
    tip = surface.boundary["right"][0]

    def measure(shell, state):
        d = shell.positions(state)[tip] - surface.nodes[tip]
        return {"-U": -d[0], "W": d[2]}

    def references():
        both = (cantilever(load, LENGTH, EI, EA) for EA in (E * WIDTH * h, np.inf))
        exact, inextensible = (dict(zip(("-U", "W"), values, strict=True)) for values in both)
        others = {"exact inextensible elastica": inextensible}
        if slenderness == 0.01:
            others["Sze, Liu, Lo 2004 (finite elements with shear, 16x1)"] = final("cantilever-shear", "sze2004")
        return exact, others

    return Case(problem, measure, references, "exact elastica that stretches (EA finite, no shear)", initial_step=0.1)
