"""Knowledge graphs as Turtle files: read with every fault named by its line, and written."""

from __future__ import annotations

import re
from dataclasses import fields
from decimal import Decimal
from pathlib import Path
from typing import Any

from mfar_fem.errors import DataFileError, ParameterError
from mfar_fem.tomlfile import suggest
from reconstruction.keypoints.knowledge import KINDS, Constraint, Knowledge, problem_of
from reconstruction.landmarks import INDEX, LANDMARKS
from reconstruction.libraries import optional

NAMESPACE = "urn:mfar-fem:garment#"
SHIPPED = Path(__file__).parent / "knowledge.ttl"


def load(path: str | Path = SHIPPED) -> Knowledge:
    """Read and check a graph from a Turtle file.

    Raises
    ------
    DataFileError
        It does not exist, is not Turtle (with the line), or a node is wrong (with the line where it begins).
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise DataFileError(f"cannot be read as UTF-8 text: {error}", path=path) from error
    return parse(text, path)


def parse(text: str, path: str | Path = "<text>") -> Knowledge:
    """As :func:`load`, from text."""
    rdflib = optional("rdflib", "Turtle files need")
    rdf = rdflib.Graph()
    try:
        rdf.parse(data=text, format="turtle")
    except Exception as error:  # the parser raises its own class, ValueError and others
        line = getattr(error, "lines", None)
        reason = getattr(error, "_why", None) or str(error).splitlines()[0]
        raise DataFileError(f"is not valid Turtle: {reason}", path=path, line=None if line is None else line + 1) from error
    reader = _Reader(rdflib, rdf, text, path)
    levels, parts, constraints = {}, {}, []
    for node, kind in sorted(rdf.subject_objects(rdflib.RDF.type)):
        name, kind = reader.local(node), reader.local(kind)
        if kind == "KeyPoint":
            if name not in INDEX:
                raise reader.error(name, f"'{name}' is no point{suggest(name, INDEX)}")
            level = reader.values(node, "level")
            if level:
                levels[name] = reader.number(name, "level", level)
        elif kind == "Part":
            points = [reader.local(p) for p in reader.values(node, "point")]
            unknown = [p for p in points if p not in INDEX]
            if unknown:
                raise reader.error(name, f"'{unknown[0]}' is no point{suggest(unknown[0], INDEX)}")
            parts[name] = tuple(sorted(points, key=LANDMARKS.index))
        elif kind in KINDS:
            constraints.append(reader.constraint(node, name, KINDS[kind]))
        else:
            raise reader.error(name, f"'{kind}' is no kind of node{suggest(kind, ['KeyPoint', 'Part', *KINDS])}")
    try:
        return Knowledge(tuple(sorted(constraints, key=lambda c: c.name)), parts, levels)
    except ParameterError as error:
        raise DataFileError(str(error), path=path) from error


class _Reader:
    """Values of nodes, with errors that say where in the text the node begins."""

    def __init__(self, rdflib, rdf, text: str, path):
        self.rdflib, self.rdf, self.text, self.path = rdflib, rdf, text, path

    def local(self, term) -> str:
        return str(term).removeprefix(NAMESPACE)

    def error(self, name: str, message: str) -> DataFileError:
        lines = self.text.splitlines()
        pattern = re.compile(rf"^\s*(?:[\w-]*:|<[^>]*#){re.escape(name)}>?(?![\w-])")
        line = next((i for i, row in enumerate(lines, 1) if pattern.match(row)), None)
        return DataFileError(message, path=self.path, line=line, column=name)

    def values(self, node, key: str) -> list:
        return sorted(self.rdf.objects(node, self.rdflib.URIRef(NAMESPACE + key)))

    def number(self, name: str, key: str, values: list) -> float:
        if len(values) != 1:
            raise self.error(name, f"{key} is given {len(values)} times; give it once")
        try:
            return float(values[0])
        except ValueError:
            raise self.error(name, f"{key} is '{values[0]}'; it must be a number") from None

    def constraint(self, node, name: str, kind: type) -> Constraint:
        known = [f.name for f in fields(kind) if f.name != "name"]
        for predicate in self.rdf.predicates(node):
            key = self.local(predicate)
            if predicate != self.rdflib.RDF.type and key not in known:
                raise self.error(name, f"unknown property '{key}'{suggest(key, known)}")
        found: dict[str, Any] = {}
        for f in fields(kind):
            if f.name == "name":
                continue
            values = self.values(node, f.name)
            if f.type == "float":
                found[f.name] = self.number(name, f.name, values)
            elif len(values) == 1:
                found[f.name] = self.local(values[0])
            else:
                raise self.error(name, f"{f.name} is given {len(values)} times; give it once")
        constraint = kind(name=name, **found)
        problem = problem_of(constraint)
        if problem:
            raise self.error(name, problem)
        return constraint


def dumps(knowledge: Knowledge) -> str:
    """Turtle text of a graph, from which :func:`parse` makes the same again."""
    rdflib = optional("rdflib", "Turtle files need")
    rdf, base = rdflib.Graph(), rdflib.Namespace(NAMESPACE)
    rdf.bind("", base)
    add = rdf.add

    def number(value: float):
        """A literal with every digit (rdflib writes doubles with seven)."""
        return rdflib.Literal(f"{Decimal(repr(float(value))):f}", datatype=rdflib.XSD.decimal, normalize=False)

    for point in LANDMARKS:
        add((base[point], rdflib.RDF.type, base.KeyPoint))
        if point in knowledge.levels:
            add((base[point], base.level, number(knowledge.levels[point])))
    for part, points in knowledge.parts.items():
        add((base[part], rdflib.RDF.type, base.Part))
        for point in points:
            add((base[part], base.point, base[point]))
    for c in knowledge.constraints:
        add((base[c.name], rdflib.RDF.type, base[type(c).__name__]))
        for f in fields(c):
            value = getattr(c, f.name)
            if f.name in "abcd":
                add((base[c.name], base[f.name], base[value]))
            elif f.name != "name":
                add((base[c.name], base[f.name], number(value) if f.type == "float" else rdflib.Literal(value)))
    return rdf.serialize(format="turtle")


def save(knowledge: Knowledge, path: str | Path) -> None:
    """Write a graph as Turtle."""
    Path(path).write_text(dumps(knowledge), encoding="utf-8")

