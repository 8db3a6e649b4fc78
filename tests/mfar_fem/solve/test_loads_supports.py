"""Loads and supports: sums, potentials against finite differences, closed forms."""

import numpy as np
import pytest

from mfar_fem.benchmarks.case import sheet
from mfar_fem.errors import InputError
from mfar_fem.loads import Foundation, Pressure, area_load, edge_load, edge_moment, gravity, nodal_force
from mfar_fem.solve import Problem, solve_static
from mfar_fem.supports import Clamp, Hinge, Support, Symmetry
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import annulus, cylinder, strip

orders = pytest.mark.parametrize("order", [1, 2])
PLATE = sheet(1e6, 0.0, 2e-3)  # EI per width 6.67e-4 N·m
D = 1e6 * 2e-3**3 / 12


def flat(order, nx=4, ny=2):
    return Surface.from_pattern(strip(0.3, 0.1, nx, ny), order)


def closed_sphere(order, radius=0.5):
    """Octahedron, once subdivided, on the sphere; normals outwards."""
    v = [np.array(p, float) for p in ((1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))]
    faces = [(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4), (1, 0, 5), (2, 1, 5), (3, 2, 5), (0, 3, 5)]
    middle, triangles = {}, []

    def mid(a, b):
        key = (min(a, b), max(a, b))
        if key not in middle:
            p = v[a] + v[b]
            v.append(p / np.linalg.norm(p))
            middle[key] = len(v) - 1
        return middle[key]

    for a, b, c in faces:
        ab, bc, ca = mid(a, b), mid(b, c), mid(c, a)
        triangles += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    vertices = radius * np.array(v)

    def midpoint(a, b):
        p = vertices[a] + vertices[b]
        return radius * p / np.linalg.norm(p, axis=1, keepdims=True)

    x = vertices[np.array(triangles)].mean(axis=1)
    warp = np.cross([0.1, 0.2, 1.0], x)
    return Surface(vertices, np.array(triangles), order, warp=warp, midpoint=midpoint)


def moved(problem, displacement, seed=0):
    state = problem.start()
    u = state.u.copy()
    u[: problem.shell.alpha_offset] += displacement * np.random.default_rng(seed).normal(size=problem.shell.alpha_offset)
    return state.with_u(u)


def load_gradient(load, problem, state, lam=1.0):
    g = np.zeros(problem.n)
    load.gradient(problem.shell, state, lam, g)
    return g


def forces(problem, state, lam=1.0):
    return problem.external_force(state, lam)[: problem.shell.alpha_offset].reshape(-1, 3)


@orders
def test_gravity_sums_to_the_weight(order):
    for surface, area in ((flat(order), 0.03), (Surface.from_pattern(annulus(0.1, 0.2, 2, 24), order), np.pi * 0.03)):
        problem = Problem(surface, PLATE, loads=[gravity(0.06)])
        total = forces(problem, problem.start()).sum(axis=0)
        assert total[:2] == pytest.approx(0.0, abs=1e-15)
        assert total[2] == pytest.approx(-0.06 * 9.80665 * area, rel=1e-12 if area == 0.03 else (2e-2 if order == 1 else 1e-4))


@orders
def test_loads_scale_with_the_load_factor_unless_told_not_to(order):
    problem = Problem(flat(order), PLATE, loads=[gravity(0.06), area_load((0.0, 0.0, 1.0), ramp=False)])
    f0, f1 = (forces(problem, problem.start(), lam)[:, 2].sum() for lam in (0.0, 1.0))
    assert f0 == pytest.approx(0.03) and f1 == pytest.approx(0.03 - 0.06 * 9.80665 * 0.03)


@orders
def test_edge_load_sums_to_force_times_length_of_a_curved_edge(order):
    surface = Surface.from_pattern(annulus(0.1, 0.2, 1, 12, angle=np.pi / 2), order)
    problem = Problem(surface, PLATE, loads=[edge_load("outer", (0.0, 3.0, 0.0))])
    total = forces(problem, problem.start()).sum(axis=0)
    assert total == pytest.approx([0.0, 3.0 * 0.2 * np.pi / 2, 0.0], rel=2e-3 if order == 1 else 1e-6, abs=1e-15)


def test_edge_load_off_the_boundary_is_an_error():
    with pytest.raises(InputError, match="no boundary edge"):
        Problem(flat(1), PLATE, loads=[edge_load([0], (0.0, 0.0, 1.0))])


@orders
def test_pressure_is_the_derivative_of_the_volume_of_a_closed_sphere(order):
    load = Pressure(7.0)
    problem = Problem(closed_sphere(order), PLATE, loads=[load])
    exact = 4 / 3 * np.pi * 0.5**3
    volume = -load.energy(problem.shell, problem.start(), 1.0) / 7.0
    assert volume == pytest.approx(exact, rel=0.4 if order == 1 else 0.02) and volume < exact
    state, h = moved(problem, 0.02), 1e-6
    v = np.random.default_rng(3).normal(size=problem.n)
    up, down = (load.energy(problem.shell, state.with_u(state.u + t * v), 1.0) for t in (h, -h))
    g = load_gradient(load, problem, state)
    assert (up - down) / (2 * h) == pytest.approx(g @ v, rel=1e-8)
    assert g[: problem.shell.alpha_offset].reshape(-1, 3).sum(axis=0) == pytest.approx(0.0, abs=1e-12)  # a closed surface


@orders
def test_pressure_tangent_on_a_closed_sphere(order):
    load = Pressure(7.0)
    problem = Problem(closed_sphere(order), PLATE, loads=[load])
    state, h = moved(problem, 0.02), 1e-6
    v = np.random.default_rng(4).normal(size=problem.n)
    _, with_load = problem.tangent(state, 1.0, True)
    _, without = problem.tangent(state, 0.0, True)
    K = problem.pattern.matrix(with_load - without)
    up, down = (load_gradient(load, problem, state.with_u(state.u + t * v)) for t in (h, -h))
    expected = (up - down) / (2 * h)
    assert np.linalg.norm(K @ v - expected) < 1e-6 * np.linalg.norm(expected)


@orders
@pytest.mark.parametrize("direction", [None, (0.0, 1.0, 1.0)])
def test_foundation_is_a_spring(order, direction):
    load = Foundation(50.0, direction)
    problem = Problem(flat(order), PLATE, loads=[load])
    u = problem.start().u.copy()
    u[: problem.shell.alpha_offset].reshape(-1, 3)[:] += [0.01, 0.02, 0.04]
    state = problem.start().with_u(u)
    expected = 0.5 * 50.0 * 0.03 * (0.0021 if direction is None else 0.06**2 / 2)
    assert load.energy(problem.shell, state, 0.0) == pytest.approx(expected, rel=1e-12)
    state, v = moved(problem, 0.02), np.random.default_rng(1).normal(size=problem.n)
    up, down = (load.energy(problem.shell, state.with_u(state.u + t * v), 0.0) for t in (1e-3, -1e-3))
    assert (up - down) / 2e-3 == pytest.approx(load_gradient(load, problem, state) @ v, rel=1e-8)
    g, data = np.zeros(problem.n), np.zeros(problem.pattern.nnz)
    load.hessian(problem.shell, state, 0.0, data, problem.pattern.positions[1], True)
    load.gradient(problem.shell, state, 0.0, g)
    assert problem.pattern.matrix(data) @ (state.u - problem.start().u) == pytest.approx(g, rel=1e-12, abs=1e-15)
    with pytest.raises(InputError):
        Foundation(-1.0)


@orders
def test_edge_moment_bends_a_strip_to_a_circle(order):
    moment = D * 2.0  # curvature 2 / m over 0.3 m
    problem = Problem(flat(order, 12, 1), PLATE, [Clamp("left")], [edge_moment("right", moment, axis=(0.0, -1.0, 0.0))])
    result = solve_static(problem, 1)
    assert result.converged
    tip = problem.shell.positions(result.state)[problem.surface.boundary["right"]].mean(axis=0)
    assert tip[2] == pytest.approx((1 - np.cos(0.6)) / 2.0, rel=2e-3)
    assert tip[0] == pytest.approx(np.sin(0.6) / 2.0, rel=2e-3)
    assert result.steps[-1].bending_energy == pytest.approx(0.5 * D * 4.0 * 0.03, rel=5e-3)


def test_edge_moment_needs_bending():
    with pytest.raises(InputError, match="no bending"):
        Problem(flat(1), PLATE, loads=[edge_moment("right", 1.0)], bending=False)


@orders
def test_reactions_balance_the_load(order):
    problem = Problem(flat(order), PLATE, [Clamp("left")], [nodal_force([flat(order).boundary["right"][0]], (0.0, 0.0, -1e-3))])
    result = solve_static(problem, 1)
    reaction = result.steps[-1].reaction[: problem.shell.alpha_offset].reshape(-1, 3).sum(axis=0)
    assert reaction == pytest.approx([0.0, 0.0, 1e-3], abs=1e-9)


@orders
def test_clamp_with_a_tilted_normal_turns_the_strip(order):
    """The strip on a tilted clamp is the strip on a level clamp under the load turned back."""
    slope, load = 0.4, np.array([0.0, 0.0, 0.02])
    R = np.array([[np.cos(slope), 0.0, -np.sin(slope)], [0.0, 1.0, 0.0], [np.sin(slope), 0.0, np.cos(slope)]])
    x = []
    for clamp, force in ((Clamp("left", normal=R[:, 2]), load), (Clamp("left"), R.T @ load)):
        problem = Problem(flat(order, 6, 1), PLATE, [clamp], [area_load(force)])
        result = solve_static(problem, 1)
        assert result.converged
        x.append(problem.shell.positions(result.state))
    assert x[0][-1, 2] > 0.1
    assert x[0] == pytest.approx(x[1] @ R.T, abs=1e-8)


@orders
def test_hinge_leaves_the_rotation_free(order):
    """A strip on two hinges under a small uniform load: w = 5 q L⁴ / 384 D; clamped it is five times stiffer."""
    surface = Surface.from_pattern(strip(0.3, 0.05, 24, 4), order)
    middle, q = np.flatnonzero(np.isclose(surface.vertices[:, 0], 0.15)), 1e-4
    for kind, factor in ((Hinge, 5.0), (Clamp, 1.0)):
        problem = Problem(surface, PLATE, [kind("left"), kind("right")], [area_load((0.0, 0.0, q))])
        result = solve_static(problem, 1)
        assert result.converged
        deflection = problem.shell.positions(result.state)[middle, 2].mean()
        assert deflection == pytest.approx(factor * q * 0.3**4 / (384 * D), rel=0.03 if order == 1 else 0.003)


@orders
def test_half_an_arch_with_symmetry_is_the_whole_arch(order):
    def solve(angle, n, supports, share):
        surface = Surface.from_pattern(cylinder(0.2, 0.1, angle, n, 1), order, (0.0, 1.0, 0.0))
        problem = Problem(surface, PLATE, supports, [area_load((0.0, 0.0, -0.5))])
        result = solve_static(problem, 1)
        assert result.converged
        crown = np.flatnonzero(np.abs(surface.nodes[:, 0]) < 1e-12)
        return problem.shell.positions(result.state)[crown, 2].mean(), result.steps[-1].bending_energy * share

    half = solve((0.0, 0.8), 8, [Symmetry("left", 0), Clamp("right")], 2.0)
    # the mesh of the whole is not the mirror image of the half: equal up to the discretisation
    whole = solve((-0.8, 0.8), 16, [Clamp("left"), Clamp("right")], 1.0)
    assert half[0] - 0.2 == pytest.approx(whole[0] - 0.2, rel=0.03)
    assert half[1] == pytest.approx(whole[1], rel=0.06)


def test_contradicting_supports_and_empty_ones_are_errors():
    with pytest.raises(InputError, match="two supports prescribe different"):
        Problem(flat(1), PLATE, [Hinge("left"), Hinge("left", displacement=(0.1, 0.0, 0.0))])
    with pytest.raises(InputError, match="no nodes"):
        Problem(flat(1), PLATE, [Support([], by_node=True)])


def test_prescribed_displacement_follows_the_load_factor():
    surface = flat(2)
    problem = Problem(surface, PLATE, [Hinge("left"), Hinge("right", displacement=(0.003, 0.0, 0.0)),
                                       Support(np.arange(len(surface.nodes)), (2,), by_node=True)], bending=False)
    result = solve_static(problem, [0.5, 1.0])
    x = [problem.shell.positions(s.state)[surface.boundary["right"], 0] for s in result.at_levels()]
    assert x[0] == pytest.approx(0.3015, rel=1e-12) and x[1] == pytest.approx(0.303, rel=1e-12)
