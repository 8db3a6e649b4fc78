"""Similarity of the Fourier spectra of two wrinkle pictures or height fields, with the null values that give a number its meaning.

`method.md` says what the number can and cannot tell, `targets.csv` holds cited and exact figures to compare with.
"""

from material_tests.spectrum.compare import run
from material_tests.spectrum.field import Field, common_grid, read_field
from material_tests.spectrum.similarity import similarity, spectrum

__all__ = ["Field", "common_grid", "read_field", "run", "similarity", "spectrum"]
