"""The cantilever test without a mesh: exact elastica of a strip cut in any direction, read as the standard reads it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from material_tests import elastica, heart_loop
from mfar_fem.errors import InputError, ParameterError
from mfar_fem.units import STANDARD_GRAVITY

LOOP_LENGTH = 0.2
"""Default loop length of option B, m."""


@dataclass(frozen=True)
class CantileverResult:
    """What the test reads on a strip, and what the fabric really has.

    Attributes
    ----------
    option : {'A', 'B'}
    angle : float
        Of the strip's axis from the warp, rad.
    weight : float
        Areal density times gravity, N/m².
    rigidity : float
        Bending rigidity B of the strip by width that went in, N m.
    reading : float
        What is measured, m: the overhang at 41.5 degrees (A) or the height of the loop (B).
    loop_length : float or None
        Option B, m.
    bending_length, standard_bending_length : float
        (B / w)^(1/3) exactly, and by the standard's formula from `reading`, m.
    exact_rigidity, standard_rigidity : float
        From `reading` by the exact elastica of a linear moment law, and by the standard's w c³, N m.
    s, x, y : (n,) arrays
        The strip (B: half the loop), m: distance from the clamp along it, position outwards and upwards.
    """

    option: str
    angle: float
    weight: float
    rigidity: float
    reading: float
    loop_length: float | None
    bending_length: float
    standard_bending_length: float
    exact_rigidity: float
    standard_rigidity: float
    s: np.ndarray
    x: np.ndarray
    y: np.ndarray

    @property
    def error_percent(self) -> float:
        """Standard's rigidity against the one that went in, %."""
        return 100.0 * (self.standard_rigidity / self.rigidity - 1.0)

    @property
    def standard_rigidity_mg_cm(self) -> float:
        """The standard's own unit: G = W c³ in mg cm (W as mass by area)."""
        return self.standard_rigidity / STANDARD_GRAVITY * 1e8


def exact(
    fabric,
    direction: str | float = "warp",
    option: str = "A",
    free: bool = True,
    loop_length: float = LOOP_LENGTH,
    beta: float = 0.0,
    gravity: float = STANDARD_GRAVITY,
    points: int = 201,
) -> CantileverResult:
    """Exact test of an inextensible strip.

    Parameters
    ----------
    fabric : Fabric
        Only its bending and its areal density count.
    direction : {'warp', 'weft', 'bias'} or float
        Of the strip's axis; a number is the angle from the warp, rad.
    option : {'A', 'B'}
        A: overhang at 41.5 degrees; B: heart loop.
    free : bool
        True (default): a narrow strip whose edges carry no moment, so that it may curve across and twist:
        ``B = 1 / (D^-1)_11``. False: bent into a cylinder as a wide strip is far from its edges, ``B = D_11``.
    loop_length : float
        Option B, m.
    beta : float
        Option A: second coefficient of M = B kappa + beta kappa² (N m²), see `material_tests.elastica`.
    gravity : float
        m/s².
    points : int
        Of the shape.

    Raises
    ------
    InputError
        Unknown option or direction.
    ParameterError
        A length that is not positive, or a loop too limp or too stiff for the standard's formula.
    material_tests.elastica.MomentLimitError
        A softening law that cannot carry the strip.
    """
    from mfar_fem.materials.homogeneous import direction_angle

    if option not in ("A", "B"):
        raise InputError(f"ASTM D1388 has the options A (cantilever) and B (heart loop), not '{option}'")
    if beta and option == "B":
        raise InputError("the heart loop is solved for a linear moment law: beta must be 0")
    angle = direction_angle(direction)
    rigidity, weight = fabric.bending.along(angle, free), fabric.areal_density * gravity
    c = elastica.bending_length(rigidity, weight)
    if option == "A":
        reading = elastica.overhang(rigidity, weight, beta=beta)
        standard = elastica.standard_bending_length(reading)
        exact_rigidity = elastica.rigidity(reading, weight)
        shape = elastica.shape((reading / c) ** 3, beta / (rigidity * c), points)
        s, x, y = reading * shape.s, reading * shape.x, -reading * shape.drop
    else:
        if not (math.isfinite(loop_length) and loop_length > 0):
            raise ParameterError(f"the loop length must be positive, not {loop_length} m")
        loop = heart_loop.solve(loop_length / c)
        reading = loop_length * loop.height
        standard = heart_loop.standard_bending_length(loop_length, reading)
        exact_rigidity = weight * heart_loop.bending_length(loop_length, reading) ** 3
        s, x, y = (loop_length * values for values in (loop.s, loop.x, loop.y))
    return CantileverResult(
        option=option,
        angle=angle,
        weight=weight,
        rigidity=rigidity,
        reading=reading,
        loop_length=loop_length if option == "B" else None,
        bending_length=c,
        standard_bending_length=standard,
        exact_rigidity=exact_rigidity,
        standard_rigidity=weight * standard**3,
        s=s,
        x=x,
        y=y,
    )
