"""Patterns in the GarmentCode JSON specification, read and written.

Panels have ``vertices`` (in ``properties.units_in_meter`` per metre, 100 = cm), ``edges`` with ``endpoints`` and ``curvature``
(``quadratic`` and ``cubic`` with control points relative to the chord, ``circle`` with radius, large-arc and right flag; a bare
``[u, v]`` is quadratic), ``translation`` and ``rotation`` (Euler angles, degrees); ``stitches`` join pairs of edges.
M. Korosteleva, O. Sorkine-Hornung, GarmentCode: programming parametric sewing patterns, ACM Trans. Graph. 42 (2023) 199,
doi:10.1145/3618351.

What the specification has no place for (warp direction, seam allowances, notches, kind and ease of seams) stands under the key
``mfar``, which other readers ignore; a file without it gets the warp along y and no allowances.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import DataFileError, InputError
from mfar_fem.tomlfile import suggest
from reconstruction.template.panel import CURVES, Edge, Panel, Pattern, Seam

UNITS_IN_METRE = 100
_FLAT = {"quadratic": 1, "cubic": 2}


def write_garmentcode(path, pattern: Pattern) -> None:
    """Write a pattern; keys that came with a file that was read are kept."""
    Path(path).write_text(json.dumps(specification(pattern), indent=2, allow_nan=False) + "\n", encoding="utf-8")


def specification(pattern: Pattern) -> dict[str, Any]:
    """The JSON object of a pattern."""
    extra = dict(pattern.extra)
    properties = dict(extra.get("properties") or {"curvature_coords": "relative", "normalize_panel_translation": False,
                                                  "normalized_edge_loops": True, "units_in_meter": UNITS_IN_METRE})
    units = properties["units_in_meter"]
    panels = {name: _panel_json(panel, units) for name, panel in pattern.panels.items()}
    stitches = [[{"panel": p, "edge": i} for p, i in (seam.first, seam.second)] for seam in pattern.seams]
    inner: dict[str, Any] = {"panels": panels, "stitches": stitches}
    inner |= extra.get("pattern", {} if extra else {"panel_order": list(panels)})
    data = {"pattern": inner, "parameters": extra.get("parameters", {}), "parameter_order": extra.get("parameter_order", []),
            "properties": properties}
    own = {
        "garment": pattern.name,
        "dimensions_m": json.loads(json.dumps({
            key: asdict(value) if is_dataclass(value) and not isinstance(value, type) else value
            for key, value in pattern.parameters.items()
        })),
        "panels": {name: _details(panel) for name, panel in pattern.panels.items()},
        "seams": [{"kind": seam.kind, "ease_m": seam.ease} for seam in pattern.seams],
    }
    if "mfar" in extra or not extra or not _is_plain(pattern):
        data["mfar"] = own
    return data


def _is_plain(pattern: Pattern) -> bool:
    """Whether the specification has a place for all that the pattern says: warp along y, no allowances, notches, ease."""
    panels = pattern.panels.values()
    return (all(np.array_equal(panel.warp, (0, 1)) and not any(e.allowance or e.notches for e in panel.edges) for panel in panels)
            and all(seam.kind == "sewn" and not seam.ease for seam in pattern.seams))


def read_garmentcode(path) -> Pattern:
    """Read a specification.

    Raises
    ------
    DataFileError
        The file cannot be read or a value is missing or wrong; names the file, the panel and the edge or stitch.
    """
    try:
        data = json.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise DataFileError("there is no such file", path=path) from None
    except (OSError, UnicodeDecodeError) as error:
        raise DataFileError(f"cannot be read: {error}", path=path) from error
    except json.JSONDecodeError as error:
        raise DataFileError(f"is not valid JSON: {error.msg}", path=path, line=error.lineno) from error
    return _Reader(path, data).pattern()


def _panel_json(panel: Panel, units: float) -> dict[str, Any]:
    edges = []
    for edge in panel.edges:
        entry: dict[str, Any] = {"endpoints": [edge.start, edge.end]}
        if edge.kind == "circle":
            entry["curvature"] = {"type": "circle", "params": [edge.params[0] * units, int(edge.params[1]), int(edge.params[2])]}
        elif edge.kind != "line":
            entry["curvature"] = {"type": edge.kind, "params": np.reshape(edge.params, (-1, 2)).tolist()}
        if edge.name:
            entry["label"] = edge.name
        edges.append(entry)
    data = {"translation": (panel.translation * units).tolist(), "rotation": panel.rotation.tolist(),
            "vertices": (panel.vertices * units).tolist(), "edges": edges}
    return data | ({"label": panel.label} if panel.label else {})


def _details(panel: Panel) -> dict[str, Any]:
    return {"warp": panel.warp.tolist(), "allowances_m": [edge.allowance for edge in panel.edges],
            "notches": [list(edge.notches) for edge in panel.edges]}


class _Reader:
    """A specification while it is read."""

    def __init__(self, path, data: Any):
        self.path, self.data = path, data

    def error(self, where: str, message: str) -> DataFileError:
        return DataFileError(message, path=self.path, column=where)

    def get(self, table: Any, key: str, where: str, kind: type) -> Any:
        names: dict[type, str] = {dict: "an object", list: "a list"}
        if not isinstance(table, dict) or not isinstance(table.get(key), kind):
            raise self.error(f"{where}.{key}" if where else key, f"must be there and be {names[kind]}")
        return table[key]

    def numbers(self, value: Any, shape: tuple[int, ...], where: str) -> np.ndarray:
        try:
            array = np.array(value, dtype=float)
        except (TypeError, ValueError):
            array = np.array([np.nan])  # is refused below
        if array.ndim != len(shape) or any(want >= 0 and want != n for want, n in zip(shape, array.shape, strict=True)) \
                or not np.isfinite(array).all():
            wanted = ", ".join("n" if s < 0 else str(s) for s in shape)
            raise self.error(where, f"must be finite numbers of shape ({wanted}), not {value!r:.60}")
        return array

    def pattern(self) -> Pattern:
        body = self.get(self.data, "pattern", "", dict)
        properties = self.get(self.data, "properties", "", dict)
        units = properties.get("units_in_meter")
        if isinstance(units, bool) or not isinstance(units, int | float) or units <= 0:
            raise self.error("properties.units_in_meter", f"must be a positive number (100 for cm), not {units!r}")
        if properties.get("curvature_coords", "relative") != "relative":
            raise self.error("properties.curvature_coords", f"must be 'relative', not {properties['curvature_coords']!r}")
        details = self.details(self.data.get("mfar"))
        panels = {name: self.panel(name, entry, units, details["panels"].get(name) or {})
                  for name, entry in self.get(body, "panels", "pattern", dict).items()}
        seams = tuple(self.seam(i, entry, panels, details.get("seams"))
                      for i, entry in enumerate(self.get(body, "stitches", "pattern", list)))
        parameters = details.get("dimensions_m") or {}
        extra = {key: value for key, value in self.data.items() if key != "pattern"}
        extra["pattern"] = {key: value for key, value in body.items() if key not in ("panels", "stitches")}
        return Pattern(details.get("garment") or Path(self.path).stem, panels, seams, parameters, extra)

    def details(self, value: Any) -> dict[str, Any]:
        """The block ``mfar``: its tables are tables, and what stands in them has the right form."""
        block = {} if value is None else value
        if not isinstance(block, dict):
            raise self.error("mfar", f"must be an object, not {value!r:.60}")
        for key, kind, name in (("panels", dict, "an object"), ("dimensions_m", dict, "an object"), ("seams", list, "a list"),
                                ("garment", str, "a text")):
            if block.get(key) is not None and not isinstance(block[key], kind):
                raise self.error(f"mfar.{key}", f"must be {name}, not {block[key]!r:.60}")
        panels = block.get("panels") or {}
        for name, panel in panels.items():
            where = f"mfar.panels.{name}"
            if not isinstance(panel, dict):
                raise self.error(where, f"must be an object, not {panel!r:.60}")
            if panel.get("allowances_m") is not None:
                self.numbers(panel["allowances_m"], (-1,), f"{where}.allowances_m")
            notches = panel.get("notches")
            if not (notches is None or isinstance(notches, list)):
                raise self.error(f"{where}.notches", "must be a list with one list of places for each edge")
            for i, places in enumerate(notches or []):
                self.numbers(places, (-1,), f"{where}.notches[{i}]")
        for i, seam in enumerate(block.get("seams") or []):
            where = f"mfar.seams[{i}]"
            if not isinstance(seam, dict):
                raise self.error(where, f"must be an object with kind and ease_m, not {seam!r:.60}")
            if not isinstance(seam.get("kind", ""), str):
                raise self.error(f"{where}.kind", f"must be a text, not {seam['kind']!r}")
            self.numbers(seam.get("ease_m", 0.0), (), f"{where}.ease_m")
        return {**block, "panels": panels}

    def panel(self, name: str, entry: Any, units: float, details: Mapping[str, Any]) -> Panel:
        where = f"panel '{name}'"
        vertices = self.numbers(self.get(entry, "vertices", where, list), (-1, 2), f"{where}.vertices") / units
        edges = tuple(self.edge(f"{where}, edge {i}", i, edge, vertices, units, details)
                      for i, edge in enumerate(self.get(entry, "edges", where, list)))
        if len(edges) < 2:
            raise self.error(where, "has fewer than two edges")
        return Panel(name, vertices, edges, self.numbers(details.get("warp", [0, 1]), (2,), f"{where}, warp"),
                     self.numbers(entry.get("translation", [0, 0, 0]), (3,), f"{where}.translation") / units,
                     self.numbers(entry.get("rotation", [0, 0, 0]), (3,), f"{where}.rotation"), entry.get("label", ""))

    def edge(self, where: str, number: int, entry: Any, vertices: np.ndarray, units: float, details: Mapping[str, Any]) -> Edge:
        ends = self.get(entry, "endpoints", where, list)
        if len(ends) != 2 or not all(type(e) is int and 0 <= e < len(vertices) for e in ends):
            raise self.error(where, f"endpoints must be two vertices 0..{len(vertices) - 1}, not {ends!r}")
        kind, params = self.curvature(where, entry.get("curvature"), units)
        allowances, notches = details.get("allowances_m") or [], details.get("notches") or []
        edge = Edge(ends[0], ends[1], kind, params, entry.get("label", ""), allowances[number] if number < len(allowances) else 0.0,
                    tuple(notches[number]) if number < len(notches) else ())
        try:
            edge.length(vertices[ends[0]], vertices[ends[1]])
        except InputError as error:
            raise self.error(where, str(error)) from None
        return edge

    def curvature(self, where: str, value: Any, units: float) -> tuple[str, tuple[float, ...]]:
        if value is None:
            return "line", ()
        if isinstance(value, list):  # the older form of a quadratic curve
            return "quadratic", tuple(self.numbers(value, (2,), f"{where}, curvature").tolist())
        kind = value.get("type") if isinstance(value, dict) else None
        if kind not in CURVES or kind == "line":
            raise self.error(where, f"unknown curvature {kind!r}{suggest(str(kind), [c for c in CURVES if c != 'line'])}")
        if kind == "circle":
            radius, large, right = self.numbers(value.get("params"), (3,), f"{where}, curvature")
            return kind, (float(radius / units), float(large), float(right))
        return kind, tuple(self.numbers(value.get("params"), (_FLAT[kind], 2), f"{where}, curvature").ravel().tolist())

    def seam(self, number: int, entry: Any, panels: Mapping[str, Panel], details: Any) -> Seam:
        where = f"stitch {number}"
        if not isinstance(entry, list) or len(entry) != 2:
            raise self.error(where, "must be a pair of edges {panel, edge}")
        ends: list[tuple[str, int]] = []
        for end in entry:
            name: Any = end.get("panel") if isinstance(end, dict) else None
            index: Any = end.get("edge") if isinstance(end, dict) else None
            if not isinstance(name, str) or name not in panels:
                raise self.error(where, f"unknown panel {name!r}{suggest(str(name), panels)}")
            if type(index) is not int or not 0 <= index < len(panels[name].edges):
                raise self.error(where, f"panel '{name}' has edges 0..{len(panels[name].edges) - 1}, not {index!r}")
            ends.append((name, index))
        more = details[number] if isinstance(details, list) and number < len(details) else {}
        return Seam(ends[0], ends[1], more.get("kind", "sewn"), more.get("ease_m", 0.0))
