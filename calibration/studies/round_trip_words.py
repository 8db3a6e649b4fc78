"""Summary of the round trip in numbers and in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

COVERAGE, MEDIAN_ERROR = 0.85, 2.0
"""What the study must show: 17 of 20 intervals of mu cover the truth, median error of mu in %."""


def summary(s, rows: list[dict], bias: dict, profiles: dict, expected: Sequence[dict] = ()) -> dict:
    """From the runs of `calibration.studies.round_trip` to what is reported."""
    n = len(rows)
    errors = np.array([r["error_percent"]["mu"] for r in rows])
    out = {
        "seeds": n,
        "covered_linear": sum(r["covered_linear"]["mu"] for r in rows),
        "covered_profile": sum(r["covered_profile"]["mu"] for r in rows),
        "median_error_percent": float(np.median(np.abs(errors))),
        "largest_error_percent": float(np.abs(errors).max()),
        "mean_error_percent": float(errors.mean()),
        "scatter_percent": float(errors.std(ddof=1)) if n > 1 else None,
        "mesh_bias": bias,
        "nu": nu_summary(s, rows, bias, profiles) | {"expected_precision": list(expected)},
        "profiles": profiles,
    }
    need = int(np.ceil(COVERAGE * n - 1e-9))
    out["passed"] = bool(min(out["covered_linear"], out["covered_profile"]) >= need and out["median_error_percent"] <= MEDIAN_ERROR)
    out["words"] = [mu_words(s, out), *bending_words(bias), nu_words(s, out["nu"]), *precision_words(s, expected)]
    out["per_seed"] = rows
    return out


def nu_summary(s, rows: list[dict], bias: dict, profiles: dict) -> dict:
    """What the seeds say about nu."""
    nu = np.array([r["parameters"]["law.nu"] for r in rows])
    widths = [r["interval"]["nu"][1] / r["interval"]["nu"][0] for r in rows]
    return {
        "truth": s.nu,
        "seeds": len(rows),
        "median": float(np.median(nu)),
        "smallest": float(nu.min()),
        "largest": float(nu.max()),
        "median_error_percent": float(np.median(np.abs(100 * (nu / s.nu - 1)))),
        "covered_linear": sum(r["covered_linear"]["nu"] for r in rows),
        "covered_profile": sum(r["covered_profile"]["nu"] for r in rows),
        "without_upper_bound": sum(r["nu_without_upper_bound"] for r in rows),
        "median_interval_factor": float(np.median(widths)),
        "median_correlation_mu_nu": float(np.median([r["correlation_mu_nu"] for r in rows])),
        "mesh_bias_percent": bias["law_percent"]["nu"],
        "profile_interval_first_seed": profiles["nu"]["interval"] if profiles else None,
    }


def mu_words(s, out: dict) -> str:
    """Coverage, error and mesh bias of mu, from the summary `out`, as prose."""
    scatter = "" if out["scatter_percent"] is None else f", scatter {out['scatter_percent']:.2f} %"
    moved = out["mesh_bias"]["law_percent"]["mu"]
    return (f"mu: the {100 * s.confidence:g} % interval covers the truth in {out['covered_linear']} (linearised) and "
            f"{out['covered_profile']} (profile likelihood) of {out['seeds']} seeds; median error "
            f"{out['median_error_percent']:.2f} %{scatter}. Without noise the coarser mesh alone moves mu by {moved:+.2f} %.")


def bending_words(bias: dict) -> list[str]:
    """Bias of the bending rigidities without noise, as prose: one item, or none where bending was not fitted."""
    b = bias["bending_percent"]
    if not b:
        return []
    parts = ", ".join(f"{k} {v:+.1f} %" for k, v in b.items())
    return [f"Bending, without noise: {parts}. These are differences of model, not of mesh or noise: the overhangs come from a "
            "sheet of finite width, which does not curve across as freely as the narrow strip of the elastica that reads them."]


def nu_words(s, nu: dict) -> str:
    """What the data say about nu, from the dict of :func:`nu_summary`, as prose."""
    n_open = nu["without_upper_bound"]
    bound = ("no seed excludes" if n_open == nu["seeds"] else f"{n_open} of {nu['seeds']} seeds do not exclude") if n_open else \
        "every seed excludes"
    first = ""
    if nu["profile_interval_first_seed"] is not None:
        low, high = nu["profile_interval_first_seed"]
        first = f" The profile of the first seed reaches from {_end(low, 'no lower bound')} to {_end(high, 'no upper bound')}."
    side = "no" if n_open else "an"
    factor, rho = nu["median_interval_factor"], nu["median_correlation_mu_nu"]
    return (f"nu: {nu['smallest']:.3g} to {nu['largest']:.3g} over the seeds for a truth of {nu['truth']:g}; a typical interval "
            f"spans a factor {factor:.3g}; mu and nu are correlated by {rho:+.3f}. {bound[0].upper()}{bound[1:]} a nu so large "
            f"that the chains never lock: the data set nu {side} upper bound. Tension up to {100 * s.top:g} % is far from locking: "
            f"the data determine the stiffness, and nu only through the slight change of the curve's shape.{first}")


def precision_words(s, expected: Sequence[dict]) -> list[str]:
    """How far one would have to pull to know nu."""
    if not expected:
        return []

    def listed(known: bool) -> str:
        chosen = [e for e in expected if (len(e["unknown"]) == 2) == known]
        sizes = [f"{e['nu_factor']:.3g}" if np.isfinite(e["nu_factor"]) else "unbounded" for e in chosen]
        return ", ".join(f"{100 * e['top']:g} %: {size}" for e, size in zip(chosen, sizes, strict=True))

    return [f"Expected factor between the ends of nu's interval at {100 * s.noise:g} % noise, by the largest strain pulled: "
            f"{listed(True)} with the anisotropy known as here; {listed(False)} with the shares of warp and weft unknown too."]


def _end(value: float | None, none: str) -> str:
    return none if value is None else f"{value:.3g}"
