"""Even triangles before subdivision: the slivers of marching cubes go, which no movement of vertices mends.

Not in the paper. The surface is remeshed by gpytoolbox (M. Botsch, L. Kobbelt, A remeshing approach to multiresolution
modeling, SGP 2004, doi:10.2312/SGP/SGP04/189-196), which keeps boundary vertices; short boundary edges are collapsed before.
"""

from __future__ import annotations

import numpy as np

from mfar_fem.errors import ParameterError
from reconstruction.libraries import optional
from reconstruction.surface.collapse import collapse_short_edges
from reconstruction.surface.triangles import TriangleMesh


def even_edge(mesh: TriangleMesh) -> float:
    """Edge of the equilateral triangle with the mean area, m."""
    return float(np.sqrt(4 * mesh.areas.mean() / np.sqrt(3)))


def remesh(mesh: TriangleMesh, edge: float | None = None, iterations: int = 5) -> tuple[TriangleMesh, list[str]]:
    """Mesh with edges of about one length, and what was done.

    Parameters
    ----------
    mesh : TriangleMesh
        Manifold.
    edge : float, optional
        m; default :func:`even_edge`.
    iterations : int
        Of gpytoolbox.

    Raises
    ------
    ParameterError
        An edge that is not positive, or shorter than a tenth of what the mesh has.
    """
    natural = even_edge(mesh)
    edge = natural if edge is None else float(edge)
    if not edge > 0.1 * natural:
        raise ParameterError(f"edge {edge} m; the mesh has {natural:.3g} m and may be made at most ten times as fine")
    short, count = collapse_short_edges(mesh, 0.5 * edge)
    toolbox = optional("gpytoolbox", "remeshing needs")
    vertices, faces = toolbox.remesh_botsch(short.vertices, short.faces.astype(np.int32), iterations, edge, project=True)
    even, again = collapse_short_edges(TriangleMesh(vertices, faces), 0.4 * edge)
    return even, [f"{count + again} short edges collapsed, remeshed to edges of {1e3 * edge:.3g} mm: "
                  f"{len(mesh.faces)} triangles became {len(even.faces)}"]  # fmt: skip
