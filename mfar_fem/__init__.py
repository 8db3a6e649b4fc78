"""Mechanics of silk: hyperelastic laws, a thin-shell finite-element method and its solvers (SI units throughout)."""

__version__ = "0.1.0"
