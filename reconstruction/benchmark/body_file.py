"""A body from an OBJ file with named joints instead of the parametric figure."""

from __future__ import annotations

import dataclasses
import functools
import json
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import zoom
from scipy.spatial import cKDTree

from mfar_fem.errors import DataFileError

from .body import HANGING, T_POSE, BodySpec, Measured
from .body_field import Field

JOINTS = tuple(f"{side}_{part}" for part in ("ear", "shoulder", "elbow", "wrist") for side in ("left", "right"))
"""Joints that the keypoints file must have (COCO names)."""
SPACING = 0.01
"""Grid of the signed distance, m."""


@functools.cache
def load_body(path: str, keypoints: str) -> tuple[Measured, tuple[float, ...], tuple[float, ...]]:
    """Read a body.

    Parameters
    ----------
    path : str
        OBJ file in metres, z up, facing -y, closed.
    keypoints : str
        JSON object of joint name to [x, y, z], m, or of body name (the OBJ's stem) to such objects; :data:`JOINTS` are needed.

    Returns
    -------
    body : Measured
        Moved so that it stands on z = 0 with its shoulders over the origin.
    left_arm, right_arm : tuples of 4 floats
        Angles of its arms, degrees.

    Raises
    ------
    DataFileError
        A file cannot be read, the surface is not closed, it is not in metres, or a joint is missing.
    """
    vertices, faces = _read_obj(Path(path))
    joints = _read_joints(Path(keypoints), Path(path).stem)
    height = float(np.ptp(vertices[:, 2]))
    if not 1.0 < height < 2.3:
        raise DataFileError(f"the body is {height:.3g} high in z; it must be in metres, z up", path=path)
    middle = 0.5 * (joints["left_shoulder"] + joints["right_shoulder"])
    shift = -np.array([middle[0], middle[1], vertices[:, 2].min()])
    vertices = vertices + shift
    at = {name: p + shift for name, p in joints.items()}
    if at["left_shoulder"][0] <= 0:
        raise DataFileError("the left shoulder must be at +x: the body must face -y", path=keypoints)
    arms = []
    for side, sign in (("left", 1.0), ("right", -1.0)):
        shoulder, elbow, wrist = (at[f"{side}_{part}"] for part in ("shoulder", "elbow", "wrist"))
        arms.append((*_angles(elbow - shoulder, sign), *_angles(wrist - elbow, sign)))
    ears = 0.5 * (at["left_ear"] + at["right_ear"])
    top = vertices[vertices[:, 2] > ears[2] + 0.02]
    centre = np.array([0.0, 0.5 * (top[:, 1].min() + top[:, 1].max()), ears[2] + 0.02])
    skull = float(np.linalg.norm(top - centre, axis=1).max())
    shoulder = 0.5 * (at["left_shoulder"] + at["right_shoulder"] * [-1, 1, 1])
    shape = signed_distance(vertices, faces)
    upper, fore = _length(at, "shoulder", "elbow"), _length(at, "elbow", "wrist")
    body = Measured(Path(path).name, vertices, faces, shape, shoulder, upper, fore, centre, skull)
    return body, arms[0], arms[1]


def _length(at: dict[str, np.ndarray], a: str, b: str) -> float:
    return float(np.mean([np.linalg.norm(at[f"{side}_{a}"] - at[f"{side}_{b}"]) for side in ("left", "right")]))


def wearing_body(loaded: tuple[Measured, tuple[float, ...], tuple[float, ...]], drawn: BodySpec) -> BodySpec:
    """The figure of a file: its pose, and the way of dressing of a drawn figure."""
    body, left, right = loaded
    start = HANGING if drawn.start == HANGING else T_POSE
    height = float(np.ptp(body.vertices[:, 2]))
    own: dict[str, Any] = {
        "stature": height,
        "girth": 1.0,
        "pose": "file",
        "left_arm": left,
        "right_arm": right,
        "topknot": False,
        "skirt": False,
    }
    return dataclasses.replace(drawn, **own, start=start, measured=body)


def signed_distance(vertices, faces, spacing: float = SPACING, margin: float = 0.06) -> Field:
    """Signed distance of a closed surface on a grid, exact to the curvature of its faces near it and coarse farther than 5 cm.

    Parameters
    ----------
    vertices, faces : arrays
        m; counter-clockwise from outside.
    spacing, margin : float
        Of the grid and around the surface, m.
    """
    p = vertices[faces]
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True) + 1e-30
    inner = [0.5 * p[:, k] + 0.25 * (p[:, (k + 1) % 3] + p[:, (k + 2) % 3]) for k in range(3)]
    samples = np.concatenate([p.mean(axis=1), *inner])
    tree = cKDTree(samples)

    def distance(points):
        away, nearest = tree.query(points)
        height = np.einsum("ij,ij->i", points - samples[nearest], normal[nearest % len(faces)])
        return np.where(away < 1.5 * spacing, height, np.sign(height) * away)

    low = vertices.min(axis=0) - margin
    shape = (np.ceil((vertices.max(axis=0) + margin - low) / (4 * spacing)).astype(int) + 1) * 4 + 1
    points = low + spacing * np.stack(np.meshgrid(*(np.arange(n) for n in shape), indexing="ij"), axis=-1)
    rough = distance(points[::4, ::4, ::4].reshape(-1, 3)).reshape([(n + 3) // 4 for n in shape])
    value = zoom(rough, np.array(shape) / rough.shape, order=1, grid_mode=False)
    near = np.abs(value) < 0.05 + 4 * spacing
    value[near] = distance(points[near])
    return Field(np.zeros((1, 8)), 0.004, value, np.array([*low, spacing]))


def _angles(limb: np.ndarray, sign: float) -> tuple[float, float]:
    """Elevation from hanging and azimuth from sideways to forwards, degrees."""
    x, y, z = limb / np.linalg.norm(limb)
    return float(np.degrees(np.arccos(np.clip(-z, -1, 1)))), float(np.degrees(np.arctan2(-y, sign * x)))


def _read_obj(path: Path) -> tuple[np.ndarray, np.ndarray]:
    import trimesh

    if not path.is_file():
        raise DataFileError("there is no such file", path=path)
    try:
        mesh = trimesh.load(path, file_type="obj", force="mesh")
    except Exception as error:
        raise DataFileError(f"cannot be read as an OBJ mesh: {error}", path=path) from error
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise DataFileError("holds no triangles", path=path)
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    if not mesh.is_watertight:
        raise DataFileError("the surface is not closed; close its holes first", path=path)
    return np.array(mesh.vertices), np.array(mesh.faces)


def _read_joints(path: Path, body: str) -> dict[str, np.ndarray]:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise DataFileError(f"cannot be read as JSON: {error}", path=path) from error
    if isinstance(data, dict) and isinstance(data.get(body), dict):
        data = data[body]
    missing = [name for name in JOINTS if not isinstance(data, dict) or name not in data]
    if missing:
        raise DataFileError(f"has no joint {', '.join(missing)} (neither at the top nor under '{body}')", path=path)
    try:
        joints = {name: np.array(data[name], dtype=float) for name in JOINTS}
    except (TypeError, ValueError) as error:
        raise DataFileError(f"joints must be [x, y, z] in metres: {error}", path=path) from error
    for name, point in joints.items():
        if point.shape != (3,) or not np.isfinite(point).all():
            raise DataFileError(f"joint '{name}' must be three finite numbers, not {data[name]}", path=path)
    return joints
