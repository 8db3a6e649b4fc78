"""The strip test, ASTM D5035: force against elongation of a strip held by two grips, at any angle to the warp.

`method.md` says what is done and what is left out, `targets.csv` holds cited figures to compare with.
"""

from material_tests.strip.homogeneous import LATERAL, StripCurve, force_curve

__all__ = ["LATERAL", "StripCurve", "force_curve"]
