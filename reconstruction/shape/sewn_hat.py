"""The veil hat as a sewn mesh: a cone, a flat brim, and a veil gathered along the brim but for the opening at the face.

Flat coordinates of a vertex: u = angle from the nape (towards the wearer's left) times the radius there, v = way along the meridian
from the tip, m. Crown and brim are developed triangle by triangle; the veil is a rectangle wider than the brim by the gathering.
"""

from __future__ import annotations

import numpy as np

from mfar_fem.errors import InputError
from reconstruction.shape.sewn import Sewn
from reconstruction.template.dimensions import HatDimensions

CROWN, BRIM, VEIL = 0, 1, 2
"""Panels."""


def sew_hat(d: HatDimensions, edge: float) -> Sewn:
    """Mesh a veil hat.

    Parameters
    ----------
    d : HatDimensions
    edge : float
        Length of edges, m.

    Raises
    ------
    InputError
        Edges too long for brim, crown or veil.
    """
    base, brim = 0.5 * d.crown_diameter, 0.5 * d.brim_diameter
    slant = float(np.hypot(base, d.crown_height))
    narrow = min(brim - base, slant, d.veil_length)
    if edge > narrow:
        raise InputError(f"edges of {1e3 * edge:g} mm are too long for a part of {1e3 * narrow:.0f} mm")
    steps = [max(1, int(np.ceil(length / edge))) for length in (slant, brim - base, d.veil_length)]
    meridian = np.concatenate([np.linspace(0, slant, steps[0] + 1), slant + np.linspace(0, brim - base, steps[1] + 1)[1:]])
    radius = np.interp(meridian, [0.0, slant, slant + brim - base], [0.0, base, brim])
    rings, angle, way, faces, panel = [np.array([0])], [np.zeros(1)], [np.zeros(1)], [], []
    for k in range(1, len(meridian)):
        n = 2 * max(3, round(np.pi * radius[k] / edge))
        turn = 2 * np.pi * np.arange(n) / n - np.pi  # the face lies at -pi
        rings.append(sum(len(r) for r in rings) + np.arange(n))
        new = _stitch(rings[-2], angle[-1], rings[-1], turn)
        faces.append(new)
        panel.append(np.full(len(new), CROWN if k <= steps[0] else BRIM))
        angle.append(turn)
        way.append(np.full(n, meridian[k]))
    edge_ring, edge_turn = rings[-1], angle[-1]
    covered = np.flatnonzero(np.abs(edge_turn) <= np.pi - 0.5 * d.open_angle + 1e-9)
    if len(covered) < 3:
        raise InputError(f"a veil that is open over {np.degrees(d.open_angle):.0f} degrees covers nothing")
    columns = edge_turn[covered]
    rows = [edge_ring[covered]]
    for k in range(1, steps[2] + 1):
        rows.append(sum(len(a) for a in angle) + np.arange(len(columns)))
        angle.append(columns)
        way.append(np.full(len(columns), meridian[-1] + d.veil_length * k / steps[2]))
        a, b, c, e = rows[-2][:-1], rows[-2][1:], rows[-1][:-1], rows[-1][1:]
        new = np.concatenate([np.stack([a, b, c], axis=1), np.stack([b, e, c], axis=1)])
        faces.append(new)
        panel.append(np.full(len(new), VEIL))
    theta, s = np.concatenate(angle), np.concatenate(way)
    all_faces, all_panels = np.concatenate(faces), np.concatenate(panel)
    flat = _developed(theta[all_faces], s[all_faces], all_panels, base, slant, brim, d.gathering)
    free = np.setdiff1d(np.arange(len(edge_ring)), covered[1:-1])  # of the brim, with the ends of the veil
    free = free[np.argsort(edge_turn[free] % (2 * np.pi))]
    return Sewn(
        "veil-hat",
        np.stack([theta * np.interp(s, meridian, radius), s], axis=1),
        all_faces,
        flat,
        all_panels,
        ("crown", "brim", "veil"),
        np.tile([0.0, 1.0], (len(all_faces), 1)),
        np.zeros(len(theta), dtype=int),
        {"face": edge_ring[free], "hem": rows[-1], "right_edge": np.array([r[0] for r in rows]),
         "left_edge": np.array([r[-1] for r in rows])},
        two_sided=True,
    )  # fmt: skip


def _stitch(inner: np.ndarray, inner_turn: np.ndarray, outer: np.ndarray, outer_turn: np.ndarray) -> np.ndarray:
    """Triangles (n, 3) between two closed rings whose angles rise; of a tip of one vertex a fan."""
    n, m = len(inner), len(outer)
    if n == 1:
        return np.stack([np.repeat(inner, m), np.roll(outer, -1), outer], axis=1)
    ahead, behind = np.append(inner_turn, inner_turn[0] + 2 * np.pi), np.append(outer_turn, outer_turn[0] + 2 * np.pi)
    i = j = 0
    out = []
    while i < n or j < m:
        if j < m and (i == n or behind[j + 1] <= ahead[i + 1]):
            out.append((inner[i % n], outer[(j + 1) % m], outer[j]))
            j += 1
        else:
            out.append((inner[i], inner[(i + 1) % n], outer[j % m]))
            i += 1
    return np.array(out)


def _developed(theta, s, panel, base: float, slant: float, brim: float, gathering: float) -> np.ndarray:
    """Flat corners (nf, 3, 2) of triangles with corner angles (nf, 3) and ways along the meridian (nf, 3)."""
    tip = s < 1e-12  # has no angle of its own
    theta = np.where(tip, np.roll(theta, 1, axis=1), theta)
    theta = theta + 2 * np.pi * ((theta[:, :1] - theta) > np.pi) - 2 * np.pi * ((theta - theta[:, :1]) > np.pi)
    middle = np.where(tip, 0.0, theta).sum(axis=1) / np.maximum((~tip).sum(axis=1), 1)
    theta = np.where(tip, middle[:, None], theta)
    around = theta * base / slant
    cone = np.stack([s * np.sin(around), s * np.cos(around)], axis=-1)
    r = base + s - slant
    ring = np.stack([r * np.sin(theta), r * np.cos(theta)], axis=-1)
    veil = np.stack([gathering * brim * theta, s], axis=-1)
    return np.choose(panel[:, None, None], [cone, ring, veil])


def in_space(sewn: Sewn, d: HatDimensions) -> np.ndarray:
    """Vertices (nv, 3), m, of the hat set down level: the middle of the crown's base at the origin, x to the wearer's left, y
    backwards, the veil straight down."""
    base, brim = 0.5 * d.crown_diameter, 0.5 * d.brim_diameter
    slant = float(np.hypot(base, d.crown_height))
    s = sewn.uv[:, 1]
    ways = [0.0, slant, slant + brim - base, slant + brim - base + d.veil_length]
    radius = np.interp(s, ways, [0.0, base, brim, brim])
    height = np.interp(s, ways, [d.crown_height, 0.0, 0.0, -d.veil_length])
    theta = np.divide(sewn.uv[:, 0], radius, out=np.zeros_like(s), where=radius > 1e-12)
    return np.stack([radius * np.sin(theta), radius * np.cos(theta), height], axis=1)
