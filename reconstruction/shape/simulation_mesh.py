"""The mesh that the shell takes: the fitted pattern itself, or a Poisson surface through its points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mfar_fem.errors import SurfaceError
from reconstruction.shape.untangle import untangle
from reconstruction.shape.warp import WarpField, warp_field
from reconstruction.surface.pipeline import SurfaceResult, SurfaceSettings, build_surface
from reconstruction.surface.triangles import TriangleMesh


@dataclass(frozen=True, eq=False)
class SimulationMesh:
    """A mesh without crossings, the warp on it, its free edges by name (vertex ids), what was done, and the meshes on the way by
    name, in order (none if no vertex moved)."""

    mesh: TriangleMesh
    warp: WarpField
    openings: dict[str, np.ndarray]
    actions: tuple[str, ...]
    stages: dict[str, TriangleMesh]


def simulation_mesh(
    shape: Mapping[str, np.ndarray], method: str = "template", edge: float = 0.025, settings: SurfaceSettings | None = None
) -> SimulationMesh:
    """Make a fitted shape fit for the solver.

    Parameters
    ----------
    shape : mapping
        ``vertices`` (nv, 3), ``faces`` (nf, 3), ``warp`` (nf, 3), ``noise`` (nv,), and ``opening_*`` vertex ids.
    method : str
        ``template``: the pattern's own triangles; ``poisson``: a new surface ((9),
        :func:`reconstruction.surface.pipeline.build_surface`) of edges `edge`, m, cut along the pattern's free edges.
    settings : SurfaceSettings, optional
        Of that surface; by default even triangles and ARAP.

    Raises
    ------
    SurfaceError
        Triangles still pass through each other, or a step of the Poisson surface failed.
    """
    fitted = TriangleMesh(shape["vertices"], shape["faces"])
    actions: list[str] = []
    openings = {key.removeprefix("opening_"): ids for key, ids in shape.items() if key.startswith("opening_")}
    mesh, stages = fitted, {"fitted": fitted}
    if method == "poisson":
        made = _poisson(fitted, shape["noise"], settings or SurfaceSettings(edge=edge, adaptive=False))
        mesh, openings = made.mesh, _rims(fitted, openings, made.mesh, edge)
        stages |= {"trimmed Poisson": made.trimmed, "even triangles": made.even}
        actions += made.actions
    loose = untangle(mesh)
    if loose.before:
        actions.append(
            f"{loose.before} pairs of triangles passed through each other, {loose.after} do after smoothing around them; "
            f"vertices moved {1e3 * loose.moved:.3g} mm at most"
            + (f"; {loose.spanned} vertices lost their folds, which had passed through each other" if loose.spanned else "")
        )
    if loose.after:
        raise SurfaceError(
            f"{loose.after} pairs of triangles of the garment still pass through each other after smoothing: try other "
            "pictures or a coarser fidelity"
        )
    mesh = TriangleMesh(loose.vertices, mesh.faces)
    centres = fitted.vertices[fitted.faces].mean(axis=1)
    field = warp_field(mesh, centres, shape["warp"], reach=2 * edge, smoothing=0.5)
    return SimulationMesh(mesh, field, openings, tuple(actions), stages if actions else {})


def _poisson(fitted: TriangleMesh, noise: np.ndarray, settings: SurfaceSettings) -> SurfaceResult:
    x, e, n = fitted.vertices, fitted.edges, fitted.vertex_normals
    points = np.concatenate([x, x[e].mean(axis=1), x[fitted.faces].mean(axis=1)])
    normals = np.concatenate([n, n[e].sum(axis=1), fitted.face_normals])
    spread = np.concatenate([noise, noise[e].max(axis=1), noise[fitted.faces].max(axis=1)])
    return build_surface(points, normals, spread, fitted, settings)


def _rims(fitted: TriangleMesh, openings: Mapping[str, np.ndarray], mesh: TriangleMesh, edge: float) -> dict[str, np.ndarray]:
    """The free edges of the fitted pattern on a new surface; what is held lies anywhere, not on a rim."""
    from scipy.spatial import cKDTree

    rim, found = mesh.boundary_vertices, {}
    for name, ids in openings.items():
        if name == "held":
            found[name] = np.unique(cKDTree(mesh.vertices).query(fitted.vertices[ids])[1])
        else:
            found[name] = rim[cKDTree(fitted.vertices[ids]).query(mesh.vertices[rim])[0] < edge]
    return found
