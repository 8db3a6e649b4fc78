"""Photographs with cameras and without a ground truth, through matching, stereo and surface, judged by views that were held out.

A point that is matched between a held-out view and one of the others lies somewhere on the ray of the other; where the
reconstructed surface meets that ray the point is projected into the held-out view. How far it falls from its match there, in
pixels, needs no true surface: the held-out picture had no part in the mesh. Beside it stands what a plane through the middle of the
points gives.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import InputError, MfarError
from mfar_fem.files import replace_bytes
from reconstruction.images import grey, load
from reconstruction.libraries import opencv
from reconstruction.matching.features import Features, detect
from reconstruction.matching.pair import match_pair
from reconstruction.matching.settings import MatchSettings
from reconstruction.matching.study import SETS, buddha, temple
from reconstruction.stereo.consistency import consistent, fuse
from reconstruction.stereo.sweep import planes, sweep
from reconstruction.stereo.view import View
from reconstruction.surface.pipeline import SurfaceSettings, build_surface
from reconstruction.surface.poisson import poisson_surface
from reconstruction.surface.rays import Rays
from reconstruction.surface.triangles import TriangleMesh
from reconstruction.surface.trimming import OpeningsError, trim_by_distance

READERS = {SETS[0]: buddha, SETS[1]: temple}
LONGEST = 500
"""Longer side of the pictures of the sweep, px."""
NEAR = 2.0
"""Distance from the given epipolar line up to which a match is believed, px."""
PLANES = 192
"""Hypotheses of depth, at most: between views far apart half a pixel would ask for thousands."""
INNER = 0.1
"""Share of the matched points that may lie on either side of the box of what is looked for, before its margin: some are of the
background."""
CELLS = 180
"""Cells of the fused points along the longest extent."""


@dataclass(frozen=True, eq=False)
class Match:
    """Matched pixels (n, 2) of two views, and where they meet in space (n, 3), units of the cameras."""

    a: int
    b: int
    first: np.ndarray
    second: np.ndarray
    points: np.ndarray


def read_views(folder: Path, name: str) -> list[View]:
    """Views of a set of photographs, shrunk to :data:`LONGEST`.

    Raises
    ------
    InputError
        Unknown set, or no such folder.
    """
    if name not in READERS:
        raise InputError(f"there is no set '{name}' with cameras; known: {', '.join(READERS)}")
    if not (folder / name).is_dir():
        raise InputError(f"'{folder}' holds no folder '{name}'")
    out = []
    for photo in READERS[name](folder / name):
        whole = View.of(photo.name, load(photo.path).rgb, photo.camera)
        out.append(whole.shrunk(LONGEST))
    return out


def matches(views: Sequence[View], progress: Callable[[], None] | None = None) -> list[Match]:
    """Matches of all neighbouring views that agree with the cameras and meet before both."""
    cv2 = opencv()
    settings = MatchSettings()
    found: list[Features] = [detect(grey((255 * v.image).astype(np.uint8)), settings) for v in views]
    out = []
    for i, j in itertools.combinations(range(len(views)), 2):
        if not any(v is views[j] for v in views[i].neighbours(views)):
            continue
        pair = match_pair(found[i], found[j], settings, (views[i].name, views[j].name), (views[i].camera, views[j].camera))
        if progress is not None:
            progress()
        if not pair.matched:
            continue
        first, second = pair.points[pair.mask][:, :2], pair.points[pair.mask][:, 2:4]
        space = cv2.triangulatePoints(views[i].camera, views[j].camera, first.T.astype(float), second.T.astype(float))
        points = (space[:3] / space[3]).T
        (one, near), (two, far) = views[i].project(points), views[j].project(points)
        away = np.maximum(np.linalg.norm(one - first, axis=1), np.linalg.norm(two - second, axis=1))
        good = (away < NEAR) & (near > 0) & (far > 0)
        out.append(Match(i, j, first[good], second[good], points[good]))
    return out


def reconstruct(
    views: Sequence[View], points: np.ndarray, settings: SurfaceSettings | None = None
) -> tuple[TriangleMesh, dict[str, Any]]:
    """Surface of some views about matched points (n, 3): sweep, consistency, fusion, Poisson, even triangles, ARAP.

    Raises
    ------
    InputError, SurfaceError
        Views that confirm nothing of each other, or points that make no surface.
    """
    low, high = np.quantile(points, [INNER, 1 - INNER], axis=0)
    margin = 0.25 * (high - low)
    low, high = low - margin, high + margin
    maps = []
    for view in views:
        others = view.neighbours(views)
        if others:
            others = sorted(others, key=lambda o: -float(o.axis @ view.axis))[:4]
            depth = view.project(points)[1]
            near, far = np.quantile(depth[depth > 0], [INNER, 1 - INNER]) if (depth > 0).any() else (1.0, 1.0)
            ends = view.centre + np.array([[max(near - 0.25 * (far - near), 0.5 * near)], [far + 0.25 * (far - near)]]) * view.axis
            base, offsets = planes(view, ends, others, margin=0.0)
            if len(offsets) > PLANES:
                offsets = np.linspace(offsets[0], offsets[-1], PLANES)
            maps.append(sweep(view, others, base, offsets))
    agreed = consistent(maps)
    p, n, sigma = fuse(agreed, float((high - low).max()) / CELLS)
    inside = ((p > low) & (p < high)).all(axis=1)
    p, n, sigma = p[inside], n[inside], sigma[inside]
    try:
        mesh, how = build_surface(p, n, sigma, None, settings or SurfaceSettings(adaptive=False)).mesh, "even triangles, ARAP"
    except OpeningsError as error:  # ragged rims: neither triangles nor rims are bettered then
        base_surface = poisson_surface(p, n, sigma)
        mesh = trim_by_distance(base_surface.mesh, base_surface.points, base_surface.spacing).mesh
        how = f"trimmed only ({error})"
    depths = sum(int(np.isfinite(m.depth).sum()) for m in agreed)
    facts = {"views": len(maps), "depths": depths, "points": int(inside.sum()), "triangles": len(mesh.faces), "surface": how}
    return mesh, facts


def reprojection(mesh: TriangleMesh, views: Sequence[View], held: int, found: Sequence[Match]) -> dict[str, Any]:
    """Errors, px, in a held-out view of the points that are matched with it, by way of the mesh and by way of a plane.

    Returns
    -------
    dict
        ``matches``, ``on_mesh`` (share whose ray meets the mesh), of those ``median_px``, ``q75_px``, ``within_2px``; and
        ``plane_median_px``.
    """
    tool = Rays(mesh)
    errors, flat, count, hits = [], [], 0, 0
    for m in found:
        if held not in (m.a, m.b):
            continue
        other, there, here = (views[m.b], m.second, m.first) if held == m.a else (views[m.a], m.first, m.second)
        rays = other.rays(there)
        face, depth, _ = tool.first(other.centre, rays)
        met = face >= 0
        place = other.centre + depth[met, None] * rays[met]
        errors.append(np.linalg.norm(views[held].project(place)[0] - here[met], axis=1))
        middle = float(np.median(other.project(m.points)[1])) if len(m.points) else 1.0
        flat.append(np.linalg.norm(views[held].project(other.centre + middle * rays)[0] - here, axis=1))
        count, hits = count + len(here), hits + int(met.sum())
    away, plane = (np.concatenate([np.zeros(0), *some]) for some in (errors, flat))
    if not hits:
        return {"matches": count, "on_mesh": 0.0}
    middle, upper = np.quantile(away, [0.5, 0.75])
    return {"matches": count, "on_mesh": hits / count, "median_px": float(middle), "q75_px": float(upper),
            "within_2px": float((away < 2).mean()), "plane_median_px": float(np.median(plane))}  # fmt: skip


def study(folder: Path, name: str, out: Path, most: int = 0, progress: Callable[[str], None] | None = None) -> dict[str, Any]:
    """Hold out one view after the other.

    Parameters
    ----------
    folder : Path
        That holds the sets.
    name : str
        One of :data:`READERS`.
    out : Path
        Gets a mesh and a row for each; rows that are there are taken as they are.
    most : int
        Views that are held out, those with most matches first; 0: all that have any.
    progress : callable, optional
        Told what is being done.

    Returns
    -------
    dict
        ``set``, ``views``, ``matched_pairs``, ``rows`` (by held-out view; ``why`` where it failed), ``summary``.
    """
    tell = progress or (lambda text: None)
    views = read_views(folder, name)
    tell("matching")
    found = matches(views)
    count = {k: sum(len(m.first) for m in found if k in (m.a, m.b)) for k in range(len(views))}
    chosen = sorted((k for k in count if count[k]), key=lambda k: -count[k])[: most or None]
    rows: list[dict[str, Any]] = []
    for k in chosen:
        tell(f"without {views[k].name}")
        kept = out / f"{name}-without-{views[k].name}.json"
        if kept.exists():  # of a run that was killed later
            rows.append(json.loads(kept.read_text(encoding="utf-8")))
            continue
        rest = [v for i, v in enumerate(views) if i != k]
        space = [m.points for m in found if k not in (m.a, m.b) and len(m.points)]
        try:
            if not space:
                raise InputError("no other pair of views is matched")
            mesh, facts = reconstruct(rest, np.concatenate(space))
            mesh.write(out / f"{name}-without-{views[k].name}.ply")
            rows.append({"held_out": views[k].name} | reprojection(mesh, views, k, found) | facts | {"why": ""})
        except MfarError as error:
            rows.append({"held_out": views[k].name, "matches": count[k], "why": str(error)})
            continue  # a failure is tried again
        replace_bytes(kept, json.dumps(rows[-1], indent=1).encode())
    good = [r for r in rows if "median_px" in r]
    keys = ("median_px", "q75_px", "within_2px", "on_mesh", "plane_median_px")
    summary = {key: float(np.median([r[key] for r in good])) for key in keys} if good else {}
    return {"set": name, "views": len(views), "matched_pairs": len(found), "rows": rows, "summary": summary, "held_out": len(good)}
