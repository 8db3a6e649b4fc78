"""The stage ``surface``: the mesh of the solver with its warp, the meshes on the way to it, and their triangles in numbers."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from reconstruction.restore.drawings import warp_picture
from reconstruction.shape.fit import Shape
from reconstruction.shape.simulation_mesh import simulation_mesh
from reconstruction.surface.quality import quality, quality_picture

ANGLES = "angles.png"
"""Meshes coloured by smallest angles, where there are several."""
TRIMMED = "trimmed.ply"


def named_openings(openings: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Vertex ids under the names of a stored array each."""
    return {f"opening_{name}": ids for name, ids in openings.items()}


def solver_input(shape: Shape) -> dict[str, np.ndarray]:
    """A fitted shape in the wearer's axes, as :func:`reconstruction.shape.simulation_mesh.simulation_mesh` takes it."""
    local, sewn = shape.frame.to_body(shape.vertices), shape.sewn
    held = {"held": shape.pinned} if len(shape.pinned) else {}
    return {"vertices": local, "faces": sewn.faces, "warp": sewn.warp_in_space(local), "noise": shape.noise,
            **named_openings(sewn.openings | held)}  # fmt: skip


def write_surface(shape_file: Path, at: Path, method: str, edge: float) -> dict[str, Any]:
    """Make and write the mesh of the solver.

    Returns
    -------
    dict
        ``method``, ``triangles``, ``quality`` (a row a mesh, the solver's last), ``actions``, and figures of the warp.
    """
    from mfar_fem.surface.io import write_mesh

    with np.load(shape_file) as stored:
        shape = {key: stored[key] for key in stored}
    made = simulation_mesh(shape, method, edge)
    mesh, stages = made.mesh, made.stages
    marks = {f"boundary_{name}": np.isin(np.arange(len(mesh.vertices)), ids).astype(float) for name, ids in made.openings.items()}
    write_mesh(at / "garment.vtu", mesh.vertices, mesh.faces, marks, {"warp": made.warp.directions})
    np.savez_compressed(
        at / "mesh.npz",
        vertices=mesh.vertices,
        faces=mesh.faces,
        warp=made.warp.directions,
        prior=made.warp.prior,
        **named_openings(made.openings),
    )
    mesh.write(at / "garment.ply")
    warp_picture(at / "warp.png", mesh, made.warp)
    if method == "poisson":
        stages["trimmed Poisson"].write(at / TRIMMED)
        drawn = [(name, m) for name, m in stages.items() if name != "fitted"]
        quality_picture(at / ANGLES, [*drawn, ("final", mesh)])
    return {
        "method": method,
        "triangles": len(mesh.faces),
        "quality": [quality(m, name).to_dict() for name, m in {**stages, "for the solver": mesh}.items()],
        "actions": list(made.actions),
        "singularities": {str(k): v for k, v in made.warp.singular.items()},
        "warp_flipped": made.warp.flipped,
        "warp_prior_share": float(made.warp.prior.mean()),
    }
