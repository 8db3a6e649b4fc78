"""What a computation returns: frozen, complete, and honest about how it ended."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mfar_fem.shell import State


@dataclass(frozen=True)
class LoadStep:
    """One accepted load step."""

    lam: float
    state: State
    iterations: int
    residual: float
    residual_relative: float
    membrane_energy: float
    bending_energy: float
    reaction: np.ndarray = field(repr=False)
    requested: bool = True


@dataclass(frozen=True)
class StaticResult:
    """Result of :func:`mfar_fem.solve.statics.solve_static`.

    Attributes
    ----------
    converged : bool
        Whether load factor 1 (or the last level) was reached.
    status : str
        ``converged`` or the named failure: ``LockingReached``, ``Diverged``, ``StepTooSmall``, ``SingularTangent``.
    message : str
        The same in words.
    steps : tuple of LoadStep
        Accepted steps; the last one is the last converged state.
    newton_iterations : int
        Of the accepted steps; ``wasted_iterations`` those of steps that were cut.
    timings : dict
        Seconds: ``assembly``, ``solve``, ``total``.
    notes : tuple of str
        What the solvers had to do (fallbacks, shifts).
    """

    converged: bool
    status: str
    message: str
    steps: tuple[LoadStep, ...]
    newton_iterations: int
    wasted_iterations: int
    assemblies: int
    timings: dict[str, float]
    notes: tuple[str, ...]

    @property
    def state(self) -> State:
        """Last converged state."""
        return self.steps[-1].state

    @property
    def lam(self) -> float:
        """Load factor of the last converged state."""
        return self.steps[-1].lam

    def at_levels(self) -> list[LoadStep]:
        """The accepted steps at the load factors that were asked for."""
        return [s for s in self.steps if s.requested]
