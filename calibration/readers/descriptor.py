"""One experiment from its TOML descriptor: the keys, their units, and the errors that name file, line and key."""

from __future__ import annotations

import difflib
import math
import re
import tomllib
from pathlib import Path

import numpy as np

from calibration.experiments import DIRECTIONS, KINDS, Experiment
from calibration.readers.rules import Rules, apply_rules, split_branches
from calibration.readers.table import read_table
from mfar_fem.errors import DataFileError, InputError
from mfar_fem.units import factor, parse

KEYS = {
    "": {
        "name", "kind", "data", "direction", "gauge", "width", "weight", "specimen", "role", "citation",
        "columns", "rows", "branch", "rules", "variants",
    },
    "columns": {"strain", "extension", "distance", "force", "line_force", "angle", "overhang", "bending_length"},
    "branch": {"cycle", "part", "turn_tolerance"},
    "rules": {"tare", "tare_readings", "slack", "preload", "retreat_tolerance", "max_force", "max_strain"},
}  # fmt: skip
UNITS = {
    "strain": "-", "extension": "m", "distance": "m", "force": "N", "line_force": "N/m",
    "angle": "rad", "overhang": "m", "bending_length": "m",
}  # fmt: skip


class Descriptor:
    """A parsed TOML table that knows its file, so that every complaint can name file, line and key."""

    def __init__(self, values: dict, path: Path, text: str):
        self.values, self.path, self.text = values, path, text

    def line(self, key: str) -> int | None:
        """Line of the first assignment to a key (its last dotted part), if found."""
        name = re.escape(key.split(".")[-1])
        hit = re.search(rf'(?m)^[^#\n]*?(?<![\w"]){name}"?\s*=', self.text)
        return self.text.count("\n", 0, hit.start()) + 1 if hit else None

    def fail(self, message: str, key: str) -> DataFileError:
        """The error to raise for a key: it names the file, the key's line and the key."""
        return DataFileError(message, self.path, self.line(key), key)

    def need(self, key: str, what: str):
        """The value of a key as the file has it; DataFileError saying what to write (`what`) if the key is missing."""
        if key not in self.values:
            raise DataFileError(f"the key is missing; write {what}", self.path, column=key)
        return self.values[key]

    def quantity(self, value, unit: str, key: str) -> float:
        """A quantity with its unit, converted to SI."""
        return parse(value, unit, key, self.path, self.line(key))

    def positive(self, key: str, unit: str, example: str) -> float:
        """A quantity above zero in `unit` (SI); DataFileError showing `example` if it is missing or not positive."""
        value = self.quantity(self.need(key, f'{key} = "{example}"'), unit, key)
        if not value > 0:
            raise self.fail(f'{key} is {value:g} {unit}; it must be positive, for instance {key} = "{example}"', key)
        return value


def load_toml(path: str | Path) -> tuple[dict, str]:
    """Values and text of a TOML file; syntax errors name the line."""
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
        return tomllib.loads(text), text
    except FileNotFoundError:
        raise DataFileError("there is no such file", path) from None
    except (OSError, UnicodeDecodeError) as error:
        raise DataFileError(f"the file cannot be read as UTF-8 text ({error})", path) from None
    except tomllib.TOMLDecodeError as error:
        hit = re.search(r"line (\d+)", str(error))
        raise DataFileError(f"not valid TOML: {error}", path, int(hit[1]) if hit else None) from None


def experiment_from(values: dict, path: Path, text: str = "") -> Experiment:
    """Build one experiment from a descriptor's values; ``data`` is relative to the descriptor's folder."""
    d = Descriptor(values, Path(path), text)
    _known_keys(d)
    kind = values.get("kind", "strip")
    if kind not in KINDS:
        raise d.fail(f"unknown kind of test '{kind}'; known: {', '.join(KINDS)}", "kind")
    data = d.path.parent / str(d.need("data", 'data = "curve.csv"'))
    direction = _direction(d)
    common = {
        "name": str(values.get("name", d.path.stem)),
        "kind": kind,
        "direction": direction,
        "weight": _number(d, "weight", 1.0),
        "specimen": str(values.get("specimen", "")),
        "role": str(values.get("role", "fit")),
        "citation": str(values.get("citation", "")),
    }
    if not common["weight"] > 0:
        raise d.fail(f"the weight is {common['weight']:g}; it must be positive", "weight")
    if common["role"] not in ("fit", "check"):
        raise d.fail(f"unknown role '{common['role']}'; known: fit, check", "role")
    table = read_table(data)
    if values.get("rows"):
        table = table.where(values["rows"])
    return (_strip if kind == "strip" else _cantilever)(d, table, common)


def _strip(d: Descriptor, table, common: dict) -> Experiment:
    gauge, width = d.positive("gauge", "m", "80 mm"), d.positive("width", "m", "50 mm")
    kind, column, values = _column(d, table, ("strain", "extension", "distance"))
    strain = {"strain": values, "extension": values / gauge, "distance": values / gauge - 1.0}[kind]
    force_kind, _, force = _column(d, table, ("line_force", "force"))
    force = force / width if force_kind == "force" else force
    rules = _rules(d)
    part, notes = _branch(d, strain, column)
    strain, force, gauge, more = apply_rules(
        strain[part], force[part], gauge, rules, path=table.path, lines=table.lines[part], column=column
    )
    return Experiment(x=strain, y=force, gauge=gauge, width=width, notes=(*notes, *more), **common)


def _cantilever(d: Descriptor, table, common: dict) -> Experiment:
    kind, column, length = _column(d, table, ("overhang", "bending_length"))
    bad = np.flatnonzero(~(length > 0))
    if bad.size:
        raise DataFileError("the length must be positive", table.path, int(table.lines[bad[0]]), column)
    angle = np.full(length.size, math.radians(41.5))
    if "angle" in d.values.get("columns", {}):
        _, _, angle = _column(d, table, ("angle",))
    if kind == "bending_length":
        length = 2.0 * length  # ASTM D1388: c = overhang / 2 at 41.5 degrees
    return Experiment(x=angle, y=length, **common)


def _branch(d: Descriptor, strain: np.ndarray, column: str):
    spec = d.values.get("branch", {})
    if not spec:
        return slice(None), []
    part, cycle = spec.get("part", "loading"), spec.get("cycle", 1)
    if part not in ("loading", "unloading"):
        raise d.fail(f"unknown part '{part}'; known: loading, unloading", "branch.part")
    if part == "unloading":
        raise d.fail('an unloading branch cannot be fitted by an elastic law; choose part = "loading"', "branch.part")
    loads = split_branches(strain, float(spec.get("turn_tolerance", 0.02)))[0::2]
    index = len(loads) if cycle == "last" else cycle
    if not isinstance(index, int) or not 1 <= index <= len(loads):
        raise d.fail(f"cycle {cycle} does not exist in column '{column}'; there are {len(loads)}", "branch.cycle")
    return loads[index - 1], [f"loading branch of cycle {index} of {len(loads)}"]


def _column(d: Descriptor, table, choices: tuple[str, ...]) -> tuple[str, str, np.ndarray]:
    columns = d.values.get("columns", {})
    given = [c for c in choices if c in columns]
    if len(given) != 1:
        example = f'{choices[0]} = {{ name = "...", unit = "{UNITS[choices[0]]}" }}'
        raise DataFileError(
            f"give exactly one of {', '.join(choices)} ({len(given)} given), for instance {example}",
            d.path, d.line("columns"), "columns",
        )  # fmt: skip
    key, spec = given[0], columns[given[0]]
    unit = UNITS[key]
    if not isinstance(spec, dict) or "name" not in spec:
        raise d.fail(f'write {key} = {{ name = "column", unit = "{unit}" }}', key)
    if "unit" not in spec and unit != "-":
        raise d.fail(f'the unit is missing: write {key} = {{ name = "{spec["name"]}", unit = "{unit}" }}', key)
    try:
        scale = factor(str(spec.get("unit", "-")), unit)
    except DataFileError as error:
        raise d.fail(str(error), key) from None
    return key, str(spec["name"]), table.numbers(str(spec["name"])) * scale


def _rules(d: Descriptor) -> Rules:
    spec = dict(d.values.get("rules", {}))
    for key, unit in (("preload", "N/m"), ("max_force", "N/m"), ("retreat_tolerance", "-"), ("max_strain", "-")):
        if key in spec:
            spec[key] = d.quantity(spec[key], unit, key)
    try:
        return Rules(**spec)
    except InputError as error:
        raise DataFileError(str(error), d.path, d.line("rules"), "rules") from None


def _direction(d: Descriptor) -> float:
    value = d.need("direction", 'direction = "warp" (or "weft", "bias", "30 deg" from the warp)')
    if isinstance(value, str) and value in DIRECTIONS:
        return DIRECTIONS[value]
    if isinstance(value, str) and not any(c.isdigit() for c in value):
        raise d.fail(
            f"unknown direction '{value}'; write warp, weft, bias or an angle from the warp, '30 deg'", "direction"
        )
    return d.quantity(value, "rad", "direction")


def _number(d: Descriptor, key: str, default: float) -> float:
    value = d.values.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise d.fail(f"{value!r} is not a number", key)
    return float(value)


def _known_keys(d: Descriptor) -> None:
    for section, known in KEYS.items():
        table = d.values if not section else d.values.get(section, {})
        if not isinstance(table, dict):
            raise d.fail(f"'{section}' must be a table", section)
        for key in table:
            if key not in known:
                near = difflib.get_close_matches(key, known, n=1)
                hint = f"did you mean '{near[0]}'? " if near else ""
                raise d.fail(f"unknown key; {hint}known: {', '.join(sorted(known))}", key)
