"""Cutting parameters of the four garment types and the ranges they are drawn from, each with its source.

Measured anchors (UNESCO Silk Roads Programme, museum entries): silk robe with floral medallion, 8th-9th c., length 1.38 m, width
(cuff to cuff) 2.48 m, warp repeat 0.55 m; resist-dyed dress, 7th-8th c., length 0.47 m, width 1.37 m. Ranges that no measured
garment supports are marked as assumptions; they are chosen so that the cut can be worn by a figure of 1.55 to 1.85 m.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mfar_fem.errors import ParameterError, UnknownNameError

KINDS = ("round-collar-robe", "half-sleeve", "flying-ribbon", "veil-hat")
"""Garment types of the paper's Table of reconstruction errors."""

ROBE_SOURCE = "silk robe with floral medallion, 8th-9th c. (UNESCO Silk Roads Programme)"
DRESS_SOURCE = "resist-dyed dress, 7th-8th c. (UNESCO Silk Roads Programme)"
ASSUMED = "assumption"


@dataclass(frozen=True)
class Range:
    """Uniform range of one parameter.

    Parameters
    ----------
    low, high : float
        Bounds, m (ratios without unit).
    source : str
        Where it comes from, or 'assumption' with the reason.
    """

    low: float
    high: float
    source: str


_LOOM = Range(0.50, 0.58, "assumption: Tang tabby about 0.5 to 0.6 m wide (1 chi 8 cun), brackets the 0.55 m repeat of the robe")
RANGES: dict[str, dict[str, Range]] = {
    "round-collar-robe": {
        "length": Range(1.16, 1.42, f"1.38 in {ROBE_SOURCE}; lower end {ASSUMED}: mid-calf on a woman"),
        "cross_sleeve": Range(1.70, 2.50, f"2.48 in {ROBE_SOURCE}; lower end {ASSUMED}: to the knuckles"),
        "sleeve_depth": Range(0.25, 0.34, f"{ASSUMED}: armpit depth of a straight cut that can be put on"),
        "cuff_width": Range(0.15, 0.34, f"{ASSUMED}: narrow to wide sleeve"),
        "chest_width": Range(0.60, 0.72, f"{ASSUMED}: flat width under the arms, ease of 0.25 to 0.5 m"),
        "hem_width": Range(0.72, 1.00, f"{ASSUMED}: flat width at the hem, straight to flared"),
        "slit": Range(0.0, 0.55, f"{ASSUMED}: side slit up to the hip"),
        "collar_radius": Range(0.070, 0.090, f"{ASSUMED}: close round collar"),
        "collar_drop": Range(0.085, 0.115, f"{ASSUMED}: depth of the collar at the front"),
        "overlap": Range(0.10, 0.26, f"{ASSUMED}: width of the hidden under-lap"),
        "opening": Range(0.0, 0.0, "the round collar is buttoned"),
        "loom_width": _LOOM,
    },
    "half-sleeve": {
        "length": Range(0.47, 0.85, f"0.47 in {DRESS_SOURCE}; upper end {ASSUMED}: hip"),
        "cross_sleeve": Range(1.00, 1.37, f"1.37 in {DRESS_SOURCE}; lower end {ASSUMED}: above the elbow"),
        "sleeve_depth": Range(0.24, 0.31, f"{ASSUMED}: armpit depth"),
        "cuff_width": Range(0.19, 0.30, f"{ASSUMED}: wide short sleeve"),
        "chest_width": Range(0.58, 0.68, f"{ASSUMED}: flat width under the arms"),
        "hem_width": Range(0.60, 0.80, f"{ASSUMED}: flat width at the hem"),
        "slit": Range(0.0, 0.12, f"{ASSUMED}"),
        "collar_radius": Range(0.085, 0.115, f"{ASSUMED}: wide neck"),
        "collar_drop": Range(0.10, 0.16, f"{ASSUMED}: depth of the neck at the front"),
        "overlap": Range(0.0, 0.0, "edge to edge in front"),
        "opening": Range(0.06, 0.20, f"{ASSUMED}: front opening below the neck"),
        "loom_width": _LOOM,
    },
    "flying-ribbon": {
        "length": Range(2.0, 2.9, f"{ASSUMED}: tip to tip, ends hang to knee or ankle"),
        "width": Range(0.30, 0.55, f"{ASSUMED}: up to one loom width"),
        "slack": Range(1.00, 1.12, f"{ASSUMED}: cloth between shoulder and hand over the distance between them"),
    },
    "veil-hat": {
        "brim_radius": Range(0.20, 0.27, f"{ASSUMED}: brim about as wide as the shoulders"),
        "crown_height": Range(0.19, 0.24, f"{ASSUMED}: pointed crown"),
        "veil_length": Range(0.30, 0.95, f"{ASSUMED}: to the shoulder or to the hip"),
        "fullness": Range(1.02, 1.25, f"{ASSUMED}: gathered veil over the brim's arc"),
        "front_gap": Range(0.12, 0.34, f"{ASSUMED}: width of the open front, m along the brim"),
    },
}


@dataclass(frozen=True)
class Cut:
    """Cutting parameters of one garment.

    Parameters
    ----------
    kind : str
        Garment type, one of :data:`KINDS`.
    values : dict of str to float
        Parameters named in :data:`RANGES`, m.

    Raises
    ------
    UnknownNameError
        Unknown type.
    ParameterError
        A parameter is missing, unknown, not finite, or the cut cannot be made.
    """

    kind: str
    values: dict[str, float]

    def __post_init__(self):
        if self.kind not in RANGES:
            raise UnknownNameError(f"there is no garment type '{self.kind}'; known: {', '.join(KINDS)}")
        wanted = set(RANGES[self.kind])
        if wrong := wanted ^ set(self.values):
            raise ParameterError(f"{self.kind}: parameters missing or unknown: {', '.join(sorted(wrong))}")
        for name, value in self.values.items():
            if not np.isfinite(value) or value < 0:
                raise ParameterError(f"{self.kind}: {name} must be finite and not negative, not {value}")

    def __getitem__(self, name: str) -> float:
        return self.values[name]


def draw_cut(kind: str, seed: int) -> Cut:
    """Draw a cut uniformly from the ranges of its type.

    Parameters
    ----------
    kind : str
        One of :data:`KINDS`.
    seed : int
        The garment's seed.

    Raises
    ------
    UnknownNameError
        Unknown type.
    """
    if kind not in RANGES:
        raise UnknownNameError(f"there is no garment type '{kind}'; known: {', '.join(KINDS)}")
    rng = np.random.default_rng([seed, 11])
    return Cut(kind, {name: float(rng.uniform(r.low, r.high)) for name, r in RANGES[kind].items()})
