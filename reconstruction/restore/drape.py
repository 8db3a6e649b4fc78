"""The garment settled on its figure by the solver: an ordinary scene file that ``mfar simulate`` runs as well.

The reconstructed mesh is the stress-free reference: pictures show a garment that hangs already, and what it would be without
gravity is not known. So the settled garment hangs a little lower than the pictures; by how much, the report says (``sag``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import InputError, NotConvergedError
from reconstruction.restore.body import FittedBody, fit_body
from reconstruction.surface.triangles import TriangleMesh

GARMENT, FIGURE, SCENE = "garment.vtu", "figure.obj", "scene.toml"
CONTACT = 2e-3
"""Distance at which contact begins, m."""
FRICTION = 0.5
"""Of cloth on the figure: between silk on skin (0.3 to 0.4) and silk on an undergarment; an assumption."""


@dataclass(frozen=True)
class Effort:
    """What a level spends on a garment: length of the mesh's edges (m), simulated time (s), time step (s)."""

    edge: float
    duration: float
    dt: float


EFFORT = {"draft": Effort(0.04, 0.6, 0.02), "standard": Effort(0.03, 0.6, 0.02), "reference": Effort(0.02, 1.0, 0.005)}
"""By level of fidelity. Steps are longer than the 2 ms of moving scenes: only where it comes to rest matters here."""


def effort(fidelity: str) -> Effort:
    """The effort of a level.

    Raises
    ------
    InputError
        Unknown level.
    """
    if fidelity not in EFFORT:
        raise InputError(f"unknown fidelity '{fidelity}'; it is one of {', '.join(EFFORT)}")
    return EFFORT[fidelity]


def write_scene(folder: Path, surface, body: TriangleMesh | None, fabric: str, fidelity: str, name: str = "garment",
                ) -> FittedBody | None:  # fmt: skip
    """Write garment, figure and scene.

    Parameters
    ----------
    folder : Path
    surface : mfar_fem.surface.mesh.Surface
        With its warp direction; its named boundaries go along.
    body : TriangleMesh or None
        Closed figure, m; it is fitted (:func:`reconstruction.restore.body.fit_body`). None: nothing but the named boundary
        ``held`` carries the garment.
    fabric : str
        Name of a fabric, or its file.
    fidelity : str
    name : str

    Returns
    -------
    FittedBody or None
    """
    from mfar_fem.surface.io import write_mesh

    spent = effort(fidelity)
    every = np.arange(len(surface.vertices))
    marks = {f"boundary_{key}": np.isin(every, ids).astype(float) for key, ids in surface.boundary.items()}
    write_mesh(folder / GARMENT, surface.vertices, surface.triangles, marks, {"warp": surface.warp})
    fitted = None
    lines = [f'name = "{name}"', f'fabric = "{fabric}"', f'fidelity = "{fidelity}"', f'duration = "{spent.duration} s"',
             "", "[damping]", 'mass = "4 1/s"          # it shall settle, not swing', "", "[[sheet]]", 'kind = "mesh"',
             f'file = "{GARMENT}"', ""]  # fmt: skip
    if body is not None:
        fitted = fit_body(body, TriangleMesh(surface.vertices, surface.triangles), 1.5 * CONTACT)
        write_mesh(folder / FIGURE, fitted.mesh.vertices, fitted.mesh.faces)
        lines += ["[[body]]", 'name = "figure"', 'kind = "mesh"', f'file = "{FIGURE}"', f"friction = {FRICTION}", "",
                  "[contact]", f'distance = "{1e3 * CONTACT:g} mm"', ""]  # fmt: skip
    if "held" in surface.boundary:
        lines += ["[[support]]", 'where = "held"', ""]
    lines += ["[numerics]", f'dt = "{1e3 * spent.dt:g} ms"', "", "[output]", 'every = "0.1 s"', "animation = false",
              "view = [8, -70]", ""]  # fmt: skip
    (folder / SCENE).write_text("\n".join(lines), encoding="utf-8")
    return fitted


def settle(folder: Path, resume: bool = False, progress: Callable[[Mapping[str, Any]], None] | None = None) -> dict[str, Any]:
    """Run the scene of a folder into its ``run``.

    Returns
    -------
    dict
        Figures of the run; ``sag_m`` (mean downward displacement), ``moved_m`` (root mean square), ``kinetic_J`` at the end and at
        most, ``status``.

    Raises
    ------
    NotConvergedError
        The solver gave up; what it had is in the folder.
    """
    from mfar_fem.scene_file import load_scene
    from mfar_fem.simulation import simulate

    scene = load_scene(folder / SCENE)
    run = folder / "run"
    going = resume and (run / "checkpoint.npz").exists() and not (run / "result.json").exists()
    result = simulate(scene, run, resume=going, restart=not going, progress=progress)
    if not result.converged:
        raise NotConvergedError(f"the drape ended with {result.status} at {result.time:.3g} s: {result.message} (in '{run}')")
    start = scene.surface().nodes
    nodes = result.nodes[: len(start)]
    moved = nodes - start
    kinetic = [row["kinetic"] for row in result.history]
    np.savez_compressed(folder / "settled.npz", nodes=result.nodes, triangles=result.triangles)
    return {"status": result.status, "time_s": result.time, "steps": len(result.history), "sag_m": float(-moved[:, 2].mean()),
            "moved_m": float(np.sqrt((moved**2).sum(axis=1).mean())), "kinetic_J": kinetic[-1], "kinetic_most_J": max(kinetic),
            "elements": result.payload["elements"], "unknowns": result.payload["unknowns"],
            "largest_strain": _largest_strain(result.payload)}  # fmt: skip


def _largest_strain(payload: Mapping[str, Any]) -> float | None:
    value = payload.get("largest_strain")
    return None if value is None else float(value)
