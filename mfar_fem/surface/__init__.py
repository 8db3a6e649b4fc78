"""The reference mid-surface: mesh, patterns, checks, files."""

from mfar_fem.surface.mesh import Surface

__all__ = ["Surface"]
