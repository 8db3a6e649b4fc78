"""Line fields on surfaces: indices, signs, smoothing, tensors."""

import numpy as np
import pytest
from scipy.spatial import Delaunay

from mfar_fem.errors import InputError
from reconstruction.shape.warp import ETA, WARP, WEFT, singularities, warp_field
from reconstruction.surface.triangles import TriangleMesh

trimesh = pytest.importorskip("trimesh")


def sphere():
    ball = trimesh.creation.icosphere(3)
    return TriangleMesh(ball.vertices, ball.faces)


def square(n=20, seed=0):
    g = np.linspace(-1, 1, n)
    p = np.stack(np.meshgrid(g, g), axis=-1).reshape(-1, 2)
    p = p + 0.002 * np.random.default_rng(seed).normal(size=p.shape)
    return TriangleMesh(np.column_stack([p, np.zeros(len(p))]), Delaunay(p).simplices)


def centres(mesh):
    return mesh.vertices[mesh.faces].mean(axis=1)


@pytest.mark.parametrize("smoothing", [0.0, 0.3])
@pytest.mark.parametrize("axis", [(0, 0, 1.0), (1.0, 0.3, 0)])
def test_indices_on_a_sphere_sum_to_two(axis, smoothing):
    """Poincare and Hopf, for lines."""
    mesh = sphere()
    field = warp_field(mesh, centres(mesh), np.cross(axis, centres(mesh)), 1.0, smoothing)
    assert sum(field.singular.values()) == 2.0 and field.flipped == 0


@pytest.mark.parametrize("index", [0.5, -0.5, 1.0, -1.0, 1.5])
def test_index_in_the_plane(index):
    mesh = square()
    c = centres(mesh)
    angle = np.arctan2(c[:, 1] - 0.03, c[:, 0] - 0.02)
    lines = np.column_stack([np.cos(index * angle), np.sin(index * angle), 0 * angle])
    field = warp_field(mesh, c, lines, 1.0, 0.0)
    assert sum(field.singular.values()) == index
    if index % 1:
        assert field.flipped > 0  # a half turn has no consistent sign


def test_signs_agree_and_do_not_matter():
    mesh = square()
    rng = np.random.default_rng(3)
    lines = np.tile([0.6, 0.8, 0.0], (len(mesh.faces), 1)) * rng.choice([-1, 1], (len(mesh.faces), 1))
    field = warp_field(mesh, centres(mesh), lines, 1.0, 0.5)
    assert field.flipped == 0 and not field.singular and not field.prior.any()
    np.testing.assert_allclose(np.abs(field.directions @ [0.6, 0.8, 0.0]), 1.0, atol=1e-9)
    assert len(np.unique(np.sign(field.directions @ [0.6, 0.8, 0.0]))) == 1


def test_smoothing_takes_noise_away():
    mesh = square()
    noise = 0.4 * np.random.default_rng(1).normal(size=len(mesh.faces))
    lines = np.column_stack([np.cos(noise), np.sin(noise), 0 * noise])
    rough, smooth = (warp_field(mesh, centres(mesh), lines, 1.0, s).directions for s in (0.0, 3.0))
    off = lambda d: np.degrees(np.arccos(np.minimum(np.abs(d[:, 0]), 1))).mean()  # noqa: E731
    assert off(smooth) < 0.4 * off(rough)


def test_out_of_reach_it_follows_the_axis_of_a_cylinder():
    a, z = np.meshgrid(2 * np.pi * np.arange(40) / 40, np.linspace(0, 1, 20))
    v = np.column_stack([0.2 * np.cos(a.ravel()), 0.2 * np.sin(a.ravel()), z.ravel()])
    i = np.arange(800).reshape(20, 40)
    p, q, r, s = i[:-1].ravel(), np.roll(i, -1, 1)[:-1].ravel(), np.roll(i, -1, 1)[1:].ravel(), i[1:].ravel()
    mesh = TriangleMesh(v, np.vstack([np.column_stack([p, q, r]), np.column_stack([p, r, s])]))
    known = centres(mesh)[:5]
    field = warp_field(mesh, known, np.tile([0.0, 0.0, 1.0], (5, 1)), 0.05, 0.1)
    assert field.prior.mean() > 0.9
    assert np.abs(field.directions[:, 2]).min() > 0.98


def test_tensor_12():
    mesh = square()
    field = warp_field(mesh, centres(mesh), np.tile([1.0, 0.0, 0.0], (len(mesh.faces), 1)), 1.0)
    h = field.tensors(mesh)
    np.testing.assert_allclose(h, np.tile(np.diag([ETA * WARP, ETA * WEFT, 0.0]), (len(h), 1, 1)), atol=1e-9)


def test_mistakes_are_named():
    mesh = square(5)
    with pytest.raises(InputError, match="no direction"):
        warp_field(mesh, centres(mesh), np.zeros((len(mesh.faces), 3)), 1.0)
    with pytest.raises(InputError, match=r"\(n, 3\)"):
        warp_field(mesh, centres(mesh), np.zeros(3), 1.0)
    assert singularities(mesh, np.tile([0.0, 1.0, 0.0], (len(mesh.faces), 1))) == {}
