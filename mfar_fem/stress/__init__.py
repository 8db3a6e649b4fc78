"""Extremes: random problems at the ends of what cloth and solver can be, each solved, watched and verified independently."""

from mfar_fem.stress.cases import Case, draw
from mfar_fem.stress.runner import run_stress_test, summary
from mfar_fem.stress.solve import Outcome, run_case

__all__ = ["Case", "Outcome", "draw", "run_case", "run_stress_test", "summary"]
