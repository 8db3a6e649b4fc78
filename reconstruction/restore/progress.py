"""How far a stage is, from what the functions in it report."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

Share = Callable[[float], None]
"""Told how much of a stage is done, 0 to 1."""
Report = Callable[[str, float], None]
"""Told a stage and how much of it is done."""


def counter(share: Share, total: float | None = None) -> Callable[..., None]:
    """A callback for steps, ``step(number=1, total=None)``; a label in place of the number counts as one.

    Nothing is told before the total is known.
    """
    done, of = 0.0, total

    def step(number: Any = 1, total: float | None = None) -> None:
        nonlocal done, of
        of = of if total is None else total
        done += 1 if isinstance(number, str) else number
        if of:
            share(done / of)

    return step
