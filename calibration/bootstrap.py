"""Bootstrap: the fit repeated on resampled data.

- ``residual``: predictions plus residuals drawn with replacement within each experiment, inflated by sqrt(n/(n-p)).
  For a law that fits to within noise.
- ``case``: readings drawn with replacement within each experiment. Needs no constant variance.
- ``block``: as ``residual``, in runs of neighbouring residuals (circular blocks of about n^(1/3), at least 3), which
  keeps their correlation along a curve.
- ``specimen``: whole experiments drawn with replacement among those of one kind, direction and gauge: the only one that
  sees the scatter from specimen to specimen. It needs at least two specimens in some group.

Efron & Tibshirani, An Introduction to the Bootstrap (1993), doi 10.1201/9780429246593.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calibration.fit import Fit, fit
from calibration.runs import SERIAL, Failed, Workers, run_all
from mfar_fem.errors import InputError, MfarError

METHODS = ("residual", "case", "block", "specimen")


@dataclass(frozen=True, eq=False)
class Bootstrap:
    """Bootstrap of a fit.

    Attributes
    ----------
    method : str
    names : tuple of str
    values : ndarray, shape (replicates, p)
        Parameters of every successful replicate, SI.
    failed : int
        Replicates whose fit failed.
    intervals : dict of str to (low, high)
        Percentile intervals at `level`.
    level : float
    """

    method: str
    names: tuple[str, ...]
    values: np.ndarray
    failed: int
    intervals: dict[str, tuple[float, float]]
    level: float

    @property
    def median(self) -> dict[str, float]:
        """Median over the replicates by parameter, SI."""
        return dict(zip(self.names, np.median(self.values, axis=0).tolist(), strict=True))


def resample(f: Fit, method: str, rng: np.random.Generator):
    """A problem with resampled data, started at the fitted values."""
    problem = f.problem.started_at(f.parameters)
    n, p = f.jacobian.shape
    if method == "case":
        draws = [rng.multinomial(len(e), np.full(len(e), 1 / len(e))).astype(float) for e in problem.experiments]
        return problem.vary(multiplicity=tuple(draws))
    if method == "specimen":
        return problem.vary(experiments=_draw_specimens(problem.experiments, rng))
    experiments = []
    for e, prediction in zip(problem.experiments, f.predictions, strict=True):
        r = (e.y - prediction.y) * np.sqrt(n / (n - p))
        picked = rng.integers(0, len(e), len(e)) if method == "residual" else _blocks(len(e), rng)
        experiments.append(replace(e, y=prediction.y + r[picked]))
    # the models depend on the experiments' geometry and abscissa only, which are unchanged: keep them
    return replace(problem, experiments=_same_scale(problem.experiments, experiments), _models=problem.models())


def _same_scale(old, new):
    """Residuals stay divided by the measured range, not by that of the resampled curve: adjust the weights to it."""
    return tuple(replace(b, weight=a.weight * (b.scale / a.scale) ** 2) for a, b in zip(old, new, strict=True))


def _blocks(n: int, rng) -> np.ndarray:
    length = min(n, max(3, round(n ** (1 / 3))))
    starts = rng.integers(0, n, -(-n // length))
    return ((starts[:, None] + np.arange(length)) % n).ravel()[:n]


def _draw_specimens(experiments, rng):
    groups: dict[tuple, list] = {}
    for e in experiments:
        groups.setdefault((e.kind, round(e.direction, 9), round(e.gauge, 4)), []).append(e)
    if all(len(g) < 2 for g in groups.values()):
        raise InputError("the bootstrap over specimens needs at least two specimens of one kind, direction and gauge")
    out = []
    for group in groups.values():
        for j, i in enumerate(rng.integers(0, len(group), len(group))):
            out.append(replace(group[i], name=f"{group[i].name} (draw {len(out)}.{j})"))
    return tuple(out)


def _one(job) -> np.ndarray:
    f, method, seed, k, max_evaluations = job
    problem = resample(f, method, np.random.default_rng([seed, k]))
    g = fit(problem, max_evaluations=max_evaluations, tolerance=1e-7)
    return np.array([g.parameters[name] for name in f.problem.names])


def bootstrap(
    f: Fit,
    replicates: int = 100,
    *,
    method: str = "residual",
    seed: int = 0,
    confidence: float = 0.95,
    max_evaluations: int = 60,
    where: Workers = SERIAL,
    progress=None,
) -> Bootstrap:
    """Repeat the fit on resampled data, each replicate an independent run with its own random stream.

    Raises
    ------
    InputError
        Unknown method, fewer than 2 replicates, or no two specimens alike for 'specimen'.
    MfarError
        Every replicate failed.
    """
    if method not in METHODS:
        raise InputError(f"unknown bootstrap method '{method}'; known: {', '.join(METHODS)}")
    if replicates < 2:
        raise InputError(f"{replicates} bootstrap replicates; at least 2 are needed")
    if method == "specimen":
        _draw_specimens(f.problem.experiments, np.random.default_rng(0))
    jobs = [(f, method, seed, k, max_evaluations) for k in range(replicates)]
    results = run_all(_one, jobs, where, progress=progress, on_error="keep")
    good = [r for r in results if not isinstance(r, Failed)]
    for r in results:
        if isinstance(r, Failed) and not isinstance(r.error, MfarError):
            raise r.error
    if len(good) < 2:
        raise next(r.error for r in results if isinstance(r, Failed))
    values = np.array(good)
    tail = 50 * (1 - confidence)
    ends = np.percentile(values, [tail, 100 - tail], axis=0)
    intervals = {name: (float(a), float(b)) for name, a, b in zip(f.problem.names, *ends, strict=True)}
    return Bootstrap(method, f.problem.names, values, len(results) - len(good), intervals, confidence)
