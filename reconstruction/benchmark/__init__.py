"""Synthetic benchmark: garments cut from parameters, draped on bodies, drawn in three styles, with truth.

The code here shares nothing with what reconstructs: it has its own bodies, its own drape (position-based, not the shell
solver) and its own projection, so that a restoration cannot win by repeating the generator's assumptions.

`build` makes a benchmark in a folder, `load_index` and `samples` read it.
"""

from __future__ import annotations

from .index import BenchmarkIndex, Sample, load_index, samples

__all__ = ["BenchmarkIndex", "Sample", "load_index", "samples"]
