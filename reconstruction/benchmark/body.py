"""Parametric figures: a skeleton with proportions from anthropometry, poses, and limbs as tapered capsules.

Segment lengths are fractions of the stature after Drillis & Contini (1966), as tabulated by Winter, *Biomechanics and Motor Control
of Human Movement*, 4th ed. (2009), doi:10.1002/9780470549148; girths are assumptions that look human, spread by the seed.
"""

from __future__ import annotations

import dataclasses
import itertools
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from typing import Any

import numpy as np

from reconstruction.landmarks import STATURE

from .body_field import Field, surface

POSES = ("arms-down", "half-raised", "forward", "spread")
"""Families of poses, drawn with equal chance."""
T_POSE = (90.0, 0.0, 90.0, 0.0)
"""Elevation and azimuth of upper arm, then of forearm, degrees: elevation from hanging, azimuth from sideways to forwards."""
SLIM = 0.75
"""A body from a file is dressed as a figure slimmer by this factor, and pushes the cloth out when it has its pose."""
HANGING = (8.0, 0.0, 8.0, 20.0)
"""Arms at the sides, degrees."""
_POSE_RANGES = {  # assumption: postures of standing figurines
    "arms-down": ((14, 24), (5, 25), (16, 30), (20, 50)),
    "half-raised": ((28, 48), (15, 45), (70, 95), (55, 85)),
    "forward": ((38, 60), (45, 70), (72, 95), (75, 98)),
    "spread": ((52, 78), (-5, 20), (55, 90), (5, 40)),
}


@dataclass(frozen=True)
class Measured:
    """A body from a file: its surface and the lengths that dress it (m).

    Parameters
    ----------
    name : str
    vertices, faces : arrays
        Closed surface on the floor z = 0, facing -y.
    shape : Field
        Its signed distance.
    shoulder : (3,) array
        Left shoulder joint; the right one mirrors it.
    upper, fore : float
        Lengths of upper arm and forearm.
    head : (3,) array
        Middle of the head.
    skull : float
        Radius of a sphere about it that holds the skull.
    """

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    shape: Field
    shoulder: np.ndarray
    upper: float
    fore: float
    head: np.ndarray
    skull: float


@dataclass(frozen=True)
class BodySpec:
    """What a figure is made from.

    Parameters
    ----------
    sex : {"male", "female"}
    stature : float
        Height, m.
    girth : float
        Factor on all radii.
    pose : str
        Family of the pose.
    left_arm, right_arm : tuple of 4 floats
        Angles as in :data:`T_POSE`, degrees.
    topknot : bool
        Hair tied up on the head.
    skirt : bool
        Wears a long under-skirt (part of the figure, not of the garment).
    start : tuple of 4 floats
        Angles of both arms while being dressed, degrees.
    measured : Measured, optional
        A body from a file, in its own pose.
    """

    sex: str
    stature: float
    girth: float
    pose: str
    left_arm: tuple[float, ...]
    right_arm: tuple[float, ...]
    topknot: bool = True
    skirt: bool = False
    start: tuple[float, ...] = T_POSE
    measured: Measured | None = dataclass_field(default=None, compare=False)


def draw_body(seed: int, kind: str = "round-collar-robe") -> BodySpec:
    """Draw a figure: stature 1.75 / 1.65 m with a standard deviation of 0.05 m, cut at two of them.

    Parameters
    ----------
    seed : int
        The body's seed.
    kind : str
        Type of the garment: a hat leaves no room for a topknot and is put on with hanging arms; a robe covers the legs itself.
    """
    rng = np.random.default_rng([seed, 23])
    sex = ("female", "male")[int(rng.integers(2))]
    stature = STATURE[sex] + 0.05 * float(np.clip(rng.normal(), -2, 2))
    girth = float(rng.uniform(0.93, 1.1)) * (1.0 if sex == "male" else 0.96)
    pose = POSES[int(rng.integers(len(POSES)))]
    left = tuple(float(rng.uniform(*r)) for r in _POSE_RANGES[pose])
    right = tuple(float(a + rng.normal(0, 5)) for a in left)  # nearly, never exactly, symmetric
    hat = kind == "veil-hat"
    skirt = bool(rng.random() < 0.75) and kind != "round-collar-robe"
    return BodySpec(sex, stature, girth, pose, left, right, not hat, skirt, HANGING if hat else T_POSE)


def direction(elevation: float, azimuth: float, side: float) -> np.ndarray:
    """Unit vector of a limb: elevation from hanging, azimuth from sideways to forwards (degrees), side +1 left, -1 right."""
    e, a = np.radians(elevation), np.radians(azimuth)
    return np.array([side * np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), -np.cos(e)])


def joints(spec: BodySpec, blend: float = 1.0) -> dict[str, np.ndarray]:
    """Joint positions, m; `blend` 0 is the pose for dressing (``spec.start``), 1 the pose of the figure.

    Returns
    -------
    dict of str to (3,) array
        ``pelvis, waist, chest, neck, head, crown`` and, with ``left_`` / ``right_``, ``shoulder, elbow, wrist, hand, hip, knee,
        ankle, toe``.
    """
    h = spec.stature
    wide = 0.122 if spec.sex == "male" else 0.114
    at = {
        name: np.array([0.0, y * h, z * h])
        for name, y, z in (
            ("pelvis", 0.004, 0.53),
            ("waist", 0.0, 0.62),
            ("chest", 0.0, 0.735),
            ("neck", 0.004, 0.85),
            ("head", -0.006, 0.936),
            ("crown", 0.0, 1.0),
        )
    }
    for side, sign, target in (("left", 1.0, spec.left_arm), ("right", -1.0, spec.right_arm)):
        angle = [(1 - blend) * a + blend * b for a, b in zip(spec.start, target, strict=True)]
        lift = np.clip((angle[0] - 60.0) / 30.0, 0.0, 1.0)  # a raised arm lifts the shoulder a little
        x, y, z = (wide * h, 0.004 * h, 0.812 * h) if spec.measured is None else spec.measured.shoulder
        upper, lower = (0.178 * h, 0.146 * h) if spec.measured is None else (spec.measured.upper, spec.measured.fore)
        shoulder = np.array([sign * x, y, z + 0.006 * lift * h])
        elbow = shoulder + upper * direction(angle[0], angle[1], sign)
        fore = direction(angle[2], angle[3], sign)
        hip = np.array([sign * 0.052 * h, 0.0, 0.51 * h])
        ankle = np.array([sign * 0.058 * h, 0.008 * h, 0.042 * h])
        at |= {
            f"{side}_shoulder": shoulder,
            f"{side}_elbow": elbow,
            f"{side}_wrist": elbow + lower * fore,
            f"{side}_hand": elbow + (lower + 0.069 * h) * fore,
            f"{side}_hip": hip,
            f"{side}_knee": np.array([sign * 0.056 * h, -0.004 * h, 0.285 * h]),
            f"{side}_ankle": ankle,
            f"{side}_toe": ankle + h * np.array([sign * 0.012, -0.095, -0.026]),
        }
    if spec.measured is not None:
        at["head"] = spec.measured.head
    return at


def skull_radius(spec: BodySpec) -> float:
    """Radius of the sphere that is the skull, m."""
    return 0.0515 * spec.stature if spec.measured is None else spec.measured.skull


def to_dict(spec: BodySpec) -> dict[str, Any]:
    """JSON form; of a body from a file only its name."""
    out = {f.name: getattr(spec, f.name) for f in dataclasses.fields(spec) if f.name != "measured"}
    return out | {"file": None if spec.measured is None else spec.measured.name}


def skin(spec: BodySpec, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Closed surface of the figure in its pose: vertices (m) and faces; `size` is the grid of its extraction, m."""
    if spec.measured is not None:
        return spec.measured.vertices, spec.measured.faces
    return surface(field(spec), size, 0.0)


def field(spec: BodySpec, blend: float = 1.0, inflate: float = 1.0) -> Field:
    """Signed distance field of the figure.

    Parameters
    ----------
    spec : BodySpec
    blend : float
        0: pose for dressing, 1: its pose.
    inflate : float
        Factor on all radii.
    """
    if spec.measured is not None:
        if blend >= 1.0:
            return spec.measured.shape
        inflate *= SLIM
    at, h, g = joints(spec, blend), spec.stature, spec.girth
    capsules: list[tuple[np.ndarray, np.ndarray, float, float]] = []
    male = spec.sex == "male"
    hip_x, waist_x, chest_x = (0.042, 0.034, 0.052) if male else (0.046, 0.026, 0.042)
    levels = [("pelvis", hip_x, 0.061), ("waist", waist_x, 0.055 if male else 0.05), ("chest", chest_x, 0.062)]
    for (a, xa, ra), (b, xb, rb) in itertools.pairwise(levels):
        for column in (-1.0, 0.0, 1.0):
            shift = np.array([column, 0.0, 0.0])
            capsules.append((at[a] + shift * xa * h, at[b] + shift * xb * h, ra * g, rb * g))
    for side in ("left", "right"):
        sign = 1.0 if side == "left" else -1.0
        chest = at["chest"] + np.array([sign * chest_x * h, 0, 0])
        capsules += [
            (chest, at[f"{side}_shoulder"] + np.array([-sign * 0.014 * h, 0, -0.004 * h]), 0.056 * g, 0.032 * g),
            (
                at["neck"] + np.array([0, 0.004, -0.018]) * h,
                at[f"{side}_shoulder"] + np.array([-sign * 0.01, 0, 0.006]) * h,
                0.03 * g,
                0.026 * g,
            ),
            (at[f"{side}_shoulder"], at[f"{side}_elbow"], 0.03 * g, 0.0235 * g),
            (at[f"{side}_elbow"], at[f"{side}_wrist"], 0.0235 * g, 0.0165 * g),
            (at[f"{side}_wrist"], at[f"{side}_hand"], 0.0165 * g, 0.018 * g),
            (at[f"{side}_hip"], at[f"{side}_knee"], 0.048 * g, 0.033 * g),
            (at[f"{side}_knee"], at[f"{side}_ankle"], 0.032 * g, 0.021 * g),
            (at[f"{side}_ankle"] - np.array([0, 0, 0.012 * h]), at[f"{side}_toe"], 0.026, 0.017),
        ]
    capsules.append((at["chest"] + np.array([0, 0.006 * h, 0]), at["neck"], 0.055 * g, 0.031 * g))
    capsules.append((at["neck"], at["head"] + np.array([0, 0.004, -0.02]) * h, 0.031, 0.035))
    head = at["head"]
    capsules.append((head, head + np.array([0, 0, 1e-4]), skull_radius(spec) / h, skull_radius(spec) / h))
    capsules.append((head + np.array([0, -0.014, -0.012]) * h, head + np.array([0, -0.022, -0.042]) * h, 0.041, 0.026))
    capsules.append((head + np.array([0, -0.05, -0.012]) * h, head + np.array([0, -0.054, -0.022]) * h, 0.006, 0.0085))
    if spec.topknot:
        capsules.append((head + np.array([0, 0.018, 0.048]) * h, head + np.array([0, 0.022, 0.082]) * h, 0.021, 0.026))
    if spec.skirt:
        capsules.append((at["waist"], np.array([0.0, 0.0, 0.045 * h]), 0.078 * g, 0.118))  # its round end is cut off by the floor
    array = np.array([[*a, *b, ra * h * inflate, rb * h * inflate] for a, b, ra, rb in capsules])
    return Field(array, 0.004 * h)
