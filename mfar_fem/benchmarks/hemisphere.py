"""Hemisphere with an 18° hole: R 10, h 0.04, E 6.825e7, ν 0.3, P 400, one quarter (Sze, Liu, Lo 2004, section 3.4)."""

from __future__ import annotations

import numpy as np

from mfar_fem.benchmarks.case import Case, final, sheet
from mfar_fem.loads import nodal_force
from mfar_fem.solve import Problem
from mfar_fem.supports import Support, Symmetry
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import sphere

DEFAULT_MESH = (16, 16)
NOTE = ("quarter model: half of P = 400, so 200, on each loaded node; free at the hole and at the equator; the height of the "
        "outward-loaded node is held against translation")


def build(order: int, nx: int, ny: int, **triangulation) -> Case:
    """The benchmark: nx cells round, ny up."""
    pattern = sphere(10.0, (0.0, 0.5 * np.pi), (0.0, np.radians(72.0)), nx, ny, **triangulation)
    surface = Surface.from_pattern(pattern, order, warp=_around(pattern))
    out, into = surface.boundary["left"][0], surface.boundary["right"][0]
    supports = [Symmetry("left", 1), Symmetry("right", 0), Support([out], (2,), by_node=True)]
    forces = nodal_force([out, into], [[200.0, 0.0, 0.0], [0.0, -200.0, 0.0]])
    problem = Problem(surface, sheet(6.825e7, 0.3, 0.04), supports, [forces])

    def measure(shell, state):
        d = shell.positions(state) - surface.nodes
        return {"outward": d[out, 0], "inward": -d[into, 1]}

    def references():
        others = {"Sze, Liu, Lo 2004 (S4R 16x16, from memory)": final("hemisphere", "sze2004-memory")}
        return final("hemisphere", "hhj-order3"), others

    source = "computed with an independent code of the same theory: NGSolve, order 3, 7x7"
    return Case(problem, measure, references, source, initial_step=0.05, quick=12, note=NOTE)


def _around(pattern) -> np.ndarray:
    """Direction of the parallels at every triangle (the x axis is normal to the sphere somewhere)."""
    x = pattern.vertices[pattern.triangles].mean(axis=1)
    return np.stack([-x[:, 1], x[:, 0], np.zeros(len(x))], axis=1)
