"""Laws side by side on the same data: error, information criterion, number of parameters, stability of the tangent."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from calibration.fit import Fit, fit
from calibration.problem import Problem, law_unknowns
from calibration.runs import SERIAL, Failed, Workers, run_all
from calibration.stability import Stability, stability
from calibration.statistics import fit_criteria
from mfar_fem.errors import InputError, MfarError, NotConvergedError

logger = logging.getLogger(__name__)
STIFFNESS_UNITS = ("Pa", "N/m", "J/m^3", "J/m^2", "J/m**3", "J/m**2", "kg/m/s**2", "N/m**2", "N/m^2")


@dataclass(frozen=True, eq=False)
class LawResult:
    """One law of a comparison.

    Attributes
    ----------
    law : str
    fit : Fit or None
        None if the law could not be fitted; then `error` says why.
    criteria : dict
        'aic', 'aicc', 'bic'.
    stability : Stability or None
    error : str
    """

    law: str
    fit: Fit | None
    criteria: dict[str, float] = field(default_factory=dict)
    stability: Stability | None = None
    error: str = ""

    @property
    def aicc(self) -> float:
        """Akaike's criterion corrected for few readings; inf if the law could not be fitted."""
        return self.criteria.get("aicc", float("inf"))

    def to_dict(self) -> dict:
        """Row of the law table."""
        if self.fit is None:
            return {"law": self.law, "error": self.error}
        return {
            "law": self.law,
            "rmse_percent_of_range": self.fit.rmse_percent_of_range,
            "rmse_by_experiment": self.fit.rmse_by_experiment,
            **self.criteria,
            "n_parameters": len(self.fit.q),
            "n_readings": self.fit.problem.size,
            "stable": self.stability.stable if self.stability else None,
            "stability": self.stability.text if self.stability else "",
            "parameters": self.fit.parameters,
            "at_bounds": self.fit.at_bounds(),
            "n_evaluations": self.fit.n_evaluations,
            "converged": self.fit.converged,
            "status": self.fit.status,
        }


def rescaled(problem: Problem) -> Problem:
    """Start the stiffnesses (unknowns in Pa or N/m) at the common factor that fits the measured strips best.

    Forces are proportional to them in nearly every law, so this saves the fit many decades of walking. Where the model
    does not reach all readings at the initial values, those it reaches decide.
    """
    stiff = [u for u in problem.unknowns if u.scale == "log" and u.unit.replace(" ", "") in STIFFNESS_UNITS]
    if not stiff:
        return problem
    try:
        predictions = problem.predict({u.name: u.initial for u in problem.unknowns}, jacobian=False)
    except MfarError:
        return problem
    top = bottom = 0.0
    for e, p in zip(problem.experiments, predictions, strict=True):
        ok = p.reached & np.isfinite(p.y)
        if e.kind == "strip" and ok.any():
            w = e.weight / (len(e) * e.scale**2)
            top += w * float(e.y[ok] @ p.y[ok])
            bottom += w * float(p.y[ok] @ p.y[ok])
    if not (top > 0 and bottom > 0):
        return problem
    return problem.started_at({u.name: u.initial * top / bottom for u in stiff})


def fit_law(problem: Problem, *, starts: int = 1, seed: int = 0, rescale: bool = True, **settings) -> LawResult:
    """Fit one law and judge it; a law that cannot be fitted gives a result with its reason."""
    name = problem.fabric.law.name
    try:
        f = fit(rescaled(problem) if rescale else problem, starts=starts, seed=seed, **settings)
    except (NotConvergedError, ArithmeticError, np.linalg.LinAlgError) as error:
        logger.info("law %s could not be fitted: %s", name, error)
        return LawResult(name, None, error=str(error))
    return LawResult(name, f, fit_criteria(f), stability(f.law, f.problem.experiments))


def _job(job) -> LawResult:
    problem, settings = job
    return fit_law(problem, **settings)


def law_problems(fabric, laws: Sequence, experiments, level="homogeneous", bending_derived: bool = False) -> list[Problem]:
    """One problem for every law, all on the same data; parameters that the law's table does not fit keep their values."""
    problems = []
    for law in laws:
        problems.append(
            Problem(
                fabric=fabric.replace(law=law),
                unknowns=law_unknowns(law),
                experiments=tuple(experiments),
                level=level,
                bending_derived=bending_derived,
            )
        )
    if not problems:
        raise InputError("no law to compare: name at least one with --law")
    return problems


def compare(
    problems: Sequence[Problem],
    *,
    starts: int = 3,
    seed: int = 0,
    rescale: bool = True,
    max_evaluations: int = 200,
    checkpoints: Sequence | None = None,
    resume: bool = True,
    where: Workers = SERIAL,
    progress=None,
) -> list[LawResult]:
    """Fit all problems (same data, different laws) as independent runs.

    Parameters
    ----------
    checkpoints : sequence of path, optional
        One checkpoint file a problem.

    Returns
    -------
    list of LawResult
        Best AICc first; laws that could not be fitted last.
    """
    jobs = []
    for k, problem in enumerate(problems):
        settings = {"starts": starts, "seed": seed, "rescale": rescale, "max_evaluations": max_evaluations}
        if checkpoints is not None:
            settings |= {"checkpoint": checkpoints[k], "resume": resume}
        jobs.append((problem, settings))
    results = run_all(_job, jobs, where, progress=progress, on_error="keep")
    out = []
    for problem, result in zip(problems, results, strict=True):
        if isinstance(result, Failed):
            if isinstance(result.error, InputError) or not isinstance(result.error, MfarError):
                raise result.error
            result = LawResult(problem.fabric.law.name, None, error=str(result.error))
        out.append(result)
    return sorted(out, key=lambda r: (r.fit is None, r.aicc))
