"""Panels, edges, seams and the pattern they make.

Panel coordinates are metres, y up; edges run anticlockwise seen from outside. An edge is straight, a quadratic or cubic Bézier
curve or a circular arc with the same parameters as in the GarmentCode specification (M. Korosteleva, O. Sorkine-Hornung,
GarmentCode: programming parametric sewing patterns, ACM Trans. Graph. 42 (2023) 199, doi:10.1145/3618351): control points are
(along, to the left) in units of the chord; an arc has radius, large-arc flag and right flag (it bulges to the right of its chord).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mfar_fem.errors import InputError
from mfar_fem.tomlfile import suggest

SAMPLES = 24
"""Straight pieces by which a curved edge is drawn."""
CURVES = {"line": 0, "quadratic": 2, "cubic": 4, "circle": 3}
"""Kinds of edges and how many parameters each has."""


@dataclass(frozen=True)
class Edge:
    """One edge of a panel, from vertex `start` to vertex `end`.

    Attributes
    ----------
    start, end : int
        Indices into the panel's vertices.
    kind : str
        One of :data:`CURVES`.
    params : tuple of float
        Bézier control points relative to the chord, one after the other; or radius (m), large-arc flag, right flag.
    name : str
        What the edge is (``hem``, ``neckline``, ...); several may share one.
    allowance : float
        Seam allowance outside the edge, m.
    notches : tuple of float
        Positions of notches, parts of the edge's length.
    """

    start: int
    end: int
    kind: str = "line"
    params: tuple[float, ...] = ()
    name: str = ""
    allowance: float = 0.0
    notches: tuple[float, ...] = ()

    def __post_init__(self):
        if self.kind not in CURVES:
            raise InputError(f"unknown kind of edge '{self.kind}'{suggest(self.kind, CURVES)}")
        if len(self.params) != CURVES[self.kind]:
            raise InputError(f"an edge of kind '{self.kind}' has {CURVES[self.kind]} parameters, not {len(self.params)}")

    def points(self, a: np.ndarray, b: np.ndarray, samples: int = SAMPLES) -> np.ndarray:
        """Points (n, 2) from `a` to `b` along the edge."""
        if self.kind == "line":
            return np.stack([a, b])
        if self.kind == "circle":
            radius, large, right = self.params
            return _arc(a, b, radius, large, right, samples)
        return bezier_points(self.control(a, b), np.linspace(0, 1, samples + 1))

    def control(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Bézier points (n, 2) of a quadratic or cubic edge, ends included."""
        chord = b - a
        left = np.array([-chord[1], chord[0]])
        return np.stack([a, *(a + u * chord + v * left for u, v in np.reshape(self.params, (-1, 2))), b])

    def length(self, a: np.ndarray, b: np.ndarray) -> float:
        """Arc length, m (Gauss's rule for Bézier curves)."""
        if self.kind == "line":
            return float(np.linalg.norm(b - a))
        if self.kind == "circle":
            return self.params[0] * abs(_arc_angles(a, b, *self.params)[1])
        control = self.control(a, b)
        nodes, weights = np.polynomial.legendre.leggauss(24)
        hodograph = (len(control) - 1) * np.diff(control, axis=0)
        return float(weights @ np.linalg.norm(bezier_points(hodograph, (nodes + 1) / 2), axis=1) / 2)


@dataclass(frozen=True)
class Panel:
    """A piece of cloth.

    Attributes
    ----------
    name : str
    vertices : (n, 2) array
        m.
    edges : tuple of Edge
        A closed loop.
    warp : (2,) array
        Unit vector of the warp (the grain line) in panel coordinates.
    translation, rotation : (3,) array
        Where it hangs about the body: m, and Euler angles x-y-z in degrees (GarmentCode's axes, y up).
    label : str
        Part of the body.
    """

    name: str
    vertices: np.ndarray
    edges: tuple[Edge, ...]
    warp: np.ndarray = field(default_factory=lambda: np.array([0.0, 1.0]))
    translation: np.ndarray = field(default_factory=lambda: np.zeros(3))
    rotation: np.ndarray = field(default_factory=lambda: np.zeros(3))
    label: str = ""

    def edge_points(self, index: int, samples: int = SAMPLES) -> np.ndarray:
        """Points (n, 2) along an edge, m."""
        edge = self.edges[index]
        return edge.points(self.vertices[edge.start], self.vertices[edge.end], samples)

    def edge_length(self, index: int) -> float:
        """Length of an edge, m."""
        edge = self.edges[index]
        return edge.length(self.vertices[edge.start], self.vertices[edge.end])

    def outline(self, samples: int = SAMPLES) -> np.ndarray:
        """Closed polygon (n, 2) of the sewing line, m (first point not repeated)."""
        return np.vstack([self.edge_points(i, samples)[:-1] for i in range(len(self.edges))])

    def find(self, name: str) -> tuple[int, ...]:
        """Indices of the edges of a name."""
        return tuple(i for i, edge in enumerate(self.edges) if edge.name == name)


@dataclass(frozen=True)
class Seam:
    """Two edges that belong together.

    Attributes
    ----------
    first, second : (str, int)
        Panel and index of the edge.
    kind : str
        ``sewn``, or ``fold``: the panels are cut in one piece across it (no allowance).
    ease : float
        Length of the first edge minus that of the second which is meant, m.
    """

    first: tuple[str, int]
    second: tuple[str, int]
    kind: str = "sewn"
    ease: float = 0.0


@dataclass(frozen=True)
class Pattern:
    """All panels of a garment and their seams.

    Attributes
    ----------
    name : str
        Type of the garment, or of the file.
    panels : dict of str to Panel
    seams : tuple of Seam
    parameters : mapping
        Dimensions it was made from, m.
    extra : mapping
        What a file held besides (kept for writing it again).
    """

    name: str
    panels: dict[str, Panel]
    seams: tuple[Seam, ...] = ()
    parameters: Mapping[str, Any] = field(default_factory=dict)
    extra: Mapping[str, Any] = field(default_factory=dict)

    def seam_lengths(self, seam: Seam) -> tuple[float, float]:
        """Lengths of both edges of a seam, m."""
        (p, i), (q, j) = seam.first, seam.second
        return self.panels[p].edge_length(i), self.panels[q].edge_length(j)


def bezier_points(control: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Points (m, 2) of a Bézier curve with control points (n, 2), by de Casteljau's rule."""
    layer = np.broadcast_to(control, (len(t), *control.shape))
    for _ in range(len(control) - 1):
        layer = (1 - t)[:, None, None] * layer[:, :-1] + t[:, None, None] * layer[:, 1:]
    return layer[:, 0]


def relative_control(control: np.ndarray) -> tuple[float, ...]:
    """Parameters of a Bézier edge from its absolute control points (n, 2), ends included."""
    a, b = control[0], control[-1]
    chord = b - a
    left = np.array([-chord[1], chord[0]])
    inner = (control[1:-1] - a) @ np.stack([chord, left]).T / (chord @ chord)
    return tuple(float(v) for v in inner.ravel())


def _arc_angles(a: np.ndarray, b: np.ndarray, radius: float, large: float, right: float) -> tuple[float, float, np.ndarray]:
    """Start angle, signed sweep and centre of an arc."""
    chord = b - a
    size = float(np.linalg.norm(chord))
    if size == 0 or radius < size / 2 * (1 - 1e-9):
        raise InputError(f"an arc of radius {radius:.6g} m cannot span a chord of {size:.6g} m")
    height = np.sqrt(max(radius**2 - size**2 / 4, 0.0))
    left = np.array([-chord[1], chord[0]]) / size
    centre = (a + b) / 2 + left * height * (1 if bool(right) != bool(large) else -1)
    start, end = (np.arctan2(*(p - centre)[::-1]) for p in (a, b))
    sweep = (end - start) % (2 * np.pi)  # anticlockwise, which bulges to the right of the chord
    return float(start), float(sweep if right else sweep - 2 * np.pi), centre


def _arc(a: np.ndarray, b: np.ndarray, radius: float, large: float, right: float, samples: int) -> np.ndarray:
    start, sweep, centre = _arc_angles(a, b, radius, large, right)
    angle = start + sweep * np.linspace(0, 1, samples + 1)
    points = centre + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points[0], points[-1] = a, b
    return points
