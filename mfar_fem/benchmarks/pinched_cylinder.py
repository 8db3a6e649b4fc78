"""Pinched cylinder on rigid diaphragms: R 100, L 200, h 1, E 3e4, ν 0.3, P 12000, one octant (Sze, Liu, Lo 2004, section 3.6)."""

from __future__ import annotations

import numpy as np

from mfar_fem.benchmarks.case import Case, final, sheet
from mfar_fem.loads import nodal_force
from mfar_fem.solve import Problem
from mfar_fem.supports import Hinge, Symmetry
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import cylinder

DEFAULT_MESH = (16, 16)
NOTE = ("the cylinder snaps on the way, and has several equilibria at the full load; every load level rolls downhill in energy. "
        "Triangles that lie unsymmetrically ('right') end in another equilibrium, hence the mesh of crossed diagonals")


def build(order: int, nx: int, ny: int, pattern: str = "criss", **triangulation) -> Case:
    """The benchmark: nx cells round a quarter, ny along half the length; a quarter of P on the octant."""
    mesh = cylinder(100.0, 100.0, (0.0, 0.5 * np.pi), nx, ny, pattern, **triangulation)
    surface = Surface.from_pattern(mesh, order, (0.0, 1.0, 0.0), size=None)
    a, b = surface.boundary["left"][0], surface.boundary["right"][0]
    supports = [Symmetry("left", 0), Symmetry("right", 2), Symmetry("bottom", 1), Hinge("top", (0, 2))]
    problem = Problem(surface, sheet(30e3, 0.3, 1.0), supports, [nodal_force([a], [0.0, 0.0, -3000.0])])

    def measure(shell, state):
        d = shell.positions(state) - surface.nodes
        return {"-W at A": -d[a, 2], "U at B": d[b, 0]}

    return Case(problem, measure, lambda: (final("pinched-cylinder", "sze2004"), {}),
                "Sze, Liu, Lo 2004 (48x48; a finite-element solution)", levels=(0.2, 0.4, 0.6, 0.8, 1.0), downhill=True, note=NOTE)
