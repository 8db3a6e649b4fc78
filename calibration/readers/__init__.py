"""Readers: CSV + TOML descriptor, and the U3M/FAB JSON of a public fabric tester.

`read_dataset(path)` accepts a folder, a TOML file (one experiment or a dataset) or a U3M JSON file.
"""

from __future__ import annotations

from calibration.readers.dataset import read_dataset, read_experiment
from calibration.readers.rules import Rules, apply_rules, split_branches
from calibration.readers.table import Table, read_table
from calibration.readers.u3m import read_u3m

__all__ = [
    "Rules",
    "Table",
    "apply_rules",
    "read_dataset",
    "read_experiment",
    "read_table",
    "read_u3m",
    "split_branches",
]
