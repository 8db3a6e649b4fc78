"""Slit annular plate: radii 6 and 10, h 0.03, E 21e6, ν 0, line force 0.8 on one face (Sze, Liu, Lo 2004, section 3.3)."""

from __future__ import annotations

import numpy as np

from mfar_fem.benchmarks.case import Case, final, sheet
from mfar_fem.loads import edge_load
from mfar_fem.solve import Problem
from mfar_fem.supports import Clamp
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import annulus

DEFAULT_MESH = (6, 30)


def build(order: int, nx: int, ny: int, **triangulation) -> Case:
    """The benchmark: nx cells along the radius, ny round the ring."""
    surface = Surface.from_pattern(annulus(6.0, 10.0, nx, ny, slit=True, **triangulation), order)
    problem = Problem(surface, sheet(21e6, 0.0, 0.03), [Clamp("slit0")], [edge_load("slit1", [0.0, 0.0, 0.8])])
    face = surface.boundary["slit1"]
    radius = np.linalg.norm(surface.nodes[face], axis=1)
    inner, outer = face[radius.argmin()], face[radius.argmax()]

    def measure(shell, state):
        z = shell.positions(state)[:, 2]
        return {"W inner": z[inner], "W outer": z[outer]}

    return Case(problem, measure, lambda: (final("slit-annulus", "sze2004"), {}),
                "Sze, Liu, Lo 2004 (S4R, 10x80; a finite-element solution)",
                initial_step=0.02, quick=16)
