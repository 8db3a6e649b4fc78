"""What a scene will compute and cost before it runs: terms, what leaving one out would cost, unknowns, memory, expected time."""

from __future__ import annotations

import contextlib
import math
import time as clock
from dataclasses import replace
from typing import Any

import numpy as np

from mfar_fem.scene import Scene
from mfar_fem.units import STANDARD_GRAVITY

HANGING = 1.20241278
"""Lowest frequency of a hanging strip, ω √(L/g): half the first zero of the Bessel function J0."""
STEP_ITERATIONS = {(False, False): 3.0, (False, True): 2.0, (True, False): 8.0, (True, True): 2.5}
"""Newton iterations a time step usually takes, by whether things touch and whether an error may be left; at rest in all:"""
REST_ITERATIONS = 500.0
CONTACT_COST = {True: 1.6, False: 2.5}
"""What an iteration with contact costs beside one without, by whether bodies are met by their exact distance."""


def plan(scene: Scene, measure: bool = True) -> dict[str, Any]:
    """The plan of a scene.

    Parameters
    ----------
    scene : Scene
    measure : bool
        Assemble and factorise once, and base the expected time on that; otherwise no time is given.

    Returns
    -------
    dict
        ``terms`` (name, on, why, estimate), ``scales``, ``mesh``, ``unknowns``, ``matrix_entries``, ``memory_MB``, ``seconds``
        (None without ``measure``) and how they were found.
    """
    surface = scene.surface()
    area = float(surface.areas.sum())
    scales = _scales(scene, surface, area)
    terms = [
        {"name": t.name, "on": t.on, "why": t.why, "estimate": _estimate(t.name, t.on, scene, surface, scales)}
        for t in scene.explain()
    ]
    found: dict[str, Any] = {
        "scene": scene.name,
        "fabric": scene.fabric.name,
        "fidelity": scene.level.name,
        "order": scene.level.order,
        "analysis": "to rest"
        if scene.to_rest
        else f"{scene.duration:g} s in steps of {1e3 * scene.level.dt:g} ms, {scene.level.method}",
        "terms": terms,
        "scales": scales,
        "mesh": {
            "vertices": len(surface.vertices),
            "triangles": len(surface.triangles),
            "edges": len(surface.edges),
            "size_m": float(np.median(surface.edge_lengths)),
        },
    }
    cost = _cost_positions(scene, surface, measure) if scene.level.order == 0 else _cost_elements(scene, surface, measure)
    return found | cost


def _scales(scene: Scene, surface, area: float) -> dict[str, Any]:
    """Lengths, times and energies that decide what matters, SI."""
    fabric = scene.fabric
    g = float(np.linalg.norm(scene.gravity)) or STANDARD_GRAVITY
    weight = fabric.areal_density * g
    size = float(np.ptp(surface.nodes, axis=0).max())
    rest = fabric.law.tangent_at_rest() * fabric.membrane_scale
    stiffness, shear = 0.5 * float(rest[0, 0] + rest[1, 1]), float(rest[2, 2])
    B = math.sqrt(fabric.bending.warp * fabric.bending.weft)
    bending_length = (B / weight) ** (1 / 3)
    stretch = weight * size / stiffness
    gravity = weight * area * size
    return {
        "size": size,
        "area": area,
        "mass": fabric.areal_density * area,
        "weight_per_area": weight,
        "membrane_stiffness": stiffness,
        "shear_stiffness": shear,
        "bending_rigidity": B,
        "bending_length": bending_length,
        "stretch_under_own_weight": stretch,
        "gravity_energy": gravity,
        "membrane_energy": 0.5 * weight * size * stretch * area,
        "bending_energy": 0.5 * B / bending_length**2 * area,
        "kinetic_energy": gravity,
        "slowest_period": 2 * math.pi / HANGING * math.sqrt(size / g),
        "fall_speed": math.sqrt(2 * g * size),
        "terminal_speed": None if scene.air is None or not scene.air.normal else math.sqrt(weight / scene.air.normal),
        "wave_time_of_a_cell": float(np.median(surface.edge_lengths)) * math.sqrt(fabric.areal_density / stiffness),
    }


def _estimate(name: str, on: bool, scene: Scene, surface, s: dict[str, Any]) -> str:
    """What the term amounts to, or what leaving it out costs."""
    cell = float(np.median(surface.edge_lengths))
    if name == "membrane":
        return (
            f"stretch under its own weight {100 * s['stretch_under_own_weight']:.2g} %; energy {s['membrane_energy']:.2g} J beside "
            f"{s['gravity_energy']:.2g} J of gravity"
        )
    if name == "bending":
        length = 1e3 * s["bending_length"]
        resolved = "" if cell < s["bending_length"] else f", below the mesh size {1e3 * cell:.2g} mm: folds are not resolved"
        ratio = s["bending_energy"] / s["gravity_energy"]
        cost = "without it folds have no size and the sheet no shape" if on else "left out: folds as fine as the mesh"
        return f"bending length {length:.2g} mm{resolved}; energy {100 * ratio:.2g} % of gravity's; {cost}"
    if name == "inertia":
        if not on:
            swing = f"{s['slowest_period']:.2g} s a swing"
            return f"left out: the way to rest ({swing}) is not that of the cloth, and of several rest states another may be found"
        steps = s["slowest_period"] / scene.level.dt
        return f"slowest swing about {s['slowest_period']:.2g} s ({steps:.0f} steps); falls at up to {s['fall_speed']:.2g} m/s"
    if name == "drag":
        if on and s["terminal_speed"]:
            share = (s["fall_speed"] / s["terminal_speed"]) ** 2
            return f"terminal speed {s['terminal_speed']:.2g} m/s; at {s['fall_speed']:.2g} m/s it is {share:.1f} times the weight"
        if not scene.to_rest:
            v = math.sqrt(s["weight_per_area"] / 0.6)
            sheet = f"a sheet of {1e3 * scene.fabric.areal_density:.0f} g/m²"
            return f"left out: {sheet} falls flat at {v:.2g} m/s at most in air; without it only the integrator damps"
        return "no motion, no drag"
    if name == "damping":
        if not on and scene.to_rest:
            return "no motion, no damping"
        return "" if on else "left out: the fabric itself loses nothing (implicit Euler still does, see the defect in history.csv)"
    if name == "contact with bodies":
        if not on:
            return "left out at no cost: there is nothing to touch"
        near = [b.signed_distance(surface.vertices, 0.0)[0] < s["size"] for b in scene.bodies]
        reach = int(np.any(near, axis=0).sum())
        met = ""
        if scene.level.order > 0:
            reason = scene.meshed_because(surface)
            met = "; bodies met by their exact distance" if reason is None else f"; bodies met as meshes: {reason}"
        begins = f"begins {1e3 * scene.contact.distance:.2g} mm away"
        return f"up to {reach} of {len(surface.vertices)} vertices can reach a body; {begins}{met}"
    if name == "self-contact":
        return "" if on else "left out: folds may pass through each other, and the result does not tell"
    if name == "gravity":
        return f"weight {s['weight_per_area'] * s['area']:.3g} N" if on else ""
    return ""


def _cost_elements(scene: Scene, surface, measure: bool) -> dict[str, Any]:
    from mfar_fem.solve.problem import Problem

    loads = scene.loads()
    if not scene.to_rest:
        from mfar_fem.solve.inertia import Inertia

        loads.append(Inertia(scene.fabric.areal_density, "lumped" if scene.level.order == 1 else "consistent"))
    problem = Problem(surface, scene.fabric, scene.supports(surface), loads, bending=scene.bending)
    n, entries = len(problem.free), problem.pattern.nnz
    fill = (
        5.5 * entries * max(1.0, math.log2(max(n, 2)) / 10)
    )  # of a sparse factor of a surface mesh, measured on 2k to 100k unknowns
    memory = (8.0 * (3 * entries + fill) + 4.0 * sum(p.size for p in problem.pattern.positions)) / 1e6
    steps = None if scene.duration is None else math.ceil(scene.duration / scene.level.dt)
    left = scene.level.error_left(scene.has_contact)
    iterations = REST_ITERATIONS if steps is None else STEP_ITERATIONS[scene.has_contact, left > 0] * steps
    found: dict[str, Any] = {
        "unknowns": n,
        "edge_unknowns": problem.shell.n_alpha,
        "matrix_entries": entries,
        "memory_MB": memory,
        "steps": steps,
        "iterations_expected": iterations,
        "iteration_error": left,
        "seconds": None,
    }
    if measure:
        once = _one_iteration(problem)
        dearer = CONTACT_COST[scene.meshed_because(surface) is None] if scene.has_contact else 1.0
        found |= {
            "assembly_s": once[0],
            "solve_s": once[1],
            "seconds": iterations * (1.15 * once[0] + once[1]) * dearer,
            "seconds_from": "one assembly and one factorisation timed now, times the usual iterations: within a factor of 2",
        }
    return found


def _one_iteration(problem) -> tuple[float, float]:
    from mfar_fem.solve.integrators import Kinematics, step_rule
    from mfar_fem.solve.linear import LinearSolver, SingularMatrixError

    state = problem.start()
    for load in problem.loads:
        if hasattr(load, "mass"):
            zero = np.zeros(problem.shell.alpha_offset)
            k = Kinematics(state.u[: len(zero)], zero, zero)
            load.begin_step(step_rule("implicit-euler", k, 2e-3), k)
    times: tuple[float, float] = (math.inf, math.inf)
    solver = LinearSolver("direct", cache=problem.linear_cache)
    for _ in range(3):
        begin = clock.perf_counter()
        g, data = problem.tangent(state, 1.0, False)
        middle = clock.perf_counter()
        data[problem.pattern.diagonal] += 1e-6 * np.abs(data[problem.pattern.diagonal]).max()
        with contextlib.suppress(SingularMatrixError):  # it has cost what it costs
            solver.factor(problem.system(data))(g[problem.free])
        times = (min(times[0], middle - begin), min(times[1], clock.perf_counter() - middle))
    return times


def _cost_positions(scene: Scene, surface, measure: bool) -> dict[str, Any]:
    from mfar_fem.simulation.engines import PositionLevel

    duration = 10.0 if scene.duration is None else scene.duration
    engine = PositionLevel(replace(scene, duration=duration))
    steps = math.ceil(duration / scene.level.dt)
    found: dict[str, Any] = {
        "unknowns": 3 * len(surface.vertices),
        "edge_unknowns": 0,
        "matrix_entries": 0,
        "memory_MB": 8e-6 * 120 * len(surface.triangles),
        "steps": steps,
        "substeps": engine.model.substeps,
        "iterations_expected": float(steps * engine.model.substeps),
        "seconds": None,
    }
    if measure:
        engine.model.step()
        begin = clock.perf_counter()
        for _ in range(3):
            engine.model.step()
        found |= {"seconds": (clock.perf_counter() - begin) / 3 * steps, "seconds_from": "three steps timed now"}
    return found
