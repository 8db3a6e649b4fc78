"""A half-sleeve garment hung by other settings than those of the fit, seen by four cameras."""

import functools

import numpy as np

from reconstruction.landmarks import INDEX, LANDMARKS
from reconstruction.shape.cloth import Cloth, ClothSettings
from reconstruction.shape.evidence import Caster
from reconstruction.shape.landmarks3d import SpacePoints
from reconstruction.shape.mannequin import mannequin
from reconstruction.shape.placing import SHOULDER, folds, place_tunic
from reconstruction.shape.sewn import sew
from reconstruction.stereo.view import View
from reconstruction.template.dimensions import TDimensions

STATURE = 1.65
SIZE = (140, 130)


def dimensions():
    return TDimensions(0.6, 1.0, 0.5, 0.24, 0.2, 0.52, 0.17, 0.14, 0.015, 0.0, 0.0, 0.0, 0.0)


def camera(azimuth, distance=4.0, focal=480.0):
    a = np.radians(azimuth)
    forward, right = np.array([np.sin(a), np.cos(a), 0.0]), np.array([np.cos(a), -np.sin(a), 0.0])
    r = np.stack([right, [0.0, 0.0, -1.0], forward])
    k = np.array([[focal, 0, SIZE[1] / 2], [0, focal, 25.0], [0, 0, 1.0]])
    return k @ np.column_stack([r, distance * r @ forward])


def places():
    half = {"neckline": (0.085, 0.0, 0.0), "shoulder": (0.2, 0.01, -0.04), "elbow": (0.33, -0.03, -0.13),
            "wrist": (0.45, -0.08, -0.23), "waist": (0.23, 0.0, -0.4), "ankle": (0.25, 0.0, -0.6)}  # fmt: skip
    return np.array([np.array(half[n.split("_")[1]]) * (1 if n.startswith("left") else -1, 1, 1) for n in LANDMARKS])


@functools.cache
def scene():
    """Vertices and sewn pattern of the truth, views with masks, depths by view, landmarks on the cloth."""
    d = dimensions()
    lines = folds(places(), d.neck_width, STATURE)
    body = mannequin(1.08 * STATURE, tuple(line[1:] for line in lines), (0.0, 0.02))
    sewn = sew("half-sleeve", d, 0.03)
    start = place_tunic(sewn, d, lines, body)
    cloth = Cloth(sewn, start, None, ClothSettings(bending=1e-3))
    top = np.where((sewn.layer < 0) & (sewn.uv[:, 1] < 1e-9), 20.0, 0.0)
    for k in range(40):
        if k == 8:
            cloth.body = body
        cloth.step(top, start, 0.0 if k < 8 else 9.81)
    mesh = sewn.mesh(cloth.x)
    caster = Caster(mesh)
    views, depths = [], {}
    for azimuth in (0, 28, -28, 180):
        blank = View.of(f"view {azimuth}", np.full((*SIZE, 3), 0.5, dtype=np.float32), camera(azimuth))
        _, depth, facing = caster.cast(blank, 1)
        mask = np.isfinite(depth) & (facing < 0)
        views.append(View(blank.name, blank.image, blank.camera, mask))
        if azimuth != 180:
            depths[blank.name] = (np.where(mask, depth, np.nan), np.full(SIZE, 2e-3))
    points = np.full((12, 3), np.nan)
    shoulder, cuff = SHOULDER * STATURE, 0.5 * d.cross_sleeve_width
    flat = {"neckline": (0.085, 0.0), "shoulder": (shoulder, 0.0), "elbow": (0.5 * (shoulder + cuff), 0.0), "wrist": (cuff, 0.0),
            "waist": (0.255, 0.4), "ankle": (0.26, 0.6)}  # fmt: skip
    for part, (u, v) in flat.items():
        for side, sign in (("left", 1), ("right", -1)):
            points[INDEX[f"{side}_{part}"]] = cloth.x[sewn.nearest((sign * u, v))]
    return mesh, sewn, views, depths, SpacePoints(points, np.full(12, 0.01), np.full(12, 3))
