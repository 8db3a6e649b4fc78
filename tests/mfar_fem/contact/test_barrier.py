"""The barrier: derivatives, the guarantee of no intersection, start errors, equilibrium, friction, moving bodies."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_matrix

from mfar_fem.errors import InputError, MissingDependencyError
from mfar_fem.loads import GRAVITY, gravity
from mfar_fem.materials import Bending, Fabric, StVenantKirchhoff
from mfar_fem.shell import Shell
from mfar_fem.solve import Problem, solve_static
from mfar_fem.solve.newton import newton
from mfar_fem.solve.problem import InadmissibleStateError
from mfar_fem.supports import Hinge
from mfar_fem.surface import Surface, patterns

ipctk = pytest.importorskip("ipctk")
from mfar_fem.contact.barrier import Barrier  # noqa: E402
from mfar_fem.contact.body import Plane, Sphere  # noqa: E402
from mfar_fem.contact.collision_mesh import subdivide  # noqa: E402
from mfar_fem.contact.motion import Motion  # noqa: E402
from mfar_fem.contact.start import IntersectingStartError  # noqa: E402

CLOTH = Fabric("cloth", StVenantKirchhoff.isotropic(1e6, 0.3), 2e-4, 0.1, Bending(2e-6, 1e-6, 1.5e-6, 0.3e-6))
DHAT = 2e-3


def sheet(order: int = 1, cells: int = 4, size: float = 0.1, bending: bool = False) -> Shell:
    """A square sheet about the origin, in the plane z = 0."""
    half = 0.5 * size
    pattern = patterns.rectangle(cells, cells, (-half, half), (-half, half))
    return Shell(Surface.from_pattern(pattern, order), CLOTH, bending=bending)


def lifted(shell: Shell, height, noise: float = 0.0, seed: int = 0):
    """The flat sheet at z = ``height`` (a number or a function of x, y), its nodes moved by up to ``noise`` (m)."""
    state = shell.reference_state()
    u, k = state.u.copy(), shell.alpha_offset
    x = u[:k].reshape(-1, 3)
    x[:, 2] = height(x[:, 0], x[:, 1]) if callable(height) else height
    u[:k] += noise * np.random.default_rng(seed).uniform(-1, 1, k)
    return state.with_u(u)


def bound(shell: Shell, *bodies, **options) -> Barrier:
    size = 1.5 * float(shell.surface.edge_lengths.mean()) / shell.surface.order
    barrier = Barrier(bodies, **{"dhat": DHAT, "stiffness": 50.0, "body_size": size, **options})
    barrier.bind(shell)
    return barrier


def folded(shell: Shell, gap: float, seed: int = 0):
    """The sheet folded over its middle, its halves ``gap`` apart and roughened."""
    def fold(x, y):
        return np.where(x > 0.0, gap, 0.0)

    state = lifted(shell, fold, 0.1 * gap, seed)
    x = shell.positions(state)
    right = x[:, 0] > 1e-9
    x[right, 0] = -x[right, 0] + 0.002
    return state


def gradient_of(barrier: Barrier, shell: Shell, state) -> np.ndarray:
    g = np.zeros(shell.n)
    barrier.gradient(shell, state, 1.0, g)
    return g


def hessian_of(barrier: Barrier, shell: Shell, state, psd: bool = True) -> np.ndarray:
    rows, columns, values = barrier.sparse_hessian(shell, state, 1.0, psd)
    return coo_matrix((values, (rows, columns)), shape=(shell.n, shell.n)).toarray()


def over_sphere(order: int, **options):
    """A rough sheet a little above the top of a sphere, near and far contacts."""
    shell = sheet(order)
    barrier = bound(shell, Sphere((0.003, -0.002, -0.05), 0.05, name="ball", friction=0.4), **options)
    return shell, barrier, lifted(shell, lambda x, y: 0.001 + barrier.min_distance - 8.0 * (x**2 + y**2), 2e-4)


CASES = {
    "body, order 1": lambda: over_sphere(1),
    "body, order 2": lambda: over_sphere(2),
    "body, order 2, displacement map": lambda: over_sphere(2, subdivision=3),
    "body, distance kept": lambda: over_sphere(1, min_distance=4e-4),
    "self-contact": lambda: (s := sheet(1), bound(s, self_contact=True), folded(s, 0.0012)),
    "self-contact, order 2": lambda: (s := sheet(2), bound(s, self_contact=True, subdivision=4, dhat=1.5e-3), folded(s, 0.0009)),
}


def check_derivatives(barrier: Barrier, shell: Shell, state) -> None:
    rng = np.random.default_rng(1)
    g, H = gradient_of(barrier, shell, state), hessian_of(barrier, shell, state, psd=False)
    assert np.abs(g).max() > 1e-4
    for _ in range(3):
        d = np.zeros(shell.n)
        d[: shell.alpha_offset] = rng.normal(size=shell.alpha_offset)
        h = 2e-9
        ends = [state.with_u(state.u + s * h * d) for s in (1, -1)]
        slope = (barrier.energy(shell, ends[0], 1.0) - barrier.energy(shell, ends[1], 1.0)) / (2 * h)
        assert slope == pytest.approx(g @ d, rel=2e-5, abs=1e-6 * np.abs(g).max())
        change = (gradient_of(barrier, shell, ends[0]) - gradient_of(barrier, shell, ends[1])) / (2 * h)
        assert np.abs(change - H @ d).max() <= 2e-5 * np.abs(H @ d).max()


@pytest.mark.parametrize("case", CASES)
def test_derivatives_against_finite_differences(case):
    shell, barrier, state = CASES[case]()
    assert barrier.report(shell, state).pairs > 10
    check_derivatives(barrier, shell, state)
    P = hessian_of(barrier, shell, state)
    assert np.abs(P - P.T).max() <= 1e-12 * np.abs(P).max()
    assert np.linalg.eigvalsh(P)[0] >= -1e-10 * np.abs(P).max()


@pytest.mark.parametrize("order", [1, 2])
def test_friction_derivatives_in_a_step(order):
    shell = sheet(order)
    path = Motion([0.0, 0.1], [[0.0, 0.0, 0.0], [2e-3, 0.0, 0.0]])
    barrier = bound(shell, Sphere((0.003, -0.002, -0.05), 0.05, friction=0.4, motion=path))
    state = lifted(shell, lambda x, y: 0.001 - 8.0 * (x**2 + y**2), 2e-4)
    assert barrier.begin_step(shell, state, state, 0.0, 0.01, 0.01) == 1.0
    moved = state.with_u(state.u + 1e-5 * np.random.default_rng(2).normal(size=shell.n))
    without = bound(shell, Sphere((0.003, -0.002, -0.05), 0.05, friction=0.0, motion=path))
    without.begin_step(shell, state, state, 0.0, 0.01, 0.01)
    assert np.abs(gradient_of(barrier, shell, moved) - gradient_of(without, shell, moved)).max() > 1e-4
    check_derivatives(barrier, shell, moved)


def test_subdivision_follows_the_quadratic_surface():
    pattern = patterns.sphere(0.2, (0.0, 1.0), (0.0, 1.0), 4, 4)
    away = []
    for count in (2, 4, 8):
        pieces = subdivide(Surface.from_pattern(pattern, 2), count)
        surface = Surface.from_pattern(pattern, 2)
        points = pieces.map @ surface.nodes
        away.append(np.abs(np.linalg.norm(points[pieces.triangles].mean(axis=1), axis=1) - 0.2).max())
        assert len(np.unique(points.round(12), axis=0)) == len(points)
    assert away[0] > 3 * away[1] > 0 and away[2] < away[1]


# -- the guarantee -------------------------------------------------------------------------------------------------------------
@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), length=st.floats(1e-4, 0.3), order=st.sampled_from([1, 2]), fold=st.booleans())
def test_steps_cut_at_collisions_never_intersect(seed, length, order, fold):
    shell = sheet(order, 3)
    if fold:
        barrier, state = bound(shell, self_contact=True), folded(shell, 0.0012)
    else:
        barrier, state = bound(shell, Sphere((0.0, 0.0, -0.05), 0.05), Plane((0.0, 0.0, -0.02))), lifted(shell, 0.003, 1e-3, seed)
    rng = np.random.default_rng(seed)
    assert not barrier.has_intersections(shell, state)
    for _ in range(3):
        step = np.zeros(shell.n)
        step[: shell.alpha_offset] = length * (rng.normal(size=3) + 0.3 * rng.normal(size=(len(shell.surface.nodes), 3))).ravel()
        fraction = barrier.max_step(shell, state, step)
        assert 0.0 < fraction <= 1.0
        state = state.with_u(state.u + fraction * step)
        assert not barrier.has_intersections(shell, state)
        assert np.isfinite(barrier.energy(shell, state, 1.0))
        assert np.all(np.isfinite(gradient_of(barrier, shell, state)))


def test_a_free_step_is_granted_whole_and_a_long_one_is_stopped_at_the_ball():
    shell = sheet(1, 10)
    barrier = bound(shell, Sphere((0.0, 0.0, -0.3), 0.1, name="ball"))
    state = lifted(shell, 0.0)
    step = np.zeros(shell.n)
    step[2: shell.alpha_offset: 3] = -0.19
    assert barrier.max_step(shell, state, step) == 1.0
    fraction = barrier.max_step(shell, state, 5 * step)  # the top of the ball is 0.2 m below
    assert 0.9 < fraction * 5 * 0.19 / 0.2 < 1.0


def test_energy_is_infinite_where_surfaces_intersect_or_touch_and_nothing_is_nan():
    shell = sheet(1, 6)
    barrier = bound(shell, Sphere((0.0, 0.0, -0.05), 0.05))
    low, top = lifted(shell, -0.02), barrier.mesh.rest[barrier.mesh.n_sheet:, 2].max()
    for state in (low, lifted(shell, top), lifted(shell, np.nan)):
        assert barrier.energy(shell, state, 1.0) == np.inf
        assert np.all(np.isfinite(gradient_of(barrier, shell, state)))
    with pytest.raises(InadmissibleStateError):
        barrier.sparse_hessian(shell, lifted(shell, top), 1.0)
    with pytest.raises(InadmissibleStateError):
        barrier.max_step(shell, low, np.ones(shell.n))
    kept = bound(shell, Sphere((0.0, 0.0, -0.05), 0.05), min_distance=1e-3)
    assert kept.energy(shell, lifted(shell, top + 0.9e-3), 1.0) == np.inf
    assert np.isfinite(kept.energy(shell, lifted(shell, top + 1.2e-3), 1.0))


def test_a_sheet_inside_a_closed_body_is_no_free_state():
    shell = sheet(1, 4, 0.02)
    barrier = bound(shell, Sphere((0.0, 0.0, 0.0), 0.1, name="ball"))
    assert barrier.energy(shell, lifted(shell, 0.0), 1.0) == np.inf
    assert barrier.energy(shell, lifted(shell, 0.2), 1.0) == 0.0
    with pytest.raises(IntersectingStartError, match="inside body 'ball'"):
        barrier.check_start(shell, lifted(shell, 0.0))


# -- starts --------------------------------------------------------------------------------------------------------------------
def test_start_errors_name_pairs_and_what_would_do():
    shell = sheet(1, 6)
    barrier = bound(shell, Sphere((0.0, 0.0, -0.05), 0.05, name="ball"), Plane((0.0, 0.0, -0.04), name="table"))
    with pytest.raises(IntersectingStartError, match=r"body 'ball'.*move it by at least 2\d(\.\d+)? mm") as error:
        barrier.check_start(shell, lifted(shell, -0.02))
    assert {name for _, name in error.value.pairs} == {"ball"}
    assert all(0 <= element < len(shell.surface.triangles) for element, _ in error.value.pairs)
    with pytest.raises(IntersectingStartError, match=r"touches.*body 'table'") as error:
        barrier.check_start(shell, lifted(shell, lambda x, y: np.where(np.hypot(x, y) < 0.06, 0.01, -0.04 + 1e-7)))
    assert error.value.distance == pytest.approx(1e-7, rel=1e-3)
    assert isinstance(error.value, InputError)
    barrier.check_start(shell, lifted(shell, 0.003))


def test_reference_sheet_finer_than_dhat_is_refused_with_self_contact():
    with pytest.raises(IntersectingStartError, match=r"use dhat <= 3\.\d* mm") as error:
        bound(sheet(1, 20), self_contact=True, dhat=6e-3)
    assert error.value.pairs and error.value.distance == pytest.approx(0.005 / np.sqrt(2), rel=1e-6)
    bound(sheet(1, 20), dhat=6e-3)


@pytest.mark.parametrize("wrong", [{"dhat": 0.0}, {"dhat": np.nan}, {"stiffness": -1.0}, {"friction": -0.1}, {"eps_v": 0.0},
                                   {"min_distance": -1e-3}, {"broad_phase": "magic"}, {"collision_detection": "none"}])
def test_values_that_make_no_sense_are_refused(wrong):
    with pytest.raises(InputError):
        Barrier([Sphere()], **wrong)


def test_without_ipctk_the_message_says_how_to_install_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "ipctk", None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'mfar-fem\[contact\]'"):
        Barrier([Sphere()])


# -- equilibrium and motion ------------------------------------------------------------------------------------------------------
def implicit_euler(shell, barrier, state, velocity, t, dt, loads=(), tolerance=1e-10, limit=200):
    """One step by a dense Newton method, membrane only; returns state and velocity (n,)."""
    mass = np.full(shell.n, CLOTH.areal_density * shell.surface.areas.sum() / len(shell.surface.nodes))
    fraction = barrier.begin_step(shell, state, state, t, t + dt, dt)
    start = state
    goal = state.u + dt * velocity
    for _ in range(20):
        if fraction < 1.0:
            fraction, state = barrier.advance(shell, state)
        for _ in range(limit):
            g = mass * (state.u - goal) / dt**2
            K = np.diag(mass) / dt**2
            shell.gradient(state, g)
            for load in (*loads, barrier):
                load.gradient(shell, state, 1.0, g)
            if np.abs(g).max() < tolerance:
                break
            K += membrane_stiffness(shell, state) + hessian_of(barrier, shell, state)
            step = -np.linalg.solve(K, g)
            a = barrier.max_step(shell, state, step)

            def total(s, a=a):
                d = s.u - goal
                return 0.5 * d @ (mass * d) / dt**2 + shell.energy(s) + sum(x.energy(shell, s, 1.0) for x in (*loads, barrier))

            old, slope = total(state), float(g @ step)
            while total(state.with_u(state.u + a * step)) > old + 1e-4 * a * slope + 1e-13 * abs(old) and a > 1e-12:
                a *= 0.5
            state = state.with_u(state.u + a * step)
        else:
            raise AssertionError(f"Newton did not converge: {np.abs(g).max():.3g} N")
        if fraction == 1.0:
            break
    assert fraction == 1.0
    barrier.end_step(shell, state)
    return state, (state.u - start.u) / dt


def membrane_stiffness(shell, state):
    from mfar_fem.assembly import Pattern

    pattern = Pattern(shell.n, [shell.element_dofs])
    data, g = np.zeros(pattern.nnz), np.zeros(shell.n)
    shell.hessian(state, g, data, pattern.positions[0], False)
    return pattern.matrix(data).toarray()


@pytest.mark.parametrize("order", [1, 2])
def test_a_sheet_at_rest_on_a_plane_presses_with_its_weight(order):
    """Static equilibrium with bending: nothing but the plane carries it."""
    surface = Surface.from_pattern(patterns.rectangle(4, 4, (-0.025, 0.025), (-0.025, 0.025)), order)
    barrier = Barrier([Plane(name="table")], dhat=1e-3)
    middle = np.argmin(np.linalg.norm(surface.nodes, axis=1))
    edge = np.argmin(np.linalg.norm(surface.nodes - [0.025, 0.0, 0.0], axis=1))
    supports = [Hinge([middle], (0, 1), by_node=True), Hinge([edge], (1,), by_node=True)]
    problem = Problem(surface, CLOTH, supports, [gravity(CLOTH.areal_density), barrier])
    result = solve_static(problem, start=lifted(problem.shell, 0.0006), start_lam=0.5)
    assert result.converged, result.message
    report = barrier.report(problem.shell, result.state)
    assert report.forces[0] == pytest.approx([0.0, 0.0, CLOTH.areal_density * 0.05**2 * GRAVITY[2]], rel=1e-6, abs=2.5e-9)
    assert 0.2e-3 < report.least_distance < 0.8e-3
    assert not barrier.has_intersections(problem.shell, result.state)


@pytest.mark.parametrize("angle, sticks", [(15.0, True), (25.0, False)])
def test_a_patch_on_a_slope_sticks_below_the_friction_angle_and_slides_above(angle, sticks):
    """Friction angle 20°: below it creeps slower than eps_v; above it accelerates by g (sin a - mu cos a)."""
    mu, a, dt, steps = np.tan(np.radians(20.0)), np.radians(angle), 2e-3, 40
    shell = sheet(1, 2, 0.02)
    barrier = bound(shell, Plane(friction=mu, name="slope", extent=0.3), stiffness=None, dhat=1e-3)
    pull = gravity(CLOTH.areal_density, 9.80665 * np.array([np.sin(a), 0.0, -np.cos(a)]))
    pull.bind(shell)
    state, velocity = lifted(shell, 0.0006), np.zeros(shell.n)
    hold = gravity(CLOTH.areal_density, 9.80665 * np.array([0.0, 0.0, -np.cos(a)]))
    hold.bind(shell)
    for i in range(10):  # settle before it is let go
        state, _ = implicit_euler(shell, barrier, state, 0 * velocity, i * dt, dt, [hold], tolerance=1e-9)
    speeds = []
    for i in range(10, 10 + steps):
        state, velocity = implicit_euler(shell, barrier, state, velocity, i * dt, dt, [pull], tolerance=1e-9)
        speeds.append(velocity[: shell.alpha_offset].reshape(-1, 3)[:, 0].mean())
    if sticks:
        assert max(np.abs(speeds)) < 1e-3
    else:
        expected = 9.80665 * (np.sin(a) - mu * np.cos(a))
        assert (speeds[-1] - speeds[9]) / ((steps - 10) * dt) == pytest.approx(expected, rel=0.05)


def test_a_moving_plane_drags_the_sheet_along_by_friction():
    """A belt of speed 0.05 m/s under a sheet at rest: acceleration mu g until it goes along."""
    dt, mu = 2e-3, 0.3
    shell = sheet(1, 2, 0.02)
    belt = Plane(friction=mu, extent=0.5, motion=Motion([0.0, 10.0], [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]]))
    barrier = bound(shell, belt, stiffness=None, dhat=1e-3)
    weight = gravity(CLOTH.areal_density)
    weight.bind(shell)
    state, velocity = lifted(shell, 0.0006), np.zeros(shell.n)
    for i in range(30):
        state, velocity = implicit_euler(shell, barrier, state, velocity, i * dt, dt, [weight], tolerance=1e-9)
    assert velocity[: shell.alpha_offset].reshape(-1, 3)[:, 0].mean() == pytest.approx(0.05, abs=1.1e-3)


@pytest.mark.parametrize("order", [1, 2])
def test_a_ball_that_moves_5_cm_in_one_step_pushes_the_sheet_ahead(order):
    shell = sheet(order, 6)
    ball = Sphere((0.0, 0.0, -0.05), 0.03, name="ball", motion=Motion([0.0, 0.1], [[0.0, 0.0, 0.0], [0.0, 0.0, 0.05]]))
    barrier = bound(shell, ball)
    state = lifted(shell, 0.0)
    fraction = barrier.begin_step(shell, state, state, 0.0, 0.1, 0.1)
    assert 0.2 < fraction < 0.4  # 2 cm of free way before it meets the sheet
    assert not barrier.has_intersections(shell, state)
    corners = np.flatnonzero(np.abs(shell.surface.nodes[:, :2]).min(axis=1) > 0.049)
    held = (3 * corners[:, None] + np.arange(3)).ravel()
    for _ in range(10):
        if fraction == 1.0:
            break
        fraction, state = barrier.advance(shell, state, held)
        assert not barrier.has_intersections(shell, state) and np.isfinite(barrier.energy(shell, state, 1.0))
    assert fraction == 1.0 and barrier.body_time == 0.1
    assert np.array_equal(state.u[held], shell.reference_state().u[held])
    centre = np.argmin(np.linalg.norm(shell.surface.nodes, axis=1))
    assert 0.03 < shell.positions(state)[centre, 2] < 0.05


def test_a_turning_bar_sweeps_the_sheet_up_instead_of_jumping_through():
    from mfar_fem.contact.body import Cylinder

    shell = sheet(1, 6)
    bar = Cylinder((0.0, 0.0, -0.04), (1.0, 0.0, 0.0), 0.01, 0.3, name="bar",
                   motion=Motion([0.0, 1.0], rotations=[[0.0, 0.0, 0.0], [0.0, np.pi, 0.0]], pivot=(0.2, 0.0, -0.04)))
    barrier = bound(shell, bar)
    state = lifted(shell, 0.0)
    fraction = barrier.begin_step(shell, state, state, 0.0, 1.0, 1.0)  # half a turn: the end lies where it never met the sheet
    assert 0.0 < fraction < 0.5
    assert not barrier.has_intersections(shell, state)


def test_two_bodies_share_the_load_and_static_ones_cost_no_motion():
    shell = sheet(1, 8)
    left, right = (Sphere((x, 0.0, -0.02), 0.02, name=n) for x, n in ((-0.03, "left"), (0.03, "right")))
    barrier = bound(shell, left, right)
    state = lifted(shell, 0.0005)
    forces = barrier.report(shell, state).forces
    assert forces.shape == (2, 3) and np.all(forces[:, 2] < 0)
    g = gradient_of(barrier, shell, state).reshape(-1, 3)
    assert forces.sum(axis=0) == pytest.approx(g.sum(axis=0), rel=1e-9)  # action and reaction
    assert forces[0, 2] == pytest.approx(forces[1, 2], rel=0.1)
    assert barrier.begin_step(shell, state, state, 0.0, 0.01, 0.01) == 1.0


def test_obstacles_and_sheet_without_self_contact_are_never_paired():
    shell = sheet(1)
    barrier = bound(shell, Sphere((0.0, 0.0, -0.051), 0.05), Sphere((0.0, 0.0, -0.08), 0.05))
    state = folded(shell, 1e-4)
    x = shell.positions(state)
    x[:, 2] += 0.02
    assert barrier.energy(shell, state, 1.0) == 0.0  # the bodies overlap, the sheet almost touches itself: not modelled
    assert not barrier.has_intersections(shell, state)


def test_stiffness_grows_when_contacts_come_too_near():
    shell = sheet(1)
    barrier = bound(shell, Plane(), stiffness=None, dhat=1e-3)
    barrier.begin_step(shell, lifted(shell, 5e-4), None, 0.0, 0.002, 0.002)
    first = barrier.stiffness
    assert first == pytest.approx(CLOTH.areal_density * 1e-3 / 0.002**2)  # inertia, above weight and tension
    barrier.end_step(shell, lifted(shell, 5e-5))
    assert barrier.stiffness == first
    barrier.end_step(shell, lifted(shell, 4e-5))
    assert barrier.stiffness == 2 * first
    fixed = bound(shell, Plane(), stiffness=7.0)
    fixed.end_step(shell, lifted(shell, 5e-5))
    fixed.end_step(shell, lifted(shell, 4e-5))
    assert fixed.stiffness == 7.0


def test_a_5_cm_move_in_one_step_ends_in_balance():
    """A ball moves 5 cm and lifts a sheet held at its corners: Newton starts from the pushed sheet and finds the equilibrium."""
    surface = Surface.from_pattern(patterns.rectangle(6, 6, (-0.05, 0.05), (-0.05, 0.05)))
    ball = Sphere((0.0, 0.0, -0.065), 0.03, motion=Motion([0.0, 0.1], [[0.0, 0.0, 0.0], [0.0, 0.0, 0.05]]))
    barrier = Barrier([ball], dhat=DHAT, stiffness=1e3)
    corners = np.flatnonzero(np.abs(surface.nodes[:, :2]).min(axis=1) > 0.049)
    problem = Problem(surface, CLOTH, [Hinge(corners, by_node=True)], [barrier])
    shell, state = problem.shell, problem.start()
    fraction = barrier.begin_step(shell, state, state, 0.0, 0.1, 0.1)
    assert 0.5 < fraction < 0.75  # 3.5 cm of free way
    for _ in range(10):
        if fraction < 1.0:
            fraction, state = barrier.advance(shell, state, problem.fixed)
        result = newton(problem, state, 1.0)
        assert result.converged, result.status
        state = shell.accept(result.state)
        assert not barrier.has_intersections(shell, state)
        if fraction == 1.0:
            break
    assert fraction == 1.0
    push, reaction = barrier.report(shell, state).forces[0], problem.gradient(state, 1.0)[problem.fixed].reshape(-1, 3)
    assert push[2] < -0.05
    assert push == pytest.approx(reaction.sum(axis=0), abs=1e-6 * abs(push[2]))
    height = np.linalg.norm(shell.positions(state) - [0.0, 0.0, -0.015], axis=1).min()
    assert 0.03 < height < 0.03 + DHAT


def test_the_energy_is_the_same_whenever_it_is_asked():
    """Parallel edges in self-contact: ipctk's sets from several threads are not reproducible, ours must be."""
    shell = sheet(2)
    barrier, state = bound(shell, self_contact=True, subdivision=4, dhat=1.5e-3), folded(shell, 0.0009)
    energies = []
    for _ in range(6):
        barrier._snapshot = None
        energies.append(barrier.energy(shell, state, 1.0))
    assert np.ptp(energies) <= 1e-13 * energies[0]


def test_memory_continues_as_if_nothing_had_happened():
    shell = sheet(1)
    belt = Plane(friction=0.3, motion=Motion([0.0, 1.0], [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]))
    barrier = bound(shell, belt, stiffness=None, dhat=1e-3)
    barrier.begin_step(shell, lifted(shell, 5e-5), None, 0.0, 0.002, 0.002)
    for height in (5e-5, 4e-5):
        barrier.end_step(shell, lifted(shell, height))
    other = bound(shell, belt, stiffness=None, dhat=1e-3)
    other.restore(barrier.memory())
    state = lifted(shell, 4e-5)
    for b in (barrier, other):
        b.begin_step(shell, state, None, 0.002, 0.004, 0.002)
    assert other.stiffness == barrier.stiffness
    assert other.energy(shell, state, 1.0) == pytest.approx(barrier.energy(shell, state, 1.0), rel=1e-12)
    assert gradient_of(other, shell, state) == pytest.approx(gradient_of(barrier, shell, state), rel=1e-12)
    assert barrier.summary() == (barrier.report(shell, state).pairs, pytest.approx(4e-5))


def test_candidates_are_searched_again_only_when_needed_and_contacts_stay_the_same():
    shell = sheet(1, 8)
    barrier = bound(shell, Sphere((0.0, 0.0, -0.05), 0.05))
    rng = np.random.default_rng(0)
    state = lifted(shell, 0.004)
    for _ in range(30):
        step = np.zeros(shell.n)
        step[2: shell.alpha_offset: 3] = -1.2e-4 + 3e-5 * rng.normal(size=len(shell.surface.nodes))
        state = state.with_u(state.u + barrier.max_step(shell, state, step) * step)
        fresh = bound(shell, Sphere((0.0, 0.0, -0.05), 0.05))
        assert barrier.energy(shell, state, 1.0) == pytest.approx(fresh.energy(shell, state, 1.0), rel=1e-12)
