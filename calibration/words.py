"""The statistics in plain words: what the data say about every parameter, and what they do not."""

from __future__ import annotations

import math
from collections.abc import Mapping

from calibration.bootstrap import Bootstrap
from calibration.fit import Fit
from calibration.profile import Profile
from calibration.statistics import STRONG_CORRELATION, Linear

POOR_CONDITION = 1e4
CORRELATED_RESIDUALS = 0.5


def number(value: float, unit: str = "") -> str:
    """A number to 4 significant digits with its unit."""
    text = f"{value:.4g}" if math.isfinite(value) else ("infinite" if value > 0 else "minus infinite")
    return f"{text} {unit}" if unit and unit not in ("-", "dimensionless", "1") else text


def short(name: str) -> str:
    """'mu' for 'law.mu'; bending rigidities keep their prefix."""
    return name.removeprefix("law.")


def parameter_words(f: Fit, name: str, linear: Linear, profile: Profile | None = None) -> str:
    """One or two sentences about a parameter: value, interval, and what is wrong with it if anything is."""
    u = f.problem.unknowns[f.problem.names.index(name)]
    value, percent = f.parameters[name], f"{100 * linear.level:g} %"
    head = f"{short(name)}: {number(value, u.unit)}"
    zero = u.lower == 0.0 and u.scale == "linear"
    open_profile = profile is not None and math.isfinite(profile.threshold)
    low: float | None
    high: float | None
    if profile is not None and open_profile:
        parts = [head + "; " + _profile_interval(profile, u.unit, percent, zero) + "."]
        low, high = profile.low, profile.high
    else:
        low, high = linear.intervals[name]
        finite = math.isfinite(low) and math.isfinite(high)
        text = f"{percent} interval {number(low)} to {number(high, u.unit)} (linearised)" if finite else "no interval"
        parts = [f"{head}; {text}" + ("" if finite else ": the Jacobian is singular, the data do not determine it") + "."]
        if profile is not None and profile.note:
            parts.append(f"Its profile {profile.note}.")
    side = f.at_bounds().get(name)
    if side:
        bound = u.lower if side == "lower" else u.upper
        parts.append(f"It ended on its {side} bound {number(bound, u.unit)}: the value is the bound's, not the data's.")
    elif not open_profile and low is not None and high is not None and math.isfinite(low) and (low < u.lower or high > u.upper):
        parts.append("Warning: the interval reaches past a bound.")
    if u.scale == "linear" and low is not None and high is not None and low < 0.0 < high:
        parts.append("Warning: the interval contains zero; the data do not show that this effect exists.")
    elif low is not None and high is not None and low > 0 and high / low > 10:
        parts.append(f"Poorly determined: the interval spans a factor {high / low:.2g}.")
    return " ".join(parts)


def _profile_interval(p: Profile, unit: str, percent: str, zero: bool) -> str:
    if zero and p.low is None and p.high is not None:
        return f"at most {number(p.high, unit)} at {percent}; zero is not excluded"
    if p.low is None and p.high is None:
        return f"no lower and no upper bound at {percent}: the data do not determine it"
    if p.high is None:
        assert p.low is not None
        return f"at least {number(p.low, unit)} at {percent}, no upper bound: the data do not determine it"
    if p.low is None:
        return f"at most {number(p.high, unit)} at {percent}, no lower bound: the data do not determine it"
    return f"{percent} interval {number(p.low)} to {number(p.high, unit)} (profile likelihood)"


def all_words(
    f: Fit, linear: Linear, profiles: Mapping[str, Profile] | None = None, bootstrap: Bootstrap | None = None
) -> dict[str, list[str] | dict[str, str]]:
    """Words for a report.

    Returns
    -------
    dict
        ``parameters``: name to sentence; ``warnings``: sentences about the fit as a whole.
    """
    profiles = profiles or {}
    words = {name: parameter_words(f, name, linear, profiles.get(name)) for name in f.problem.names}
    return {"parameters": words, "warnings": _warnings(f, linear, profiles, bootstrap)}


def _warnings(f: Fit, linear: Linear, profiles, bootstrap: Bootstrap | None) -> list[str]:
    out = []
    if not f.converged:
        out.append(f"The fit did not converge: {f.status}.")
    for a, b, rho in linear.strong_pairs(STRONG_CORRELATION):
        out.append(
            f"{short(a)} and {short(b)} are strongly correlated ({rho:+.3f}): the data determine a combination of "
            "the two better than either."
        )
    if linear.rank < len(linear.names):
        out.append(
            f"The Jacobian has rank {linear.rank} for {len(linear.names)} parameters: "
            "some combination of them does not change the prediction at all."
        )
    elif linear.condition > POOR_CONDITION:
        out.append(f"The scaled Jacobian has condition {linear.condition:.1e}: some combination is hardly determined.")
    bad = {k: v for k, v in linear.autocorrelation.items() if v > CORRELATED_RESIDUALS}
    if bad:
        curves = ", ".join(f"{k} ({v:.2f})" for k, v in bad.items())
        out.append(
            f"Residuals are correlated along the curve ({curves}): they show misfit of the law, not noise. Intervals "
            "that assume independent errors are too narrow."
        )
    for p in profiles.values():
        if p.improved is not None:
            out.append(f"The profile of {short(p.name)} found a better fit (SSR {p.improved:.4g} under {f.ssr:.4g}).")
    if bootstrap is not None:
        if bootstrap.failed:
            out.append(f"{bootstrap.failed} bootstrap replicates failed and were left out.")
        for name in f.problem.names:
            low, high = bootstrap.intervals[name]
            lower, upper = linear.intervals[name]
            if all(map(math.isfinite, (lower, upper))) and high - low > 2 * (upper - lower):
                out.append(
                    f"The bootstrap interval of {short(name)} ({number(low)} to {number(high)}) is more than twice as "
                    "wide as the linearised one: trust the wider."
                )
    return out
