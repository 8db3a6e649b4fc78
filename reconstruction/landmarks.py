"""The twelve structural points of a garment, their order and their mirror images.

Left and right are the wearer's. In images x runs to the right and y downwards from the centre of the top-left pixel; in space z
is up and the body faces -y, so that the wearer's left is at +x.
"""

from __future__ import annotations

LANDMARKS = (
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
    "left_neckline",
    "right_neckline",
    "left_waist",
    "right_waist",
    "left_ankle",
    "right_ankle",
)
"""Names, in the order of every array with an axis of twelve."""
PARTS = ("shoulder", "elbow", "wrist", "neckline", "waist", "ankle")
INDEX = {name: i for i, name in enumerate(LANDMARKS)}
PAIRS = tuple((2 * i, 2 * i + 1) for i in range(len(PARTS)))
"""(left, right) indices of every part."""
MIRROR = tuple(i + 1 if i % 2 == 0 else i - 1 for i in range(len(LANDMARKS)))
"""Index of the point that each becomes in a mirrored image."""
WITHOUT = {"flying-ribbon": ("waist",), "veil-hat": ("elbow", "wrist", "waist")}
"""Parts that a type of garment does not have; other types have all."""
KINDS = ("mural", "figurine", "textile")
"""Kinds of sources."""
STATURE = {"male": 1.75, "female": 1.65}
"""Height of the figures of the unified measurement system, m (silk paper, section on fusion)."""


def points_of(garment: str) -> tuple[bool, ...]:
    """Which of :data:`LANDMARKS` a type of garment has."""
    missing = WITHOUT.get(garment, ())
    return tuple(not name.endswith(missing) for name in LANDMARKS)
