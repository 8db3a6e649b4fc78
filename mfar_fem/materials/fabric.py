"""A fabric: membrane law, bending law, thickness and areal density, each with its source, as an object and a TOML file.

Quantities in a fabric file are strings with a unit (:mod:`mfar_fem.units`); plain numbers are accepted for law
parameters only and are then in the law's own SI unit.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

from .. import units
from ..errors import DataFileError, InputError, MfarError, ParameterError, UnknownNameError
from ..tomlfile import TomlFile, suggest
from .bending import Bending
from .law import Law, law_class, law_names

_KEYS = ("name", "description", "thickness", "areal_density", "law", "bending", "sources")
_BENDING = ("warp", "weft", "twist", "coupling")
ALIASES = {"polyester-faille": "faille"}
"""Other names of presets."""
_PRESETS = Path(__file__).parent / "presets"
_PRETTY = {"m": ("mm",), "kg/m^2": ("g/m^2",), "N*m": ("uN*m",)}


@dataclass(frozen=True)
class Fabric:
    """Everything the shell needs to know about a cloth.

    Attributes
    ----------
    name : str
    law : Law
        Membrane law.
    thickness : float
        m.
    areal_density : float
        kg/m².
    bending : Bending
        N·m; its frame is that of the law.
    sources : mapping of str to str
        Where each number comes from, by key: ``thickness``, ``areal_density``, ``law``, ``bending``, or finer
        ``law.G``, ``bending.twist``.
    description : str

    Raises
    ------
    ParameterError
        Thickness or areal density are not positive and finite.
    """

    name: str
    law: Law
    thickness: float
    areal_density: float
    bending: Bending
    sources: Mapping[str, str] = field(default_factory=dict, hash=False)
    description: str = ""

    def __post_init__(self):
        for name, unit in (("thickness", "m"), ("areal_density", "kg/m^2")):
            value = float(getattr(self, name))
            if not (math.isfinite(value) and value > 0.0):
                raise ParameterError(f"fabric '{self.name}': {name} = {value:g} {unit} must be positive and finite")
            object.__setattr__(self, name, value)
        object.__setattr__(self, "sources", MappingProxyType(dict(self.sources)))

    def __reduce__(self):
        values = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)} | {"sources": dict(self.sources)}
        return _rebuild, (values,)

    @property
    def membrane_scale(self) -> float:
        """From the law's energy to energy per area: the thickness (m) for a law per volume, 1 for one per area."""
        return self.thickness if self.law.basis == "volume" else 1.0

    @property
    def density(self) -> float:
        """Mass per volume, kg/m³."""
        return self.areal_density / self.thickness

    def replace(self, **changes: Any) -> Fabric:
        """The same fabric with some attributes changed."""
        return dataclasses.replace(self, **changes)

    def source_of(self, key: str) -> str:
        """Source of a quantity such as ``thickness`` or ``law.G`` (that of ``law`` unless it has its own), or ''."""
        return self.sources.get(key, self.sources.get(key.split(".")[0], ""))

    # -- files ---------------------------------------------------------------------------------------------------

    @classmethod
    def load(cls, source: str | os.PathLike) -> Fabric:
        """Load a preset by name or a fabric file.

        Parameters
        ----------
        source : str or path-like
            A name of :func:`fabric_names`, or the path of a TOML file.

        Raises
        ------
        UnknownNameError
            Neither a preset nor a file.
        DataFileError
            The file is wrong; the message names file, line and key.
        """
        source = ALIASES.get(source, source) if isinstance(source, str) else source
        if isinstance(source, str) and source in fabric_names():
            return _read(TomlFile.read(_PRESETS / f"{source}.toml"))
        path = Path(source)
        if not path.exists() and path.suffix != ".toml":
            hint = suggest(str(source), fabric_names())
            raise UnknownNameError(f"'{source}' is neither a fabric preset nor a file{hint}")
        return _read(TomlFile.read(path))

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Fabric:
        """Build a fabric from the contents of a fabric file (quantities as strings with units)."""
        return _read(TomlFile(dict(data)))

    def to_dict(self) -> dict[str, Any]:
        """Contents of a fabric file; reading them back gives an equal fabric, to the last bit.

        Raises
        ------
        InputError
            The law is not in the registry (a file could not name it).
        """
        if self.law.name not in law_names() or law_class(self.law.name) is not type(self.law):
            raise InputError(f"the law '{self.law.name}' is not registered, so no fabric file can name it")
        data: dict[str, Any] = {"name": self.name}
        if self.description:
            data["description"] = self.description
        data["thickness"] = _text(self.thickness, "m")
        data["areal_density"] = _text(self.areal_density, "kg/m^2")
        data["law"] = {"name": self.law.name, "parameters": dict(self.law.values)}
        data["bending"] = {name: _text(getattr(self.bending, name), "N*m") for name in _BENDING}
        data["sources"] = dict(self.sources)
        return data

    def save(self, path: str | os.PathLike) -> Path:
        """Write a fabric file (see :meth:`to_dict`); an existing one is replaced at once or not at all.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        import tomli_w

        path = Path(path)
        text = "# Fabric file of mfar-fem. Quantities carry their unit; law parameters are in SI.\n"
        text += tomli_w.dumps(self.to_dict())
        partial = path.with_name(path.name + ".part")
        try:
            partial.write_text(text, encoding="utf-8")
            partial.replace(path)
        except OSError as error:
            raise InputError(f"cannot write the fabric file '{path}': {error.strerror or error}") from error
        return path


def fabric_names() -> list[str]:
    """Names of the fabric presets, sorted."""
    return sorted(path.stem for path in _PRESETS.glob("*.toml"))


def _rebuild(values: dict[str, Any]) -> Fabric:
    return Fabric(**values)


def _text(value: float, unit: str) -> str:
    """The quantity in a unit people use if that is exact to the last bit, otherwise in SI."""
    for pretty in _PRETTY[unit]:
        text = f"{value / units.factor(pretty, unit):.12g} {pretty}"
        if units.parse(text, unit) == value:
            return text
    return units.write(value, unit)


def _read(file: TomlFile) -> Fabric:
    """Build a fabric from a parsed file; every error names the file, the line and the key."""
    file.check_keys((), _KEYS)
    name = file.get("name", kind=str)
    thickness = _positive(file, "thickness", "m")
    areal_density = _positive(file, "areal_density", "kg/m^2")
    law = _read_law(file, thickness)
    bending = _read_bending(file, law, thickness)
    sources = _read_sources(file, law)
    return Fabric(name, law, thickness, areal_density, bending, sources, file.get("description", default="", kind=str))


def _positive(file: TomlFile, key: str, unit: str) -> float:
    value = file.quantity(key, unit=unit)
    if not value > 0.0:
        raise file.error(f"must be positive, got '{file.get(key)}'", key)
    return value


def _read_law(file: TomlFile, thickness: float) -> Law:
    """The membrane law; a modulus (Pa) may be given as stiffness per width (N/m), which the thickness divides."""
    file.check_keys(("law",), ("name", "parameters"))
    name = file.get("law", "name", kind=str)
    try:
        cls = law_class(name)
    except UnknownNameError:
        raise file.error(f"unknown law '{name}'{suggest(name, law_names())}", "law", "name") from None
    table = {p.name: p for p in cls.parameters}
    values = {}
    for key, given in file.get("law", "parameters", default={}, kind=dict).items():
        where = ("law", "parameters", key)
        if key not in table:
            raise file.error(f"the law '{name}' has no parameter '{key}'{suggest(key, table)}", *where)
        parameter = table[key]
        try:
            values[key] = parameter.check(_parameter_value(file, given, parameter.unit, thickness, where), name)
        except ParameterError as error:
            raise file.error(str(error), *where) from error
    try:
        return cls(**values)
    except ParameterError as error:
        raise file.error(str(error), "law", "parameters") from error


def _parameter_value(file: TomlFile, given: Any, unit: str, thickness: float, where: tuple[str, ...]) -> Any:
    """A law parameter in its SI unit; plain numbers are taken as they are."""
    if not isinstance(given, str):
        if isinstance(given, bool) or not isinstance(given, int | float):
            raise file.error(f"must be a number in {unit} or a string with a unit, not {given!r}", *where)
        return given
    try:
        return file.quantity(*where, unit=unit)
    except DataFileError:
        if unit == "Pa":
            with contextlib.suppress(DataFileError):  # the error about the modulus is the one to report
                return units.parse(given, "N/m") / thickness
        raise


def _read_bending(file: TomlFile, law: Law, thickness: float) -> Bending:
    """Measured rigidities, or ``derived = true``."""
    if "bending" not in file.data:
        raise file.error("the table [bending] is missing: give warp and weft, e.g. '1.9 uN*m', or derived = true")
    file.check_keys(("bending",), (*_BENDING, "derived"))
    derived = file.get("bending", "derived", default=False, kind=bool)
    given = {key: file.quantity("bending", key, unit="N*m") for key in _BENDING if key in file.data["bending"]}
    if derived and given:
        raise file.error(f"derived = true leaves no room for {', '.join(given)}: give one or the other", "bending")
    for key in () if derived else ("warp", "weft"):
        if key not in given:
            raise file.error(f"'{key}' is missing: write e.g. {key} = \"1.9 uN*m\", or derived = true", "bending")
    try:
        return Bending.derived(law, thickness) if derived else Bending.from_rigidities(**given)
    except MfarError as error:
        raise file.error(str(error), "bending") from error


def _read_sources(file: TomlFile, law: Law) -> dict[str, str]:
    if "sources" not in file.data:
        return {}
    fine = [f"law.{name}" for name in law.values] + [f"bending.{name}" for name in _BENDING]
    file.check_keys(("sources",), ("thickness", "areal_density", "law", "bending", *fine))
    return {key: file.get("sources", key, kind=str) for key in file.data["sources"]}
