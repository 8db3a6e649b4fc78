"""Is the fitted law stable where the data are? Smallest eigenvalue of the tangent along the measured stretches."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from calibration.experiments import Experiment


@dataclass(frozen=True)
class Stability:
    """Stability of a law over the range of the strip tests.

    Attributes
    ----------
    stable : bool
        The tangent dS/dE is positive definite in every state checked, and every state was reached.
    least : float
        Smallest eigenvalue found, over the largest eigenvalue at rest.
    where : str
        The state of the smallest eigenvalue.
    states : int
        Number of states checked.
    missed : int
        States within the measured range that the law did not reach: locked, or without a stable equilibrium.
    """

    stable: bool
    least: float
    where: str
    states: int
    missed: int = 0

    @property
    def text(self) -> str:
        """The finding as one line of prose."""
        word = "positive definite" if self.least > 0.0 else "NOT positive definite"
        missed = f"; {self.missed} states within the measured range NOT reached" if self.missed else ""
        size = f"smallest eigenvalue {self.least:.2g} of the stiffness at rest ({self.where})"
        return f"tangent {word} on {self.states} states; {size}{missed}"


def stability(law, experiments: Iterable[Experiment], points: int = 25) -> Stability:
    """Check dS/dE along the homogeneous uniaxial paths of the strip tests, from rest to the largest measured strain.

    A state that is not reached (locking, no stable equilibrium) counts against the law. Positive definite dS/dE in tension
    means that every small further deformation takes work; a law that fails it may still be usable in tension but wrinkles
    or folds on its own.
    """
    from calibration.homogeneous import path

    reference = float(np.linalg.eigvalsh(law.tangent_at_rest()).max())
    least, where, states, missed = np.inf, "at rest", 0, 0
    strips: dict[str, tuple[float, float]] = {}
    for e in experiments:
        if e.kind == "strip":
            top = max(float(e.x.max()), strips.get(e.direction_name, (0.0, 0.0))[1])
            strips[e.direction_name] = (e.direction, top)
    for name, (direction, top) in strips.items():
        strain = np.linspace(0.0, top, points)
        C, ok = path(law, direction, strain)
        missed += int((~ok).sum())
        if not ok.any():
            continue
        values = np.linalg.eigvalsh(law.tangent(C[ok]))[:, 0] / reference
        states += int(ok.sum())
        k = int(values.argmin())
        if values[k] < least:
            least, where = float(values[k]), f"{name} at strain {strain[ok][k]:.3f}"
    return Stability(bool(least > 0.0 and missed == 0), least, where, states, missed)
