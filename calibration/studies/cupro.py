"""Every law by finite elements on the measured cupro strips (warp, weft and bias at once), in both states of the fabric.

Each law is fitted without a mesh first, which starts the finite elements (`calibration.finite_element.refine`); laws whose fit has
several minima get more starts. Beside the numbers stands, in words, why a law cannot follow the measurement.
"""

from __future__ import annotations

import time
from collections.abc import Sequence

from calibration.compare import LawResult, compare, law_problems
from calibration.finite_element import refine
from calibration.runs import SERIAL, Workers
from calibration.studies.reasons import EACH_DIRECTION, OVER_ALL, reasons
from mfar_fem.errors import InputError

VARIANTS = ("preconditioned", "virgin")
STARTS = {"bischoff": {"mu": 1e6, "a": 3.0, "b": 5.0, "c": 1.0}}
"""Second starting values of laws whose own lead to a poorer minimum."""


def fit_all(variant: str, laws: Sequence, level: str = "fe", *, dataset: str = "cupro-su1098", starts: int = 3, seed: int = 0,
            max_evaluations: int = 200, folder=None, resume: bool = True, where: Workers = SERIAL,
            progress=None):
    """Fit laws to one state of the fabric.

    Returns
    -------
    experiments : tuple of Experiment
    homogeneous, final : list of LawResult
        Without a mesh and at `level`; best AICc first.
    """
    from calibration.datasets import resolve
    from calibration.study import template_fabric

    data = resolve(dataset, variant)
    experiments = data.select(role="fit")
    base = template_fabric(data, laws[0])
    known = [STARTS.get(law.name) for law in laws]
    initial = law_problems(base, [law.replace(**k) if k else law for law, k in zip(laws, known, strict=True)], experiments)
    second = law_problems(base, [law for law, k in zip(laws, known, strict=True) if k], experiments) if any(known) else []

    def at(stage):
        return None if progress is None else (lambda done, total: progress(f"{variant}: {stage}", done, total))

    files = None
    if folder is not None:
        names = [f"homogeneous-{p.fabric.law.name}.json" for p in initial]
        files = [folder / n for n in names] + [folder / f"homogeneous-again-{p.fabric.law.name}.json" for p in second]
    tried = compare([*initial, *second], starts=starts, seed=seed, max_evaluations=max_evaluations, checkpoints=files,
                    resume=resume, where=where, progress=at("homogeneous fits"))
    first: dict[str, LawResult] = {}
    for result in sorted(tried, key=lambda r: float("inf") if r.fit is None else r.fit.cost):
        first.setdefault(result.law, result)
    homogeneous = sorted(first.values(), key=lambda r: (r.fit is None, r.aicc))
    if level == "homogeneous":
        return experiments, homogeneous, homogeneous
    final = refine(initial, homogeneous, level, max_evaluations=max_evaluations, folder=folder, resume=resume, where=where,
                   progress=at("finite elements"))
    missing = [r for r in homogeneous if r.law not in {f.law for f in final}]
    return experiments, homogeneous, [*final, *missing]


def row(result: LawResult, homogeneous: LawResult | None, least: float) -> dict:
    """One line of the table, with the reasons."""
    out = result.to_dict()
    if result.fit is None:
        return out | {"reaches_target": False, "why_not": [f"It could not be fitted: {result.error}."]}
    errors = result.fit.rmse_by_experiment
    out["delta_aicc"] = result.aicc - least
    out["largest_rmse_percent_of_range"] = max(errors.values())
    out["reaches_target"] = bool(out["rmse_percent_of_range"] <= OVER_ALL and max(errors.values()) <= EACH_DIRECTION)
    out["homogeneous_rmse_percent_of_range"] = None if homogeneous is None or homogeneous.fit is None else \
        homogeneous.fit.rmse_percent_of_range
    out["evaluation_s"] = evaluation_time(result.fit)
    out["why_not"] = reasons(result.fit)
    return out


def evaluation_time(f) -> float:
    """Seconds for one evaluation of all curves with derivatives, meshing and every load step included."""
    fresh = f.problem.vary(level=f.problem.level)
    clock = time.perf_counter()
    fresh.evaluate(f.q)
    return time.perf_counter() - clock


def run(laws: Sequence | None = None, variants: Sequence[str] = VARIANTS, level: str = "fe", *, folder=None, progress=None,
        **settings) -> dict:
    """The whole study.

    Parameters
    ----------
    laws : sequence of Law, optional
        All registered ones by default.
    variants : sequence of str
        States of the fabric.
    level : str
        'fe', or another registered level.
    folder : Path, optional
        Of the checkpoints.
    settings
        See `fit_all`.

    Returns
    -------
    dict
        ``variants``: name to ``laws`` (rows, best AICc first), ``best_law``, ``wall_s``; ``words``.
    """
    from mfar_fem.materials import get_law, law_names

    laws = [get_law(n) for n in law_names()] if laws is None else list(laws)
    if not laws or not variants:
        raise InputError("name at least one law and one state of the fabric")
    clock, out, words = time.perf_counter(), {}, []
    for variant in variants:
        begin = time.perf_counter()
        where = None if folder is None else folder / variant
        experiments, first, final = fit_all(variant, laws, level, folder=where, progress=progress, **settings)
        by_law = {r.law: r for r in first}
        rows = [row(r, by_law.get(r.law), final[0].aicc) for r in final]
        out[variant] = {"laws": rows, "best_law": final[0].law if final[0].fit else None,
                        "experiments": {e.name: {"readings": len(e), "range_N_per_m": e.scale, "largest_strain": float(e.x.max())}
                                        for e in experiments},
                        "wall_s": time.perf_counter() - begin}
        words += _words(variant, rows)
    return {"level": level, "target": {"over_all_percent": OVER_ALL, "each_direction_percent": EACH_DIRECTION}, "variants": out,
            "words": words, "wall_s": time.perf_counter() - clock}


def _words(variant: str, rows: list[dict]) -> list[str]:
    good = [r["law"] for r in rows if r["reaches_target"]]
    head = f"{variant}: {OVER_ALL:g} % of the range over all and {EACH_DIRECTION:g} % in each direction "
    head += f"is reached by {', '.join(good)}." if good else "is reached by no law."
    return [head, *(f"{variant}, {r['law']}: {' '.join(r['why_not'])}" for r in rows if r["why_not"] and not r["reaches_target"])]
