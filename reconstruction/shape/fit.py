"""From landmarks, template, outlines and depths to the shape of a garment."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.ndimage import distance_transform_edt

from reconstruction.shape.cloth import Cloth, ClothSettings
from reconstruction.shape.evidence import (
    FIRM,
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
from reconstruction.shape.frame import BodyFrame
from reconstruction.shape.landmarks3d import SpacePoints
from reconstruction.shape.mannequin import Mannequin
from reconstruction.shape.sewn import Sewn
from reconstruction.shape.uncertainty import uncertainty
from reconstruction.shape.wearing import LEAST_GATHERED, put_on
from reconstruction.stereo.sweep import DepthMap, sweep
from reconstruction.stereo.view import View
from reconstruction.template.dimensions import Dimensions


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
    sigma, noise : (nv,) arrays
        Standard deviation of each vertex, and the part of it that smoothing can take away, m
        (:mod:`reconstruction.shape.uncertainty`).
    source : (nv,) array of str
        What supports it most: ``stereo``, ``outline``, ``landmark`` or ``template`` (nothing that is seen).
    body : Mannequin
        In the wearer's axes.
    frame : BodyFrame
    facts : dict
        Plain values: differences that are left, by view.
    pinned : (k,) array of int
        Vertices that hands, pins or a head hold; empty where the figure carries the garment.
    """

    sewn: Sewn
    vertices: np.ndarray
    sigma: np.ndarray
    noise: np.ndarray
    source: np.ndarray
    body: Mannequin
    frame: BodyFrame
    facts: dict
    pinned: np.ndarray


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
    worn = put_on(garment, dimensions, points, stature, s.edge)
    sewn, body, frame = worn.sewn, worn.body, worn.frame
    views = [View(v.name, v.image, frame.camera(v.camera), v.mask) for v in views]
    compressed = min(s.cloth.compressed, max(worn.gathered, LEAST_GATHERED))
    cloth = Cloth(sewn, worn.start, None, replace(s.cloth, compressed=compressed))
    for _ in range(10):  # out of the worst distortion, weightless and through the figure
        cloth.step(worn.firm, worn.start, 0.0)
    cloth.body, cloth.velocity = body, np.zeros_like(cloth.x)

    def asked() -> Targets:
        targets = Targets(len(cloth.x))
        landmark_targets(targets, worn.known)
        _tighten(targets, cloth, worn.belt)
        targets.add("template", worn.stiff, worn.start[worn.stiff], 10 * FIRM * cloth.vertex_area[worn.stiff])
        return targets

    targets = asked()
    for _ in range(s.hang):
        targets = asked()
        cloth.step(targets.weight, targets.places)
        tick(1)
    facts: dict = {"outline": {}, "depth_m": {}, "gathered": worn.gathered, "belt": bool(len(worn.belt))}
    outlines = [Outline(view) for view in views]
    hidden = _depths(body, views)
    depths: dict[str, DepthMap] = {}
    early = s.outline if s.outlines else 0
    for k in range(early + (s.depth if s.depths else 0)):
        if k == early:
            depths = depth_maps(cloth, views, worn.reach) if given is None else _given(views, given)
            cloth.body = _withdrawn(body, list(depths.values()))
            hidden = _depths(cloth.body, views)
            facts["figure_moved_m"] = float(cloth.body.centre[1] - body.centre[1])
        targets = asked()
        mesh = sewn.mesh(cloth.x)
        caster = Caster(mesh, sewn.two_sided)
        for view, outline, figure in zip(views, outlines, hidden, strict=True):
            drawn = draw(view, caster, figure)
            at = seen(view, drawn, mesh, sewn.outside)
            if s.outlines:
                facts["outline"][view.name] = outline_targets(targets, view, outline, drawn, at, cloth)
            if view.name in depths:
                gate = max(0.05, 1.25 * worn.reach * 0.85 ** (k - early))
                facts["depth_m"][view.name] = depth_targets(targets, depths[view.name], at, cloth, gate)
        cloth.step(targets.weight, targets.places)
        tick(1)
    sigma, noise, source = uncertainty(cloth, targets, garment)
    return Shape(sewn, frame.to_world(cloth.x), sigma, noise, source, cloth.body, frame, facts, worn.pinned)


def depth_maps(cloth: Cloth, views: Sequence[View], reach: float = 0.08, pixels: float = 0.5) -> dict[str, DepthMap]:
    """Depths of every view that has a neighbour, by name, sought about what the shape makes expect."""
    found = {}
    caster = Caster(cloth.sewn.mesh(cloth.x), cloth.sewn.two_sided)
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


def _tighten(targets: Targets, cloth: Cloth, belt: np.ndarray) -> None:
    """Draw the vertices under a belt to the figure."""
    body = cloth.body
    if body is not None and len(belt):
        gap = body.distance(cloth.x[belt]) - cloth.s.clearance
        places = cloth.x[belt] - np.maximum(gap, 0.0)[:, None] * body.outwards(cloth.x[belt])
        targets.add("template", belt, places, 0.05 * FIRM * cloth.vertex_area[belt])
