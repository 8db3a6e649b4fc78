"""Contact in motion: no accepted step intersects, friction holds and lets go, bodies push, folds rest on folds."""

from pathlib import Path

import numpy as np
import pytest

from mfar_fem.benchmarks.drape_scenes import error_study
from mfar_fem.contact.barrier import Barrier
from mfar_fem.contact.body import Plane, Sphere
from mfar_fem.contact.motion import Motion
from mfar_fem.contact.start import IntersectingStartError
from mfar_fem.errors import InputError
from mfar_fem.loads import gravity
from mfar_fem.materials import Bending, Fabric
from mfar_fem.scene_file import scene_from_dict
from mfar_fem.simulation.engines import engine
from mfar_fem.solve.dynamics import Dynamics, DynamicsOptions
from mfar_fem.solve.problem import Problem
from mfar_fem.supports import Hinge
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import strip

SILK = Fabric.load("silk-charmeuse")
WEIGHT = gravity(SILK.areal_density)
G = 9.80665


def square(side=0.1, cells=4, at=(0.0, 0.0, 0.0), order=1):
    p = strip(side, side, cells, cells, "union")
    shift = np.asarray(at) - [0.5 * side, 0.5 * side, 0.0]
    return Surface(p.vertices + shift, p.triangles, order, boundary=p.boundary)


def free_of_intersections(dynamics):
    """Checks every accepted step by ipctk, nothing remembered."""

    def check(record):
        assert not dynamics.contact.has_intersections(dynamics.problem.shell, dynamics.motion.state), record.time
        assert record.distance is None or record.distance > 0

    return check


@pytest.mark.parametrize(("order", "share"), [(1, 0.0), (2, 0.0), (1, 0.5)])
def test_cloth_falls_on_a_sphere_and_never_enters_it(order, share):
    ball = Sphere((0.0, 0.0, 0.0), 0.05, friction=0.3)
    d = Dynamics(
        square(0.12, 6, (0.0, 0.0, 0.053), order), SILK, (), [WEIGHT], contact=Barrier([ball]),
        options=DynamicsOptions(rtol=1e-4, iteration_error=share)
    )
    result = d.run(0.1, free_of_intersections(d))
    assert result.converged and result.records[-1].contacts > 10 and (result.inexact_steps > 0) == (share > 0)
    x = d.problem.shell.positions(result.state)
    assert ball.signed_distance(x)[0].min() > 0 and x[:, 2].min() < 0.045  # it rests on top and hangs over


@pytest.mark.parametrize("angle, slides", [(15.0, False), (22.0, True)])
def test_a_sheet_on_a_slope_sticks_below_the_friction_angle_and_slips_above(angle, slides):
    """μ = tan 18°. The slope is level, gravity is turned: a = g (sin α − μ cos α) once it slides."""
    mu, a = np.tan(np.radians(18.0)), np.radians(angle)
    g = G * np.array([np.sin(a), 0.0, -np.cos(a)])
    d = Dynamics(
        square(0.05, 2, (0.0, 0.0, 2e-3)),
        SILK,
        (),
        [gravity(SILK.areal_density, g)],
        contact=Barrier([Plane(friction=mu)]),
        options=DynamicsOptions(rtol=1e-6),
    )
    settled = d.run(0.15)  # it comes to lie on the slope first
    before = d.motion.kinematics.v.reshape(-1, 3)[:, 0].mean()
    result = d.run(0.25, free_of_intersections(d))
    assert settled.converged and result.converged
    gained = d.motion.kinematics.v.reshape(-1, 3)[:, 0].mean() - before
    if slides:
        assert gained / 0.1 == pytest.approx(G * (np.sin(a) - mu * np.cos(a)), rel=0.05)
    else:
        assert abs(d.motion.kinematics.v.reshape(-1, 3)[:, 0].mean()) < 1.1e-3  # creeps no faster than eps_v


def test_a_folded_cloth_rests_on_itself():
    """A limp strip, folded over: its upper layer falls on the lower one and lies there, and no step crosses it."""
    length, gap = 0.06, 6e-3
    p = strip(length, 0.012, 30, 3, "union")
    surface = Surface(p.vertices + np.array([0.0, 0.0, 2e-3]), p.triangles, 1, boundary=p.boundary)
    limp = SILK.replace(bending=Bending(1e-8, 1e-8, 5e-9))
    s, turn = surface.nodes[:, 0], 0.5 * np.pi * gap
    flat = 0.5 * (length - turn)
    angle = np.clip((s - flat) / (0.5 * gap), 0.0, np.pi)
    x = np.where(s < flat, s, np.where(s < flat + turn, flat + 0.5 * gap * np.sin(angle), 2 * flat + turn - s))
    nodes = np.column_stack([x, surface.nodes[:, 1], 2e-3 + 0.5 * gap * (1 - np.cos(angle))])
    start = Problem(surface, limp, [Hinge("left")]).state_at(nodes)
    barrier = Barrier([Plane()], self_contact=True, dhat=0.8e-3)
    d = Dynamics(surface, limp, [Hinge("left")], [WEIGHT], contact=barrier, options=DynamicsOptions(rtol=1e-4), start=start)
    result = d.run(0.08, free_of_intersections(d))
    assert result.converged
    z = d.problem.shell.positions(result.state)[:, 2]
    upper = (s > length - flat + 5e-3) & (s < length)
    assert 0 < z[upper].min() and z[upper].max() < 4e-3  # from 8 mm down to the lower layer
    assert d.contact.report(d.problem.shell, result.state).pairs > 50


def test_a_body_moves_five_centimetres_in_one_step():
    ball = Sphere((0.0, 0.0, -0.03), 0.02, motion=Motion([0.0, 2e-3], [[0, 0, 0], [0, 0, 0.05]]))
    surface = square(0.12, 4)
    d = Dynamics(surface, SILK, [Hinge("left")], [WEIGHT], contact=Barrier([ball]), options=DynamicsOptions(rtol=1e-4))
    result = d.run(4e-3, free_of_intersections(d))
    assert result.converged
    x = d.problem.shell.positions(result.state)
    assert ball.signed_distance(x, 4e-3)[0].min() > 0
    assert x[:, 2].max() > 0.02  # the sheet was carried along by the ball, whose top is at 40 mm
    assert d.motion.time == pytest.approx(4e-3)


def test_an_integrator_that_contact_cannot_follow_is_refused():
    with pytest.raises(InputError, match="'implicit-euler' or 'bdf2'"):
        Dynamics(square(at=(0.0, 0.0, 0.01)), SILK, contact=Barrier([Plane()]), options=DynamicsOptions(method="generalized-alpha"))


def test_a_touching_start_is_refused_with_what_would_do():
    data = {
        "fabric": "silk-charmeuse",
        "duration": "10 ms",
        "sheet": [{"kind": "rectangle", "size": ["0.1 m", "0.1 m"], "centred": True, "at": ["0 m", "0 m", "0.03 m"]}],
        "body": [{"kind": "sphere", "radius": "0.05 m", "name": "ball"}],
    }
    with pytest.raises(IntersectingStartError, match=r"ball.*move it by at least .* mm"):
        engine(scene_from_dict(data, "standard", cells=4))


def test_every_level_supports_the_cloth():
    """The same scene at all levels: the sheet lies on the plane, none of it below."""
    data = {
        "fabric": "silk-charmeuse",
        "duration": "80 ms",
        "sheet": [{"kind": "rectangle", "size": ["0.1 m", "0.1 m"], "at": ["0 m", "0 m", "5 mm"]}],
        "body": [{"kind": "plane", "friction": 0.3}],
        "contact": {"distance": "1 mm"},
    }
    for level in ("draft", "standard", "reference"):
        e = engine(scene_from_dict(data, level, cells=3))
        assert e.advance(0.08, lambda row: None).status == "converged"
        assert 0 < e.nodes()[:, 2].min() and e.nodes()[:, 2].max() < 3e-3, level


FIGURE = Path(__file__).resolve().parents[4] / "shared" / "data" / "vision" / "bodies" / "anny_female_rest.obj"


@pytest.mark.skipif(not FIGURE.exists(), reason="the measured bodies are not part of the project")
@pytest.mark.parametrize(
    "level, duration, cells", [("draft", 0.25, 12), pytest.param("standard", 0.12, 12, marks=pytest.mark.slow)]
)
def test_silk_falls_over_a_figure(level, duration, cells):
    """A scanned-like body (27 000 triangles): the cloth lies on head and shoulders, and no vertex is inside."""
    from mfar_fem.contact.body import MeshBody

    body = MeshBody.load(FIGURE)
    top = float(body.mesh()[0][:, 2].max())
    data = {
        "fabric": "silk-charmeuse",
        "duration": "1 s",
        "sheet": [{"kind": "rectangle", "size": ["0.4 m", "0.4 m"], "centred": True, "at": ["0 m", "0 m", f"{top + 0.01} m"]}],
        "body": [{"kind": "mesh", "file": str(FIGURE), "friction": 0.3}],
        "contact": {"distance": "2 mm"},
        "air": {"normal": "0.6 kg/m^3"},
    }
    e = engine(scene_from_dict(data, level, cells=cells))
    assert e.advance(duration, lambda row: None).status == "converged"
    nodes = e.nodes()
    distance = body.signed_distance(nodes)[0]
    assert distance.min() > -1e-9 and np.sum(distance < 4e-3) > 3
    assert nodes[:, 2].max() > top - 0.01 and nodes[:, 2].min() < top - 0.05
    if level == "standard":
        assert not e.barrier.has_intersections(e.dynamics.problem.shell, e.dynamics.motion.state)


def test_steps_accepted_by_their_error_end_where_solved_ones_do():
    runs = error_study("drape-cylinder", (0.5,), until=0.06, cells=6)["runs"]
    solved, loose, half = runs
    assert solved["distance_largest_m"] == 0.0 and half["dt_s"] == 0.5 * solved["dt_s"]
    assert loose["iterations_per_step"] < 0.75 * solved["iterations_per_step"]
    assert loose["distance_largest_m"] < 0.2 * half["distance_largest_m"]
