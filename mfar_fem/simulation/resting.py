"""Scenes that run to rest: an equilibrium found by relaxation, with contact where there are bodies."""

from __future__ import annotations

import time as clock
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.scene import Scene
from mfar_fem.shell import State
from mfar_fem.simulation.engines import shell_fields
from mfar_fem.simulation.files import flat, load_checkpoint, save_checkpoint, save_json
from mfar_fem.solve.rest import RestOptions, relax, resting_problem

CHECKPOINT_EVERY = 1.0
"""Wall-clock seconds between checkpoints of a relaxation."""


def rest(scene: Scene, folder: Path | None, resume: bool, key: str, progress):
    """See :func:`mfar_fem.simulation.run.simulate`; contact is without friction, which has no energy.

    A resumed relaxation starts from the last state kept and ends in an equilibrium too, not by the same path.
    """
    from mfar_fem.simulation.run import SimulationResult

    if scene.level.order == 0:
        return _settle(scene, folder, resume, progress)
    begin = clock.perf_counter()
    surface = scene.surface()
    supports = scene.supports(surface)
    barrier = scene.barrier(surface)
    loads = scene.loads()
    if barrier is not None:
        barrier.friction = np.zeros_like(barrier.friction)
        loads.append(barrier)
    problem = resting_problem(surface, scene.fabric, supports, loads, scene.bending)
    start = problem.state_at(scene.start_nodes(surface, supports))
    kept = {"at": clock.perf_counter()}
    if resume:
        assert folder is not None
        saved = load_checkpoint(folder / "checkpoint.npz", key)
        start = State(saved["u"], saved["directors"])
    rows: list[dict[str, float]] = []

    def note(iteration: int, energy: float, relative: float, state: State) -> None:
        rows.append({"iteration": iteration, "energy": energy, "residual_relative": relative})
        if folder is not None and clock.perf_counter() - kept["at"] > CHECKPOINT_EVERY:
            save_checkpoint(folder / "checkpoint.npz", {"u": state.u, "directors": state.directors}, key)
            kept["at"] = clock.perf_counter()
        if progress is not None:
            progress(rows[-1] | {"until": None, "contacts": 0 if barrier is None else barrier.summary()[0]})

    softening = (0.1,) if scene.level.order == 2 and not scene.has_contact else ()
    result = relax(
        problem,
        start,
        RestOptions(rtol=min(scene.level.rtol, 1e-6), softening=softening, linear_solver=scene.level.linear_solver),
        note,
    )
    nodes = problem.shell.positions(result.state)
    points, triangles, parent = flat(surface, nodes)
    payload: dict[str, Any] = {
        "scene": scene.name,
        "fabric": scene.fabric.name,
        "fidelity": scene.level.name,
        "order": scene.level.order,
        "converged": result.converged,
        "status": result.status,
        "message": result.message,
        "stable": result.stable,
        "negative_eigenvalues": result.negative,
        "escapes": result.escapes,
        "energy": result.energy,
        "membrane": result.membrane,
        "bending": result.bending,
        "residual": result.residual,
        "residual_relative": result.residual_relative,
        "iterations": result.iterations,
        "perturbation": {"amplitude": scene.perturbation[0], "seed": scene.perturbation[1]},
        "unknowns": problem.n,
        "elements": len(surface.elements),
        "terms": {t.name: t.on for t in scene.explain()},
        "seconds": result.timings | {"wall": clock.perf_counter() - begin},
        "files": [],
    }
    if barrier is not None:
        found = barrier.report(problem.shell, result.state)
        payload["contact"] = {"pairs": found.pairs, "least_distance": found.least_distance, "forces": found.forces}
    if folder is not None:
        payload["files"] = _write(
            scene, folder, surface, points, triangles, {k: v[parent] for k, v in shell_fields(problem.shell, result.state).items()}
        )
        save_checkpoint(folder / "checkpoint.npz", {"u": result.state.u, "directors": result.state.directors}, key)
        save_json(folder / "result.json", payload)
    return SimulationResult(
        result.converged, result.status, result.message, 0.0, nodes, np.zeros_like(nodes), triangles, rows, payload
    )


def _settle(scene: Scene, folder: Path | None, resume: bool, progress):
    """The draft level has no static residual: it runs until the kinetic energy is a millionth of what it was, or for 10 s."""
    from mfar_fem.simulation.engines import PositionLevel
    from mfar_fem.simulation.run import SimulationResult, simulate

    longest, piece, most = 10.0, 0.25, 0.0
    run = replace(scene, duration=longest, mass_damping=max(scene.mass_damping, 5.0))
    if folder is not None:
        return simulate(run, folder, resume, restart=not resume, progress=progress)
    engine = PositionLevel(run)
    rows: list[dict[str, float]] = []
    outcome = engine.advance(piece, rows.append)
    while outcome.status == "converged" and engine.time < longest:
        most = max(most, max(r["kinetic"] for r in rows))
        if rows[-1]["kinetic"] < 1e-6 * most:
            break
        outcome = engine.advance(engine.time + piece, rows.append)
        if progress is not None:
            progress(rows[-1] | {"until": None})
    nodes = engine.nodes()
    message = "nearly at rest; the draft level (position-based dynamics) controls no residual and knows no stability"
    payload = {
        "scene": scene.name,
        "fabric": scene.fabric.name,
        "fidelity": scene.level.name,
        "order": 0,
        "message": message,
        "converged": outcome.status == "converged",
        "status": outcome.status,
        "stable": None,
        "time": engine.time,
        "last": rows[-1],
        "terms": {t.name: t.on for t in scene.explain()},
        **engine.summary(),
    }
    return SimulationResult(
        payload["converged"],
        outcome.status,
        message,
        engine.time,
        nodes,
        engine.velocities(),
        flat(engine.surface, nodes)[1],
        rows,
        payload,
    )


def _write(scene: Scene, folder: Path, surface, points, triangles, fields) -> list[str]:
    from mfar_fem.surface.io import write_mesh

    files = [write_mesh(folder / "last.glb", points, triangles), write_mesh(folder / "last.vtu", points, triangles, {}, fields)]
    if scene.output.pictures:
        from mfar_fem.simulation.pictures import Camera, draw

        bodies = [(b.placed(v, 0.0), t) for b in scene.bodies for v, t in [b.mesh()]]
        near = [np.clip(v, points.min(axis=0) - 0.1, points.max(axis=0) + 0.1) for v, _ in bodies]
        camera = Camera([points, *near], scene.output.view)
        files.append(draw(folder / "rest.png", camera, (points, triangles), bodies, f"{scene.name}  {scene.level.name}  at rest"))
    return [str(f) for f in files]
