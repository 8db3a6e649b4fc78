"""The 27 features of the silk paper's checklist, as questions that a mesh answers or an expert does.

The paper has 27 typical features in five groups (7 collar and closure, 6 sleeve and hem, 5 silhouette, 5 accessories, 4 texture and
pattern), judged by three experts; it does not list them. These are ours. The extractor reads a bare mesh (its openings and
sections), knows nothing of landmarks, template or the rules that training used, and answers twenty-three of them; the four of
texture need colours that the meshes here do not have and are left to experts. A rate of agreement is read beside its chance
level: that of unrelated garments (:func:`chance`).
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mfar_fem.errors import InputError
from reconstruction.surface.connectivity import boundary_loops
from reconstruction.surface.triangles import TriangleMesh

COLLAR, SLEEVE, SILHOUETTE, ACCESSORIES, TEXTURE = (
    "collar and closure", "sleeve and hem", "silhouette", "accessories", "texture and pattern",
)  # fmt: skip


@dataclass(frozen=True)
class Feature:
    """A question that is answered yes or no."""

    name: str
    group: str
    question: str


FEATURES = (
    Feature("neck-opening", COLLAR, "Is there an opening for the neck?"),
    Feature("neck-wide", COLLAR, "Is the opening of the neck wider than 20 cm?"),
    Feature("neck-dips", COLLAR, "Does the front of the neck lie more than 5 cm below its back?"),
    Feature("neck-deep", COLLAR, "Does the neck's opening reach more than 12 cm down?"),
    Feature("neck-round", COLLAR, "Is the opening of the neck round (not drawn out or slit)?"),
    Feature("neck-even", COLLAR, "Is the neck's opening alike on the left and on the right?"),
    Feature("neck-level", COLLAR, "Is the neck the highest part of the garment?"),
    Feature("cuffs", SLEEVE, "Are there two openings for the hands?"),
    Feature("sleeves-long", SLEEVE, "Do the sleeves reach farther than 60 cm from the middle?"),
    Feature("cuffs-wide", SLEEVE, "Is a cuff's edge longer than 45 cm?"),
    Feature("hem-open", SLEEVE, "Is the garment open below?"),
    Feature("hem-long", SLEEVE, "Is the garment longer than 90 cm?"),
    Feature("slits", SLEEVE, "Is the hem slit by more than 8 cm?"),
    Feature("flared", SILHOUETTE, "Is the lower end a fifth wider than the upper third?"),
    Feature("waisted", SILHOUETTE, "Is the middle a tenth narrower than what is above it?"),
    Feature("taller", SILHOUETTE, "Is the garment taller than wide?"),
    Feature("full", SILHOUETTE, "Is the lower third deeper than half its width?"),
    Feature("arms-low", SILHOUETTE, "Do the outer ends hang lower than half the garment's height?"),
    Feature("closed-top", ACCESSORIES, "Is the top closed, as of a hat?"),
    Feature("pointed-top", ACCESSORIES, "Does the top end in a point?"),
    Feature("brim", ACCESSORIES, "Is there a flat rim about the top?"),
    Feature("free-ends", ACCESSORIES, "Do ends of cloth hang free at the sides, without a trunk between them?"),
    Feature("belt", ACCESSORIES, "Is the cloth drawn in over a short height, as by a belt?"),
    Feature("roundels", TEXTURE, "Does the pattern consist of roundels?"),
    Feature("repeat", TEXTURE, "Does the pattern repeat within 60 cm?"),
    Feature("border", TEXTURE, "Are the edges bordered by another cloth?"),
    Feature("two-coloured", TEXTURE, "Has the pattern more than two colours?"),
)
"""All of them."""
GROUPS = (COLLAR, SLEEVE, SILHOUETTE, ACCESSORIES, TEXTURE)
BY_NAME = {f.name: f for f in FEATURES}


def extract(mesh: TriangleMesh) -> dict[str, bool | None]:
    """Answers of a mesh.

    Parameters
    ----------
    mesh : TriangleMesh
        m; x to a side, y to front or back (front at smaller y), z up.

    Returns
    -------
    dict of str to bool or None
        By name of the feature; None where the mesh cannot tell.
    """
    x = mesh.vertices
    low, high = x.min(axis=0), x.max(axis=0)
    size = high - low
    loops = [x[loop] for loop in boundary_loops(mesh.faces)]
    loops = [loop for loop in loops if _length(loop) > 0.1]  # smaller ones are holes
    middle = 0.5 * (low[0] + high[0])
    neck = _neck(loops, x, middle)
    cuffs = _cuffs(loops, x, middle)
    rest = [loop for loop in loops if loop is not neck and all(loop is not c for c in cuffs)]
    hem = min(rest, key=lambda loop: loop[:, 2].mean(), default=None)
    found: dict[str, bool | None] = {f.name: None for f in FEATURES}
    found |= {"neck-opening": neck is not None, "cuffs": len(cuffs) == 2}
    found |= {name: False for name in ("neck-wide", "neck-dips", "neck-deep", "neck-round", "neck-even", "neck-level")}
    if neck is not None:
        found |= _of_the_neck(neck, high[2], middle)
    reach = max(abs(low[0] - middle), abs(high[0] - middle))
    found["sleeves-long"] = len(cuffs) == 2 and reach > 0.6
    found["cuffs-wide"] = bool(cuffs) and float(np.mean([_length(c) for c in cuffs])) > 0.45
    found["hem-open"] = hem is not None and hem[:, 2].min() < low[2] + 0.15 * size[2]
    found["hem-long"] = size[2] > 0.9
    found["slits"] = hem is not None and bool(found["hem-open"]) and float(np.ptp(hem[:, 2])) > 0.08 and len(cuffs) == 2
    found |= _silhouette(mesh, middle) | _accessories(mesh, neck, middle)
    return found


def _length(loop: np.ndarray) -> float:
    return float(np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1).sum())


def _neck(loops, x, middle) -> np.ndarray | None:
    """The opening above the middle of the garment, about its axis, that is neither the whole rim nor far out."""
    top, low = x[:, 2].max(), x[:, 2].min()
    fit = [
        c
        for c in loops
        if c[:, 2].mean() > 0.5 * (top + low)
        and abs(c[:, 0].mean() - middle) < 0.1
        and c[:, 0].min() < middle < c[:, 0].max()
        and np.ptp(c[:, 0]) < 0.5
    ]
    return max(fit, key=lambda c: c[:, 2].mean(), default=None)


def _cuffs(loops, x, middle) -> list[np.ndarray]:
    """Openings whose middle lies beyond two thirds of the reach to a side, one for each side."""
    reach = np.abs(x[:, 0] - middle).max()
    out = []
    for side in (1, -1):
        fit = [c for c in loops if side * (c[:, 0].mean() - middle) > 0.6 * reach]
        if fit:
            out.append(max(fit, key=lambda c: abs(c[:, 0].mean() - middle)))
    return out


def _of_the_neck(neck, top: float, middle: float) -> dict[str, bool | None]:
    front, back = (neck[side, 2] for side in (neck[:, 1] < np.median(neck[:, 1]), neck[:, 1] >= np.median(neck[:, 1])))
    width, depth = np.ptp(neck[:, 0]), np.ptp(neck[:, 2])
    spread = np.sort(np.linalg.svd(neck - neck.mean(axis=0), compute_uv=False))[::-1]
    left, right = (neck[side, 2].mean() for side in (neck[:, 0] > middle, neck[:, 0] <= middle))
    return {
        "neck-wide": bool(width > 0.2),
        "neck-dips": bool(back.mean() - front.mean() > 0.05),
        "neck-deep": bool(depth > 0.12),
        "neck-round": bool(spread[1] > 0.6 * spread[0]),
        "neck-even": bool(abs(left - right) < 0.015),
        "neck-level": bool(neck[:, 2].max() > top - 0.06),
    }


def _widths(mesh: TriangleMesh, middle: float, at, reach: float = 0.45) -> np.ndarray:
    """Width and depth (k, 2), m, of the trunk (vertices within `reach` of the axis) at heights given as shares from the bottom."""
    x = mesh.vertices[np.abs(mesh.vertices[:, 0] - middle) < reach]
    low, size = mesh.vertices[:, 2].min(), np.ptp(mesh.vertices[:, 2])
    out = []
    for share in at:
        near = x[np.abs(x[:, 2] - (low + share * size)) < max(0.04 * size, 0.02)]
        out.append(np.ptp(near[:, :2], axis=0) if len(near) > 3 else np.zeros(2))
    return np.array(out)


def _silhouette(mesh: TriangleMesh, middle: float) -> dict[str, bool | None]:
    size = np.ptp(mesh.vertices, axis=0)
    (bottom, _), (waist, _), (chest, _) = _widths(mesh, middle, (0.06, 0.5, 0.68), reach=0.3)
    third = _widths(mesh, middle, (0.2,))[0]
    outer = mesh.vertices[np.abs(mesh.vertices[:, 0] - middle) > 0.8 * np.abs(mesh.vertices[:, 0] - middle).max()]
    return {
        "flared": bool(bottom > 1.2 * chest),
        "waisted": bool(waist < 0.9 * chest),
        "taller": bool(size[2] > size[0]),
        "full": bool(third[1] > 0.5 * third[0]),
        "arms-low": bool(outer[:, 2].min() < mesh.vertices[:, 2].min() + 0.5 * size[2]),
    }


def _accessories(mesh: TriangleMesh, neck, middle: float) -> dict[str, bool | None]:
    x = mesh.vertices
    low, size = x[:, 2].min(), np.ptp(x[:, 2])
    top = x[x[:, 2] > x[:, 2].max() - 0.04]
    pointed = bool(np.ptp(top[:, 0]) < 0.15 and np.ptp(top[:, 1]) < 0.15)
    upright = np.abs(mesh.face_normals[:, 2]) > 0.9
    high = x[mesh.faces].mean(axis=1)[:, 2] > low + 0.5 * size
    flat = float(mesh.areas[upright & high].sum() / mesh.areas.sum())
    trunk = np.abs(x[:, 0] - middle) < 0.15
    below = x[:, 2] < low + 0.35 * size
    heights = np.linspace(0.4, 0.8, 17)
    w = _widths(mesh, middle, heights, reach=0.3)[:, 0]
    dip = w / np.maximum(np.minimum(np.maximum.accumulate(w), np.maximum.accumulate(w[::-1])[::-1]), 1e-9)
    return {
        "closed-top": neck is None and pointed,
        "pointed-top": pointed,
        "brim": flat > 0.08 and pointed,
        "free-ends": bool(below.any() and not (trunk & below).any()),
        "belt": bool(dip.min() < 0.85),
    }


def agreement(first: Mapping[str, bool | None], second: Mapping[str, bool | None]) -> dict[str, tuple[int, int]]:
    """Features of each group that agree, and how many both sides answer."""
    out = {}
    for group in GROUPS:
        names = [f.name for f in FEATURES if f.group == group]
        both = [n for n in names if first.get(n) is not None and second.get(n) is not None]
        out[group] = (sum(first[n] == second[n] for n in both), len(both))
    return out


def chance(truths: Sequence[Mapping[str, bool | None]]) -> dict[str, float]:
    """Share of the features of each group on which two different garments agree, mean over all pairs.

    Raises
    ------
    InputError
        Fewer than two garments.
    """
    if len(truths) < 2:
        raise InputError(f"the chance level needs two garments at least, not {len(truths)}")
    found: dict[str, list[float]] = {group: [] for group in GROUPS}
    for a, b in itertools.combinations(truths, 2):
        for group, (same, asked) in agreement(a, b).items():
            if asked:
                found[group].append(same / asked)
    return {group: float(np.mean(values)) for group, values in found.items() if values}
