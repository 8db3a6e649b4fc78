"""Where the weights of a detector lie; without torch, for those who only ask whether they have changed."""

from __future__ import annotations

from pathlib import Path

SHIPPED = "shipped"
"""Name of the detector that comes with the package."""
SHIPPED_FILE = Path(__file__).parent / "weights" / "small.pt"


def weights_file(name: str | Path = SHIPPED) -> Path:
    """The file of a detector, by its path or :data:`SHIPPED`."""
    return SHIPPED_FILE if name == SHIPPED else Path(name)
