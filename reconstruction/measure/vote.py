"""The weighted vote between kinds of sources, and the list of conflicts.

Weights as in the paper (section on fusion): textile 0.5, figurine 0.3, mural 0.2, renormalised over the kinds that measured the
length. The paper does not say what happens with several images of one kind: here they are averaged first (arithmetic mean), so that
ten murals do not outvote a textile; what their models get wrong (:mod:`reconstruction.measure.spread`) they get wrong together and
averaging does not reduce it. The fixed weights know nothing of uncertainty; ``weighting="precision"`` uses inverse variances
instead.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from mfar_fem.errors import InputError, UnknownNameError
from mfar_fem.tomlfile import suggest
from reconstruction.measure.quantity import Measurement

WEIGHTS = {"textile": 0.5, "figurine": 0.3, "mural": 0.2}
"""Weight of a kind in the vote (paper, section on fusion)."""
WEIGHTINGS = ("paper", "precision")
"""Ways to weigh the kinds."""
DEFAULT_WEIGHTING = "precision"
"""Of the commands: on the synthetic benchmark it gives 46 of 48 dimensions within 3 %, the paper's weights 20."""
Z_LIMIT = 2.0
"""Two values conflict if they differ by more than this many combined standard deviations."""


@dataclass(frozen=True)
class Vote:
    """The agreed value of one length.

    Attributes
    ----------
    name : str
    value, sigma : float
        Weighted mean and the standard deviation that the kinds' own uncertainties give it, m.
    spread : float
        Weighted standard deviation of the kinds about the value, m (0 with one kind).
    weights : dict of str to float
        Renormalised weights of the kinds present.
    values : dict of str to (float, float)
        Mean and standard deviation of every kind, m.
    chi_square, p_value : float
        Agreement of the kinds (about their inverse-variance mean; kinds - 1 degrees of freedom; 0 and 1 with one kind).
    """

    name: str
    value: float
    sigma: float
    spread: float
    weights: dict[str, float]
    values: dict[str, tuple[float, float]]
    chi_square: float
    p_value: float

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "name": self.name, "value_m": self.value, "sigma_m": self.sigma, "spread_m": self.spread, "weights": self.weights,
            "kinds": {kind: {"value_m": v, "sigma_m": s} for kind, (v, s) in self.values.items()},
            "chi_square": self.chi_square, "p_value": self.p_value,
        }


@dataclass(frozen=True)
class Conflict:
    """Two sources that disagree by more than their uncertainty allows."""

    name: str
    level: str
    first: str
    second: str
    first_value: float
    second_value: float
    combined_sigma: float
    z: float

    def to_dict(self) -> dict[str, Any]:
        """A row of ``conflicts.csv``."""
        return {
            "name": self.name, "level": self.level, "first": self.first, "second": self.second, "first_value_m": self.first_value,
            "second_value_m": self.second_value, "combined_sigma_m": self.combined_sigma, "z": self.z,
        }


def check_weighting(name: str) -> None:
    """:class:`UnknownNameError` if there is no such weighting."""
    if name not in WEIGHTINGS:
        raise UnknownNameError(f"unknown weighting '{name}' of the vote{suggest(name, WEIGHTINGS)}")


def vote(
    measurements: Iterable[Measurement], z_limit: float = Z_LIMIT, weighting: str = "paper"
) -> tuple[dict[str, Vote], list[Conflict]]:
    """Vote on every length that was measured.

    Parameters
    ----------
    measurements : iterable of Measurement
    z_limit : float
        See :data:`Z_LIMIT`.
    weighting : str
        One of :data:`WEIGHTINGS`: the paper's fixed weights, or inverse variances of the kinds (``precision``).

    Returns
    -------
    votes : dict of str to Vote
    conflicts : list of Conflict
        Between kinds (level ``kind``) and between images of one kind (level ``image``), largest |z| first.

    Raises
    ------
    InputError
        A measurement of an unknown kind, or one that is not finite.
    """
    check_weighting(weighting)
    by_name: dict[str, list[Measurement]] = {}
    for m in measurements:
        if m.kind not in WEIGHTS:
            raise InputError(f"{m.source}: no weight is known for the kind '{m.kind}'{suggest(m.kind, WEIGHTS)}")
        if not (np.isfinite(m.value) and np.isfinite(m.sigma)):
            raise InputError(f"{m.source}: {m.name} is {m.value} ± {m.sigma} m; it must be finite")
        by_name.setdefault(m.name, []).append(m)
    votes, conflicts = {}, []
    for name, group in by_name.items():
        votes[name] = _vote(name, group, weighting)
        rows: Sequence[tuple[str, str, float, float]]
        rows = [("kind", kind, v, s) for kind, (v, s) in votes[name].values.items()]
        conflicts += _conflicts(name, rows, z_limit)
        for kind in votes[name].values:
            conflicts += _conflicts(name, [("image", m.source, m.value, m.sigma) for m in group if m.kind == kind], z_limit)
    return votes, sorted(conflicts, key=lambda c: -abs(c.z))


def _vote(name: str, group: Sequence[Measurement], weighting: str) -> Vote:
    values = {}
    for kind in WEIGHTS:
        same = [m for m in group if m.kind == kind]
        if same:
            own = sum(m.point_sigma**2 + m.scale_sigma**2 for m in same) / len(same) ** 2
            sigma = np.hypot(np.sqrt(own), np.mean([m.model_sigma for m in same]))
            values[kind] = (float(np.mean([m.value for m in same])), float(sigma))
    base = dict(WEIGHTS) if weighting == "paper" else {kind: max(s, 1e-9) ** -2 for kind, (_, s) in values.items()}
    total = sum(base[kind] for kind in values)
    weights = {kind: base[kind] / total for kind in values}
    w, (v, s) = np.array(list(weights.values())), np.array(list(values.values())).T
    value = float(w @ v)
    chi_square, p_value = 0.0, 1.0
    if len(v) > 1 and (s > 0).all():
        from scipy.stats import chi2

        precision = s**-2
        chi_square = float(np.sum(precision * (v - precision @ v / precision.sum()) ** 2))
        p_value = float(chi2.sf(chi_square, len(v) - 1))
    spread = float(np.sqrt(w @ (v - value) ** 2))
    return Vote(name, value, float(np.sqrt(w**2 @ s**2)), spread, weights, values, chi_square, p_value)


def _conflicts(name: str, rows: Sequence[tuple[str, str, float, float]], z_limit: float) -> list[Conflict]:
    found = []
    for (level, a, va, sa), (_, b, vb, sb) in combinations(rows, 2):
        sigma = float(np.hypot(sa, sb))
        if sigma > 0:
            z = (va - vb) / sigma
        else:
            z = 0.0 if va == vb else float(np.copysign(np.inf, va - vb))
        if abs(z) > z_limit:
            found.append(Conflict(name, level, a, b, va, vb, sigma, float(z)))
    return found
