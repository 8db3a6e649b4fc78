"""From landmarks, template, outlines and depths to the shape of a garment."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.ndimage import distance_transform_edt

from mfar_fem.errors import InputError
from reconstruction.landmarks import INDEX
from reconstruction.measure.ellipse import perimeter
from reconstruction.shape.cloth import Cloth, ClothSettings
from reconstruction.shape.evidence import (
    FIRM,
    SIGMA,
    STRIDE,
    Caster,
    Outline,
    Targets,
    depth_targets,
    draw,
    landmark_targets,
    outline_targets,
    seen,
)  # fmt: skip
from reconstruction.shape.frame import BodyFrame, body_frame
from reconstruction.shape.landmarks3d import SpacePoints
from reconstruction.shape.mannequin import Mannequin, mannequin
from reconstruction.shape.placing import SHOULDER, folds, place_tunic
from reconstruction.shape.sewn import BACK, FRONT, Sewn, sew
from reconstruction.stereo.sweep import DepthMap, sweep
from reconstruction.stereo.view import View
from reconstruction.template.dimensions import Dimensions, TDimensions


@dataclass(frozen=True)
class FitSettings:
    """Edge length (m); steps without evidence, with outlines, with depths; what is used; cloth.

    ``outlines`` and ``depths`` off: the template on the landmarks alone.
    """

    edge: float = 0.025
    hang: int = 25
    outline: int = 20
    depth: int = 25
    outlines: bool = True
    depths: bool = True
    cloth: ClothSettings = field(default_factory=ClothSettings)


@dataclass(frozen=True, eq=False)
class Shape:
    """A garment in space.

    Attributes
    ----------
    sewn : Sewn
    vertices : (nv, 3) array
        m, world.
    sigma : (nv,) array
        Standard deviation of each vertex, m.
    source : (nv,) array of str
        What supports it most: ``stereo``, ``outline``, ``landmark`` or ``template`` (nothing that is seen).
    body : Mannequin
        In the wearer's axes.
    frame : BodyFrame
    facts : dict
        Plain values: differences that are left, by view.
    """

    sewn: Sewn
    vertices: np.ndarray
    sigma: np.ndarray
    source: np.ndarray
    body: Mannequin
    frame: BodyFrame
    facts: dict


def fit_shape(
    garment: str,
    dimensions: Dimensions,
    points: SpacePoints,
    views: Sequence[View],
    stature: float,
    settings: FitSettings | None = None,
    progress: Callable[[int], None] | None = None,
    given: Mapping[str, tuple[np.ndarray, np.ndarray]] | None = None,
) -> Shape:
    """Sew a template, put it on a figure and draw it to what calibrated pictures show.

    Parameters
    ----------
    garment : str
    dimensions : Dimensions
    points : SpacePoints
        Landmarks, world, m.
    views : sequence of View
        World cameras, with masks of the garment's outer face.
    stature : float
        Of the wearer, m.
    settings : FitSettings, optional
    progress : callable, optional
        ``progress(1)`` after each step; there are ``hang + outline + depth`` at most.
    given : mapping of str to (depth, sigma), optional
        Depths (h, w) by view's name and their standard deviations, m, in place of stereo (a scanner's, or an oracle's).

    Raises
    ------
    InputError
        Too few landmarks, or a type of garment without a rule.
    """
    s = settings or FitSettings()
    tick = progress or (lambda n: None)
    if not isinstance(dimensions, TDimensions):
        raise InputError(f"the shape of a {garment} cannot be fitted yet; only garments with sleeves can")
    frame = body_frame(points)
    views = [View(v.name, v.image, frame.camera(v.camera), v.mask) for v in views]
    places = frame.to_body(points.points)
    lines = folds(places, dimensions, stature)
    middle = np.mean([line[min(1, len(line) - 1)][1] for line in lines])
    body = mannequin(stature, tuple(line[1:] if len(line) > 2 else line for line in lines), (0.0, middle))
    sewn = sew(garment, dimensions, s.edge)
    start = place_tunic(sewn, dimensions, lines, body)
    belted = garment in BELTED
    gathered = gathering(dimensions, places) if belted else 1.0
    belt = _belt(sewn, dimensions, places) if belted else np.zeros(0, dtype=int)
    known = _known(sewn, dimensions, places, points.sigma, stature)
    cloth = Cloth(sewn, start, None, replace(s.cloth, compressed=min(s.cloth.compressed, max(gathered, LEAST_GATHERED))))
    top = np.where((sewn.layer < 0) & (sewn.uv[:, 1] < 1e-9), 20.0, 0.0)
    for _ in range(10):  # out of the worst distortion, weightless and through the figure
        cloth.step(top, start, 0.0)
    cloth.body, cloth.velocity = body, np.zeros_like(cloth.x)

    def asked() -> Targets:
        targets = Targets(len(cloth.x))
        landmark_targets(targets, known)
        _tighten(targets, cloth, belt)
        return targets

    targets = asked()
    for _ in range(s.hang):
        targets = asked()
        cloth.step(targets.weight, targets.places)
        tick(1)
    facts: dict = {"outline": {}, "depth_m": {}, "gathered": gathered, "belt": bool(len(belt))}
    outlines = [Outline(view) for view in views]
    hidden = _depths(body, views)
    depths: dict[str, DepthMap] = {}
    early = s.outline if s.outlines else 0
    for k in range(early + (s.depth if s.depths else 0)):
        if k == early:
            depths = depth_maps(cloth, views) if given is None else _given(views, given)
            cloth.body = _withdrawn(body, list(depths.values()))
            hidden = _depths(cloth.body, views)
            facts["figure_moved_m"] = float(cloth.body.centre[1] - body.centre[1])
        targets = asked()
        mesh = sewn.mesh(cloth.x)
        caster = Caster(mesh)
        for view, outline, figure in zip(views, outlines, hidden, strict=True):
            drawn = draw(view, caster, figure)
            at = seen(view, drawn, mesh)
            if s.outlines:
                facts["outline"][view.name] = outline_targets(targets, view, outline, drawn, at, cloth)
            if view.name in depths:
                gate = max(0.05, 0.1 * 0.85 ** (k - early))
                facts["depth_m"][view.name] = depth_targets(targets, depths[view.name], at, cloth, gate)
        cloth.step(targets.weight, targets.places)
        tick(1)
    sigma, source = _support(cloth, targets)
    return Shape(sewn, frame.to_world(cloth.x), sigma, source, cloth.body, frame, facts)


def depth_maps(cloth: Cloth, views: Sequence[View], reach: float = 0.08, pixels: float = 0.5) -> dict[str, DepthMap]:
    """Depths of every view that has a neighbour, by name, sought about what the shape makes expect."""
    found = {}
    caster = Caster(cloth.sewn.mesh(cloth.x))
    figures = [None] * len(views) if cloth.body is None else _depths(cloth.body, views, 1)
    for view, figure in zip(views, figures, strict=True):
        others = view.neighbours(views)
        if not others:
            continue
        drawn = draw(view, caster, figure, stride=1)
        expected = np.where(drawn.outer & view.mask, drawn.depth, np.nan)
        if not np.isfinite(expected).any():
            continue
        step = pixels / max(view.parallax(o, float(np.nanmedian(expected))) for o in others)
        n = int(np.ceil(reach / step))
        found[view.name] = sweep(view, others, _filled(expected, view.mask), step * np.arange(-n, n + 1))
    return found


def _given(views: Sequence[View], given: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> dict[str, DepthMap]:
    return {v.name: DepthMap(v, given[v.name][0], np.ones(v.size), given[v.name][1]) for v in views if v.name in given}


def _depths(body: Mannequin, views: Sequence[View], stride: int = STRIDE) -> list[np.ndarray]:
    """Depths of the figure in every view."""
    caster = Caster(body.mesh())
    return [caster.cast(view, stride)[1] for view in views]


def _withdrawn(body: Mannequin, depths: Sequence[DepthMap], most: float = 0.03) -> Mannequin:
    """The figure moved back until cloth that is seen lies outside its trunk, but for five percent of the points."""
    points = np.concatenate([np.zeros((0, 3)), *(found.view.points(found.depth)[np.isfinite(found.depth)] for found in depths)])
    points = points[:: max(1, len(points) // 20_000)]
    points = points[np.abs(points[:, 0] - body.centre[0]) < 0.08 * body.stature]
    if len(points) < 50:
        return body
    trunk = replace(body, arms=())
    for shift in np.arange(0.0, most + 1e-9, 0.005):
        moved = body.centre + np.array([0.0, shift])
        if np.percentile(replace(trunk, centre=moved).distance(points), 5) > 0:
            break
    return replace(body, centre=moved)


def _filled(expected: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Expected depths also where the mask reaches beyond the drawn shape: those of the nearest drawn pixel."""
    index = distance_transform_edt(~np.isfinite(expected), return_distances=False, return_indices=True)
    return np.where(mask, expected[tuple(index)], np.nan)


def _known(sewn: Sewn, d: TDimensions, places, sigma, stature: float) -> list[tuple[int, np.ndarray, float]]:
    """Vertices of the landmarks with their places; of the waist the height on the garment is not known."""
    shoulder = SHOULDER * stature
    cuff = 0.5 * d.cross_sleeve_width
    flat = {
        "neckline": (0.5 * d.neck_width, 0.0),
        "shoulder": (shoulder, 0.0),
        "elbow": (0.5 * (shoulder + cuff), 0.0),
        "wrist": (cuff, 0.0),
        "ankle": (0.5 * d.hem_width, d.length),
    }
    out = []
    for part, (u, v) in flat.items():
        for side, sign in (("left", 1.0), ("right", -1.0)):
            k = INDEX[f"{side}_{part}"]
            if np.isfinite(places[k]).all():
                ids = {sewn.nearest((sign * u, v), layer) for layer in (FRONT, BACK)}
                out += [(vertex, places[k], float(sigma[k])) for vertex in sorted(ids)]
    return out


FLAT = 0.75
"""Depth over width of a garment about a figure that hangs without being gathered, at most (assumption)."""
BELTED = ("round-collar-robe",)
"""Types that are worn with a belt (as the robes of Tang figures are)."""
LEAST_GATHERED = 0.8
"""No more than this is believed of gathering."""


def gathering(d: TDimensions, places) -> float:
    """Girth that the waist's width allows over the girth that was cut; at most 1.

    The garment's girth at the height of the waist is twice its flat width; an ellipse as wide as the waist's landmarks are apart
    and :data:`FLAT` as deep is the most that an ungathered garment shows.
    """
    left, right = (places[INDEX[f"{side}_waist"]] for side in ("left", "right"))
    if not (np.isfinite(left).all() and np.isfinite(right).all()):
        return 1.0
    width = float(np.linalg.norm(left - right))
    down = -0.5 * (left + right)[2]
    flat = np.interp(down, [d.armhole_depth, d.length], [d.body_width, d.hem_width])
    return float(min(1.0, perimeter(width, FLAT * width) / (2 * flat)))


def _belt(sewn: Sewn, d: TDimensions, places) -> np.ndarray:
    """Vertices under a belt: those of the trunk at the height of the waist's landmarks, flat."""
    down = -0.5 * (places[INDEX["left_waist"]] + places[INDEX["right_waist"]])[2]
    wide = np.interp(sewn.uv[:, 1], [d.armhole_depth, d.length], [d.body_width, d.hem_width]) / 2
    return np.flatnonzero((np.abs(sewn.uv[:, 1] - down) < 0.02) & (np.abs(sewn.uv[:, 0]) < wide + 1e-6))


def _tighten(targets: Targets, cloth: Cloth, belt: np.ndarray) -> None:
    """Draw the vertices under a belt to the figure."""
    body = cloth.body
    if body is not None and len(belt):
        gap = body.distance(cloth.x[belt]) - cloth.s.clearance
        places = cloth.x[belt] - np.maximum(gap, 0.0)[:, None] * body.outwards(cloth.x[belt])
        targets.add("template", belt, places, 0.05 * FIRM * cloth.vertex_area[belt])


TEMPLATE_SIGMA, MESH_SIGMA = 0.03, 6e-3
"""Standard deviation of a point that only the template places, and what a mesh of 30 mm with its stiffness adds to the pictures',
m: twice the sum held 80 to 100 % of the points of two benchmark garments."""


def _support(cloth: Cloth, targets: Targets) -> tuple[np.ndarray, np.ndarray]:
    """Standard deviation and name of what holds each vertex."""
    names = np.full(len(cloth.x), "template", dtype=object)
    best = np.zeros(len(cloth.x))
    for name, weight in targets.support.items():
        more = weight > best
        names[more], best[more] = name, weight[more]
    evidence = targets.weight - targets.support.get("template", 0.0)  # a belt is no evidence
    information = evidence / (FIRM * SIGMA**2 * cloth.vertex_area)  # 1/m²
    return np.sqrt(1.0 / (information + TEMPLATE_SIGMA**-2) + MESH_SIGMA**2), names.astype(str)
