"""How stiff a barrier is: chosen for the sheet and the time step, more where contacts come too near."""

from __future__ import annotations

import numpy as np

from mfar_fem.loads import GRAVITY
from mfar_fem.shell import Shell

TENSION = 1e-3
"""Strain whose tension the barrier is made for, on a curve as wide as the sheet."""
HARD, STIFFER = 0.1, 1e6
"""Contacts nearer than this share of ``dhat`` and still approaching make the barrier stiffer, up to this factor."""


class BarrierStiffness:
    """κ of one barrier over a run.

    Parameters
    ----------
    shell : Shell
        Whose weight and tension it has to carry.
    dhat : float
        Activation distance, m.
    given : float, optional
        κ, Pa, that is kept; default: ``max(ρ g, 1e-3 D/L)``, with the first time step also ``ρ dhat/Δt²``, and doubled after steps
        that end with contacts nearer than ``HARD * dhat`` and approaching.

    Attributes
    ----------
    value : float
        κ, Pa, for the next solve.
    solved : float
        κ with which the last accepted step was solved.
    """

    def __init__(self, shell: Shell, dhat: float, given: float | None = None):
        fabric = shell.fabric
        size = float(np.linalg.norm(np.ptp(shell.surface.nodes, axis=0)))
        self._density, self._dhat, self._given = float(fabric.areal_density), dhat, given
        least = max(self._density * -GRAVITY[2],
                    TENSION * fabric.membrane_scale * float(np.abs(fabric.law.tangent_at_rest()).max()) / size)
        self.value = float(given or least)
        self.solved, self._least, self._hardest = self.value, least, STIFFER * self.value
        self._chosen, self._previous = given is not None, np.inf

    def choose(self, dt: float) -> bool:
        """Take the length ``dt`` (s) of the first step into account; whether that changed anything."""
        if self._chosen:
            return False
        self.value = self.solved = max(self._least, self._density * self._dhat / dt**2)
        self._hardest, self._chosen = STIFFER * self.value, True
        return True

    def end_step(self, distance: float) -> None:
        """After an accepted step whose nearest contact is at ``distance`` (m; inf without one)."""
        self.solved = self.value
        if self._given is None and distance < self._previous < HARD * self._dhat:
            self.value = min(self._hardest, 2.0 * self.value)
        self._previous = distance

    def memory(self) -> dict[str, float]:
        """For a checkpoint."""
        return {"stiffness": self.value, "solved": self.solved, "hardest": self._hardest, "previous": self._previous,
                "chosen": float(self._chosen)}

    def restore(self, memory: dict[str, float]) -> None:
        """Take up what :meth:`memory` gave."""
        self.value, self.solved = memory["stiffness"], memory["solved"]
        self._hardest, self._previous, self._chosen = memory["hardest"], memory["previous"], bool(memory["chosen"])
