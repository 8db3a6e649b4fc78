"""Solvers: linear systems, Newton's method, statics."""

from mfar_fem.solve.newton import NewtonOptions
from mfar_fem.solve.problem import Problem
from mfar_fem.solve.statics import solve_static

__all__ = ["NewtonOptions", "Problem", "solve_static"]
