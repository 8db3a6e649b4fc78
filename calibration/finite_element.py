"""The finite-element level of the forward model: strips between grips (`material_tests.strip.fe`).

Every model keeps its mesh and its last states, so that a fit pays two or three Newton iterations a reading. Derivatives are
exact (`mfar_fem.solve.sensitivity`). A strip that locks or does not converge predicts up to where it got (`reached`).

The cantilever needs no mesh: the exact heavy elastica of a narrow strip, as on the homogeneous level. How far the sheet's own
finite elements are from it is reported by `material_tests.cantilever.fe`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from calibration.experiments import Experiment
from calibration.forward import Prediction, register
from calibration.homogeneous import HomogeneousCantilever
from mfar_fem.errors import UnknownNameError


class FiniteElementStrip:
    """Forward model of a strip test between grips.

    Parameters
    ----------
    experiment : Experiment
    fidelity : {'draft', 'standard', 'reference'}
        Mesh, see `material_tests.strip.fe.CELLS`.
    """

    def __init__(self, experiment: Experiment, fidelity: str = "standard"):
        from material_tests.strip.fe import StripTest

        self.test = StripTest(experiment.gauge, experiment.width, experiment.direction, fidelity)

    def predict(self, fabric, x: np.ndarray, names: Sequence[str] = ()) -> Prediction:
        """Line force (N/m) at the engineering strains x (m,) and its Jacobian (m, p); readings below 0 are not reached."""
        x = np.asarray(x, dtype=float)
        good = x >= 0.0
        y, reached = np.full(x.size, np.nan), np.zeros(x.size, bool)
        J = np.zeros((x.size, len(names))) if names else None
        status = "ok" if good.all() else "strain below zero"
        if good.any():
            result = self.test.run(fabric, x[good], names)
            y[good], reached[good] = result.line_force, result.reached
            if J is not None:
                J[good] = result.sensitivity
            if not result.converged:
                status = result.message
        return Prediction(y, J, reached, status)


def model(experiment: Experiment, fidelity: str = "standard"):
    """The finite-element forward model of an experiment (level 'fe'; 'fe-draft' and 'fe-reference' for other meshes)."""
    if experiment.kind == "cantilever":
        return HomogeneousCantilever(experiment)
    if experiment.kind != "strip":
        raise UnknownNameError(f"no finite-element model of a '{experiment.kind}' test; known: strip, cantilever")
    return FiniteElementStrip(experiment, fidelity)


def level(fidelity: str = "standard"):
    """The forward-model factory of a fidelity: picklable, for `Problem(level=...)`."""
    return partial(model, fidelity=fidelity)


draft, reference = level("draft"), level("reference")
for _name in ("draft", "reference"):
    register(f"fe-{_name}", f"calibration.finite_element:{_name}")
