"""The finite-element level of the forward model: strips between grips (`material_tests.strip.fe`).

Every model keeps its mesh and its last states, so that a fit pays two or three Newton iterations a reading. Derivatives are
exact (`mfar_fem.solve.sensitivity`). A strip that locks or does not converge predicts up to where it got (`reached`).

The cantilever needs no mesh: the exact heavy elastica of a narrow strip, as on the homogeneous level. How far the sheet's own
finite elements are from it is reported by `material_tests.cantilever.fe`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from calibration.compare import LawResult, fit_law, rescaled
from calibration.experiments import Experiment
from calibration.forward import Prediction
from calibration.homogeneous import HomogeneousCantilever
from calibration.problem import Problem
from calibration.runs import SERIAL, Failed, Workers, run_all
from mfar_fem.errors import InputError, MfarError, UnknownNameError

ROUGH = 1e-3
"""Tolerance of the fits on the draft mesh: good enough to choose between two starts."""


class FiniteElementStrip:
    """Forward model of a strip test between grips.

    Parameters
    ----------
    experiment : Experiment
    fidelity : {'draft', 'standard', 'reference'}
        Mesh, see `material_tests.strip.fe.TRIANGLES`.
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


draft, reference = partial(model, fidelity="draft"), partial(model, fidelity="reference")


def refine(
    initial: Sequence[Problem],
    first: Sequence[LawResult],
    level: str = "fe",
    *,
    max_evaluations: int = 200,
    folder: Path | None = None,
    resume: bool = True,
    where: Workers = SERIAL,
    progress=None,
) -> list[LawResult]:
    """Fit laws at the finite-element level, each from two starts: its homogeneous answer and its own initial values.

    On the bias the homogeneous answer can be a poor start (the grips prevent the shear), and a law may have two minima.
    Both starts run roughly on the draft mesh; the better answer starts the fit at ``level``.

    Parameters
    ----------
    initial : sequence of Problem
        With the laws' own initial values (`calibration.compare.law_problems`).
    first : sequence of LawResult
        Homogeneous answers; laws that could not be fitted are left out.
    level : str
        'fe', or any other registered level (which then has no draft before it).
    folder : Path, optional
        For the checkpoints.

    Returns
    -------
    list of LawResult
        Best AICc first; laws that could not be fitted last.
    """
    coarse = "fe-draft" if level in ("fe", "fe-reference") else level
    own = {p.fabric.law.name: rescaled(p) for p in initial}
    jobs, common = [], {"max_evaluations": max_evaluations, "rescale": False}
    for result in first:
        if result.fit is None:
            continue
        answer = result.fit.problem.started_at(result.fit.parameters)
        for label, problem in (("answer", answer), ("initial", own.get(result.law))):
            if problem is not None:
                file = None if folder is None else folder / f"{coarse}-{label}-{result.law}.json"
                settings = {"tolerance": ROUGH, "checkpoint": file, "resume": resume} if coarse != level else \
                    {"checkpoint": file, "resume": resume}
                jobs.append((problem.vary(level=coarse), common | settings))
    tried = sorted(_fits(jobs, where, progress), key=lambda r: float("inf") if r.fit is None else r.fit.cost)
    best: dict[str, LawResult] = {}
    for result in tried:
        best.setdefault(result.law, result)
    done = list(best.values())
    if coarse != level:
        good = [(r.law, r.fit) for r in done if r.fit is not None]
        files = [None if folder is None else folder / f"{level}-{law}.json" for law, _ in good]
        jobs = [(f.problem.started_at(f.parameters).vary(level=level),
                 common | {"checkpoint": file, "resume": resume}) for (_, f), file in zip(good, files, strict=True)]
        done = _fits(jobs, where, progress) + [r for r in done if r.fit is None]
    return sorted(done, key=lambda r: (r.fit is None, r.aicc))


def _job(job) -> LawResult:
    problem, settings = job
    return fit_law(problem, **settings)


def _fits(jobs, where: Workers, progress) -> list[LawResult]:
    """Independent fits; one that fails for its law's own reasons is a result with the reason."""
    out = []
    for (problem, _), result in zip(jobs, run_all(_job, jobs, where, progress=progress, on_error="keep"), strict=True):
        if isinstance(result, Failed):
            if isinstance(result.error, InputError) or not isinstance(result.error, MfarError):
                raise result.error
            result = LawResult(problem.fabric.law.name, None, error=str(result.error))
        out.append(result)
    return out
