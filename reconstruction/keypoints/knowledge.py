"""The knowledge graph of the garment: points and parts as nodes, geometric constraints as edges, kept as Turtle.

Three kinds of constraint, all free of scale, position and rotation (lengths are in units of the figure's size, the root mean square
distance of its points from their centre; the axis is that of the figure, fitted to the midpoints of the pairs):

``symmetry``  two points are mirror images about the figure's axis, within tolerances across and along it;
``ratio``     the distance of two points over that of two others lies in a range;
``order``     one point lies above another along the axis, by a gap at least.

Every constraint carries its source (a reference, or "assumption: …"). Formula (6) of the silk paper is *not* in the graph: it
compares ``x_a + x_b`` with the image width and so holds only for a figure that is centred and upright; see
:mod:`reconstruction.keypoints.loss`.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, cast

import numpy as np

from mfar_fem.errors import ParameterError
from mfar_fem.tomlfile import suggest
from reconstruction.landmarks import INDEX, LANDMARKS
from reconstruction.libraries import networkx


@dataclass(frozen=True)
class Symmetry:
    """Points `a` and `b` mirror each other: their midpoint is within `across` of the axis, their levels within `along`."""

    name: str
    a: str
    b: str
    across: float
    along: float
    weight: float
    source: str


@dataclass(frozen=True)
class Ratio:
    """|a b| / |c d| is between `minimum` and `maximum`."""

    name: str
    a: str
    b: str
    c: str
    d: str
    minimum: float
    maximum: float
    weight: float
    source: str


@dataclass(frozen=True)
class Order:
    """`a` is above `b` along the axis by at least `gap`."""

    name: str
    a: str
    b: str
    gap: float
    weight: float
    source: str


Constraint = Symmetry | Ratio | Order
KINDS: dict[str, type] = {"Symmetry": Symmetry, "Ratio": Ratio, "Order": Order}


@dataclass(frozen=True)
class Knowledge:
    """A checked knowledge graph.

    Attributes
    ----------
    constraints : tuple of Symmetry, Ratio or Order
        In order of their names.
    parts : dict
        Name of a part of the garment to the names of its points.
    levels : dict
        Nominal level of the points that define the axis, 0 at the top to 1 at the feet.
    """

    constraints: tuple[Constraint, ...]
    parts: dict[str, tuple[str, ...]]
    levels: dict[str, float]

    def __post_init__(self):
        names = [c.name for c in self.constraints]
        if len(set(names)) < len(names):
            raise ParameterError(f"two constraints are called '{next(n for n in names if names.count(n) > 1)}'")
        for name in [*self.levels, *(p for points in self.parts.values() for p in points)]:
            if name not in INDEX:
                raise ParameterError(f"'{name}' is no point{suggest(name, INDEX)}")
        if len(set(self.levels.values())) < 2:
            raise ParameterError("the axis needs points at two levels at least")
        for c in self.constraints:
            problem = problem_of(c)
            if problem:
                raise ParameterError(f"constraint '{c.name}': {problem}")

    def of(self, kind: type) -> list[Any]:
        """The constraints of one kind."""
        return [c for c in self.constraints if isinstance(c, kind)]

    def shuffled(self, seed: int) -> Knowledge:
        """The same graph with its points exchanged at random: a control that keeps the number, kinds and numbers of the
        constraints."""
        order = np.random.default_rng(seed).permutation(len(LANDMARKS))
        other = {name: LANDMARKS[i] for name, i in zip(LANDMARKS, order, strict=True)}
        moved = tuple(
            cast(Any, type(c))(**{f.name: other[getattr(c, f.name)] if f.name in "abcd" else getattr(c, f.name) for f in fields(c)})
            for c in self.constraints
        )
        parts = {part: tuple(sorted((other[p] for p in points), key=LANDMARKS.index)) for part, points in self.parts.items()}
        return Knowledge(moved, parts, {other[k]: v for k, v in self.levels.items()})

    def graph(self):
        """As a ``networkx.MultiDiGraph``: nodes are points (with ``level``) and parts, edges are constraints and ``part_of``.

        An edge runs from `a` to `b` with the constraint's name as key, its ``kind`` and its numbers; a ratio also has ``over``
        = (c, d).
        """
        graph = networkx().MultiDiGraph()
        for name in LANDMARKS:
            graph.add_node(name, kind="point", **({"level": self.levels[name]} if name in self.levels else {}))
        for part, points in self.parts.items():
            graph.add_node(part, kind="part")
            for point in points:
                graph.add_edge(point, part, key="part_of", kind="part_of")
        for c in self.constraints:
            numbers = {f.name: getattr(c, f.name) for f in fields(c) if f.name not in ("name", "a", "b", "c", "d")}
            over = {"over": (c.c, c.d)} if isinstance(c, Ratio) else {}
            graph.add_edge(c.a, c.b, key=c.name, kind=type(c).__name__.lower(), **over, **numbers)
        return graph

    @classmethod
    def from_graph(cls, graph) -> Knowledge:
        """The inverse of :meth:`graph`, for graphs that were edited in networkx."""
        levels = {n: float(d["level"]) for n, d in graph.nodes(data=True) if d.get("kind") == "point" and "level" in d}
        parts: dict[str, tuple[str, ...]] = {n: () for n, d in graph.nodes(data=True) if d.get("kind") == "part"}
        constraints: list[Constraint] = []
        for a, b, key, data in graph.edges(keys=True, data=True):
            numbers = dict(data)
            kind = numbers.pop("kind")
            if kind == "part_of":
                parts[b] = tuple(sorted((*parts[b], a), key=LANDMARKS.index))
                continue
            if "over" in numbers:
                numbers["c"], numbers["d"] = numbers.pop("over")
            constraints.append(KINDS[kind.capitalize()](name=key, a=a, b=b, **numbers))
        return cls(tuple(sorted(constraints, key=lambda c: c.name)), parts, levels)


def problem_of(c: Constraint) -> str | None:
    """What is wrong with the values of a constraint, or None."""
    points = [getattr(c, k) for k in "abcd" if hasattr(c, k)]
    for point in points:
        if point not in INDEX:
            return f"'{point}' is no point{suggest(point, INDEX)}"
    numbers = {f.name: getattr(c, f.name) for f in fields(c) if f.type == "float"}
    for name, value in numbers.items():
        if not np.isfinite(value):
            return f"{name} is {value}; it must be a finite number"
        if value < 0 and name != "gap":
            return f"{name} is {value}; it must not be negative"
    if c.a == c.b or (isinstance(c, Ratio) and c.c == c.d):
        return "a point is compared with itself"
    if isinstance(c, Ratio) and not c.minimum < c.maximum:
        return f"the range {c.minimum} to {c.maximum} is empty"
    if not c.source.strip():
        return "the source is missing; give a reference or 'assumption: why'"
    return None

