"""Running scenes: engines for every level, files that survive a kill, pictures, and what accuracy costs."""

from mfar_fem.simulation.run import SimulationResult, simulate

__all__ = ["SimulationResult", "simulate"]
