"""A whole calibration: compare laws, refit by finite elements, judge, cross-validate."""

from __future__ import annotations

import contextlib
import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from calibration.bootstrap import METHODS, Bootstrap, bootstrap
from calibration.compare import LawResult, compare, law_problems
from calibration.experiments import Dataset
from calibration.finite_element import refine
from calibration.fit import Fit
from calibration.profile import Profile, profiles
from calibration.runs import SERIAL, Workers
from calibration.statistics import Linear, linear_statistics
from calibration.validation import Check, CrossValidation, by_interval, cross_validate, predict_all
from calibration.words import all_words
from mfar_fem.errors import InputError, NotConvergedError

logger = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Study:
    """Everything a calibration found.

    ``levels`` maps a level ('homogeneous', 'fe') to its law results, best AICc first; ``level`` is the final one, on
    which ``fit`` (the best law's), the statistics and the cross-validation stand. ``timings`` are seconds by stage.
    """

    dataset: Dataset
    fabric: object
    level: str
    levels: dict[str, list[LawResult]]
    fit: Fit
    linear: Linear
    profiles: dict[str, Profile]
    bootstrap: Bootstrap | None
    checks: list[Check]
    intervals: list[dict]
    cross: list[CrossValidation]
    words: dict
    settings: dict = field(default_factory=dict)
    timings: dict[str, float] = field(default_factory=dict)

    @property
    def best(self) -> LawResult:
        """The law of least AICc on the final level."""
        return self.levels[self.level][0]

    def calibrated(self):
        """The calibrated fabric, ready to save; its sources say where every number comes from."""
        f, d = self.fit.fabric, self.dataset
        what = f"fitted to {d.name}{f', {d.variant}' if d.variant else ''} ({self.level} level, "
        what += f"RMSE {self.fit.rmse_percent_of_range:.2f} % of range); {d.citation}"
        state = f", {d.variant}" if d.variant else ""
        return f.replace(name=f"{d.name}{state}", sources={**f.sources, "law": what})

    def level_pairs(self) -> list[dict]:
        """The laws' errors on all levels side by side (homogeneous against finite elements)."""
        rows: dict[str, dict] = {}
        for name, results in self.levels.items():
            for r in results:
                row = rows.setdefault(r.law, {"law": r.law})
                row[name] = None if r.fit is None else r.fit.rmse_percent_of_range
                row[f"{name}_by_experiment"] = {} if r.fit is None else r.fit.rmse_by_experiment
        return list(rows.values())


def template_fabric(dataset: Dataset, law, fabric=None):
    """The fabric whose law will be fitted: the given one, or one made of the dataset's figures.

    Without measured bending it is taken as for a solid sheet of the law; without areal density or thickness the dataset
    cannot make a fabric.
    """
    from mfar_fem.materials.bending import Bending
    from mfar_fem.materials.fabric import Fabric

    if fabric is not None:
        return fabric
    missing = [k for k in ("thickness", "areal_density") if getattr(dataset, k) is None]
    if missing:
        raise InputError(
            f"dataset '{dataset.name}' does not state {' and '.join(missing)}; give a fabric file with --fabric, or add "
            "a [fabric] table to dataset.toml"
        )
    assert dataset.thickness is not None and dataset.areal_density is not None
    sources = {k: v for k, v in dataset.sources.items() if k in ("thickness", "areal_density", "bending")}
    measured = {k: dataset.bending[k] for k in ("warp", "weft", "twist", "coupling") if k in dataset.bending}
    if "warp" in measured and "weft" in measured:
        bending = Bending.from_rigidities(**measured)
        if "twist" not in measured:
            sources["bending.twist"] = "ASSUMED: Huber's estimate, sqrt(warp * weft)/2 - coupling/2; not measured"
        if "coupling" not in measured:
            sources["bending.coupling"] = "ASSUMED: 0, not measured"
    else:
        bending = Bending.derived(law, dataset.thickness)
        sources["bending"] = "not measured: derived from the membrane law at its initial values, as for a solid sheet"
    return Fabric(dataset.name, law, dataset.thickness, dataset.areal_density, bending, sources)


def calibrate(
    dataset: Dataset,
    laws: Sequence,
    *,
    fabric=None,
    level: str = "homogeneous",
    fe_laws: str = "best",
    starts: int = 3,
    seed: int = 0,
    max_evaluations: int = 200,
    replicates: int = 0,
    bootstrap_method: str = "block",
    with_profiles: bool = True,
    cross_validation: bool = True,
    checkpoints: Path | None = None,
    resume: bool = True,
    where: Workers = SERIAL,
    progress: Callable[[str, int, int], None] | None = None,
) -> Study:
    """Calibrate.

    Parameters
    ----------
    dataset : Dataset
        Its experiments of role 'fit' are fitted; all are predicted.
    laws : sequence of Law
        Compared at the homogeneous level; their values are the initial ones.
    fabric : Fabric, optional
        Thickness, areal density and bending; by default from the dataset.
    level : str
        'homogeneous', or 'fe' (any registered level): refitted there, each law started from its homogeneous answer and
        from its initial values (`calibration.finite_element.refine`).
    fe_laws : {'best', 'all'}
        Which laws are refitted at the second level.
    replicates : int
        Bootstrap replicates of the final fit; 0 leaves it out.
    checkpoints : Path, optional
        Folder for the checkpoint files.
    progress : callable, optional
        ``progress(stage, done, total)``.

    Raises
    ------
    InputError
        Nothing to fit.
    NotConvergedError
        No law could be fitted.
    """

    timings: dict[str, float] = {}

    @contextlib.contextmanager
    def timed(stage):
        clock = time.perf_counter()
        yield
        timings[stage] = time.perf_counter() - clock

    def at(stage):
        return None if progress is None else (lambda done, total: progress(stage, done, total))

    experiments = dataset.select(role="fit")
    if not experiments:
        raise InputError(f"dataset '{dataset.name}' has no experiment of role 'fit'")
    if fe_laws not in ("best", "all"):
        raise InputError(f"unknown choice of laws '{fe_laws}' for the second level; known: best, all")
    if replicates and bootstrap_method not in METHODS:
        raise InputError(f"unknown bootstrap method '{bootstrap_method}'; known: {', '.join(METHODS)}")
    if not laws:
        raise InputError("no law to fit; name at least one")
    base = template_fabric(dataset, laws[0], fabric)
    problems = law_problems(base, laws, experiments, "homogeneous")

    def files(name, some):
        return None if checkpoints is None else [checkpoints / f"{name}-{p.fabric.law.name}.json" for p in some]

    common: dict[str, Any] = {"seed": seed, "max_evaluations": max_evaluations, "resume": resume, "where": where}
    with timed("homogeneous fits"):
        first = compare(
            problems, starts=starts, checkpoints=files("homogeneous", problems), progress=at("homogeneous fits"), **common
        )
    levels = {"homogeneous": first}
    if first[0].fit is None:
        raise NotConvergedError(f"no law could be fitted: {'; '.join(f'{r.law}: {r.error}' for r in first)}")
    if level != "homogeneous":
        chosen = [r for r in first if r.fit is not None][: 1 if fe_laws == "best" else None]
        second: dict[str, Any] = {"max_evaluations": max_evaluations, "resume": resume, "where": where}
        with timed(f"{level} fits"):
            levels[level] = refine(problems, chosen, level, folder=checkpoints, progress=at(f"{level} fits"), **second)
        if levels[level][0].fit is None:
            reasons = "; ".join(f"{r.law}: {r.error}" for r in levels[level])
            raise NotConvergedError(f"no law could be fitted at the level '{level}': {reasons}")
    best = levels[level][0].fit
    assert best is not None
    with timed("profiles"):
        found = profiles(best, where=where, progress=at("profiles")) if with_profiles else {}
    boot = None
    if replicates:
        with timed("bootstrap"):
            boot = bootstrap(
                best, replicates, method=bootstrap_method, seed=seed, where=where, progress=at("bootstrap replicates")
            )
    linear = linear_statistics(best)
    checks = predict_all(best.fabric, dataset.experiments, level)
    cross = []
    if cross_validation:
        with timed("cross-validation"):
            cross = cross_validate(best.fabric, dataset.experiments, level, where=where, progress=at("cross-validation"))
    settings = {"starts": starts, "seed": seed, "bootstrap": replicates, "bootstrap_method": bootstrap_method}
    return Study(
        dataset=dataset,
        fabric=base,
        level=level,
        levels=levels,
        fit=best,
        linear=linear,
        profiles=found,
        bootstrap=boot,
        checks=checks,
        intervals=by_interval(checks),
        cross=cross,
        words=all_words(best, linear, found, boot),
        settings=settings,
        timings=timings,
    )
