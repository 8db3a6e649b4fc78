"""Contact by exact distances: derivatives, a sheet that never enters by two detectors, and what it refuses."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mfar_fem.contact import exact_kernels as kernels
from mfar_fem.contact.barrier import Barrier
from mfar_fem.contact.body import Cylinder, Disc, Plane, Sphere
from mfar_fem.contact.exact import ExactBarrier, why_not
from mfar_fem.contact.motion import Motion
from mfar_fem.contact.start import IntersectingStartError
from mfar_fem.errors import InputError, NotConvergedError
from mfar_fem.loads import gravity
from mfar_fem.materials import Fabric
from mfar_fem.scene_file import scene_from_dict
from mfar_fem.simulation.engines import engine
from mfar_fem.solve.dynamics import Dynamics, DynamicsOptions
from mfar_fem.solve.problem import InadmissibleStateError, Problem
from mfar_fem.supports import Hinge
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import strip

SILK = Fabric.load("silk-charmeuse")
WEIGHT = gravity(SILK.areal_density)
G = 9.80665
ROUND = {
    "sphere": Sphere((0.0, 0.0, -0.05), 0.05, friction=0.3),
    "cylinder": Cylinder((0.0, 0.0, -0.05), (1.0, 1.0, 0.0), 0.05, 1.0, friction=0.3),
    "plane": Plane(normal=(0.1, -0.2, 1.0), friction=0.3),
}


def square(side=0.1, cells=12, at=(0.0, 0.0, 0.0), order=1):
    p = strip(side, side, cells, cells, "union")
    shift = np.asarray(at) - [0.5 * side, 0.5 * side, 0.0]
    return Surface(p.vertices + shift, p.triangles, order, boundary=p.boundary)


def bound(bodies, surface, **options):
    contact = ExactBarrier(bodies, **options)
    problem = Problem(surface, SILK, (), [contact], bending=False)
    return contact, problem.shell, problem.start()


def facet_distances(contact, contacts):
    """Exact distances of all facets."""
    out = np.empty(contacts.facets.shape)
    kernels.facet_distances(*contact._shape, contacts.x, contact._triangles, contacts.distance, np.inf, out)
    return out


# -- geometry ----------------------------------------------------------------------------------------------------------------
coordinate = st.floats(-2.0, 2.0, allow_nan=False)
point = st.tuples(coordinate, coordinate, coordinate)


@settings(max_examples=200, deadline=None)
@given(point, point, point)
def test_the_distance_of_a_triangle_is_the_least_of_all_its_points(p, q, r):
    p, q, r = (np.array(v) for v in (p, q, r))
    found = kernels.origin_from_triangle(p, q, r)
    n = 60
    a, b = np.meshgrid(np.arange(n + 1), np.arange(n + 1))
    a, b = a[a + b <= n] / n, b[a + b <= n] / n
    sampled = np.linalg.norm(np.outer(1 - a - b, p) + np.outer(a, q) + np.outer(b, r), axis=1).min()
    longest = max(np.linalg.norm(q - p), np.linalg.norm(r - q), np.linalg.norm(p - r))
    assert found <= sampled + 1e-9
    assert found >= sampled - longest / n  # no point of the triangle is farther than that from a sampled one


@pytest.mark.parametrize("name", list(ROUND))
@pytest.mark.parametrize("order", [1, 2])
def test_nodes_that_keep_their_distance_keep_the_facets_out(name, order):
    """Corners laid exactly at s from a body, whatever the direction, leave no facet inside: that is what s is for."""
    body, rng = ROUND[name], np.random.default_rng(3)
    surface = square(0.06, 6, order=order)
    contact, shell, start = bound([body], surface)
    x = shell.positions(start) + rng.normal(0.0, 2e-4, (len(surface.nodes), 3))
    for _ in range(60):  # moved along the normal until their distance is s
        d, n = body.signed_distance(x)
        x = x - (d - contact._clearance[:, 0] * (1 + 1e-9) - 1e-12)[:, None] * n
    state = start.with_u(np.concatenate([x.ravel(), start.u[shell.alpha_offset:]]))
    assert not contact.has_intersections(shell, state)


# -- the potential -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", list(ROUND))
def test_gradient_and_second_derivative_are_those_of_the_energy(name):
    body, rng = ROUND[name], np.random.default_rng(1)
    contact, shell, start = bound([body], square(0.02, 6), stiffness=1e3)
    k = shell.alpha_offset
    x = shell.positions(start)
    for _ in range(40):
        d, n = body.signed_distance(x)
        x = x - (d - contact._clearance[:, 0] - 0.5e-3)[:, None] * n
    state = start.with_u(np.r_[(x + rng.normal(0.0, 5e-5, x.shape)).ravel(), start.u[k:]])
    contact.begin_step(shell, state, None, 0.0, 1e-3, 1e-3)  # friction acts from here
    state = state.with_u(state.u + np.r_[rng.normal(0.0, 2e-5, k), np.zeros(len(start.u) - k)])
    direction = np.r_[rng.normal(size=k), np.zeros(len(start.u) - k)]

    def energy(t):
        return contact.energy(shell, state.with_u(state.u + t * direction), 1.0)

    def gradient(t):
        g = np.zeros(len(state.u))
        contact.gradient(shell, state.with_u(state.u + t * direction), 1.0, g)
        return g

    h = 1e-8
    slope = (8 * (energy(h) - energy(-h)) - (energy(2 * h) - energy(-2 * h))) / (12 * h)
    assert np.isfinite(energy(0.0)) and contact._pressed.any()
    assert gradient(0.0) @ direction == pytest.approx(slope, rel=1e-7)
    rows, columns, values = contact.sparse_hessian(shell, state, 1.0, psd=False)
    H = np.zeros(len(state.u))
    np.add.at(H, rows, values * direction[columns])
    numeric = (8 * (gradient(h) - gradient(-h)) - (gradient(2 * h) - gradient(-2 * h))) / (12 * h)
    assert np.abs(H - numeric).max() < 1e-6 * np.abs(numeric).max()


def test_the_definite_part_is_definite():
    contact, shell, start = bound([ROUND["sphere"]], square(0.02, 4, (0.0, 0.0, 8e-4)), stiffness=1e3)
    _, _, values = contact.sparse_hessian(shell, start, 1.0, psd=True)
    assert len(values) > 0 and np.linalg.eigvalsh(values.reshape(-1, 3, 3)).min() > -1e-9 * np.abs(values).max()


def test_the_forces_on_the_bodies_are_those_the_sheet_feels():
    plane, ball = Plane(friction=0.5), Sphere((0.0, 0.0, -0.05), 0.05, friction=0.2)
    contact, shell, start = bound([plane, ball], square(0.02, 4, (0.0, 0.0, 9e-4)), stiffness=1e3)
    contact.begin_step(shell, start, None, 0.0, 1e-3, 1e-3)
    state = start.with_u(start.u + np.tile([1e-5, -2e-5, 0.0], shell.alpha_offset // 3))
    g = np.zeros(len(start.u))
    contact.gradient(shell, state, 1.0, g)
    report = contact.report(shell, state)
    assert report.pairs > 0 and np.all(np.abs(report.forces[:, 2]) > 0)
    assert report.forces.sum(axis=0) == pytest.approx(g[: shell.alpha_offset].reshape(-1, 3).sum(axis=0), rel=1e-12, abs=1e-15)


# -- steps -------------------------------------------------------------------------------------------------------------------
@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from(["sphere", "cylinder", "plane"]), st.floats(1e-4, 0.3))
def test_the_free_part_of_a_step_is_free_all_along(seed, name, size):
    rng = np.random.default_rng(seed)
    contact, shell, start = bound([ROUND[name]], square(0.05, 5, (0.0, 0.0, 0.02)))
    step = np.zeros(len(start.u))
    step[: shell.alpha_offset] = (rng.normal(0.0, size, 3) + rng.normal(0.0, 0.1 * size, (len(shell.surface.nodes), 3))).ravel()
    fraction = contact.max_step(shell, start, step)
    assert 0.0 < fraction <= 1.0
    for t in np.linspace(0.0, 1.0, 23):
        state = start.with_u(start.u + t * fraction * step)
        assert not contact.has_intersections(shell, state) and np.isfinite(contact.energy(shell, state, 1.0))
    if fraction < 1.0:  # it was cut because something was in the way: most of a distance is gone
        before, after = (contact._look(shell.positions(s)) for s in (start, start.with_u(start.u + fraction * step)))
        facets = [facet_distances(contact, c) for c in (before, after)]
        assert min((after.room / before.room).min(), (facets[1] / facets[0]).min()) < 0.3


def test_a_step_from_inside_is_refused():
    contact, shell, start = bound([ROUND["sphere"]], square(0.02, 4, (0.0, 0.0, -1e-3)))
    assert np.isinf(contact.energy(shell, start, 1.0))
    with pytest.raises(InadmissibleStateError):
        contact.max_step(shell, start, np.zeros(len(start.u)))


# -- in motion ---------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("body", "order"), [(Sphere((0, 0, 0), 0.05, friction=0.3), 1), (Sphere((0, 0, 0), 0.05, friction=0.3), 2),
                                             (Cylinder((0, 0, 0), (0, 1, 0), 0.05, 0.5, friction=0.3), 1)])
def test_cloth_falls_on_a_round_body_and_no_detector_finds_it_inside(body, order):
    d = Dynamics(square(0.12, 12 // order, (0.0, 0.0, 0.053), order), SILK, (), [WEIGHT], contact=ExactBarrier([body]),
                 options=DynamicsOptions(rtol=1e-4, iteration_error=0.5))
    meshes = Barrier([body])
    meshes.bind(d.problem.shell)

    def check(record):
        shell, state = d.problem.shell, d.motion.state
        assert not meshes.has_intersections(shell, state) and not d.contact.has_intersections(shell, state), record.time
        assert record.distance is None or record.distance > 0

    result = d.run(0.1, check)
    assert result.converged and result.records[-1].contacts > 10
    x = d.problem.shell.positions(result.state)
    assert body.signed_distance(x)[0].min() > 0 and x[:, 2].min() < 0.045


@pytest.mark.parametrize("angle, slides", [(15.0, False), (22.0, True)])
def test_a_sheet_sticks_below_the_friction_angle_and_slips_above(angle, slides):
    mu, a = np.tan(np.radians(18.0)), np.radians(angle)
    g = G * np.array([np.sin(a), 0.0, -np.cos(a)])
    d = Dynamics(square(0.05, 2, (0.0, 0.0, 2e-3)), SILK, (), [gravity(SILK.areal_density, g)],
                 contact=ExactBarrier([Plane(friction=mu)]), options=DynamicsOptions(rtol=1e-6))
    settled = d.run(0.15)
    before = d.motion.kinematics.v.reshape(-1, 3)[:, 0].mean()
    result = d.run(0.25)
    gained = d.motion.kinematics.v.reshape(-1, 3)[:, 0].mean() - before
    assert settled.converged and result.converged
    if slides:
        assert gained / 0.1 == pytest.approx(G * (np.sin(a) - mu * np.cos(a)), rel=0.05)
    else:
        assert abs(d.motion.kinematics.v.reshape(-1, 3)[:, 0].mean()) < 1.1e-3  # creeps no faster than eps_v


def test_a_resting_sheet_weighs_what_it_weighs():
    """Come to lie on a plane, a sheet presses on it with its weight."""
    scene = scene_from_dict({
        "name": "rest", "fabric": "silk-charmeuse", "duration": "1 s",
        "sheet": [{"kind": "rectangle", "size": ["0.1 m", "0.1 m"], "centred": True, "at": ["0 m", "0 m", "0.001 m"]}],
        "body": [{"kind": "plane"}], "numerics": {"cells": 6}})
    surface = scene.surface()
    contact = scene.barrier(surface)
    assert isinstance(contact, ExactBarrier)
    d = Dynamics(surface, SILK, (), [WEIGHT], contact=contact, options=DynamicsOptions(rtol=1e-8, mass_damping=100.0))
    result = d.run(0.3)
    force = contact.report(d.problem.shell, result.state).forces[0]
    assert force[2] == pytest.approx(-SILK.areal_density * G * 0.01, rel=1e-3)


def test_meshed_and_exact_contact_agree():
    """The same fall with the ball as a formula and as a mesh: the difference is within the distance at which contact begins."""
    found = []
    for bodies in ("exact", "mesh"):
        scene = scene_from_dict({
            "name": "ball", "fabric": "silk-charmeuse", "duration": "0.1 s",
            "sheet": [{"kind": "rectangle", "size": ["0.12 m", "0.12 m"], "centred": True, "at": ["0 m", "0 m", "0.053 m"]}],
            "body": [{"kind": "sphere", "radius": "0.05 m", "friction": 0.3}], "contact": {"bodies": bodies},
            "numerics": {"cells": 14}})
        run = engine(scene)
        assert isinstance(run.barrier, ExactBarrier if bodies == "exact" else Barrier)
        assert run.advance(0.1, lambda row: None).status == "converged"
        found.append(run.nodes())
    apart = np.linalg.norm(found[0] - found[1], axis=1)
    assert np.sqrt(np.mean(apart**2)) < 1.5e-3


# -- what it refuses -----------------------------------------------------------------------------------------------------------
def test_bodies_it_cannot_do_are_named():
    sheet = square(0.05, 10, (0.0, 0.0, 0.06))
    assert why_not([Sphere((0, 0, 0), 0.05), Plane(), Cylinder((0, 0, 0), (0, 1, 0), 0.05, 0.5)], sheet, 1e-3) is None
    assert "no plane, sphere or cylinder" in why_not([Disc()], sheet, 1e-3)
    assert "on a path" in why_not([Sphere(motion=Motion([0.0, 1.0], [[0, 0, 0], [0, 0, 1]]))], sheet, 1e-3)
    assert "end of cylinder" in why_not([Cylinder((0, 0, 0), (0, 0, 1), 0.05, 0.1)], sheet, 1e-3)
    assert "facets between nodes" in why_not([Sphere((0, 0, 0), 0.05)], square(0.05, 2, (0.0, 0.0, 0.06)), 1e-3)
    with pytest.raises(InputError, match="bodies = 'mesh'"):
        bound([Disc()], sheet)
    with pytest.raises(InputError, match="friction"):
        ExactBarrier([Plane()], friction=-1.0)


def test_a_start_too_near_says_how_far_to_move():
    contact, shell, start = bound([ROUND["sphere"]], square(0.02, 4, (0.0, 0.0, -5e-4)))
    with pytest.raises(IntersectingStartError, match=r"intersects: element \d+ – body 'sphere'.*move the sheet by") as caught:
        contact.check_start(shell, start)
    assert caught.value.pairs
    contact, shell, start = bound([ROUND["sphere"]], square(0.02, 4, (0.0, 0.0, 1e-5)))
    with pytest.raises(IntersectingStartError, match="touches"):
        contact.check_start(shell, start)


def test_a_sheet_that_slides_to_the_end_of_a_cylinder_is_told_so():
    pipe = Cylinder((0.0, 0.0, -0.02), (1.0, 0.0, 0.0), 0.02, 0.06)
    d = Dynamics(square(0.04, 8, (0.0, 0.0, 1.5e-3)), SILK, (), [gravity(SILK.areal_density, (5 * G, 0.0, -G))],
                 contact=ExactBarrier([pipe]), options=DynamicsOptions(rtol=1e-4, iteration_error=0.5))
    with pytest.raises(NotConvergedError, match="end of cylinder 'cylinder'"):
        d.run(0.2)


def test_a_checkpoint_brings_the_stiffness_back():
    d = Dynamics(square(0.05, 2, (0.0, 0.0, 1.2e-3)), SILK, [Hinge("left")], [WEIGHT], contact=ExactBarrier([Plane()]))
    d.run(0.02)
    other = ExactBarrier([Plane()])
    other.bind(d.problem.shell)
    other.restore(d.contact.memory())
    assert other.memory() == d.contact.memory() and other.stiffness == d.contact.stiffness
