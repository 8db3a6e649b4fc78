"""Fixed sparsity patterns: built once, filled by index."""

from mfar_fem.assembly.pattern import Pattern

__all__ = ["Pattern"]
