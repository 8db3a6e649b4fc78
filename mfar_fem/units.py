"""Quantities with units, as textile laboratories write them, converted to SI.

Everything inside the code is SI. At the border (fabric files, data files, options) a quantity is a string:
a number and a unit, ``"0.1046 mm"``, ``"105.6 g/m^2"``, ``"0.019 gf*cm^2/cm"`` (KES), ``"1.12 oz/yd^2"``,
``"19 momme"``, ``"20 denier"``.
The `pint` library does the conversion; powers may be written ``cm^2``, ``cm**2``, ``cm2`` or ``cm²``, products ``*``,
``·`` or a space.

Two textile habits are handled explicitly:

* **Flexural rigidity in mg·cm** (ASTM D1388): the standard computes ``G = W c³`` with the *mass* per area W in mg/cm²
  and the bending length c in cm and calls the result mg·cm. It is a weight: the milligram stands for a milligram-force,
  so G is multiplied by the standard gravity, 1 mg·cm = 9.80665e-8 N·m. This is done only where a rigidity (N·m) is
  expected; elsewhere a mass where a force is expected is an error that proposes ``gf``.
* **momme** (silk): 1 momme = 4.340 g/m².
"""

from __future__ import annotations

import decimal
import functools
import math
import re
import tokenize

from mfar_fem.errors import DataFileError

STANDARD_GRAVITY = 9.80665  # m/s^2, by definition (CGPM 1901)

_NUMBER = re.compile(r"\s*([-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*)", re.DOTALL)
_BARE_POWER = re.compile(r"(?<=[A-Za-zµμ])([23])(?![\w.])")
_DIMENSIONLESS = ("", "-", "1", "dimensionless")
_EXAMPLES = {
    "m": "0.1 mm",
    "kg/m^2": "80 g/m^2",
    "N*m": "1.9 uN*m",
    "N/m": "3 kN/m",
    "Pa": "87.5 kPa",
    "N": "2 N",
    "rad": "45 deg",
}


@functools.cache
def registry():
    """The `pint` unit registry with the textile units (made at first use: it takes a third of a second)."""
    import pint

    units = pint.UnitRegistry()
    units.define("momme = 4.340 * gram / meter**2")
    units.define("gsm = gram / meter**2")
    return units


@functools.cache
def _unit(text: str):
    """The pint unit of a string; '-' and '' are dimensionless."""
    if text.strip() in _DIMENSIONLESS:
        return registry().Unit("")
    return registry().Unit(_BARE_POWER.sub(r"**\1", text.strip()))


@functools.cache
def factor(unit: str, target: str) -> float:
    """Factor that converts values in `unit` into values in `target`.

    Parameters
    ----------
    unit, target : str
        Units, e.g. ``factor("gf", "N")`` = 9.80665e-3 and ``factor("mg*cm", "N*m")`` = 9.80665e-8 (see the module's
        text).

    Returns
    -------
    float

    Raises
    ------
    DataFileError
        `unit` is not known, or measures something else than `target` (the message says what each of them is).
    """
    import pint

    example = example_of(target)
    try:
        given = _unit(unit)
    except (pint.PintError, AttributeError, TypeError, ValueError, SyntaxError, tokenize.TokenError) as error:
        raise DataFileError(f"unknown unit '{unit}': write e.g. '{example}'") from error
    wanted = _unit(target)
    quantity = registry().Quantity
    if given.dimensionality == wanted.dimensionality:
        return float(quantity(1.0, given).to(wanted).magnitude)
    weight = quantity(1.0, given) * quantity(STANDARD_GRAVITY, "m/s^2")
    hint = ""
    if weight.dimensionality == wanted.dimensionality:
        if wanted.dimensionality == _unit("N*m").dimensionality:
            return float(weight.to(wanted).magnitude)
        hint = " (a mass where a force is meant: write 'gf' or 'kgf' for gram- or kilogram-force)"
    raise DataFileError(
        f"'{unit}' is {_kind(given)} but {_kind(wanted)} is needed{hint}: write e.g. '{example}'"
    )


def parse(value, target: str, name: str | None = None, path=None, line: int | None = None) -> float:
    """Convert "number unit" to a float in the unit `target`.

    Parameters
    ----------
    value : str, or a number if `target` is dimensionless
        The quantity as written, e.g. ``"0.1046 mm"``.
    target : str
        Unit of the result, e.g. ``"m"``; ``"-"`` for a dimensionless one (then ``"4 %"`` is 0.04).
    name : str, optional
        Key or column it comes from, for the error message.
    path : str or path-like, optional
        File it comes from.
    line : int, optional
        1-based line in it.

    Returns
    -------
    float

    Raises
    ------
    DataFileError
        The unit is missing, unknown or of the wrong kind, or there is no number.
    """

    def fail(message: str) -> DataFileError:
        return DataFileError(message, path=path, line=line, column=name)

    example = example_of(target)
    free = target in _DIMENSIONLESS
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise fail(f"{value!r} is not a quantity: write e.g. '{example}'")
    match = _NUMBER.fullmatch(str(value))
    if match is None:
        raise fail(f"'{value}' is not a number and a unit: write e.g. '{example}'")
    number, unit = float(match[1]), match[2].strip()
    if not math.isfinite(number):
        raise fail(f"'{value}' is too large for a number: write e.g. '{example}'")
    if unit.startswith(","):
        raise fail(f"'{value}': write the decimal point as '.', e.g. '{example}'")
    if not unit and not free:
        raise fail(f"unit missing: write e.g. '{example}', not {value!r}")
    try:
        scale = factor(unit, target)
    except DataFileError as error:
        raise fail(str(error)) from error
    if (inverse := 1.0 / scale).is_integer():  # decimal, so that "0.226 mm" is the very float 0.000226
        return float(decimal.Decimal(match[1]) / int(inverse))
    return number * scale


def write(value: float, unit: str) -> str:
    """The quantity as a string that :func:`parse` reads back to the very same float, e.g. ``"0.0001046 m"``."""
    return f"{float(value)!r}" if unit in _DIMENSIONLESS else f"{float(value)!r} {unit}"


def example_of(target: str) -> str:
    """How a quantity of that unit may be written, for error messages."""
    return _EXAMPLES.get(target, "0.5" if target in _DIMENSIONLESS else f"1.0 {target}")


def _kind(unit) -> str:
    """Name of the physical kind of a pint unit, e.g. 'a length'."""
    names = {
        "m": "a length",
        "kg/m^2": "a mass per area",
        "kg": "a mass",
        "kg/m": "a mass per length",
        "kg/m^3": "a density",
        "N": "a force",
        "N/m": "a force per length",
        "N*m": "a rigidity (force times length)",
        "Pa": "a stress",
        "": "a pure number",
        "s": "a time",
        "m^2": "an area",
    }
    for text, name in names.items():
        if _unit(text).dimensionality == unit.dimensionality:
            return name
    return f"of dimension {unit.dimensionality}"
