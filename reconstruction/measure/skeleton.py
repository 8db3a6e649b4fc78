"""The canonical figure: the twelve landmarks on a standing body with its arms half raised, and the lengths of its limbs."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mfar_fem.errors import DataFileError
from mfar_fem.tomlfile import suggest
from reconstruction.landmarks import INDEX, LANDMARKS

# Over stature. Shoulder, ankle: Drillis and Contini's segments as printed in D. A. Winter, Biomechanics and Motor Control of Human
# Movement, 4th ed. 2009, fig. 4.1, doi:10.1002/9780470549148. Waist and neckline are not in it: assumptions.
_SHOULDER = (0.1295, 0.818)  # half width, height
_NECKLINE = (0.045, 0.838)
_WAIST = (0.085, 0.62)
_ANKLE = (0.05, 0.039)
_UPPER_ARM, _FOREARM = 0.186, 0.146
_ARM_ANGLE = np.radians(40.0)  # below the horizontal, in the frontal plane
LIMBS = tuple(
    (f"{side}_{name}", INDEX[f"{side}_{a}"], INDEX[f"{side}_{b}"])
    for side in ("left", "right")
    for name, a, b in (("upper_arm", "shoulder", "elbow"), ("forearm", "elbow", "wrist"), ("leg", "waist", "ankle"))
)
"""(name, index of the inner landmark, index of the outer one), inner limbs before outer ones."""
TORSO = tuple(INDEX[f"{side}_{part}"] for part in ("shoulder", "neckline", "waist") for side in ("left", "right"))
"""Landmarks that move as one rigid body."""


@dataclass(frozen=True)
class Skeleton:
    """Landmarks of a standing body.

    Attributes
    ----------
    points : (12, 3) array
        m; x to the wearer's left, facing -y, z up from the sole.
    stature : float
        m.
    name : str
    """

    points: np.ndarray
    stature: float
    name: str = "canonical"

    @classmethod
    def canonical(cls, stature: float = 1.75) -> Skeleton:
        """Figure of average proportions (sources in the module) with arms 40° below the horizontal."""
        arm = np.array([np.cos(_ARM_ANGLE), -np.sin(_ARM_ANGLE)])
        shoulder = np.array(_SHOULDER)
        elbow = shoulder + _UPPER_ARM * arm
        wrist = elbow + _FOREARM * arm
        points = np.zeros((12, 3))
        parts = {"shoulder": shoulder, "elbow": elbow, "wrist": wrist}
        parts |= {"neckline": np.array(_NECKLINE), "waist": np.array(_WAIST), "ankle": np.array(_ANKLE)}
        for part, (x, z) in parts.items():
            points[INDEX[f"left_{part}"]] = (x, 0, z)
            points[INDEX[f"right_{part}"]] = (-x, 0, z)
        return cls(points * stature, stature)

    @classmethod
    def from_body(cls, mesh, keypoints, name: str) -> Skeleton:
        """Skeleton of a body given as OBJ with a JSON of COCO-style 3-D keypoints.

        Parameters
        ----------
        mesh : path
            OBJ, metres, z up, facing -y; its height is the stature.
        keypoints : path
            JSON ``{name: {"left_shoulder": [x, y, z], ...}}`` with shoulders, elbows, wrists, hips and ankles.
        name : str
            The body's entry in it.

        Notes
        -----
        COCO has no waist and no neckline: the waist is put 45 % of the way from hips to shoulders at the hips' width, the neckline
        at the canonical width and height above the shoulders.

        Raises
        ------
        DataFileError
            A file cannot be read or a keypoint is missing.
        """
        try:
            entries = json.loads(Path(keypoints).read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise DataFileError(f"cannot be read as JSON: {error}", path=keypoints) from error
        if name not in entries:
            raise DataFileError(f"has no body '{name}'{suggest(name, entries)}", path=keypoints)
        body = entries[name]
        heights = _heights(mesh)
        stature, floor = float(np.ptp(heights)), float(heights.min())
        points = np.zeros((12, 3))
        for landmark in LANDMARKS:
            side, part = landmark.split("_")
            try:
                if part == "waist":
                    points[INDEX[landmark]] = 0.55 * np.array(body[f"{side}_hip"]) + 0.45 * np.array(body[f"{side}_shoulder"])
                    points[INDEX[landmark], 0] = body[f"{side}_hip"][0]
                elif part == "neckline":
                    lift = (_NECKLINE[1] - _SHOULDER[1]) * stature
                    inwards = _NECKLINE[0] / _SHOULDER[0]
                    points[INDEX[landmark]] = np.array(body[f"{side}_shoulder"]) * (inwards, 1, 1) + (0, 0, lift)
                else:
                    points[INDEX[landmark]] = body[landmark]
            except KeyError as error:
                raise DataFileError(f"the body '{name}' lacks the keypoint {error}", path=keypoints) from None
        points[:, 2] -= floor
        return cls(points, stature, name)

    def length(self, limb: str) -> float:
        """Length of a limb of :data:`LIMBS`, m."""
        _, a, b = next(entry for entry in LIMBS if entry[0] == limb)
        return float(np.linalg.norm(self.points[b] - self.points[a]))


def _heights(mesh) -> np.ndarray:
    """The z of all vertices of an OBJ."""
    try:
        with open(mesh, encoding="utf-8") as lines:
            heights = [float(line.split()[3]) for line in lines if line.startswith("v ")]
    except (OSError, ValueError, IndexError) as error:
        raise DataFileError(f"cannot be read as OBJ: {error}", path=mesh) from error
    if not heights:
        raise DataFileError("has no vertices", path=mesh)
    return np.array(heights)
