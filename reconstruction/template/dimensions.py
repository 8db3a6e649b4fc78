"""Dimensions of straight-cut garments, and how they follow from voted measurements.

What no image shows is assumed, by the proportions below, and every assumption is listed by name with the result.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from mfar_fem.errors import InputError, UnknownNameError
from mfar_fem.tomlfile import suggest

QUARTER = ((1.0, 0.5523), (0.5523, 1.0))
"""Inner control points of a quarter of the neckline, (across, down) over (half width, depth): a quarter of an ellipse."""


@dataclass(frozen=True)
class TDimensions:
    """A garment with sleeves cut in one with the shoulders (round-collar robe, half-sleeve); flat lengths in metres.

    Attributes
    ----------
    length, cross_sleeve_width, body_width, armhole_depth, cuff_width, hem_width, neck_width, neck_depth : float
        See :data:`reconstruction.measure.quantity.NAMES`.
    back_neck_depth : float
    overlap_neck, overlap_hem : float
        How far a front reaches past the centre at the collar (measured across) and at the hem.
    slit : float
        Open length of the side seam above the hem.
    collar_height : float
        Finished height of the collar band.
    neckline : ((u, v), (u, v))
        Shape of the front neckline, see :data:`QUARTER`.
    """

    length: float
    cross_sleeve_width: float
    body_width: float
    armhole_depth: float
    cuff_width: float
    hem_width: float
    neck_width: float
    neck_depth: float
    back_neck_depth: float
    overlap_neck: float
    overlap_hem: float
    slit: float
    collar_height: float
    neckline: tuple[tuple[float, float], tuple[float, float]] = QUARTER

    def __post_init__(self):
        _check_positive(self, zero_allowed=("overlap_neck", "overlap_hem", "slit", "collar_height"))
        rules = (
            (self.neck_width < self.body_width, "the neckline must be narrower than the body"),
            (self.body_width < self.cross_sleeve_width, "the body must be narrower than cuff to cuff"),
            (self.armhole_depth + self.slit < self.length, "armhole and slit together must be shorter than the garment"),
            (self.neck_depth < self.length, "the neckline must be shallower than the garment is long"),
            (self.overlap_neck < self.neck_width / 2, "the overlap at the collar must be less than half the neckline"),
        )
        _check_rules(self, rules)


@dataclass(frozen=True)
class RibbonDimensions:
    """Flying ribbon (shawl): one strip of cloth, m."""

    length: float
    width: float

    def __post_init__(self):
        _check_positive(self)
        _check_rules(self, ((self.width <= self.length, "the ribbon must be longer than wide"),))


@dataclass(frozen=True)
class HatDimensions:
    """Veil hat: diameters of crown and brim, heights of crown and veil (m), open angle of the veil at the face (rad), gathering."""

    crown_diameter: float
    crown_height: float
    brim_diameter: float
    veil_length: float
    open_angle: float = np.pi / 3
    gathering: float = 1.2

    def __post_init__(self):
        _check_positive(self, zero_allowed=("open_angle",))
        rules = (
            (self.crown_diameter < self.brim_diameter, "the crown must be narrower than the brim"),
            (self.open_angle < 2 * np.pi, "the opening must be less than all round"),
            (self.gathering >= 1, "the veil cannot be shorter than the brim it hangs from"),
        )
        _check_rules(self, rules)


# Default lengths: fractions of another one, or metres. Assumptions, to be replaced by measurements.
_T_RULES: dict[str, dict[str, tuple[str | None, float]]] = {
    "round-collar-robe": {
        "length": (None, 1.30), "cross_sleeve_width": ("length", 1.6), "body_width": (None, 0.60), "armhole_depth": (None, 0.30),
        "cuff_width": (None, 0.20), "hem_width": ("body_width", 1.2), "neck_width": (None, 0.16), "neck_depth": (None, 0.09),
        "back_neck_depth": (None, 0.015), "overlap_neck": ("neck_width", 0.45), "overlap_hem": ("body_width", 0.20),
        "slit": ("length", 0.4), "collar_height": (None, 0.03),
    },
    "half-sleeve": {
        "length": (None, 0.60), "cross_sleeve_width": (None, 1.10), "body_width": (None, 0.55), "armhole_depth": (None, 0.26),
        "cuff_width": (None, 0.24), "hem_width": ("body_width", 1.0), "neck_width": (None, 0.18), "neck_depth": (None, 0.20),
        "back_neck_depth": (None, 0.015), "overlap_neck": (None, 0.0), "overlap_hem": (None, 0.0),
        "slit": (None, 0.0), "collar_height": (None, 0.03),
    },
}
GARMENTS = ("round-collar-robe", "half-sleeve", "flying-ribbon", "veil-hat")
"""Types of garments a template can be made for."""
_FROM = {"length": "garment_length"}
UNUSUAL = 1.5
"""Factor from the usual length from which on a length is unusual (all cuts of the synthetic benchmark lie within it)."""
Dimensions = TDimensions | RibbonDimensions | HatDimensions


def garment_type(name: str) -> str:
    """The type of that name.

    Raises
    ------
    UnknownNameError
    """
    if name not in GARMENTS:
        raise UnknownNameError(f"unknown type of garment '{name}'{suggest(name, GARMENTS)}")
    return name


def derive(garment: str, measured: Mapping[str, float], shape=QUARTER) -> tuple[Dimensions, dict[str, str]]:
    """Dimensions from measurements, with the list of what had to be assumed.

    Parameters
    ----------
    garment : str
        One of :data:`GARMENTS`.
    measured : mapping of str to float
        Voted lengths by name, m.
    shape : ((u, v), (u, v))
        Shape of the neckline.

    Returns
    -------
    dimensions : TDimensions, RibbonDimensions or HatDimensions
    assumed : dict of str to str
        Dimension and how it was assumed.

    Raises
    ------
    UnknownNameError, InputError
        Unknown type; dimensions that contradict each other.
    """
    garment_type(garment)
    if garment == "flying-ribbon":
        return _ribbon(measured)
    if garment == "veil-hat":
        return _hat(measured)
    values: dict[str, float] = {}
    assumed: dict[str, str] = {}
    for name, (of, factor) in _T_RULES[garment].items():
        source = _FROM.get(name, name)
        if source in measured:
            values[name] = float(measured[source])
            continue
        values[name] = factor if of is None else factor * values[of]
        assumed[name] = f"{values[name]:.3f} m, {'a usual value' if of is None else f'{factor:g} times {of}'}"
    return TDimensions(**values, neckline=tuple(tuple(map(float, p)) for p in shape)), assumed  # type: ignore[arg-type]


def _ribbon(measured: Mapping[str, float]) -> tuple[RibbonDimensions, dict[str, str]]:
    values = {"length": 2.0, "width": 0.5}
    assumed = {name: f"{value} m, a usual value" for name, value in values.items() if f"ribbon_{name}" not in measured}
    values |= {name: float(measured[f"ribbon_{name}"]) for name in values if f"ribbon_{name}" in measured}
    return RibbonDimensions(**values), assumed


def _hat(measured: Mapping[str, float]) -> tuple[HatDimensions, dict[str, str]]:
    names = {"crown_diameter": ("crown_width", 0.19), "crown_height": ("crown_height", 0.12), "brim_diameter": ("brim_width", 0.40),
             "veil_length": ("veil_length", 0.60)}
    values = {name: float(measured.get(source, default)) for name, (source, default) in names.items()}
    assumed = {name: f"{default} m, a usual value" for name, (source, default) in names.items() if source not in measured}
    assumed |= {"open_angle": "60 degrees, a usual value", "gathering": "1.2, a usual value"}
    return HatDimensions(**values), assumed


def unusual(garment: str, measured: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Measured lengths (m) that a garment of the type would hardly have, with the usual ones: the type may be wrong."""
    usual = derive(garment, {})[0]
    names = {"garment_length": "length", "cross_sleeve_width": "cross_sleeve_width", "body_width": "body_width",
             "ribbon_length": "length", "brim_width": "brim_diameter"}  # fmt: skip
    pairs = {name: (float(measured[name]), float(getattr(usual, key))) for name, key in names.items() if name in measured}
    return {name: (value, known) for name, (value, known) in pairs.items() if not 1 / UNUSUAL < value / known < UNUSUAL}


def to_dict(dimensions: Dimensions) -> dict[str, Any]:
    """Plain data."""
    return asdict(dimensions)


def _check_positive(dimensions: Any, zero_allowed: tuple[str, ...] = ()) -> None:
    for entry in fields(dimensions):
        value = getattr(dimensions, entry.name)
        if entry.name == "neckline":
            continue
        if not np.isfinite(value) or value < 0 or (value == 0 and entry.name not in zero_allowed):
            raise InputError(f"the dimension '{entry.name}' is {value}; it must be positive and finite")


def _check_rules(dimensions: Any, rules) -> None:
    for good, message in rules:
        if not good:
            shown = ", ".join(f"{e.name} {getattr(dimensions, e.name):.3f}" for e in fields(dimensions) if e.name != "neckline")
            raise InputError(f"{message}; the dimensions are, in m: {shown}. Check the scale and the points of the images")
