"""Inflated membranes: the Hencky membrane, the Mylar balloon (tension field) and the spherical rubber balloon.

`method.md` says what is done and what is left out, `targets.csv` holds cited and exact figures to compare with.
"""

from material_tests.inflation.compare import run

__all__ = ["run"]
