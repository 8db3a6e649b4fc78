"""Nouns of a flat cut: panels with named edges and a grain, and the seams that join them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from mfar_fem.errors import ParameterError


@dataclass(frozen=True)
class Edge:
    """A named part of a panel's outline.

    Parameters
    ----------
    name : str
        Unique in its panel.
    points : (n, 2) array
        Polyline in panel coordinates (u along weft, v along warp), m, from corner to corner.
    """

    name: str
    points: np.ndarray

    @property
    def length(self) -> float:
        """Length of the polyline, m."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())

    def sample(self, pieces: int) -> np.ndarray:
        """`pieces` + 1 points at equal arc length, *Shape:* (pieces + 1, 2); the first and last are the corners."""
        step = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        at = np.concatenate([[0.0], np.cumsum(step)])
        want = np.linspace(0.0, at[-1], pieces + 1)
        found = np.stack([np.interp(want, at, self.points[:, k]) for k in range(2)], axis=1)
        found[0], found[-1] = self.points[0], self.points[-1]
        return found


@dataclass(frozen=True)
class Panel:
    """A flat piece of cloth; its coordinates are (u, v) in metres, u along the weft and v along the warp (grain).

    Parameters
    ----------
    name : str
        Such as ``left_body``.
    edges : tuple of Edge
        Closed outline, each edge starting where the last ended.
    folds : tuple of (n, 2) arrays
        Lines inside the panel on which the mesh has edges (the shoulder fold).
    outward : {1, -1}
        +1 if (u, v) counter-clockwise gives the outer side's normal when worn.
    draped : bool
        False for a hidden under-layer that is cut but not part of the mid-surface.
    """

    name: str
    edges: tuple[Edge, ...]
    folds: tuple[np.ndarray, ...] = ()
    outward: int = -1
    draped: bool = True

    def __post_init__(self):
        for first, second in zip(self.edges, self.edges[1:] + self.edges[:1], strict=True):
            gap = float(np.linalg.norm(first.points[-1] - second.points[0]))
            if gap > 1e-9:
                raise ParameterError(
                    f"panel '{self.name}': edge '{second.name}' must start where '{first.name}' ends; gap {gap:.3g} m"
                )

    @property
    def polygon(self) -> np.ndarray:
        """Outline, *Shape:* (n, 2), not repeated at the end, m."""
        return np.concatenate([edge.points[:-1] for edge in self.edges])

    @property
    def area(self) -> float:
        """Area, m²."""
        x, y = self.polygon.T
        return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))

    @property
    def warp(self) -> np.ndarray:
        """Grain direction in panel coordinates, a unit vector."""
        return np.array([0.0, 1.0])

    @property
    def weft(self) -> np.ndarray:
        """Direction across the grain, a unit vector."""
        return np.array([1.0, 0.0])

    def edge(self, name: str) -> Edge:
        """The edge of that name."""
        for edge in self.edges:
            if edge.name == name:
                return edge
        raise ParameterError(f"panel '{self.name}' has no edge '{name}'; it has {', '.join(e.name for e in self.edges)}")


@dataclass(frozen=True)
class Seam:
    """Two edges sewn together point by point.

    Parameters
    ----------
    name : str
        Such as ``left_side``.
    first, second : (panel, edge) names
        What is joined.
    flip : bool
        The second edge runs against the first.
    eased : bool
        The edges have different lengths; the longer one is gathered.
    """

    name: str
    first: tuple[str, str]
    second: tuple[str, str]
    flip: bool = True
    eased: bool = False


@dataclass(frozen=True)
class Anchor:
    """A structural point fixed by panel coordinates.

    Parameters
    ----------
    panel : str
        Panel it lies on.
    uv : (float, float)
        Panel coordinates, m.
    """

    panel: str
    uv: tuple[float, float]


Placement = Callable[[str, np.ndarray], np.ndarray]
"""``(panel name, (n, 2) panel coordinates) -> (n, 3)`` positions, m."""


@dataclass(frozen=True)
class Garment:
    """A cut garment: panels, seams, structural points, and where its cloth lies flat.

    Parameters
    ----------
    kind : str
        One of :data:`reconstruction.benchmark.cutting.KINDS`.
    panels : tuple of Panel
    seams : tuple of Seam
    anchors : dict of str to Anchor
        The landmarks that this cut has; a landmark not in it is absent.
    layout : callable
        Placement of the garment laid flat, x to the wearer's left, y up the page, z towards the viewer.
    openings : tuple of (panel, edge)
        Edges that stay open on purpose: collar, cuffs, hem, slits.
    """

    kind: str
    panels: tuple[Panel, ...]
    seams: tuple[Seam, ...]
    anchors: dict[str, Anchor]
    layout: Placement
    openings: tuple[tuple[str, str], ...] = field(default=())

    def panel(self, name: str) -> Panel:
        """The panel of that name."""
        for panel in self.panels:
            if panel.name == name:
                return panel
        raise ParameterError(f"there is no panel '{name}'; there are {', '.join(p.name for p in self.panels)}")
