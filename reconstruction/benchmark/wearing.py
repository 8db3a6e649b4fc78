"""How each type is put on: where its cloth starts around a figure, and which points are held and by what."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from dataclasses import field as dataclass_field

import numpy as np

from . import body
from .body import BodySpec
from .cutting import Cut
from .panels import Garment
from .sewing import SewnMesh
from .shawl import shawl, stations
from .tunic import WAIST, half_width_at, sleeve_depth_at, tunic
from .veil_hat import STIFF, hat_shape, veil_hat

PINCH = 0.01
"""Height of a pin over the body's surface, m."""
BELT_HALF = 0.02
"""Half the width of a belt, m."""


@dataclass(frozen=True)
class Worn:
    """The start of a drape.

    Parameters
    ----------
    start : (n, 3) array
        Cloth around the T-pose, m.
    held : (h,) array of int
        Vertices moved with the body.
    targets : callable
        ``targets(blend) -> (h, 3)`` positions of the held vertices.
    belt : array of int
        Vertices under a belt.
    """

    start: np.ndarray
    held: np.ndarray = dataclass_field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    targets: Callable[[float], np.ndarray] = lambda blend: np.zeros((0, 3))
    belt: np.ndarray = dataclass_field(default_factory=lambda: np.zeros(0, dtype=np.int64))


def cut_for(cut: Cut, spec: BodySpec) -> Garment:
    """The garment of a cut, with its structural points placed for a wearer."""
    if cut.kind in ("round-collar-robe", "half-sleeve"):
        return tunic(cut, spec.stature)
    if cut.kind == "flying-ribbon":
        return shawl(cut, *_shoulder_and_arm(spec))
    return veil_hat(cut, body.skull_radius(spec))


def put_on(mesh: SewnMesh, cut: Cut, spec: BodySpec, belt: bool = False) -> Worn:
    """Start of the drape of a sewn garment.

    Parameters
    ----------
    mesh : SewnMesh
        Of :func:`cut_for`.
    cut : Cut
    spec : BodySpec
    belt : bool
        Tie a belt (robe only).
    """
    if cut.kind == "flying-ribbon":
        return _ribbon(mesh, cut, spec)
    if cut.kind == "veil-hat":
        return _hat(mesh, cut, spec)
    place = _tunic_start(cut, spec)
    start = _welded(mesh, lambda panel, uv: place(uv))
    tied = np.zeros(0, dtype=np.int64)
    if belt and cut.kind == "round-collar-robe":
        v = _per_vertex(mesh, np.abs(mesh.uv[..., 1]))
        u = _per_vertex(mesh, np.abs(mesh.uv[..., 0]))
        waist = WAIST * spec.stature
        tied = np.flatnonzero((np.abs(v - waist) < BELT_HALF) & (u < half_width_at(cut, waist) + 1e-3))
    return Worn(start, belt=tied)


def _welded(mesh: SewnMesh, place) -> np.ndarray:
    total, count = np.zeros_like(mesh.flat), np.zeros(len(mesh.flat))
    for index, panel in enumerate(mesh.garment.panels):
        at = mesh.panel == index
        if at.any():
            np.add.at(total, mesh.faces[at].reshape(-1), place(panel.name, mesh.uv[at].reshape(-1, 2)))
            np.add.at(count, mesh.faces[at].reshape(-1), 1.0)
    return total / count[:, None]


def _per_vertex(mesh: SewnMesh, corner_values) -> np.ndarray:
    total, count = np.zeros(len(mesh.flat)), np.zeros(len(mesh.flat))
    np.add.at(total, mesh.faces.reshape(-1), corner_values.reshape(-1))
    np.add.at(count, mesh.faces.reshape(-1), 1.0)
    return total / count


def _tunic_start(cut: Cut, spec: BodySpec):
    """A tube around the torso and one around each arm, touching in the shoulder fold."""
    top = body.joints(spec, 0.0)["left_shoulder"][2] + 0.05 * spec.stature
    arm = cut["sleeve_depth"]

    def place(uv: np.ndarray) -> np.ndarray:
        u, s = uv[:, 0], np.abs(uv[:, 1])
        width = np.where(s < arm, cut["chest_width"] / 2, half_width_at(cut, s))
        depth = np.where(np.abs(u) < cut["chest_width"] / 2, arm, sleeve_depth_at(cut, u))
        reach = 0.14 * np.cos(np.pi / 2 * np.clip(u / width, -1, 1)) + 1e-9
        torso = reach * np.sin(np.pi / 2 * np.clip(s / (1.7 * reach), 0, 1))
        sleeve = 0.3 * depth * np.sin(np.pi * np.clip(s / depth, 0, 1))
        y = -np.sign(uv[:, 1]) * (torso**4 + sleeve**4) ** 0.25
        drop = s - 0.6 * reach * np.clip(s / (1.7 * reach), 0, 1) ** 0.5 * np.clip(s / 0.05, 0, 1)
        return np.stack([u, y, top - np.maximum(drop, 0.3 * s)], axis=1)

    return place


def _shoulder_and_arm(spec: BodySpec) -> tuple[float, float]:
    at = body.joints(spec, 0.0)
    return float(at["left_shoulder"][0]), float(at["left_hand"][0] - at["left_shoulder"][0])


def _ribbon(mesh: SewnMesh, cut: Cut, spec: BodySpec) -> Worn:
    shoulder, arm = _shoulder_and_arm(spec)
    along = stations(cut, shoulder, arm)
    top = body.joints(spec, 0.0)["left_shoulder"][2] + 0.03 * spec.stature + 2 * PINCH
    start = _welded(mesh, lambda panel, uv: np.stack([uv[:, 1], 0.045 * spec.stature + uv[:, 0], np.full(len(uv), top)], axis=1))
    u, v = _per_vertex(mesh, mesh.uv[..., 0]), _per_vertex(mesh, mesh.uv[..., 1])
    edge = np.flatnonzero(u < 1e-9)
    held, names = [], []
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for part, joint in (("shoulder", "shoulder"), ("wrist", "hand")):
            near = edge[np.argsort(np.abs(v[edge] - sign * along[part]), kind="stable")[:2]]
            held += near.tolist()
            names += [f"{side}_{joint}"] * 2

    def targets(blend: float) -> np.ndarray:
        at = body.joints(spec, blend)
        shape = body.field(spec, blend)
        wanted = np.array([at[n] + np.array([0.0, 0.35, 1.0]) * 0.05 for n in names])
        for _ in range(4):
            d, g = shape.with_gradient(wanted)
            wanted = wanted + (PINCH - d)[:, None] * g
        for first in range(0, len(held), 2):  # the two vertices of a pin keep their distance along the band
            wanted[first : first + 2, 0] += v[held[first : first + 2]] - v[held[first : first + 2]].mean()
        return wanted

    return Worn(start, np.array(held), targets)


def _hat(mesh: SewnMesh, cut: Cut, spec: BodySpec) -> Worn:
    s = hat_shape(cut, body.skull_radius(spec))
    centre = body.joints(spec, 0.0)["head"] + np.array([0.0, 0.0, 0.002])

    def place(panel: str, uv: np.ndarray) -> np.ndarray:
        u, v = uv.T
        if panel == "crown":
            rho, turn = np.hypot(u, v), np.arctan2(u, v) * np.pi / s.sector
            radius = rho * s.base / s.slant
            local = np.stack([radius * np.sin(turn), -radius * np.cos(turn), s.height * (1 - rho / s.slant)], axis=1)
        elif panel.endswith("brim"):
            local = np.stack([u, -v, np.zeros(len(u))], axis=1)
        else:
            turn = u / (s.veil_width / 2) * (np.pi - s.gap)
            radius = s.brim + (max(0.0, 0.25 * spec.stature - s.brim) + 0.02) * np.clip(v / 0.12, 0, 1)  # clear of the arms
            local = np.stack([radius * np.sin(turn), radius * np.cos(turn), -v], axis=1)
        return local + centre

    start = _welded(mesh, place)
    stiff = [i for i, p in enumerate(mesh.garment.panels) if p.name in STIFF]
    held = np.unique(mesh.faces[np.isin(mesh.panel, stiff)])
    return Worn(start, held, lambda blend: start[held])
