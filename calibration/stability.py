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
        The tangent dS/dE is positive definite in every state checked.
    least : float
        Smallest eigenvalue found, over the largest eigenvalue at rest.
    where : str
        The state of the smallest eigenvalue.
    states : int
        Number of states checked.
    """

    stable: bool
    least: float
    where: str
    states: int

    @property
    def text(self) -> str:
        word = "positive definite" if self.stable else "NOT positive definite"
        size = f"smallest eigenvalue {self.least:.2g} of the stiffness at rest ({self.where})"
        return f"tangent {word} on {self.states} states; {size}"


def stability(law, experiments: Iterable[Experiment], points: int = 25) -> Stability:
    """Check dS/dE along the homogeneous uniaxial paths of the strip tests, from rest to the largest measured strain.

    States past locking are left out (they have no tangent). Positive definite dS/dE in tension means that every small
    further deformation takes work; a law that fails it may still be usable in tension but wrinkles or folds on its own.
    """
    from calibration.homogeneous import path

    reference = float(np.linalg.eigvalsh(law.tangent_at_rest()).max())
    least, where, states = np.inf, "at rest", 0
    strips: dict[str, tuple[float, float]] = {}
    for e in experiments:
        if e.kind == "strip":
            top = max(float(e.x.max()), strips.get(e.direction_name, (0.0, 0.0))[1])
            strips[e.direction_name] = (e.direction, top)
    for name, (direction, top) in strips.items():
        strain = np.linspace(0.0, top, points)
        C, ok = path(law, direction, strain)
        if not ok.any():
            continue
        values = np.linalg.eigvalsh(law.tangent(C[ok]))[:, 0] / reference
        states += int(ok.sum())
        k = int(values.argmin())
        if values[k] < least:
            least, where = float(values[k]), f"{name} at strain {strain[ok][k]:.3f}"
    return Stability(bool(least > 0.0), least, where, states)
