"""Stick figures with known points, for tests: a trunk, a skirt, two arms and a head in flat colours on a plain ground."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from reconstruction.keypoints.data import Sample
from reconstruction.landmarks import INDEX

SIZE = (192, 144)


def pose(rng: np.random.Generator, size=SIZE) -> np.ndarray:
    """Points (12, 2) of a standing figure seen from the front: the wearer's left at larger x."""
    h, w = size
    x, y, s = w * rng.uniform(0.42, 0.58), h * rng.uniform(0.18, 0.26), h * rng.uniform(0.6, 0.68)
    points = np.zeros((12, 2))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        shoulder = np.array([x + sign * 0.13 * s, y + 0.04 * s])
        raised = np.deg2rad(rng.uniform(10, 80))
        bend = raised + np.deg2rad(rng.uniform(-20, 40))
        elbow = shoulder + 0.22 * s * np.array([sign * np.sin(raised), np.cos(raised)])
        wrist = elbow + 0.2 * s * np.array([sign * np.sin(bend), np.cos(bend)])
        for part, value in {
            "shoulder": shoulder, "elbow": elbow, "wrist": wrist, "neckline": (x + sign * 0.04 * s, y),
            "waist": (x + sign * 0.1 * s, y + 0.4 * s), "ankle": (x + sign * 0.12 * s, y + s),
        }.items():
            points[INDEX[f"{side}_{part}"]] = value
    return points


def draw(points: np.ndarray, rng: np.random.Generator, size=SIZE) -> np.ndarray:
    """Picture (h, w, 3) of the points' figure; the left and right sleeves have colours of their own."""
    import cv2

    ground = rng.integers(150, 230, 3)
    image = np.full((*size, 3), ground, np.uint8)

    def at(name):
        return tuple(round(16 * float(v)) for v in points[INDEX[name]])

    def colour(base):
        return tuple(int(np.clip(c + rng.integers(-20, 20), 0, 255)) for c in base)

    body = [at("left_shoulder"), at("left_waist"), at("left_ankle"), at("right_ankle"), at("right_waist"), at("right_shoulder")]
    cv2.fillPoly(image, [np.array(body, np.int32)], colour((120, 60, 50)), cv2.LINE_AA, 4)
    for side, base in (("left", (180, 90, 40)), ("right", (60, 80, 150))):
        shade = colour(base)
        for a, b in (("shoulder", "elbow"), ("elbow", "wrist")):
            cv2.line(image, at(f"{side}_{a}"), at(f"{side}_{b}"), shade, 9, cv2.LINE_AA, 4)
    cv2.line(image, at("left_waist"), at("right_waist"), (30, 30, 30), 3, cv2.LINE_AA, 4)
    cv2.line(image, at("left_neckline"), at("right_neckline"), (240, 240, 220), 4, cv2.LINE_AA, 4)
    head = 0.5 * (points[INDEX["left_neckline"]] + points[INDEX["right_neckline"]]) - [0, 12]
    cv2.circle(image, tuple(round(16 * float(v)) for v in head), 9 * 16, (205, 170, 140), -1, cv2.LINE_AA, 4)
    noise = rng.normal(0, 6, image.shape)
    return np.clip(image + noise, 0, 255).astype(np.uint8)


def make(folder: Path, n: int, seed: int = 0, split: str = "train", absent: float = 0.0) -> list[Sample]:
    """Write n pictures; every fourth has a hidden right wrist, and a fraction `absent` has no ankles."""
    import cv2

    rng = np.random.default_rng((seed, len(split)))
    samples = []
    for i in range(n):
        points = pose(rng)
        path = folder / f"{split}-{seed}-{i}.png"
        cv2.imwrite(str(path), draw(points, rng)[:, :, ::-1])
        visible, present = np.ones(12, bool), np.ones(12, bool)
        visible[INDEX["right_wrist"]] = i % 4 != 0
        if rng.random() < absent:
            present[[INDEX["left_ankle"], INDEX["right_ankle"]]] = False
            visible &= present
        style = "mural" if i % 2 else "figurine"
        samples.append(Sample(path, points, visible, present, style, i % 3, split, f"{split}-{seed}-{i // 2}"))
    return samples
