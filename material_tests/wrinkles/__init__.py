"""Wrinkles of sheared and of stretched sheets against the published scaling laws.

`method.md` says what is done and what is left out, `targets.csv` holds the figures to compare with.
"""

from material_tests.wrinkles.compare import run

__all__ = ["run"]
