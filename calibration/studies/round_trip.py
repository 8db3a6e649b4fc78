r"""Synthetic round trip: is a known truth found again from noisy curves, and do the stated intervals cover it?

Truth: the law `EightChainSilk` at the figures of the silk paper. Data: strips (ASTM D5035, 75 x 25 mm between grips) along warp,
weft and bias and overhangs (ASTM D1388 option A) in the same directions, both by finite elements, the strips on a mesh some nine
times finer than the one that fits, plus noise. Unknown are mu, nu and the bending rigidities; the anisotropy is held.

Coverage by the profile likelihood is decided by one refit with the parameter held at the truth: it lies in the interval
exactly if that costs no more than the F quantile (Bates & Watts 1988, section 6.1, doi 10.1002/9780470316757).
"""

from __future__ import annotations

import math
import time
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from calibration.experiments import DIRECTIONS, Experiment
from calibration.fit import Fit, fit
from calibration.homogeneous import line_force
from calibration.problem import Problem, bending_unknowns, law_unknowns
from calibration.profile import profile
from calibration.runs import SERIAL, Workers
from calibration.statistics import linear_statistics
from calibration.studies import kept
from mfar_fem.errors import InputError, MfarError, NotConvergedError

GAUGE, WIDTH = 0.075, 0.025
LARGE_NU = 1e5
"""Stands for 'no locking at all': forces differ from the limit by less than 1e-6."""
RIGIDITIES = ("warp", "weft", "twist")


@dataclass(frozen=True)
class Settings:
    """What the study is run with.

    Attributes
    ----------
    mu, nu, eta, omega1, omega2
        The truth (Pa and dimensionless).
    top : float
        Largest engineering strain of the strips; ``readings`` of them, evenly spaced.
    overhangs : int
        Specimens by direction of the cantilever test.
    noise : float
        Standard deviation over the range of a curve (over the value of an overhang).
    truth, fitted : str
        Fidelity of the meshes that make the data and that fit them.
    """

    mu: float = 87.5e3
    nu: float = 5.2
    eta: float = 1.8
    omega1: float = 0.75
    omega2: float = 0.25
    top: float = 0.25
    readings: int = 20
    overhangs: int = 4
    noise: float = 0.01
    truth: str = "reference"
    fitted: str = "standard"
    confidence: float = 0.95

    def __post_init__(self) -> None:
        if not (0 < self.noise < 1):
            raise InputError(f"noise is {self.noise:g}; it must be a fraction of the range between 0 and 1, such as 0.01")
        if not (0 < self.top <= 1):
            raise InputError(f"the largest strain is {self.top:g}; it must be above 0 and at most 1")

    @property
    def level(self) -> str:
        """Level of the forward model that fits (`calibration.forward`): 'fe', or 'fe-' and the fidelity."""
        return "fe" if self.fitted == "standard" else f"fe-{self.fitted}"


def true_fabric(s: Settings):
    """The preset ``paper-silk`` with the truth's law; its bending follows from the law as for a solid sheet."""
    from mfar_fem.materials import EightChainSilk
    from mfar_fem.materials.bending import Bending
    from mfar_fem.materials.fabric import Fabric

    law = EightChainSilk(mu=s.mu, nu=s.nu, eta=s.eta, omega1=s.omega1, omega2=s.omega2)
    fabric = Fabric.load("paper-silk")
    return fabric.replace(law=law, bending=Bending.derived(law, fabric.thickness))


def clean_data(s: Settings, progress=None) -> list[dict]:
    """The noiseless readings by finite elements: one dict of JSON types an experiment."""
    from material_tests.cantilever.fe import option_a
    from material_tests.strip.fe import StripTest

    fabric, out = true_fabric(s), []
    strain = np.linspace(s.top / s.readings, s.top, s.readings)
    for k, (name, angle) in enumerate(DIRECTIONS.items()):
        curve = StripTest(GAUGE, WIDTH, angle, s.truth).run(fabric, strain)
        if not curve.converged:
            raise NotConvergedError(f"the synthetic {name} strip was not computed: {curve.message}")
        out.append({"name": name, "kind": "strip", "direction": angle, "x": strain.tolist(), "y": curve.line_force.tolist()})
        if s.overhangs:
            droop = option_a(fabric, angle, fidelity=s.truth if s.truth != "reference" else "standard")
            chord = [math.radians(41.5)] * s.overhangs
            out.append({"name": f"{name} overhang", "kind": "cantilever", "direction": angle, "x": chord,
                        "y": [droop.reading] * s.overhangs})
        if progress is not None:
            progress(k + 1, len(DIRECTIONS))
    return out


def noisy(clean: list[dict], s: Settings, seed: int | None) -> tuple[Experiment, ...]:
    """Experiments with independent Gaussian noise (None: without); every reading counts alike."""
    rng = np.random.default_rng(seed)
    out = []
    for c in clean:
        strip = c["kind"] == "strip"
        e = Experiment(c["name"], np.array(c["x"]), np.array(c["y"]), kind=c["kind"], direction=c["direction"],
                       gauge=GAUGE if strip else 0.0, width=WIDTH if strip else 0.0, weight=len(c["x"]))
        if seed is not None:
            e = replace(e, y=e.y + s.noise * e.scale * rng.standard_normal(len(e)))
        out.append(e)
    return tuple(out)


def fitted(clean: list[dict], s: Settings, seed: int | None) -> Fit:
    """Fit from values far from the truth: homogeneous first, which starts the finite elements."""
    fabric = true_fabric(s)
    law = fabric.law.replace(mu=s.mu / 4, nu=2.0)
    start = fabric.replace(law=law, bending=replace(fabric.bending, **{k: 2 * getattr(fabric.bending, k) for k in RIGIDITIES}))
    experiments = noisy(clean, s, seed)
    unknowns = law_unknowns(law, ["mu", "nu"])
    if any(e.kind == "cantilever" for e in experiments):
        unknowns += bending_unknowns(start, RIGIDITIES)
    first = fit(Problem(start, unknowns, experiments))
    values = first.parameters | {"law.nu": float(np.clip(first.parameters["law.nu"], 1.0, 20.0))}  # not from where nu is flat
    return fit(first.problem.started_at(values).vary(level=s.level))


def cost_at(f: Fit, name: str, value: float) -> float:
    """``(SSR(value) - SSR_min)/s²`` with the other unknowns refitted; inf where that fails."""
    problem = f.problem.started_at(f.parameters)
    n, p = f.jacobian.shape
    try:
        held = fit(problem.fixed(name, value), tolerance=1e-7)
    except MfarError:
        return math.inf
    return (held.ssr - f.ssr) / (f.ssr / (n - p))


def one_seed(job: tuple[Settings, str, int]) -> dict:
    """Fit one noisy set of curves (JSON types)."""
    import json

    from scipy.stats import f as fisher

    s, clean, seed = job
    clock = time.perf_counter()
    f = fitted(json.loads(clean), s, seed)
    linear = linear_statistics(f, s.confidence)
    n, p = f.jacobian.shape
    limit = float(fisher.ppf(s.confidence, 1, n - p))
    truth = {"law.mu": s.mu, "law.nu": s.nu}
    i, j = (linear.names.index(k) for k in truth)
    out: dict[str, Any] = {"seed": seed, "parameters": f.parameters, "converged": f.converged, "evaluations": f.n_evaluations,
           "rmse_percent_of_range": f.rmse_percent_of_range, "correlation_mu_nu": float(linear.correlation[i, j]),
           "condition": linear.condition, "error_percent": {}, "interval": {}, "covered_linear": {}, "covered_profile": {}}
    for name, value in truth.items():
        low, high = linear.intervals[name]
        key = name.removeprefix("law.")
        out["error_percent"][key] = 100.0 * (f.parameters[name] / value - 1.0)
        out["interval"][key] = [low, high]
        out["covered_linear"][key] = bool(low <= value <= high)
        out["covered_profile"][key] = bool(cost_at(f, name, value) <= limit)
    out["nu_without_upper_bound"] = bool(cost_at(f, "law.nu", LARGE_NU) <= limit)
    out["wall_s"] = time.perf_counter() - clock
    return out


def bias(clean: list[dict], s: Settings) -> dict:
    """What the coarser mesh does on its own: errors (%) of a fit to the noiseless data."""
    f = fitted(clean, s, None)
    law = {k: 100.0 * (f.parameters[f"law.{k}"] / getattr(s, k) - 1.0) for k in ("mu", "nu")}
    true = true_fabric(s).bending
    bending = {k: 100.0 * (f.parameters[f"bending.{k}"] / getattr(true, k) - 1.0) for k in RIGIDITIES
               if f"bending.{k}" in f.parameters}
    return {"law_percent": law, "bending_percent": bending, "rmse_percent_of_range": f.rmse_percent_of_range,
            "rmse_by_experiment": f.rmse_by_experiment}


def expected_precision(s: Settings, tops=(0.05, 0.10, 0.25, 0.5, 1.0)) -> list[dict]:
    """How well mu and nu could be known, by the largest strain of the strips and by what else is unknown.

    From the Jacobian at the truth (no mesh, noise of `Settings.noise` times the range reached): the 95 % interval of nu spans the
    factor ``nu_factor``, infinite from 1e6 on. No fit is made.
    """
    fabric, out = true_fabric(s), []
    for top in tops:
        strain = np.linspace(top / s.readings, top, s.readings)
        for names in (("mu", "nu"), ("mu", "nu", "omega1", "omega2")):
            unknowns, experiments = law_unknowns(fabric.law, names), []
            for name, angle in DIRECTIONS.items():
                y = line_force(fabric, angle, strain).y
                experiments.append(Experiment(name, strain, y, direction=angle, gauge=GAUGE, width=WIDTH))
            problem = Problem(fabric, unknowns, tuple(experiments))
            _, J, _ = problem.evaluate(problem.q0())
            sd = s.noise * np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
            span = np.exp(np.minimum(2 * 1.96 * sd, 50.0))
            factor = [float(v) if v < 1e6 else math.inf for v in span[:2]]
            out.append({"top": top, "unknown": list(names), "mu_factor": factor[0], "nu_factor": factor[1]})
    return out


def example_profiles(clean: list[dict], s: Settings, seed: int) -> dict:
    """Whole profiles of mu and nu for one seed."""
    f = fitted(clean, s, seed)
    out = {}
    for name in ("law.mu", "law.nu"):
        p = profile(f, name, confidence=s.confidence)
        out[name.removeprefix("law.")] = {"seed": seed, "best": p.best, "interval": [p.low, p.high], "values": p.values.tolist(),
                                          "delta": p.delta.tolist(), "threshold": p.threshold}
    return out


def run(seeds: int = 20, settings: Settings | None = None, *, first_seed: int = 0, with_profile: bool = True, folder=None,
        resume: bool = True, where: Workers = SERIAL, progress=None) -> dict:
    """The whole study.

    Parameters
    ----------
    seeds : int
        Noisy repetitions.
    settings : Settings, optional
    with_profile : bool
        Trace the profiles of mu and nu for the first seed.
    folder : Path, optional
        Keeps finished runs (`calibration.studies.kept`).
    progress : callable, optional
        ``progress(stage, done, total)``.

    Returns
    -------
    dict
        ``covered_linear``, ``covered_profile`` (seeds whose interval of mu covers the truth), ``median_error_percent`` of mu,
        ``mesh_bias``, ``nu``, ``words``, ``per_seed``, ``wall_s``, ...

    Raises
    ------
    InputError
        No seed.
    """
    import json

    from calibration.studies.round_trip_words import summary

    if seeds < 1:
        raise InputError(f"--seeds is {seeds}; at least 1 is needed")
    s, clock = settings or Settings(), time.perf_counter()

    def at(stage):
        return None if progress is None else (lambda done, total: progress(stage, done, total))

    common = {"folder": folder, "resume": resume}
    clean = kept.run_kept(clean_data, [s], ["data"], progress=at("synthetic data"), **common)[0]
    text = json.dumps(clean)
    alone = kept.run_kept(_bias, [(s, text)], ["mesh-bias"], progress=at("noiseless fit"), **common)[0]
    numbers = range(first_seed, first_seed + seeds)
    rows = kept.run_kept(one_seed, [(s, text, k) for k in numbers], [f"seed-{k:03d}" for k in numbers], where=where,
                         progress=at("noisy fits"), **common)
    shapes = {}
    if with_profile:
        shapes = kept.run_kept(_profiles, [(s, text, first_seed)], ["profiles"], progress=at("profiles"), **common)[0]
    return summary(s, rows, alone, shapes, expected_precision(s)) | {"settings": asdict(s), "wall_s": time.perf_counter() - clock}


def _bias(job) -> dict:
    import json

    return bias(json.loads(job[1]), job[0])


def _profiles(job) -> dict:
    import json

    return example_profiles(json.loads(job[1]), job[0], job[2])
