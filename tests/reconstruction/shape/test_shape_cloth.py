"""The hanging cloth against what is known of it."""

import numpy as np
import pytest

from reconstruction.shape.cloth import Cloth, ClothSettings, _unstretched
from reconstruction.shape.mannequin import Mannequin, mannequin
from reconstruction.shape.sewn import sew
from reconstruction.template.dimensions import RibbonDimensions


def strip(length=1.0, width=0.1, edge=0.025):
    return sew("flying-ribbon", RibbonDimensions(length, width), edge)


def test_the_nearest_gradient_without_stretch_is_that_of_the_singular_values():
    f = np.random.default_rng(0).normal(size=(200, 3, 2))
    u, s, v = np.linalg.svd(f, full_matrices=False)
    exact = np.einsum("fik,fk,fkj->fij", u, np.clip(s, 0.9, 1.0), v)
    np.testing.assert_allclose(_unstretched(f, 0.9), exact, atol=1e-9)


def test_a_rigid_motion_costs_nothing():
    sewn = strip()
    q = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    start = np.column_stack([sewn.uv, np.zeros(len(sewn.uv))]) @ q.T + (1.0, 2.0, 3.0)
    cloth = Cloth(sewn, start, None)
    assert cloth.step(gravity=0.0) < 1e-12
    np.testing.assert_allclose(cloth.stretches(), 1.0, atol=1e-12)


def test_it_falls_freely():
    """Implicit Euler without damping: after n steps the fall is g dt² n (n + 1) / 2."""
    sewn = strip()
    start = np.column_stack([sewn.uv, np.zeros(len(sewn.uv))])
    cloth = Cloth(sewn, start, None, ClothSettings(keep=1.0, dt=0.01))
    for _ in range(5):
        cloth.step()
    np.testing.assert_allclose(cloth.x[:, 2], -9.81 * 1e-4 * 15, rtol=1e-9)


def test_a_strip_held_at_one_end_hangs_down_at_its_length():
    sewn = strip(0.6)
    start = np.column_stack([sewn.uv, np.zeros(len(sewn.uv))])
    held = np.where(sewn.uv[:, 0] < -0.3 + 1e-9, 500.0, 0.0)
    cloth = Cloth(sewn, start, None, ClothSettings(bending=1e-6, keep=0.95, inner=30))  # few iterations damp turning
    for _ in range(400):
        moved = cloth.step(held, start)
    free = cloth.x[sewn.uv[:, 0] > 0.3 - 1e-9]
    assert moved < 1e-3
    assert free[:, 2].mean() == pytest.approx(-0.6, abs=0.025)
    assert cloth.stretches().max() < 1.02


def test_bending_of_a_cylinder():
    """Energy density k/2 (1/R)²: x^T B x is k A / R² for a strip bent to a radius, away from its free edges."""
    sewn = strip(1.0, 0.5, 0.02)
    radius, k = 0.3, 1e-3
    sewn.openings.clear()
    cloth = Cloth(sewn, np.zeros((len(sewn.uv), 3)), None, ClothSettings(bending=k))
    angle = sewn.uv[:, 0] / radius
    x = np.column_stack([radius * np.sin(angle), sewn.uv[:, 1], radius * np.cos(angle)])
    force = cloth.bending(cloth.laplacian) @ x
    inner = (np.abs(sewn.uv) < (0.4, 0.15)).all(axis=1)
    # the bilaplacian of R (sin, cos) is itself over R^4: force density k / R^3 towards outside
    density = force[inner] / cloth.vertex_area[inner, None]
    exact = k / radius**4 * np.column_stack([x[inner, 0], 0 * x[inner, 1], x[inner, 2]])
    assert np.linalg.norm(density.mean(axis=0) - exact.mean(axis=0)) < 0.02 * np.linalg.norm(exact.mean(axis=0))


def test_a_figure_stops_it():
    body = Mannequin(1.7, np.zeros(2))
    sewn = strip(0.8, 0.3, 0.025)
    head = 1.7 * (0.935 + 0.066 - 0.835)
    start = np.column_stack([sewn.uv, np.full(len(sewn.uv), head + 0.02)])
    cloth = Cloth(sewn, start, body, ClothSettings(keep=0.9, inner=20, bending=1e-4))
    for _ in range(100):
        cloth.step()
    assert body.distance(cloth.x).min() > 0.0
    assert cloth.x[:, 2].max() > head  # it lies on the head
    assert cloth.x[:, 2].min() < head - 0.15  # and hangs down at its sides


def test_distance_of_the_figure_has_unit_slope_near_its_surface():
    arm = np.array([[0.2, 0, -0.05], [0.5, -0.1, -0.1], [0.8, -0.2, -0.2]])
    body = mannequin(1.7, (arm, arm * (-1, 1, 1)))
    mesh = body.mesh()
    assert len(mesh.boundary_edges) == 0
    rng = np.random.default_rng(0)
    near = mesh.vertices[rng.integers(0, len(mesh.vertices), 400)]
    out = body.outwards(near)
    slope = (body.distance(near + 2e-3 * out) - body.distance(near - 2e-3 * out)) / 4e-3
    assert np.median(slope) == pytest.approx(1.0, abs=0.1) and np.percentile(slope, 5) > 0.6
    assert np.abs(body.distance(mesh.vertices)).max() < 0.012  # less than a cell of the grid
