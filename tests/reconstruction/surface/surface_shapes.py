"""Meshes for the tests of the surface stage."""

import numpy as np
import trimesh

from reconstruction.surface.triangles import TriangleMesh


def ball(level=2):
    """Unit sphere."""
    s = trimesh.creation.icosphere(level)
    return TriangleMesh(s.vertices, s.faces)


def bowl(level=2, above=-0.3):
    """Unit sphere without what lies below a height; a ragged rim."""
    mesh = ball(level)
    return mesh.submesh(mesh.vertices[mesh.faces][:, :, 2].mean(axis=1) > above)


def euler(mesh):
    """Characteristic: 2 for a sphere, 1 for a disc, 0 for a tube or torus."""
    return len(mesh.vertices) - len(mesh.edges) + len(mesh.faces)


def edge_counts(mesh):
    """Faces at every edge."""
    return mesh._edges[1]


def noisy_grid(n, rng, size=0.2):
    """A flat square in the plane z = 0 with irregular triangles; corners and rim in place."""
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    inner = (x > 0) & (x < 1) & (y > 0) & (y < 1)
    x, y = (c + inner * rng.uniform(-size, size, x.shape) / n for c in (x, y))
    i, j = np.meshgrid(np.arange(n), np.arange(n))
    a = (j * (n + 1) + i).ravel()
    faces = np.vstack([np.stack([a, a + 1, a + n + 2], axis=1), np.stack([a, a + n + 2, a + n + 1], axis=1)])
    return TriangleMesh(np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1), faces)
