"""Bias extension by finite elements: a strip at 45° to the yarns, its three zones, and the shear moment it recovers."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from material_tests.shear.kinematics import bias_angle, bias_displacement, bias_force, bias_normalise, law_moment, zone
from material_tests.strip.fe import StripResult, StripTest
from mfar_fem.errors import InputError, NotConvergedError

CELLS = {"draft": 6, "standard": 10, "reference": 20}
"""Square cells across the width (four order-2 triangles each, edges along the yarns)."""


@dataclass(frozen=True, eq=False)
class BiasResult:
    """Bias extension at ``m`` shear angles of the kinematics.

    Attributes
    ----------
    angle, displacement : (m,) arrays
        Shear angle of inextensible yarns, rad, and the displacement of the grips that belongs to it, m.
    force : (m,) array
        Reaction of the grip, N.
    expected_force : (m,) array
        Of inextensible yarns, with the law's shear moment, N.
    moment, law_moment : (m,) arrays
        Shear moment recovered from the force by the kinematics, and the law's, N/m.
    centre_angle : (m,) array
        Mean shear angle in the middle of zone C, rad.
    zone_angle : (m, 3) array
        Area means of the shear angle over the zones A, B and C, rad.
    yarn_strain : (m,) array
        Largest elongation of a yarn (warp or weft, element means).
    """

    angle: np.ndarray
    displacement: np.ndarray
    force: np.ndarray
    expected_force: np.ndarray
    moment: np.ndarray
    law_moment: np.ndarray
    centre_angle: np.ndarray
    zone_angle: np.ndarray
    yarn_strain: np.ndarray
    strip: StripResult = field(repr=False)


def bias_extension(fabric, angles, length: float = 0.3, width: float = 0.1, fidelity: str = "standard") -> BiasResult:
    """Pull a strip at 45° to the displacements at which inextensible yarns would shear by ``angles``.

    Parameters
    ----------
    fabric : Fabric
    angles : (m,) array_like
        rad, increasing, in (0, pi/2).
    length, width : float
        m; the length at least twice the width.
    fidelity : {'draft', 'standard', 'reference'}

    Raises
    ------
    InputError, NotConvergedError
    """
    angles = np.atleast_1d(np.asarray(angles, dtype=float))
    if fidelity not in CELLS:
        raise InputError(f"unknown fidelity '{fidelity}'; known: {', '.join(CELLS)}")
    if not (np.all(np.diff(angles) > 0) and angles[0] > 0):
        raise InputError("the shear angles of a bias extension must be positive and increasing (rad)")
    displacement = bias_displacement(angles, length, width)
    across = CELLS[fidelity]
    test = StripTest(length, width, 0.25 * np.pi, cells=(round(across * length / width), across))
    strip = test.run(fabric, displacement / length)
    if not strip.converged:
        raise NotConvergedError(f"bias extension: {strip.message}", strip)
    moment = law_moment(fabric.law, fabric.membrane_scale)
    centre, zones, yarn = [], [], []
    for level in range(len(angles)):
        f = strip.field(level)
        middle = f.reference[f.triangles].mean(axis=1)
        shear = f.mean(f.engineering)
        area = f.weights.sum(axis=1)
        where = zone(middle[:, 0], middle[:, 1], length, width)
        near = (np.abs(middle[:, 0] - 0.5 * length) < 0.25 * width) & (np.abs(middle[:, 1] - 0.5 * width) < 0.25 * width)
        centre.append(np.average(shear[near, 2], weights=area[near]))
        zones.append([np.average(shear[where == k, 2], weights=area[where == k]) for k in range(3)])
        yarn.append(np.abs(shear[:, :2]).max())
    return BiasResult(angles, displacement, strip.force, bias_force(angles, moment, length, width),
                      bias_normalise(angles, strip.force, length, width), moment(angles), np.array(centre), np.array(zones),
                      np.array(yarn), strip)


def reduce_record(displacement, force, length: float, width: float) -> tuple[np.ndarray, np.ndarray]:
    """Shear angle (rad) and shear moment (N/m) of a record of increasing displacements (m) and forces (N); positive angles only."""
    angle = bias_angle(displacement, length, width)
    keep = np.isfinite(angle) & (angle > 0)
    return angle[keep], bias_normalise(angle[keep], np.asarray(force, dtype=float)[keep], length, width)
