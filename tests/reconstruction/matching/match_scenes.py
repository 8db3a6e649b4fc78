"""Made-up scenes with known cameras and matches, and where the real ones are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reconstruction.matching.features import Features

VISION = Path(__file__).resolve().parents[4] / "shared" / "data" / "vision"
SIZE = (640, 480)
needs = {
    name: pytest.mark.skipif(not (VISION / name).exists(), reason=f"the shared photographs {name} are absent")
    for name in ("alicevision_buddha", "middlebury_templeRing", "weights")
}


def rotation(axis, angle):
    """Rotation matrix about an axis, by Rodrigues' formula."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


CALIBRATION = np.array([[700.0, 0, 320], [0, 700, 240], [0, 0, 1]])


def cameras(turn=0.15, shift=(0.5, 0.1, 0.0)):
    """Two cameras 4 m before the origin."""
    first = CALIBRATION @ np.column_stack([np.eye(3), [0, 0, 4.0]])
    second = CALIBRATION @ np.column_stack([rotation([0.2, 1, 0.1], turn), np.add([0, 0, 4.0], shift)])
    return first, second


def project(camera, world):
    """World points (n, 3) to pixels (n, 2)."""
    image = np.column_stack([world, np.ones(len(world))]) @ camera.T
    return image[:, :2] / image[:, 2:]


def world(count, shape="cloud", seed=0):
    """Points in a box, on a plane or on a line."""
    points = np.random.default_rng(seed).uniform(-1, 1, (count, 3))
    if shape == "plane":
        points[:, 2] = 0.3 * points[:, 0] - 0.2 * points[:, 1]
    if shape == "line":
        points = points[:, :1] * [1.0, 0.4, 0.7]
    return points


def features(first, second, wrong=0, noise=0.3, seed=0):
    """Features of two pictures whose right matches are given, with `wrong` false matches besides, (Features, Features)."""
    rng = np.random.default_rng(seed + 1000)
    false = rng.uniform(0, 1, (wrong, 4)) * [*SIZE, *SIZE]
    a = np.vstack([first + noise * rng.standard_normal(first.shape), false[:, :2]])
    b = np.vstack([second + noise * rng.standard_normal(second.shape), false[:, 2:]])
    descriptors = rng.uniform(0, 100, (len(a), 128)).astype(np.float32)
    order = rng.permutation(len(b))
    jitter = rng.normal(0, 2, descriptors.shape).astype(np.float32)
    return Features(a, descriptors, SIZE), Features(b[order], (descriptors + jitter)[order], SIZE)
