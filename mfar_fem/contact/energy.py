"""What every contact energy has: bodies, friction, a stiffness that adapts, and steps that stop short of contact."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mfar_fem.contact.body import Body
from mfar_fem.contact.stiffness import BarrierStiffness
from mfar_fem.errors import InputError
from mfar_fem.shell import Shell, State

KEPT = 4
"""States whose contacts are remembered: those at the start of a step and of the first guesses are asked for again."""


@dataclass(frozen=True)
class ContactReport:
    """Contact at one state.

    Attributes
    ----------
    pairs : int
        Active pairs, or nodes in contact.
    least_distance : float
        m, without a distance that surfaces keep; inf if nothing is active.
    forces : (nb, 3) array
        Force of the sheet on each body, N: barrier and friction.
    stiffness : float
        κ, Pa.
    """

    pairs: int
    least_distance: float
    forces: np.ndarray
    stiffness: float


class ContactEnergy:
    """Base of the barriers.

    Parameters
    ----------
    bodies : sequence of Body
    dhat : float
        Activation distance, m.
    stiffness : float, optional
        κ, Pa, that is kept; default: see :class:`mfar_fem.contact.stiffness.BarrierStiffness`.
    friction : float or sequence of float, optional
        Coulomb coefficients against the bodies; default: each body's own.
    eps_v : float
        Speed, m/s, from which friction is fully developed.
    **more
        Other values by name that must be at least 0.

    Raises
    ------
    InputError
        For values that make no sense.
    """

    conservative = True
    element_dofs = None
    internal = True
    """Contact is no external force: residuals are not compared with it."""
    _kappa: BarrierStiffness

    def __init__(self, bodies: Sequence[Body], dhat: float, stiffness: float | None, friction, eps_v: float, **more: float):
        self.bodies = tuple(bodies)
        positive = {"dhat": dhat, "eps_v": eps_v, "stiffness": 1.0 if stiffness is None else stiffness}
        for name, value in (positive | more).items():
            if not (np.isfinite(value) and value >= 0 and (value > 0 or name in more)):
                raise InputError(f"contact: {name} must be {'at least 0' if name in more else 'positive'} and finite, got {value}")
        mu = [b.friction for b in self.bodies] if friction is None else np.broadcast_to(friction, len(self.bodies))
        self.friction = np.array(mu, dtype=float)
        if not np.all(self.friction >= 0):
            raise InputError(f"contact: friction coefficients must be at least 0, got {self.friction.tolist()}")
        self.dhat, self.eps_v, self._given = float(dhat), float(eps_v), stiffness

    @property
    def stiffness(self) -> float:
        """κ, Pa."""
        return self._kappa.value

    def max_step(self, shell: Shell, state: State, step: np.ndarray) -> float:
        """Largest fraction of ``step`` (n,) without collision, at most 1."""
        raise NotImplementedError

    def limit(self, shell: Shell, state: State, guess: State) -> State:
        """``guess`` where the way from ``state`` is free, else as far towards it as it is: a start for Newton's method."""
        step = guess.u - state.u
        fraction = self.max_step(shell, state, step)
        return guess if fraction == 1.0 else state.with_u(state.u + fraction * step)

    def memory(self) -> dict[str, float]:
        """What the next step needs besides the state of the sheet, for a checkpoint."""
        return self._kappa.memory()

    def restore(self, memory: dict[str, float]) -> None:
        """Take up what :meth:`memory` gave."""
        self._kappa.restore(memory)
