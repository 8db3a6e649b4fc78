r"""Drag of the air: closed forms, what the mesh does to it, and when the integrator's own damping hides it.

A sheet across the wind falls with :math:`v = v_T \tanh(g t / v_T)`, :math:`v_T = \sqrt{\rho g/\gamma}` (ρ per area; per vertex:
total mass over the sum of γ), and coasts without gravity with :math:`v = v_0 / (1 + \gamma v_0 t / \rho)`.

The swinging swatch compares two losses: that to the air and that of implicit Euler (``StepRecord.defect``). For a stiff plate
swinging by ±θ at ω the two take the energy away at the mean rates

.. math:: \text{air: } \frac{2\gamma L\,\theta\,\omega}{\pi\rho}, \qquad \text{implicit Euler: } \omega^2\,\Delta t,

so that they are equal at :math:`\Delta t = 2\gamma L\theta/(\pi\rho\omega)`: the smaller the swing, the smaller the step it takes.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mfar_fem.benchmarks.free_vibration import DENSITY, SIZE, G, sheet
from mfar_fem.benchmarks.time_integration import INTEGRATORS, label, reached
from mfar_fem.drag import AirDrag, VertexDrag
from mfar_fem.loads import gravity
from mfar_fem.materials.fabric import Fabric
from mfar_fem.shell import State
from mfar_fem.solve.dynamics import Dynamics, DynamicsOptions
from mfar_fem.supports import Hinge
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import strip

GAMMA = 0.6
"""Normal drag of the examples, N·s²/m⁴: half the density of air, a drag coefficient of one."""


def free_sheet(drag, method: str, dt: float, rho: float = 1.0, order: int = 1, cells: int = 2, velocity=(0.0, 0.0, 0.0),
               falls: bool = True, rigidity: float = 1e-4, **options) -> Dynamics:
    """Free square sheet, flat and horizontal, in the air."""
    surface = Surface.from_pattern(strip(SIZE, SIZE, cells, cells, pattern="criss"), order)
    start = np.broadcast_to(np.asarray(velocity, dtype=float), surface.nodes.shape)
    options = {"rtol": 1e-10} | options
    return Dynamics(surface, sheet(1e3, rigidity, 0.3), loads=[gravity(DENSITY)] if falls else [], drag=[drag], velocity=start,
                    options=DynamicsOptions(method=method, dt=dt, rho=rho, **options))


def mean_velocity(dynamics: Dynamics) -> np.ndarray:
    """Velocity (3,) of the centre of mass, m/s."""
    return dynamics.inertia.mass(dynamics.motion.kinematics.v.reshape(-1, 3)).sum(axis=0) / dynamics.inertia.mass.total


def fall(method: str, rho: float = 1.0, steps: tuple[int, ...] = (20, 40, 80), order: int = 1) -> dict:
    """Fall from rest over 2 v_T/g with drag per area: errors of the speed, relative to v_T, and rates."""
    terminal = np.sqrt(DENSITY * G / GAMMA)
    until, errors = 2.0 * terminal / G, []
    for n in steps:
        dynamics = free_sheet(AirDrag(GAMMA), method, until / n, rho, order)
        reached(dynamics.run(until))
        errors.append(abs(-mean_velocity(dynamics)[2] / terminal - np.tanh(2.0)))
    e = np.array(errors)
    return {"method": label(method, rho), "shell_order": order, "terminal_speed": float(terminal), "steps": list(steps),
            "errors": e.tolist(), "rates": np.log2(e[:-1] / e[1:]).tolist()}


def coast(method: str = "generalized-alpha", rho: float = 1.0, steps: int = 200, factor: float = 10.0) -> dict:
    """Flat sheet thrown across itself without gravity: v/v0 at γ v0 t/ρ = ``factor``."""
    speed = 3.0
    until = factor * DENSITY / (GAMMA * speed)
    dynamics = free_sheet(AirDrag(GAMMA), method, until / steps, rho, velocity=(0.0, 0.0, speed), falls=False)
    reached(dynamics.run(until))
    ratio = float(mean_velocity(dynamics)[2] / speed)
    return {"method": label(method, rho), "factor": factor, "ratio": ratio, "exact": 1.0 / (1.0 + factor)}


def wind(tangential: float = 0.3, speed: float = 4.0, factor: float = 20.0, steps: int = 200) -> dict:
    """Sheet at rest in a wind along itself: the share of the wind's speed it has taken up at γ_t w t/ρ = ``factor``."""
    until = factor * DENSITY / (tangential * speed)
    dynamics = free_sheet(AirDrag(GAMMA, tangential, (speed, 0.0, 0.0)), "generalized-alpha", until / steps, falls=False)
    reached(dynamics.run(until))
    return {"factor": factor, "share": float(mean_velocity(dynamics)[0] / speed), "exact": factor / (1.0 + factor)}


def meshes(cells: tuple[int, ...] = (1, 2, 4, 8), order: int = 1, gamma_vertex: float = 1e-3) -> list[dict]:
    """Terminal speed of a stiff sheet against the mesh, with drag per area and per vertex (the same γ on every mesh)."""
    rows = []
    for n in cells:
        row: dict = {"cells": f"{n}x{n}", "shell_order": order}
        for name, drag in (("per_area", AirDrag(GAMMA)), ("per_vertex", VertexDrag(gamma_vertex))):
            dynamics = free_sheet(drag, "implicit-euler", 0.1, order=order, cells=n, rigidity=0.1, rtol=1e-8)
            vertices = len(dynamics.problem.surface.vertices)
            total = GAMMA * SIZE**2 if name == "per_area" else gamma_vertex * vertices
            reached(dynamics.run(3.0))
            row |= {"vertices": vertices, f"terminal_speed_{name}": float(-mean_velocity(dynamics)[2]),
                    f"exact_{name}": float(np.sqrt(dynamics.inertia.mass.total * G / total))}
        rows.append(row)
    return rows


def swatch(dt: float, degrees: float = 20.0, method: str = "implicit-euler", normal: float = GAMMA, cells: tuple[int, int] = (2, 3),
           order: int = 1, fabric: Fabric | None = None, rho: float = 0.8) -> dict:
    """Swatch of silk, 0.1 m wide and 0.15 m long, hung from an edge and released flat at an angle: its losses over one period.

    Returns
    -------
    dict
        ``air`` and ``integrator``: shares of the first energy lost to each over the period of a plate; ``share``: the integrator's
        of both; ``equal_dt``: the step at which both are equal for a stiff plate (s).
    """
    fabric = fabric or Fabric.load("silk-charmeuse")
    length, angle = 0.15, np.radians(degrees)
    surface = Surface.from_pattern(strip(length, 0.1, cells[1], cells[0]), order)
    down, across = np.array([np.sin(angle), 0.0, -np.cos(angle)]), np.array([0.0, 1.0, 0.0])
    dynamics_of: dict[str, Any] = {"supports": [Hinge("left")], "loads": [gravity(fabric.areal_density)], "drag": [AirDrag(normal)],
                                   "options": DynamicsOptions(method=method, dt=dt, rho=rho)}
    reference = Dynamics(surface, fabric, **dynamics_of).problem.start()
    u = reference.u.copy()
    u[: 3 * len(surface.nodes)] = (surface.nodes[:, :1] * down + surface.nodes[:, 1:2] * across).ravel()
    start = State(u, np.broadcast_to(np.cross(down, across), reference.directors.shape).copy())
    dynamics = Dynamics(surface, fabric, start=start, **dynamics_of)
    omega = np.sqrt(1.5 * G / length)
    result = reached(dynamics.run(2 * np.pi / omega))
    energy = fabric.areal_density * 0.1 * length * G * 0.5 * length * (1 - np.cos(angle))
    air, lost = result.records[-1].dissipated / energy, result.records[-1].defect / energy
    return {"dt": dt, "degrees": degrees, "method": method, "normal": normal, "air": float(air), "integrator": float(lost),
            "share": float(lost / (air + lost)),
            "equal_dt": float(2 * normal * length * angle / (np.pi * fabric.areal_density * omega))}


def hiding_step(degrees: float, steps: tuple[float, ...] = (1e-3, 2e-3, 4e-3, 8e-3, 16e-3, 32e-3), **options) -> dict:
    """Losses of the swatch over time steps, and the step at which implicit Euler takes as much as the air (``hides_at``, s).

    ``hides_at`` is interpolated between the logarithms of the steps; it is None where the integrator's share stays on one side of
    a half, and ``bound`` then says on which.
    """
    rows = [swatch(dt, degrees, **options) for dt in steps]
    share = np.array([row["share"] for row in rows])
    above = np.flatnonzero(share >= 0.5)
    hides, bound = None, "above the largest step" if len(above) == 0 else None
    if len(above) and above[0] == 0:
        bound = "below the smallest step"
    elif len(above):
        k = above[0]
        hides = float(np.exp(np.interp(0.5, share[k - 1:k + 1], np.log(steps[k - 1:k + 1]))))
    return {"degrees": degrees, "rows": rows, "hides_at": hides, "bound": bound, "stiff_plate": rows[0]["equal_dt"]}


def run(thorough: bool = True) -> dict:
    """Everything: the payload of ``mfar benchmark drag``."""
    return {
        "benchmark": "drag",
        "fall": [fall(method, rho, order=order) for method, rho in INTEGRATORS for order in ((1, 2) if thorough else (1,))],
        "coast": [coast(factor=factor) for factor in (1.0, 10.0)],
        "wind": wind(),
        "meshes": meshes((1, 2, 4, 8) if thorough else (1, 2, 4)) + (meshes((1, 2, 4), 2) if thorough else []),
        "swatch": [hiding_step(angle) for angle in ((5.0, 20.0, 60.0) if thorough else (20.0,))],
        "swatch_second_order": swatch(2e-3, 20.0, "bdf2"),
    }
