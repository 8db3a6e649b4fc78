"""The picture frame by finite elements: a square held by four stiff hinged arms, pulled along a diagonal.

All boundary nodes follow the arms, the inside is free; the force is the reaction along the diagonal (work of all reactions in
the frame's motion). If the yarns lie along the arms the shear is pure and homogeneous and the force exact; a yarn misaligned by
a degree is stretched as well, which is the test's well-known error.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from material_tests.shear.kinematics import frame_displacement, frame_force, frame_normalise, law_moment
from mfar_fem.errors import InputError, NotConvergedError
from mfar_fem.shell import State
from mfar_fem.solve import NewtonOptions, Problem
from mfar_fem.solve.newton import newton
from mfar_fem.supports import Hinge, Support
from mfar_fem.surface import Surface, patterns

CELLS = {"draft": 2, "standard": 6, "reference": 16}
"""Cells a side (four order-2 triangles each)."""


@dataclass(frozen=True, eq=False)
class FrameResult:
    """Picture frame at ``m`` shear angles.

    Attributes
    ----------
    angle : (m,) array
        Of the frame, rad.
    displacement, force : (m,) arrays
        Of the pulled corner along the diagonal, m and N.
    moment : (m,) array
        Shear moment from the force, N/m.
    expected : (m,) array
        Force of the law in the homogeneous shear of the frame, misalignment included, N.
    fabric_angle : (m,) array
        Mean shear angle of the yarns, rad; ``scatter`` the standard deviation of C12 over the sheet.
    """

    angle: np.ndarray
    displacement: np.ndarray
    force: np.ndarray
    moment: np.ndarray
    expected: np.ndarray
    fabric_angle: np.ndarray
    scatter: np.ndarray
    iterations: int
    problem: Problem = field(repr=False)
    states: tuple[State, ...] = field(repr=False)


def directions(angle: float) -> np.ndarray:
    """Unit directions (2, 2) of the two arms at a shear angle (rad), the pulled diagonal along x."""
    phi = 0.25 * np.pi - 0.5 * angle
    return np.array([[np.cos(phi), np.sin(phi)], [np.cos(phi), -np.sin(phi)]])


def picture_frame(fabric, angles, side: float = 0.2, misalignment: float = 0.0, fidelity: str = "standard",
                  order: int = 2) -> FrameResult:
    """Shear a square of the fabric in a frame of the same side.

    Parameters
    ----------
    fabric : Fabric
    angles : (m,) array_like
        Shear angles, rad, increasing, in (0, pi/2).
    side : float
        m.
    misalignment : float
        Of the warp from its arm, rad.
    fidelity : {'draft', 'standard', 'reference'}

    Raises
    ------
    InputError, NotConvergedError
    """
    angles = np.atleast_1d(np.asarray(angles, dtype=float))
    if not (np.all(np.diff(angles) > 0) and angles[0] > 0 and angles[-1] < 0.5 * np.pi):
        raise InputError("the shear angles of a picture frame must increase between 0 and a right angle (rad)")
    if fidelity not in CELLS:
        raise InputError(f"unknown fidelity '{fidelity}'; known: {', '.join(CELLS)}")
    rest, n = directions(0.0), CELLS[fidelity]
    square = patterns.rectangle(n, n, (0.0, side), (0.0, side), lambda uv: _placed(uv @ rest), "criss")
    c, s = np.cos(misalignment), np.sin(misalignment)
    surface = Surface.from_pattern(square, order, _placed(np.array([c * rest[0] + s * rest[1]]))[0])
    # the second arm lies clockwise of the first: the normal of the sheet points to -z
    arms = np.unique(np.concatenate([surface.nodes_of(name) for name in ("left", "right", "bottom", "top")]))
    everywhere = np.arange(len(surface.nodes))
    problem = Problem(surface, fabric, [Hinge(arms, by_node=True), Support(everywhere, (2,), by_node=True)], bending=False)
    material = surface.nodes[:, :2] @ np.linalg.inv(rest)
    state, iterations, forces, states, shear, scatter = problem.start(), 0, [], [], [], []
    held = np.concatenate([3 * arms, 3 * arms + 1])
    for angle in angles:
        place = _placed(material @ directions(angle))
        problem.change[held] = (place - surface.nodes).ravel()[held]
        u = place.ravel().copy()
        result = newton(problem, state.with_u(u), 1.0, NewtonOptions(rtol=1e-10))
        if not result.converged:
            raise NotConvergedError(f"picture frame at {np.degrees(angle):.4g} degrees: {result.status}", result)
        iterations += result.iterations
        h = 1e-6
        rate = (_placed(material @ directions(angle + h)) - _placed(material @ directions(angle - h))).ravel() / (2 * h)
        stroke = (frame_displacement(angle + h, side) - frame_displacement(angle - h, side)) / (2 * h)
        forces.append(float(problem.gradient(result.state, 1.0)[held] @ rate[held] / stroke))
        field_C = problem.shell.right_cauchy_green(result.state)
        sine = field_C[..., 2] / np.sqrt(field_C[..., 0] * field_C[..., 1])
        shear.append(float(np.arcsin(np.clip(np.mean(sine), -1, 1))))
        scatter.append(float(np.std(field_C[..., 2])))
        states.append(result.state)
    force = np.array(forces)
    return FrameResult(angles, frame_displacement(angles, side), force, frame_normalise(angles, force, side),
                       homogeneous_force(fabric, angles, side, misalignment), np.array(shear), np.array(scatter), iterations,
                       problem, tuple(states))


def homogeneous_force(fabric, angles, side: float, misalignment: float = 0.0) -> np.ndarray:
    """Force along the diagonal, N (m,), of the law in the homogeneous shear of the frame."""
    if misalignment == 0.0:
        return frame_force(angles, law_moment(fabric.law, fabric.membrane_scale)(angles), side)
    c, s = np.cos(misalignment), np.sin(misalignment)
    angles = np.asarray(angles, dtype=float)
    sine, cosine = np.sin(angles), np.cos(angles)
    # warp = c a + s b, weft = c b - s a in the frame's directions a, b with a·b = sin γ
    C = np.stack([1 + 2 * c * s * sine, 1 - 2 * c * s * sine, (c * c - s * s) * sine], axis=1)
    rate = np.stack([2 * c * s * cosine, -2 * c * s * cosine, (c * c - s * s) * cosine], axis=1)
    S = fabric.law.stress(C)
    moment = fabric.membrane_scale * (0.5 * S[:, 0] * rate[:, 0] + 0.5 * S[:, 1] * rate[:, 1] + S[:, 2] * rate[:, 2])
    return frame_force(angles, moment, side)


def _placed(xy: np.ndarray) -> np.ndarray:
    return np.concatenate([xy, np.zeros((*xy.shape[:-1], 1))], axis=-1)
