"""The thin shell: membrane and bending energy at orders 1 and 2."""

from mfar_fem.shell.shell import Shell, State

__all__ = ["Shell", "State"]
