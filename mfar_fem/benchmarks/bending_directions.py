"""A flat sheet bent onto a cylinder in any direction: energy over the exact one, on five meshes.

The nodes are put exactly on the cylinder (an isometry, so the plate has ½ D κ² an area in every direction); the edge rotations take
their equilibrium, those of the boundary edges are held at the cylinder's normal. The hinge model has no unknowns left: its ratio
counts the interior hinges with a weight of (A1 + A2)/3 each.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from mfar_fem.assembly import Pattern
from mfar_fem.benchmarks.case import sheet
from mfar_fem.benchmarks.hinge import hinge_angles, hinges
from mfar_fem.shell import Shell, State
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import strip

MESHES = ("right", "union", "criss", "equilateral", "jitter")
DIRECTIONS = np.arange(0.0, 180.0, 15.0)
MODELS = ("order 2", "order 1", "hinge")
CELLS, SIDE, CURVATURE, NU = 20, 1.0, 0.2, 0.3
NOTE = ("energy of a sheet bent onto a cylinder over ½ D κ² area (1 is exact), over 12 directions; κ times the cell is 0.01, ν 0.3;"
        " the hinge model's error does not shrink with the mesh")


def sheet_mesh(mesh: str, order: int, cells: int = CELLS) -> Surface:
    """The square sheet on one of :data:`MESHES` (rows of the equilateral mesh in its own proportion)."""
    height = SIDE * np.sqrt(0.75) if mesh == "equilateral" else SIDE
    return Surface.from_pattern(strip(SIDE, height, cells, cells, mesh), order)


def on_cylinder(X: np.ndarray, phi: float, curvature: float) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 3) of flat points bent along the direction ``phi`` (rad), and the normals there."""
    along, across = np.array([np.cos(phi), np.sin(phi), 0.0]), np.array([-np.sin(phi), np.cos(phi), 0.0])
    s, up = curvature * (X @ along), np.array([0.0, 0.0, 1.0])
    x = np.outer(np.sin(s) / curvature, along) + np.outer(X @ across, across) + np.outer((1.0 - np.cos(s)) / curvature, up)
    return x, np.outer(-np.sin(s), along) + np.outer(np.cos(s), up)


def shell_ratio(surface: Surface, phi: float, curvature: float = CURVATURE) -> float:
    """Bending energy of the shell over the exact one."""
    fabric = sheet(1.0, NU, 0.01)
    shell = Shell(surface, fabric, membrane=False)
    x, _ = on_cylinder(surface.nodes, phi, curvature)
    _, directors = on_cylinder(edge_points(surface), phi, curvature)
    state = State(np.concatenate([x.ravel(), np.zeros(shell.n_alpha)]), directors)
    pattern = Pattern(shell.n, [shell.element_dofs])
    ng = surface.order
    inner = np.flatnonzero(surface.edge_elements[:, 1] >= 0)
    free = shell.alpha_offset + (inner[:, None] * ng + np.arange(ng)).ravel()
    g, data = np.zeros(shell.n), np.zeros(pattern.nnz)
    shell.hessian(state, g, data, pattern.positions[0], False)
    from scipy.sparse.linalg import spsolve

    u = state.u.copy()
    u[free] -= spsolve(pattern.sub(free, free).matrix(data).tocsc(), g[free])  # the energy is quadratic in the rotations
    exact = 0.5 * fabric.bending.warp * curvature**2 * surface.areas.sum()
    return shell.energies(state.with_u(u))[1] / exact


def edge_points(surface: Surface) -> np.ndarray:
    """Material points (na, 3) of the edge rotations, from the low to the high vertex of every (straight) edge."""
    s = np.array([0.5]) if surface.order == 1 else 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
    a, b = (surface.vertices[surface.edges[:, i]][:, None] for i in range(2))
    return (a + s[None, :, None] * (b - a)).reshape(-1, 3)


def hinge_ratio(surface: Surface, phi: float, curvature: float = CURVATURE) -> float:
    """Energy of the interior hinges over the exact one of their share of the area."""
    nodes, weights = hinges(surface)
    x, _ = on_cylinder(surface.nodes, phi, curvature)
    theta = hinge_angles(x, nodes).value
    inner = surface.edge_elements[:, 1] >= 0
    area = surface.areas[surface.edge_elements[inner]].sum() / 3.0
    return float(weights @ theta**2) / (curvature**2 * area)


def run_directions(progress=None, meshes=MESHES, directions=DIRECTIONS) -> dict:
    """Ratios of all models on all meshes: ``rows`` of ``mesh``, ``model``, ``ratios`` by direction, ``min``, ``mean``, ``max``."""
    rows = []
    for mesh in meshes:
        for model in MODELS:
            surface = sheet_mesh(mesh, 2 if model == "order 2" else 1)
            ratio = hinge_ratio if model == "hinge" else shell_ratio
            ratios = np.array([ratio(surface, np.radians(d)) for d in directions])
            rows.append({"mesh": mesh, "model": model, "ratios": ratios,
                         "min": ratios.min(), "mean": ratios.mean(), "max": ratios.max()})
            if progress is not None:
                progress()
    return {"directions_deg": np.asarray(directions), "rows": rows, "note": NOTE}


def save_directions(folder: Path, payload: dict) -> list[str]:
    """Write ``bending_directions.csv`` and a polar picture; returns the paths."""
    from matplotlib.figure import Figure
    from matplotlib.projections.polar import PolarAxes

    table = folder / "bending_directions.csv"
    with table.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["mesh", "model", *(f"phi_{d:g}" for d in payload["directions_deg"]), "mean", "min", "max"])
        for row in payload["rows"]:
            writer.writerow([row["mesh"], row["model"], *(f"{r:.5f}" for r in row["ratios"]),
                             *(f"{row[k]:.5f}" for k in ("mean", "min", "max"))])
    figure = Figure(figsize=(11, 4), layout="constrained")
    phi = np.radians(np.concatenate([payload["directions_deg"], payload["directions_deg"] + 180.0, [360.0]]))
    for i, model in enumerate(MODELS):
        axes = figure.add_subplot(1, 3, i + 1, projection="polar")
        assert isinstance(axes, PolarAxes)
        for row in payload["rows"]:
            if row["model"] == model:
                axes.plot(phi, np.concatenate([row["ratios"], row["ratios"], row["ratios"][:1]]), label=row["mesh"])
        axes.set_title(model)
        axes.set_rlim(0.0, 3.1)
        if i == 0:
            axes.legend(loc="lower left", bbox_to_anchor=(-0.35, -0.15), fontsize=8)
    figure.suptitle("bending energy of a cylinder over the exact one, by the direction of bending")
    picture = folder / "bending_directions.png"
    figure.savefig(picture, dpi=130)
    return [str(table), str(picture)]


