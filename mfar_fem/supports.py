"""Supports: which unknowns are held or moved, and which directors they prescribe."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mfar_fem.errors import InputError
from mfar_fem.surface.mesh import Surface


@dataclass(frozen=True)
class Constraint:
    """Prescribed unknowns: ``u[dofs] = u0[dofs] + lam * change`` (m; rotations: held at the director, change 0)."""

    dofs: np.ndarray
    change: np.ndarray


def _position_dofs(nodes: np.ndarray, components) -> np.ndarray:
    return (3 * np.asarray(nodes)[:, None] + np.asarray(components)).ravel()


def _edge_points(surface: Surface, edges: np.ndarray) -> np.ndarray:
    return (edges[:, None] * surface.order + np.arange(surface.order)).ravel()


class Support:
    """Base: a part of the surface (boundary name, or node ids with ``by_node=True``) that is held or moved.

    Parameters
    ----------
    where : str or int array
        Name of a boundary or vertex ids (their boundary edges are included); with ``by_node`` node ids, nothing else.
    components : sequence of int
        Held components of the position (0, 1, 2 = x, y, z).
    displacement : (3,) or (m, 3) array
        Displacement at load factor 1, m; only the held components count.
    """

    rotations = False

    def __init__(self, where, components=(0, 1, 2), displacement=(0.0, 0.0, 0.0), by_node: bool = False):
        self.where, self.components, self.by_node = where, tuple(components), by_node
        self.displacement = np.asarray(displacement, dtype=float)

    def nodes(self, surface: Surface) -> np.ndarray:
        """Nodes concerned."""
        nodes = np.asarray(self.where, dtype=np.int64) if self.by_node else surface.nodes_of(self.where)
        if len(nodes) == 0:
            raise InputError(f"support on {self.where!r}: no nodes there")
        return nodes

    def directors(self, surface: Surface, directors: np.ndarray) -> np.ndarray:
        """Directors (na, 3) of the reference with those that this support prescribes."""
        return directors

    def constraint(self, surface: Surface, alpha_offset: int, with_bending: bool) -> Constraint:
        """The unknowns prescribed."""
        nodes = self.nodes(surface)
        change = np.broadcast_to(self.displacement, (len(nodes), 3))[:, list(self.components)].ravel()
        dofs = _position_dofs(nodes, self.components)
        if self.rotations and with_bending:
            points = alpha_offset + _edge_points(surface, surface.edges_of(self.where))
            dofs, change = np.concatenate([dofs, points]), np.concatenate([change, np.zeros(len(points))])
        return Constraint(dofs, change)


class Hinge(Support):
    """Position held or moved, rotation free."""


class Clamp(Support):
    """Position and rotation held: the director keeps its reference direction, or ``normal`` where given.

    A given normal that is not the sheet's own bends it at the clamp already in the reference.
    """

    rotations = True

    def __init__(self, where, displacement=(0.0, 0.0, 0.0), normal=None, components=(0, 1, 2)):
        super().__init__(where, components, displacement)
        self.normal = None if normal is None else np.asarray(normal, dtype=float)

    def clamp_rotation(self, surface: Surface, directors: np.ndarray) -> np.ndarray:
        """Directors to start from: those of the reference with the clamp's normal."""
        if self.normal is None:
            return directors
        directors = directors.copy()
        directors[_edge_points(surface, surface.edges_of(self.where))] = self.normal / np.linalg.norm(self.normal)
        return directors


class Symmetry(Support):
    """Symmetry plane normal to a coordinate axis: no displacement across it, directors stay in it.

    Parameters
    ----------
    where : str or int array
        Boundary on the plane.
    axis : {0, 1, 2}
        Normal of the plane.
    """

    rotations = True

    def __init__(self, where, axis: int):
        super().__init__(where, (axis,))
        self.axis = axis

    def directors(self, surface: Surface, directors: np.ndarray) -> np.ndarray:
        """Directors projected on the plane."""
        directors = directors.copy()
        points = _edge_points(surface, surface.edges_of(self.where))
        directors[points, self.axis] = 0.0
        directors[points] /= np.linalg.norm(directors[points], axis=1, keepdims=True)
        return directors
