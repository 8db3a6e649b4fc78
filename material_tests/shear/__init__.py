"""Trellis shear: the picture frame and the bias extension of a strip, their kinematics and what they recover of a law.

`method.md` says what is done and what is left out, `targets.csv` holds cited and exact figures to compare with.
"""

from material_tests.shear.compare import run
from material_tests.shear.kinematics import bias_displacement, bias_normalise, frame_force, frame_normalise

__all__ = ["bias_displacement", "bias_normalise", "frame_force", "frame_normalise", "run"]
