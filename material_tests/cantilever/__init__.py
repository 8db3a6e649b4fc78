"""The cantilever test, ASTM D1388: option A (a strip droops to 41.5 degrees) and option B (the heart loop).

`method.md` says what is done and what is left out, `targets.csv` holds cited figures to compare with.
"""

from material_tests.cantilever.model import CantileverResult, exact

__all__ = ["CantileverResult", "exact"]
