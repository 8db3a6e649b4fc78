"""Cloth that falls on a sphere or a cylinder: wall time per simulated second of every level, beside public cloth codes."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np

from mfar_fem.contact.barrier import Barrier
from mfar_fem.errors import MissingDependencyError
from mfar_fem.fidelity import LEVELS
from mfar_fem.scene_file import load_scene
from mfar_fem.simulation.engines import Advance, FiniteElements, engine

PUBLIC = (
    ("implicit solver with conjugate gradients", 21.0, 24.0, "public cloth code, like machine, 40 x 40 vertices, 2 ms"),
    (
        "vertex block descent, 10 x 10 iterations, no self-contact",
        25.0,
        25.0,
        "public cloth code, like machine, 40 x 40 vertices, 2 ms",
    ),
    (
        "vertex block descent, 10 x 10 iterations, self-contact",
        48.0,
        48.0,
        "public cloth code, like machine, 40 x 40 vertices, 2 ms",
    ),
)
"""Wall seconds per simulated second of public codes (name, from, to, what); cost per step only, their materials differ."""
AIM = {"draft": 5.0, "standard": 20.0, "reference": 60.0}
"""Wall seconds per simulated second this project aims at on two cores."""


def run(
    scene: str, level: str = "standard", duration: float = 1.0, self_contact: bool = False, progress=None, bodies: str = "auto",
    **overrides: Any
) -> dict[str, Any]:
    """Run ``drape-sphere`` or ``drape-cylinder`` for a time.

    Parameters
    ----------
    scene : str
    level : {'draft', 'standard', 'reference'}
    duration : float
        Simulated time, s.
    self_contact : bool
    bodies : {'auto', 'exact', 'mesh'}
        How they are met, see :class:`mfar_fem.scene.Contact`.
    progress : callable, optional
        Called with the simulated time after every step.
    **overrides
        Settings of :class:`mfar_fem.fidelity.Fidelity`.

    Returns
    -------
    dict
        ``wall_s_per_simulated_s`` (stepping only, compiled kernels loaded before), ``wall_s``, ``steps``, ``newton_iterations``,
        ``intersects`` (the last state the body's mesh, at the finite-element levels), ``least_distance_m`` (over all steps),
        ``status``, ``public`` and ``aim_s``.
    """
    loaded = load_scene(scene, level, **overrides)
    loaded = replace(loaded, duration=duration, contact=replace(loaded.contact, self_contact=self_contact, bodies=bodies))
    warm = engine(loaded)
    warm.advance(loaded.level.dt, lambda row: None)
    del warm
    e = engine(loaded)
    rows: list[dict[str, float]] = []

    def note(row: dict[str, float]) -> None:
        rows.append(row)
        if progress is not None:
            progress(row["time"])

    clock = time.perf_counter()
    outcome: Advance = e.advance(duration, note)
    wall = time.perf_counter() - clock
    nodes = e.nodes()
    outside = min(float(b.signed_distance(nodes, e.time)[0].min()) for b in loaded.bodies)
    intersects = None
    if isinstance(e, FiniteElements) and e.barrier is not None:
        intersects = e.barrier.has_intersections(e.dynamics.problem.shell, e.dynamics.motion.state) or meshes_intersect(e)
    distances = [r["distance"] for r in rows if "distance" in r]
    return {
        "benchmark": scene,
        "fidelity": level,
        "order": LEVELS[level].override(**overrides).order,
        "dt": loaded.level.dt,
        "simulated_s": e.time,
        "wall_s": wall,
        "wall_s_per_simulated_s": wall / e.time if e.time > 0 else None,
        "steps": len(rows),
        "newton_iterations": e.summary().get("newton_iterations"),
        "halvings": e.summary().get("halvings"),
        "inexact_steps": e.summary().get("inexact_steps"),
        "unknowns": e.summary()["unknowns"],
        "elements": e.summary()["elements"],
        "self_contact": self_contact,
        "bodies_met": None if loaded.level.order == 0 else "exact" if loaded.meshed_because(e.surface) is None else "mesh",
        "intersects": intersects,
        "least_distance_m": min(distances, default=None),
        "deepest_node_m": outside,
        "lowest_m": float(nodes[:, 2].min()),
        "mean_height_m": float(np.mean(nodes[:, 2])),
        "converged": outcome.status == "converged",
        "status": outcome.status,
        "message": outcome.message,
        "aim_s": AIM[level],
        "public": [{"code": n, "from_s": a, "to_s": b, "what": w} for n, a, b, w in PUBLIC],
    }


def meshes_intersect(run: FiniteElements) -> bool:
    """Whether the sheet intersects the bodies' meshes by ipctk, whatever contact the run had; False without ipctk."""
    try:
        check = Barrier(run.scene.bodies)
    except MissingDependencyError:
        return False
    check.bind(run.dynamics.problem.shell)
    return check.has_intersections(run.dynamics.problem.shell, run.dynamics.motion.state)


def error_study(
    scene: str = "drape-cylinder",
    shares=(0.0, 0.1, 0.5, 1.0),
    until: float = 0.3,
    cells: int | None = None,
    progress=None,
) -> dict[str, Any]:
    """What accepting steps by the error left in them does to the motion, beside half the time step (level ``standard``).

    Parameters
    ----------
    scene : str
    shares : sequence of float
        Values of ``iteration_error``; 0, every step solved to its residual, is what the others are compared with.
    until : float
        Simulated time, s; positions are compared at six times on the way.
    cells : int, optional
    progress : callable, optional
        Called after every run.

    Returns
    -------
    dict
        ``runs``: for each the share, the time step, iterations a step, wall s per simulated s, and the root mean square and the
        largest over the times of the distance of the nodes from the solved run, m.
    """
    times = np.linspace(until / 6.0, until, 6)
    dt = LEVELS["standard"].dt
    solved: list[np.ndarray] = []
    runs = []
    for share, step in [(s, dt) for s in sorted({0.0, *shares})] + [(0.0, 0.5 * dt)]:
        loaded = replace(load_scene(scene, "standard", iteration_error=share, dt=step, cells=cells), duration=until)
        rows: list[dict[str, float]] = []
        e, states = engine(loaded), []
        clock = time.perf_counter()
        for t in times:
            e.advance(float(t), rows.append)
            states.append(e.nodes())
        wall = time.perf_counter() - clock
        solved = solved or states
        apart = [float(np.sqrt(np.mean(np.sum((a - b) ** 2, axis=1)))) for a, b in zip(states, solved, strict=True)]
        runs.append(
            {
                "iteration_error": share,
                "dt_s": step,
                "iterations_per_step": sum(r["iterations"] for r in rows) / len(rows),
                "wall_s_per_simulated_s": wall / until,
                "distance_rms_m": float(np.sqrt(np.mean(np.square(apart)))),
                "distance_largest_m": max(apart),
            }
        )
        if progress is not None:
            progress(f"{scene}, {1e3 * step:g} ms, share {share:g}")
    return {"benchmark": "iteration-error", "scene": scene, "until_s": until, "runs": runs}
