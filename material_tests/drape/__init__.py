"""The Cusick drape test, ISO 9073-9 and JIS L 1096: a round cloth falls over a smaller disc.

`method.md` says what is done, what was found and what is left out; `targets.csv` holds cited figures to compare with.
"""

from material_tests.drape.branches import BranchTable, branch_table, default_seeds
from material_tests.drape.compare import render, run
from material_tests.drape.fe import Drape, Seed, drape
from material_tests.drape.geometry import DrapeTest
from material_tests.drape.measure import Reading, read

__all__ = ["BranchTable", "Drape", "DrapeTest", "Reading", "Seed", "branch_table", "default_seeds", "drape", "read", "render",
           "run"]
