"""Swing of a hanging swatch: period, decay, and the drag coefficient that a record of it determines.

`method.md` says what is done and what is left out, `targets.csv` holds exact and cited figures to compare with.
"""

from material_tests.swing.compare import run
from material_tests.swing.fe import Swing, swing
from material_tests.swing.fit import Estimate, fit_fe, fit_plate, noisy
from material_tests.swing.model import Pendulum, added_mass, drag_coefficient, euler_drag, per_area, per_vertex

__all__ = ["Estimate", "Pendulum", "Swing", "added_mass", "drag_coefficient", "euler_drag", "fit_fe", "fit_plate", "noisy",
           "per_area", "per_vertex", "run", "swing"]
