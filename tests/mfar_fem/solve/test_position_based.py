"""Position-based dynamics against closed forms, the elastica, finite elements of order 1 and its own promises."""

from __future__ import annotations

import numpy as np
import pytest

from material_tests import elastica
from mfar_fem.contact.body import Motion, Plane, Sphere
from mfar_fem.errors import InputError
from mfar_fem.loads import gravity
from mfar_fem.materials import Bending, Fabric
from mfar_fem.solve import Problem, position_kernels, solve_static
from mfar_fem.solve.position_based import PositionBased, PositionsNotFiniteError
from mfar_fem.supports import Clamp, Support, Symmetry
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import rectangle, strip

G = 9.80665
SILK = Fabric.load("silk-charmeuse")
CUPRO = Fabric.load("cupro-su1098")


def sheet(n=6, size=0.1, pattern="union", z=0.0):
    pattern = rectangle(n, n, (-size / 2, size / 2), (-size / 2, size / 2), pattern=pattern)
    pattern.vertices[:, 2] = z
    return Surface.from_pattern(pattern)


def distinct(items, colours):
    """Whether items of one colour share no node (-1: none)."""
    for c in np.unique(colours):
        nodes = items[colours == c].ravel()
        nodes = nodes[nodes >= 0]
        if len(np.unique(nodes)) < len(nodes):
            return False
    return True


@pytest.mark.parametrize("pattern", ["right", "union", "criss", "jitter"])
def test_colours_share_no_vertex(pattern):
    surface = sheet(9, pattern=pattern)
    model = PositionBased(surface, SILK, [Clamp("left")])
    patches = np.empty((len(surface.triangles), 6), dtype=int)
    patches[np.argsort(model.patch_colours, kind="stable")] = model._patches
    patches[patches >= len(surface.vertices)] = -1
    assert distinct(surface.triangles, model.triangle_colours)
    assert distinct(patches, model.patch_colours)
    assert distinct(surface.edges, model.edge_colours)
    assert not distinct(surface.edges, np.zeros(len(surface.edges)))
    tips = model._patches[:, 3:]
    assert np.count_nonzero(tips >= 0) == 2 * (len(surface.edges) - len(surface.boundary_edges)) + 9


def test_edge_kernel_is_formula_15():
    x, w = np.array([[0.0, 0, 0], [1.3, 0.4, -0.2]]), np.array([[2.0] * 3, [5.0] * 3])
    d = x[1] - x[0]
    C, n = np.linalg.norm(d) - 1.0, d / np.linalg.norm(d)
    want = x + np.array([2.0 * n, -5.0 * n]) * C / 7.0
    position_kernels._sweep_edges(x, np.array([[0, 1]]), np.array([1.0]), w)
    assert np.allclose(x, want, atol=1e-15)


@pytest.mark.parametrize("fabric", [SILK, CUPRO], ids=["silk", "cupro"])
def test_many_iterations_give_the_implicit_euler_step(fabric):
    """Residual of M (x - x̃)/dt² + dW/dx by the finite elements' membrane: what is left is quadratic in the step."""
    surface = sheet(3, 0.03)
    noise = np.random.default_rng(3).standard_normal(surface.vertices.shape)

    def residual(iterations, size):
        start = surface.vertices + 1e-5 * size * noise
        model = PositionBased(surface, fabric, [Support("left")], gravity=(0, 0, 0), dt=2e-4, substeps=1, iterations=iterations,
                              bending=False, start=start, velocity=(0.1 * size, 0.0, 0.0))
        predicted = start + model.dt * model.velocities
        model.step()
        problem = Problem(surface, fabric, [Support("left")], bending=False)
        u = problem.start().u.copy()
        u[: model.positions.size] = model.positions.ravel()
        force = problem.gradient(problem.start().with_u(u), 0.0)[: model.positions.size].reshape(-1, 3)
        gap = model.masses[:, None] * (model.positions - predicted) / model.dt**2 + force
        return np.abs(gap.ravel()[problem.free]).max() / np.abs(force).max()

    assert residual(1, 0.01) > 0.1
    assert residual(400, 0.01) < 1e-2
    assert residual(400, 0.001) < 0.12 * residual(400, 0.01)


def hung(fabric, cells, pattern, load, **options):
    """Elongation of a strip under a body force (m/s²), by position-based dynamics, and by finite elements of order 1."""
    surface = Surface.from_pattern(strip(0.1, 0.025, *cells, pattern))
    problem = Problem(surface, fabric, [Support("left")], [gravity(fabric.areal_density, (load, 0.0, 0.0))], bending=False)
    result = solve_static(problem, 1)
    assert result.converged
    tip = surface.boundary["right"]
    want = problem.shell.positions(result.state)[tip, 0].mean() - 0.1
    model = PositionBased(surface, fabric, [Support("left")], (load, 0.0, 0.0), mass_damping=60.0, **options)
    model.run(0.4)
    assert np.abs(model.velocities).max() < 1e-4
    return model, model.positions[tip, 0].mean() - 0.1, want


@pytest.mark.parametrize(("cells", "pattern", "options"), [
    ((12, 3), "right", {"dt": 1e-3}), ((12, 3), "right", {"dt": 4e-3}), ((12, 4), "union", {}), ((20, 5), "right", {}),
    ((6, 2), "right", {"substeps": 40}), ((6, 2), "right", {"substeps": 80})])
def test_elongation_is_that_of_the_law_for_any_step_and_mesh(cells, pattern, options):
    model, got, want = hung(SILK, cells, pattern, 200 * G, **options)
    assert model.excess_compliance == 0.0
    assert want > 2e-3
    assert got == pytest.approx(want, rel=0.01)


def test_softer_fabric_from_five_to_forty_substeps():
    law = SILK.law.replace(Ew=SILK.law.Ew / 100, Ef=SILK.law.Ef / 100, G=SILK.law.G / 100)
    got = [hung(SILK.replace(law=law), (10, 3), "right", 2 * G, substeps=n)[1] for n in (5, 10, 20, 40)]
    want = hung(SILK.replace(law=law), (10, 3), "right", 2 * G)[2]
    assert np.allclose(got, want, rtol=0.01)


def test_too_few_substeps_are_reported_as_softness():
    model, got, want = hung(SILK, (12, 3), "right", 20 * G, substeps=10)
    assert model.excess_compliance > 10
    assert 1.5 < got / want < 1.0 + model.excess_compliance


def test_yarn_network_near_locking():
    model, got, want = hung(CUPRO, (10, 4), "union", 400 * G)
    assert want > 1.5e-3
    assert got == pytest.approx(want, rel=0.01)
    assert np.isfinite(model.energies()["membrane"])


@pytest.mark.parametrize(("pattern", "angle", "tolerance"), [("right", 0.0, 0.9), ("right", 0.8, 0.9), ("union", 0.8, 1.0)])
def test_cantilever_droops_like_the_elastica(pattern, angle, tolerance):
    """Chord of 41.5 degrees: reached within a degree whatever the yarns' direction and the diagonals'."""
    fabric = SILK.replace(bending=Bending.from_rigidities(3.1e-6, 3.1e-6))
    length = elastica.overhang(3.1e-6, fabric.areal_density * G, np.radians(41.5))
    surface = Surface.from_pattern(strip(length, 0.02, 12, 4, pattern), 1, (np.cos(angle), -np.sin(angle), 0.0))
    model = PositionBased(surface, fabric, [Clamp("left")], mass_damping=10.0)
    model.run(1.0)
    tip = model.positions[surface.boundary["right"]].mean(axis=0)
    assert np.degrees(np.arctan2(-tip[2], tip[0])) == pytest.approx(41.5, abs=tolerance)


def test_curvature_of_quadratic_shapes_is_exact_on_a_lattice():
    surface, D = sheet(6, pattern="right"), SILK.replace(bending=Bending(3e-6, 2e-6, 1e-6, 0.5e-6))
    model = PositionBased(surface, D)
    full = (model._patches >= 0).all(axis=1)
    k = np.array([0.3, -0.2, 0.25])  # k11, k22, k12
    X, Y, _ = model._reference.T
    model._x[:, 2] = 1e-3 * (0.5 * k[0] * X**2 + 0.5 * k[1] * Y**2 + k[2] * X * Y)
    theta = np.zeros_like(model._rest)
    position_kernels.angles(model._x, model._patches, model._floor, theta)
    energy = 0.5 * np.einsum("ea,eab,eb->e", theta, model._Q, theta)[full] / surface.areas[0]
    curvature = 1e-3 * np.array([k[0], k[1], 2 * k[2]])
    assert np.allclose(energy, 0.5 * curvature @ D.bending.matrix @ curvature, rtol=1e-6)


def test_bending_gradient_is_that_of_the_angle():
    rng = np.random.default_rng(0)
    x = rng.standard_normal((4, 3))
    _, *g = position_kernels._hinge(x, 0, 1, 2, 3, 1e-9)
    gc, gd, s, t = np.array(g[:3]), np.array(g[3:6]), g[6], g[7]
    gradient = np.array([-(1 - s) * gc - (1 - t) * gd, -s * gc - t * gd, gc, gd])
    for i in range(4):
        for c in range(3):
            ends = []
            for h in (1e-6, -1e-6):
                y = x.copy()
                y[i, c] += h
                ends.append(position_kernels._hinge(y, 0, 1, 2, 3, 1e-9)[0])
            assert (ends[0] - ends[1]) / 2e-6 == pytest.approx(gradient[i, c], abs=1e-7)


def test_free_fall():
    """Velocity g t exactly; the way is that of symplectic Euler, ½ g t (t + dt/substeps); no deformation."""
    model = PositionBased(sheet(4), SILK)
    model.run(0.1)
    h = model.dt / model.substeps
    assert np.allclose(model.velocities, [0, 0, -G * 0.1], atol=1e-10)
    assert np.allclose(model.positions - model.surface.vertices, [0, 0, -0.5 * G * 0.1 * (0.1 + h)], atol=1e-12)


def test_momentum_without_supports():
    rng = np.random.default_rng(1)
    surface = sheet(5)
    start = surface.vertices + 2e-3 * rng.standard_normal(surface.vertices.shape)
    model = PositionBased(surface, SILK, gravity=(0, 0, 0), start=start, velocity=0.5 * rng.standard_normal(start.shape))
    before = model.masses @ model.velocities
    scale = model.masses @ np.abs(model.velocities)
    model.run(0.1)
    assert np.abs(model.masses @ model.velocities - before).max() < 1e-11 * scale.max()


@pytest.mark.parametrize("n", [3, 6])
def test_terminal_velocity(n):
    model = PositionBased(sheet(n), SILK, drag_normal=0.6)
    model.run(3.0)
    assert np.allclose(model.velocities[:, 2], -np.sqrt(SILK.areal_density * G / 0.6), rtol=2e-3)
    up = PositionBased(sheet(n), SILK, drag_normal=0.6, drag_tangential=0.1, gravity=(0, 0, 0),
                       air_velocity=lambda x, t: np.tile([0.5, 0.0, 1.0], (len(x), 1)))
    up.run(0.5)
    v = up.velocities.mean(axis=0)
    gamma_t, t = 0.1 * 0.5 / SILK.areal_density, 0.6 / SILK.areal_density  # v' = γ/ρ (u - v)², v = u - u/(1 + γ u t/ρ)
    assert v[0] == pytest.approx(0.5 - 0.5 / (1 + gamma_t * 0.5), rel=5e-3)
    assert v[2] == pytest.approx(1.0 - 1.0 / (1 + t * 0.5), rel=5e-3)


@pytest.mark.parametrize("degrees", [10.0, 15.0, 19.0, 30.0])
def test_inclined_plane(degrees):
    """Friction 0.3 holds up to 16.7 degrees; above the sheet slides with g (sin - 0.3 cos)."""
    a = np.radians(degrees)
    flat = rectangle(3, 3, (0, 0.05), (0, 0.05))
    rotation = np.array([[np.cos(a), 0, -np.sin(a)], [0, 1, 0], [np.sin(a), 0, np.cos(a)]])
    surface = Surface(flat.vertices @ rotation.T, flat.triangles)
    plane = Plane((0, 0, 0), rotation[:, 2], friction=0.3)
    model = PositionBased(surface, SILK, bodies=[plane])
    model.run(0.2)
    moved = (model.positions - surface.vertices) @ -rotation[:, 0]
    want = 0.5 * max(0.0, G * (np.sin(a) - 0.3 * np.cos(a))) * 0.2**2
    assert np.allclose(moved, want, rtol=0.02, atol=1e-5)


def test_sphere_drape_and_resume_bit_by_bit():
    def build():
        return PositionBased(sheet(10, 0.3, z=2e-3), SILK, bodies=[Sphere((0, 0, -0.08), 0.08, friction=0.3)], thickness=1e-3,
                             drag_normal=0.6)

    model, nearest = build(), []
    states = {}

    def watch(m):
        nearest.append(m.bodies[0].signed_distance(m.positions)[0].min())
        if m.steps == 60:
            states.update(m.state_dict())

    model.run(0.3, watch)
    assert min(nearest) > 1e-3 - 1e-9
    assert model.positions[:, 2].min() < -0.06
    again = build()
    again.load_state_dict(states)
    again.run(0.3 - again.time)
    assert again.steps == model.steps == 150
    assert np.array_equal(again.positions, model.positions)
    assert np.array_equal(again.velocities, model.velocities)
    with pytest.raises(InputError, match="positions"):
        PositionBased(sheet(4), SILK).load_state_dict(states)


def test_body_that_moves_five_centimetres_in_a_step():
    sphere = Sphere((0, 0, -0.06), 0.05, motion=Motion([0.0, 0.01, 0.012], [(0, 0, 0), (0, 0, 0), (0, 0, 0.05)]))
    model = PositionBased(sheet(8), SILK, bodies=[sphere], thickness=5e-4)
    model.run(0.03, lambda m: np.testing.assert_array_less(
        5e-4 - 1e-9, sphere.signed_distance(m.positions, m.time)[0]))
    assert model.positions[:, 2].max() > 0.03


def test_pins_and_displaced_supports():
    surface = sheet(4)
    corner = np.array([0])
    model = PositionBased(surface, SILK, [Support("right", displacement=(1e-3, 0, 0))], ramp=0.02,
                          pins=[(corner, lambda t: np.array([0.0, 0.0, 0.1 * t]))])
    model.run(0.04)
    right = surface.boundary["right"]
    assert np.allclose(model.positions[right], surface.vertices[right] + [1e-3, 0, 0], atol=1e-12)
    assert np.allclose(model.positions[0], surface.vertices[0] + [0, 0, 0.004], atol=1e-12)


def test_self_contact_keeps_layers_apart():
    """A strip folded over itself, lying on a plane: the upper layer comes to rest on the lower one."""
    surface = Surface.from_pattern(rectangle(24, 4, (0.0, 0.12), (0.0, 0.02)))
    s, r, fold = surface.vertices[:, 0], 0.004, 0.056
    turn = np.clip((s - fold) / r, 0.0, np.pi)
    start = surface.vertices.copy()
    start[:, 0] = np.minimum(s, fold) + r * np.sin(turn) - np.maximum(s - fold - np.pi * r, 0.0)
    start[:, 2] = r * (1.0 - np.cos(turn)) + 1e-3
    layers = {}
    for on in (False, True):
        model = PositionBased(surface, SILK, bodies=[Plane(friction=0.3)], thickness=5e-4, self_contact=on, self_distance=1.5e-3,
                              start=start, mass_damping=5.0, substeps=20)
        model.run(0.3)
        layers[on] = model.positions[s > 0.102, 2]  # beyond the loop that the fold makes
    assert layers[True].min() > 5e-4 + 1.3e-3
    assert layers[True].max() < 5e-3
    assert layers[False].min() < 1e-3


def test_inextensible_edges():
    surface = Surface.from_pattern(strip(0.1, 0.02, 10, 2, "right"))
    model = PositionBased(surface, SILK, [Support("left")], (100.0, 0, 0), constraints=("edges",), substeps=20, iterations=20,
                          mass_damping=20.0)
    model.run(0.2)
    a, b = surface.edges.T
    stretch = np.linalg.norm(model.positions[b] - model.positions[a], axis=1) / surface.edge_lengths - 1
    assert np.abs(stretch).max() < 2e-3


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("fabric", [SILK, CUPRO], ids=["silk", "cupro"])
@pytest.mark.parametrize("substeps", [2, 20])
def test_random_states_stay_finite(fabric, substeps, seed):
    rng = np.random.default_rng(seed)
    surface = sheet(4)
    start = surface.vertices * rng.uniform(0.2, 1.3, 3) + rng.choice([1e-3, 0.03]) * rng.standard_normal(surface.vertices.shape)
    model = PositionBased(surface, fabric, [Clamp("left")], bodies=[Sphere((0, 0, 0), 0.03, friction=0.5)], start=start,
                          velocity=20.0 * rng.standard_normal(start.shape), substeps=substeps, drag_normal=1.0)
    model.run(0.1)
    assert np.isfinite(model.positions).all()
    assert np.abs(model.positions).max() < 10.0


def test_numbers_that_run_away_are_a_named_error():
    model = PositionBased(sheet(3), SILK)
    kept = model.positions.copy()
    model.velocities[0, 0] = np.inf
    with pytest.raises(PositionsNotFiniteError, match="not finite"):
        model.step()
    assert np.array_equal(model.positions, kept)


@pytest.mark.parametrize(("options", "word"), [({"dt": 0.0}, "dt"), ({"thickness": -1.0}, "thickness"),
                                              ({"constraints": ("strian",)}, "strian"), ({"iterations": 0}, "iterations"),
                                              ({"supports": [Symmetry("left", 0)]}, "mirror")])
def test_wrong_input(options, word):
    with pytest.raises(InputError, match=word):
        PositionBased(sheet(3), SILK, **options)
