"""How far the estimates of mean curvature are off, on spheres, cylinders and a torus of known curvature."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from reconstruction.libraries import optional
from reconstruction.surface.analytic import Torus
from reconstruction.surface.curvature import mean_curvature
from reconstruction.surface.triangles import TriangleMesh

ESTIMATES: dict[str, Callable[[TriangleMesh], np.ndarray]] = {
    "cotangent": lambda m: mean_curvature(m),
    "cotangent, 1 average": lambda m: mean_curvature(m, smoothing=1),
    "cotangent, 3 averages": lambda m: mean_curvature(m, smoothing=3),
    "quadric, radius 2": lambda m: mean_curvature(m, "quadric", 2),
    "quadric, radius 3": lambda m: mean_curvature(m, "quadric", 3),
    "quadric, radius 5 (libigl's default)": lambda m: mean_curvature(m, "quadric", 5),
}
"""What is compared; the rule of the subdivision uses ``cotangent, 1 average``."""


def jittered_tube(radius: float, height: float, around: int, rng: np.random.Generator, jitter: float = 0.2) -> TriangleMesh:
    """Open cylinder with irregular triangles whose vertices lie on it."""
    along = max(2, round(height / (2 * np.pi * radius / around)))
    i, j = np.meshgrid(np.arange(around), np.arange(along + 1))
    v = 2 * np.pi * (i + 0.5 * (j % 2) + jitter * rng.uniform(-1, 1, i.shape)) / around
    z = height / along * (j + jitter * rng.uniform(-1, 1, i.shape) * ((j > 0) & (j < along)))
    i, j = np.meshgrid(np.arange(around), np.arange(along))
    a, b = j * around + i, j * around + (i + 1) % around
    c, d = a + around, b + around
    odd = (j % 2 == 1)[..., None]
    first = np.where(odd, np.stack([a, b, d], axis=-1), np.stack([a, b, c], axis=-1))
    second = np.where(odd, np.stack([a, d, c], axis=-1), np.stack([b, d, c], axis=-1))
    points = np.stack([radius * np.cos(v), radius * np.sin(v), z], axis=-1).reshape(-1, 3)
    return TriangleMesh(points, np.concatenate([first.reshape(-1, 3), second.reshape(-1, 3)]))


def torus_mesh(
    torus: Torus, around: int, tube: int, rng: np.random.Generator, jitter: float = 0.2
) -> tuple[TriangleMesh, np.ndarray]:
    """Irregular triangles with their vertices on a torus, and the exact mean curvature there, 1/m."""
    i, j = np.meshgrid(np.arange(around), np.arange(tube))
    v = 2 * np.pi * (i + jitter * rng.uniform(-1, 1, i.shape)) / around
    u = 2 * np.pi * (j + jitter * rng.uniform(-1, 1, i.shape)) / tube
    r = torus.radius + torus.tube * np.cos(u)
    points = np.stack([r * np.cos(v), r * np.sin(v), torus.tube * np.sin(u)], axis=-1).reshape(-1, 3)
    a, b = j * around + i, j * around + (i + 1) % around
    c, d = ((j + 1) % tube) * around + i, ((j + 1) % tube) * around + (i + 1) % around
    faces = np.concatenate([np.stack([a, b, d], axis=-1).reshape(-1, 3), np.stack([a, d, c], axis=-1).reshape(-1, 3)])
    exact = 0.5 * (1 / torus.tube + np.cos(u) / r)
    return TriangleMesh(points, faces), exact.ravel()


def calibration(noise: float = 0.02) -> list[dict[str, Any]]:
    """Relative errors of every estimate, by surface and edge, without and with noise.

    Parameters
    ----------
    noise : float
        Standard deviation of the vertices along the normal, in mean edges.

    Returns
    -------
    list of dict
        ``surface``, ``edge_over_radius``, ``noise`` (in edges), ``estimate``, ``bias`` (mean), ``rms``, ``largest``: of
        estimate / exact − 1 over the vertices.
    """
    igl = optional("igl", "curvature needs")
    rng = np.random.default_rng(0)
    cases: list[tuple[str, TriangleMesh, np.ndarray, float]] = []
    sphere = TriangleMesh(*_icosahedron())
    for level in (1, 2, 3):
        v, f = sphere.vertices, sphere.faces
        for _ in range(level):
            v, f = igl.loop(v, f, 1)
            v = v / np.linalg.norm(v, axis=1)[:, None]
        cases.append(("sphere", TriangleMesh(v, f), np.ones(len(v)), 1.0))
    for around in (12, 24, 48):
        tube = jittered_tube(1.0, 3.0, around, rng)
        cases.append(("cylinder, irregular", tube, np.full(len(tube.vertices), 0.5), 1.0))
    torus = Torus(1.0, 0.4)
    for n in (12, 24, 48):
        mesh, exact = torus_mesh(torus, round(2.5 * n), n, rng)
        cases.append(("torus, irregular", mesh, exact, torus.tube))
    rows: list[dict[str, Any]] = []
    for name, mesh, exact, radius in cases:
        edge = float(np.linalg.norm(mesh.vertices[mesh.edges[:, 0]] - mesh.vertices[mesh.edges[:, 1]], axis=1).mean())
        shifted = mesh.vertices + noise * edge * rng.normal(size=(len(exact), 1)) * mesh.vertex_normals
        for size, m in ((0.0, mesh), (noise, TriangleMesh(shifted, mesh.faces))):
            for label, estimate in ESTIMATES.items():
                error = estimate(m) / exact - 1
                row = {
                    "surface": name,
                    "edge_over_radius": edge / radius,
                    "noise": size,
                    "estimate": label,
                    "bias": float(error.mean()),
                }
                rows.append(row | {"rms": float(np.sqrt((error**2).mean())), "largest": float(np.abs(error).max())})
    return rows


def _icosahedron() -> tuple[np.ndarray, np.ndarray]:
    from scipy.spatial import ConvexHull

    g = (1 + np.sqrt(5)) / 2
    v = np.array([(0, s, t * g) for s in (-1, 1) for t in (-1, 1)], float)
    v = np.vstack([v, v[:, [2, 0, 1]], v[:, [1, 2, 0]]])
    f = ConvexHull(v).simplices.astype(np.int64)
    inward = np.einsum("ij,ij->i", np.cross(v[f[:, 1]] - v[f[:, 0]], v[f[:, 2]] - v[f[:, 0]]), v[f[:, 0]]) < 0
    f[inward] = f[inward][:, ::-1]
    return v / np.linalg.norm(v, axis=1)[:, None], f
