"""Scene files (TOML): quantities are strings with a unit, errors name file, line and key."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, overload

import numpy as np

from mfar_fem import units
from mfar_fem.errors import DataFileError, MfarError, UnknownNameError
from mfar_fem.fidelity import LEVELS, Fidelity
from mfar_fem.loads import GRAVITY
from mfar_fem.materials.fabric import Fabric, fabric_names
from mfar_fem.scene import BODY_CONTACT, Air, Contact, Hold, Output, Scene
from mfar_fem.sheet import KINDS, Sheet
from mfar_fem.tomlfile import TomlFile, suggest

_TOP = (
    "name",
    "fabric",
    "sheet",
    "support",
    "body",
    "duration",
    "to_rest",
    "gravity",
    "pressure",
    "air",
    "damping",
    "contact",
    "bending",
    "schedule",
    "velocity",
    "perturbation",
    "fidelity",
    "numerics",
    "output",
    "description",
)
_NUMERICS = {
    "order": None,
    "cells": None,
    "mesh_size": "m",
    "dt": "s",
    "method": None,
    "rtol": None,
    "linear_solver": None,
    "substeps": None,
    "iteration_error": None,
    "tolerance": "m",
}
_BODIES = {
    "plane": ("point", "normal", "extent"),
    "sphere": ("centre", "radius"),
    "cylinder": ("centre", "axis", "radius", "length"),
    "disc": ("centre", "normal", "radius", "thickness"),
    "mesh": ("file", "scale"),
}


def load_scene(source: str | os.PathLike, fidelity: str | None = None, **overrides: Any) -> Scene:
    """Read a scene file, or an example scene by name.

    Parameters
    ----------
    source : path or str
        A TOML file or a name of :func:`scene_names`.
    fidelity : str, optional
        Level instead of the file's.
    **overrides
        Settings of :class:`mfar_fem.fidelity.Fidelity` instead of the file's; None leaves one alone.

    Raises
    ------
    UnknownNameError, DataFileError
        The message names file, line and key.
    """
    path = Path(source)
    if isinstance(source, str) and source in scene_names():
        path = EXAMPLES / f"{source}.toml"
    elif not path.exists() and path.suffix != ".toml":
        raise UnknownNameError(f"'{source}' is neither an example scene nor a file{suggest(str(source), scene_names())}")
    return read_scene(TomlFile.read(path), fidelity, **overrides)


_SHEET = tuple("kind size radius inner outer at turn warp centred file scale pattern name grading".split())
EXAMPLES = Path(__file__).parent / "scenes"


def scene_names() -> list[str]:
    """Names of the example scenes, sorted."""
    return sorted(p.stem for p in EXAMPLES.glob("*.toml"))


def scene_from_dict(data: Mapping[str, Any], fidelity: str | None = None, **overrides: Any) -> Scene:
    """A scene from the contents of a scene file."""
    return read_scene(TomlFile(dict(data)), fidelity, **overrides)


def read_scene(file: TomlFile, fidelity: str | None = None, **overrides: Any) -> Scene:
    """Build a scene from a parsed file; every error names file, line and key."""
    file.check_keys((), _TOP)
    level, tolerance = _level(file, fidelity, overrides)
    to_rest = file.get("to_rest", default=False, kind=bool)
    if to_rest and "duration" in file.data:
        raise file.error("a scene runs for a duration or to rest, not both", "duration")
    duration = None if to_rest else file.quantity("duration", unit="s")
    scene = dict(
        name=file.get("name", default=Path(str(file.path)).stem if file.path else "scene", kind=str),
        sheets=tuple(_sheet(file, str(i)) for i in range(_count(file, "sheet", least=1))),
        fabric=_fabric(file),
        duration=duration,
        holds=tuple(_hold(file, str(i)) for i in range(_count(file, "support"))),
        bodies=tuple(_body(file, str(i)) for i in range(_count(file, "body"))),
        gravity=_gravity(file),
        pressure=file.quantity("pressure", unit="N/m^2", default=0.0),
        air=_air(file),
        contact=_contact(file),
        bending=file.get("bending", default=True, kind=bool),
        schedule=_schedule(file),
        velocity=_vector(file, "velocity", unit="m/s", default=(0.0, 0.0, 0.0)),
        level=level,
        output=_output(file),
        tolerance=tolerance,
    )
    scene |= _damping(file) | _perturbation(file)
    try:
        return Scene(**scene)
    except DataFileError:
        raise
    except MfarError as error:
        raise file.error(str(error)) from error


# -- parts ---------------------------------------------------------------------------------------------------------------
def _count(file: TomlFile, table: str, least: int = 0) -> int:
    entries = file.get(table, default=[])
    if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
        raise file.error(f"must be written [[{table}]], once for each", table)
    if len(entries) < least:
        raise file.error(f"the scene has no [[{table}]]")
    return len(entries)


@overload
def _vector(file: TomlFile, *keys: str, unit: str | None = None, default: Any = None,
            size: Literal[3] = 3) -> tuple[float, float, float]: ...


@overload
def _vector(file: TomlFile, *keys: str, unit: str | None = None, default: Any = None, size: Literal[2]) -> tuple[float, float]: ...


def _vector(file: TomlFile, *keys: str, unit: str | None = None, default: Any = None, size: int = 3) -> Any:
    value = file.get(*keys, default=default)
    if value is default and default is not None:
        return default
    if not isinstance(value, list) or len(value) != size:
        raise file.error(f"must be a list of {size}, not {value!r}", *keys)
    if unit is None:
        if not all(isinstance(v, int | float) and not isinstance(v, bool) for v in value):
            raise file.error(f"must hold {size} numbers, not {value!r}", *keys)
        return tuple(float(v) for v in value)
    return tuple(
        0.0
        if v == 0 and not isinstance(v, bool | str)
        else units.parse(v, unit, name=".".join(keys), path=file.path, line=file.line(*keys))
        for v in value
    )


def _level(file: TomlFile, name: str | None, overrides: Mapping[str, Any]) -> tuple[Fidelity, float | None]:
    name = name or file.get("fidelity", default="standard", kind=str)
    if name not in LEVELS:
        raise file.error(f"unknown fidelity '{name}'{suggest(name, LEVELS)}", "fidelity")
    given: dict[str, Any] = {}
    if "numerics" in file.data:
        file.check_keys(("numerics",), _NUMERICS)
        for key in file.data["numerics"]:
            unit = _NUMERICS[key]
            given[key] = file.get("numerics", key) if unit is None else file.quantity("numerics", key, unit=unit)
    tolerance = given.pop("tolerance", None)
    changes = dict(overrides)
    tolerance = changes.pop("tolerance", None) or tolerance
    try:
        level = LEVELS[name].override(**given)
    except (MfarError, TypeError) as error:
        raise file.error(str(error), "numerics") from error
    return level.override(**changes), tolerance  # what an option asks for wrongly is not the file's fault


def _fabric(file: TomlFile) -> Fabric:
    given = file.get("fabric")
    if isinstance(given, dict):
        try:
            return Fabric.from_dict(given)
        except MfarError as error:
            raise file.error(str(error), "fabric") from error
    if not isinstance(given, str):
        raise file.error("must be a preset, the path of a fabric file, or a table [fabric]", "fabric")
    if given not in fabric_names() and file.path is not None and (Path(file.path).parent / given).is_file():
        return Fabric.load(Path(file.path).parent / given)
    try:
        return Fabric.load(given)
    except UnknownNameError as error:
        raise file.error(str(error), "fabric") from error


def _sheet(file: TomlFile, n: str) -> Sheet:
    here = ("sheet", n)
    file.check_keys(
        here,
        _SHEET,
    )
    kind = file.get(*here, "kind", kind=str)
    if kind not in KINDS:
        raise file.error(f"unknown sheet '{kind}'{suggest(kind, KINDS)}", *here, "kind")
    size: tuple[float, ...] = ()
    path = ""
    if kind == "rectangle":
        size = _vector(file, *here, "size", unit="m", size=2)
    elif kind == "disc":
        size = (file.quantity(*here, "radius", unit="m"),)
    elif kind == "annulus":
        size = (file.quantity(*here, "inner", unit="m"), file.quantity(*here, "outer", unit="m"))
    else:
        path = _path(file, *here, "file")
    zero = (0.0, 0.0, 0.0)
    try:
        return Sheet(
            kind,
            size,
            _vector(file, *here, "at", unit="m", default=zero),
            _vector(file, *here, "turn", unit="rad", default=zero),
            _vector(file, *here, "warp", default=(1.0, 0.0, 0.0)),
            file.get(*here, "centred", default=False, kind=bool),
            path,
            _number(file, *here, "scale", default=1.0),
            file.get(*here, "pattern", default="union", kind=str),
            file.get(*here, "name", default="", kind=str),
            _number(file, *here, "grading", default=1.0),
        )
    except DataFileError:
        raise
    except MfarError as error:
        raise file.error(str(error), *here) from error


def _path(file: TomlFile, *keys: str) -> str:
    given = Path(file.get(*keys, kind=str))
    path = given if given.is_absolute() or file.path is None else Path(file.path).parent / given
    if not path.is_file():
        raise file.error(f"there is no file '{given}' (paths are relative to the scene file)", *keys)
    return str(path)


def _number(file: TomlFile, *keys: str, default: float) -> float:
    return float(file.get(*keys, default=default, kind=(int, float)))


def _hold(file: TomlFile, n: str) -> Hold:
    here = ("support", n)
    file.check_keys(here, ("where", "points", "kind", "move", "release", "components"))
    kind = file.get(*here, "kind", default="hinge", kind=str)
    if kind not in ("hinge", "clamp"):
        raise file.error(f"must be 'hinge' or 'clamp', not '{kind}'", *here, "kind")
    entry = file.get(*here)
    if ("where" in entry) == ("points" in entry):
        raise file.error("give either where = 'left' (a boundary) or points = [[...], ...]", *here)
    where: Any = entry.get("where")
    if where is None:
        rows = file.get(*here, "points", kind=list)
        where = np.array([_vector(TomlFile({"points": row}, file.path, file.text), "points", unit="m") for row in rows])
    elif not isinstance(where, str):
        raise file.error("must be the name of a boundary; single places are written points = [[...]]", *here, "where")
    components = file.get(*here, "components", default="xyz", kind=str)
    if not components or set(components) - set("xyz"):
        raise file.error(f"must be made of x, y, z, not '{components}'", *here, "components")
    return Hold(
        where,
        kind,
        _vector(file, *here, "move", unit="m", default=(0.0, 0.0, 0.0)),
        file.quantity(*here, "release", unit="s", default=None),
        tuple("xyz".index(c) for c in components),
    )


def _body(file: TomlFile, n: str):
    from mfar_fem.contact import body as bodies

    here = ("body", n)
    kind = file.get(*here, "kind", kind=str)
    if kind not in _BODIES:
        raise file.error(f"unknown body '{kind}'{suggest(kind, _BODIES)}", *here, "kind")
    file.check_keys(here, ("kind", "name", "friction", "motion", *_BODIES[kind]))
    options: dict[str, Any] = {
        "name": file.get(*here, "name", default=kind if n == "0" else f"{kind} {int(n) + 1}", kind=str),
        "friction": _number(file, *here, "friction", default=0.0),
        "motion": _motion(file, here),
    }
    for key in _BODIES[kind]:
        if key in ("point", "centre"):
            options[key] = _vector(file, *here, key, unit="m", default=(0.0, 0.0, 0.0))
        elif key in ("normal", "axis"):
            options[key] = _vector(file, *here, key, default=(0.0, 0.0, 1.0))
        elif key in ("radius", "length", "extent", "thickness") and key in file.get(*here):
            options[key] = file.quantity(*here, key, unit="m")
    try:
        if kind == "mesh":
            return bodies.MeshBody.load(_path(file, *here, "file"), scale=_number(file, *here, "scale", default=1.0), **options)
        cls = {"plane": bodies.Plane, "sphere": bodies.Sphere, "cylinder": bodies.Cylinder, "disc": bodies.Disc}[kind]
        return cls(**options)
    except DataFileError:
        raise
    except MfarError as error:
        raise file.error(str(error), *here) from error


def _motion(file: TomlFile, body: tuple[str, ...]):
    from mfar_fem.contact.motion import Motion

    if "motion" not in file.get(*body):
        return None
    here = (*body, "motion")
    file.check_keys(here, ("times", "translations", "rotations", "pivot"))
    text = TomlFile({"row": None}, file.path, file.text)

    def rows(key: str, unit: str):
        entries = file.get(*here, key, default=None)
        if entries is None:
            return None
        out = []
        for row in entries:
            text.data = {"row": row}
            out.append(_vector(text, "row", unit=unit))
        return out

    times = [
        units.parse(t, "s", name="times", path=file.path, line=file.line(*here, "times"))
        for t in file.get(*here, "times", kind=list)
    ]
    try:
        return Motion(
            times,
            rows("translations", "m"),
            rows("rotations", "rad"),
            _vector(file, *here, "pivot", unit="m", default=(0.0, 0.0, 0.0)),
        )
    except DataFileError:
        raise
    except MfarError as error:
        raise file.error(str(error), *here) from error


def _gravity(file: TomlFile) -> tuple[float, float, float]:
    given = file.get("gravity", default=True)
    if isinstance(given, bool):
        return GRAVITY if given else (0.0, 0.0, 0.0)
    return _vector(file, "gravity", unit="m/s^2")


def _air(file: TomlFile) -> Air | None:
    if "air" not in file.data:
        return None
    file.check_keys(("air",), ("normal", "tangential", "velocity", "per_vertex"))
    default = Air()
    return Air(
        file.quantity("air", "normal", unit="kg/m^3", default=default.normal),
        file.quantity("air", "tangential", unit="kg/m^3", default=default.tangential),
        _vector(file, "air", "velocity", unit="m/s", default=(0.0, 0.0, 0.0)),
        file.quantity("air", "per_vertex", unit="kg/m", default=0.0),
    )


def _contact(file: TomlFile) -> Contact:
    if "contact" not in file.data:
        return Contact()
    file.check_keys(("contact",), ("distance", "self", "self_friction", "bodies"))
    bodies = file.get("contact", "bodies", default="auto", kind=str)
    if bodies not in BODY_CONTACT:
        raise file.error(f"must be one of {', '.join(BODY_CONTACT)}, not '{bodies}'", "contact", "bodies")
    return Contact(
        file.quantity("contact", "distance", unit="m", default=1e-3),
        file.get("contact", "self", default=False, kind=bool),
        _number(file, "contact", "self_friction", default=0.0),
        bodies,
    )


def _damping(file: TomlFile) -> dict[str, float]:
    if "damping" not in file.data:
        return {}
    file.check_keys(("damping",), ("mass", "stiffness"))
    return {
        "mass_damping": file.quantity("damping", "mass", unit="1/s", default=0.0),
        "stiffness_damping": file.quantity("damping", "stiffness", unit="s", default=0.0),
    }


def _perturbation(file: TomlFile) -> dict[str, tuple[float, int]]:
    if "perturbation" not in file.data:
        return {}
    file.check_keys(("perturbation",), ("amplitude", "seed"))
    return {
        "perturbation": (
            file.quantity("perturbation", "amplitude", unit="m"),
            int(file.get("perturbation", "seed", default=0, kind=int)),
        )
    }


def _schedule(file: TomlFile) -> tuple[tuple[float, float], ...]:
    if "schedule" not in file.data:
        return ()
    file.check_keys(("schedule",), ("times", "factors"))
    times = [
        units.parse(t, "s", name="schedule.times", path=file.path, line=file.line("schedule", "times"))
        for t in file.get("schedule", "times", kind=list)
    ]
    factors = file.get("schedule", "factors", kind=list)
    if len(times) != len(factors) or not all(isinstance(f, int | float) for f in factors):
        raise file.error(f"needs a number for each of the {len(times)} times", "schedule", "factors")
    return tuple((t, float(f)) for t, f in zip(times, factors, strict=True))


def _output(file: TomlFile) -> Output:
    if "output" not in file.data:
        return Output()
    file.check_keys(("output",), ("every", "vtu", "pictures", "animation", "view"))
    default = Output()
    every = file.quantity("output", "every", unit="s", default=None)
    if every is not None and not every > 0:
        raise file.error("must be positive", "output", "every")
    view = _vector(file, "output", "view", default=default.view, size=2)
    vtu, pictures, animation = (file.get("output", k, default=True, kind=bool) for k in ("vtu", "pictures", "animation"))
    return Output(every, vtu, pictures, animation, view)
