"""The ladder every element climbs before it meets a benchmark: rest, rigid motions, derivatives, definiteness, modes."""

import numpy as np
import pytest
from shell_cases import PATTERNS, PLATE, SHAPES, SILK, gradient, moved, rotation, shell, tangent, turned

from mfar_fem.materials import Fabric
from mfar_fem.solve import Problem, solve_static
from mfar_fem.solve.linear import rigid_body_modes
from mfar_fem.supports import Support
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import strip

each_shape = pytest.mark.parametrize("shape, order", SHAPES)
QUARTER_TURN = rotation((0.3, -1.0, 0.5), np.pi / 2)


def scale(s):
    """A force (N) typical of the shell: the largest entry of its tangent times the mean edge length."""
    return abs(tangent(s, s.reference_state())).max() * s.surface.edge_lengths.mean()


@each_shape
def test_no_energy_and_no_force_at_rest(shape, order):
    s = shell(shape, order)
    rest = s.reference_state()
    assert abs(gradient(s, rest)).max() < 1e-12 * scale(s)
    assert s.energy(rest) < 1e-20 * scale(s)


@each_shape
def test_rigid_motions_give_no_force(shape, order):
    s = shell(shape, order)
    rest = s.reference_state()
    for R, shift in ((np.eye(3), (0.3, -0.2, 0.7)), (QUARTER_TURN, (0.0, 0.0, 0.0))):
        assert abs(gradient(s, turned(s, rest, R, shift))).max() < 1e-11 * scale(s)


@each_shape
@pytest.mark.parametrize("exact", [True, False], ids=["exact", "safe"])
def test_tangent_is_symmetric_at_a_random_state(shape, order, exact):
    s = shell(shape, order)
    K = tangent(s, moved(s, 3e-3, 0.2), exact)
    assert abs(K - K.T).max() < 1e-12 * abs(K).max()


@each_shape
@pytest.mark.parametrize("displacement, turn", [(1e-5, 1e-3), (4e-3, 0.3)], ids=["small", "moderate"])
def test_gradient_and_tangent_by_finite_differences(shape, order, displacement, turn):
    s = shell(shape, order)
    state = moved(s, displacement, turn)
    v = moved(s, 1.0, 10.0, seed=5).u - s.reference_state().u
    g, K, h = gradient(s, state), tangent(s, state), 1e-7

    def along(t, f):
        return f(s, state.with_u(state.u + t * v))

    # five-point rule: the energy of a stiff sheet has large third derivatives
    def derivative(f):
        return (8 * (along(h, f) - along(-h, f)) - (along(2 * h, f) - along(-2 * h, f))) / (12 * h)

    def energy(shell_, state_):
        return np.array(shell_.energy(state_))

    # truncation alone does not explain more than this; a wrong term shows up in the first digits
    assert derivative(energy) == pytest.approx(g @ v, rel=1e-6, abs=1e-6 * np.linalg.norm(g) * np.linalg.norm(v))
    assert np.linalg.norm(derivative(gradient) - K @ v) < 1e-6 * np.linalg.norm(K @ v)


@each_shape
def test_tangent_at_rest_is_positive_with_six_rigid_modes(shape, order):
    s = shell(shape, order, PLATE)
    K = scaled(s, tangent(s, s.reference_state()))
    values = np.linalg.eigvalsh(K)
    assert values[0] > -1e-10 * values[-1]
    assert np.sum(values < 1e-9 * values[-1]) == 6


def scaled(s, K):
    """Tangent with rotations measured by the displacement they cause over an edge, so that its eigenvalues compare."""
    d = np.ones(s.n)
    d[s.alpha_offset:] = 1.0 / s.surface.edge_lengths.mean()
    return d[:, None] * K * d


@pytest.mark.parametrize("order", [1, 2])
def test_zero_modes_of_a_flat_membrane(order):
    """Every height is free, and three rigid motions in the plane: nothing else (no spurious mode of the interpolation)."""
    s = shell("flat", order, PLATE, bending=False)
    values = np.linalg.eigvalsh(tangent(s, s.reference_state()))
    assert np.sum(values < 1e-10 * values[-1]) == len(s.surface.nodes) + 3


@each_shape
def test_rigid_modes_are_in_the_kernel(shape, order):
    s = shell(shape, order)
    rest = s.reference_state()
    K, B = tangent(s, rest), rigid_body_modes(s, rest)
    assert np.linalg.matrix_rank(B) == 6
    assert abs(K @ B).max() < 1e-12 * abs(K).max()


@each_shape
def test_safe_tangent_is_positive_semi_definite(shape, order):
    s = shell(shape, order)
    for seed in range(3):
        state = moved(s, 5e-3, 0.5, seed)
        values = np.linalg.eigvalsh(scaled(s, tangent(s, state, exact=False)))
        assert values[0] > -1e-12 * values[-1]
    exact = np.linalg.eigvalsh(scaled(s, tangent(s, state, exact=True)))
    assert exact[0] < -1e-6 * exact[-1]  # the exact one is not, so the test above says something


@each_shape
def test_tangents_agree_at_rest(shape, order):
    s = shell(shape, order)
    rest = s.reference_state()
    exact, safe = (tangent(s, rest, e) for e in (True, False))
    assert abs(exact - safe).max() < 1e-10 * abs(exact).max()


@each_shape
def test_frame_indifference(shape, order):
    s = shell(shape, order)
    state = moved(s, 3e-3, 0.2)
    R = rotation((1.0, 2.0, -0.5), 2.0)
    other = turned(s, state, R, (0.1, 0.2, 0.3))
    assert s.energies(other) == pytest.approx(s.energies(state), rel=1e-11)
    g, k = gradient(s, state), s.alpha_offset
    expected = np.concatenate([(g[:k].reshape(-1, 3) @ R.T).ravel(), g[k:]])
    assert abs(gradient(s, other) - expected).max() < 1e-11 * abs(g).max()


@each_shape
def test_accept_changes_no_energy(shape, order):
    s = shell(shape, order)
    state = moved(s, 3e-3, 0.3)
    accepted = s.accept(state)
    assert np.all(s.alpha(accepted) == 0.0) and np.any(s.alpha(state) != 0.0)
    assert np.linalg.norm(accepted.directors, axis=1) == pytest.approx(1.0, abs=1e-14)
    assert s.energies(accepted) == pytest.approx(s.energies(state), rel=1e-12)
    k = s.alpha_offset
    moments, before = gradient(s, accepted)[k:], gradient(s, state)[k:]
    assert abs(moments - before).max() < 1e-11 * abs(before).max()


@each_shape
def test_accept_keeps_rotations_that_would_jump_by_a_turn(shape, order):
    """Past half a turn from its director the angle of an element has another value: such edges keep their rotation."""
    s = shell(shape, order)
    for seed in range(5):
        state = moved(s, 3e-3, 2.0, seed)  # rotations of some radians at random
        accepted = s.accept(state)
        kept = s.alpha(accepted) != 0.0
        assert kept.any() and not kept.all()
        assert np.array_equal(s.alpha(accepted)[kept], s.alpha(state)[kept])
        assert s.energies(accepted) == pytest.approx(s.energies(state), rel=1e-12)
        moments, before = (gradient(s, x)[s.alpha_offset:] for x in (accepted, state))
        assert abs(moments - before).max() < 1e-10 * abs(before).max()


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("axis", [0, 1])
def test_poisson_contraction(order, axis):
    """Pulled along x or y, a free strip contracts by ν: St. Venant-Kirchhoff has E22 = -ν E11 exactly, at any strain."""
    surface = Surface.from_pattern(PATTERNS["flat"], order)
    sides = (("left", "right"), ("bottom", "top"))[axis]
    pull = np.zeros(3)
    pull[axis] = 0.05 * np.ptp(surface.nodes[:, axis])
    low, high = surface.nodes_of(sides[0]), surface.nodes_of(sides[1])
    supports = [Support(low, (axis,), by_node=True), Support(high, (axis,), pull, by_node=True),
                Support([surface.boundary[sides[0]][0]], (1 - axis,), by_node=True),
                Support(np.arange(len(surface.nodes)), (2,), by_node=True)]
    problem = Problem(surface, PLATE, supports, bending=False)
    result = solve_static(problem, 1)
    assert result.converged
    C = problem.shell.right_cauchy_green(result.state)
    E = 0.5 * (C[..., :2] - 1.0)
    assert E[..., axis] == pytest.approx(0.5 * (1.05**2 - 1), rel=1e-9)
    assert E[..., 1 - axis] == pytest.approx(-0.3 * 0.5 * (1.05**2 - 1), rel=1e-8)
    assert C[..., 2] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("order", [1, 2])
def test_collapsed_element_has_infinite_energy_and_finite_forces(order):
    s = shell("flat", order)
    state = s.reference_state()
    u = state.u.copy()
    corners = s.surface.elements[0]
    u.reshape(-1)[: s.alpha_offset].reshape(-1, 3)[corners] = u[:3]
    collapsed = state.with_u(u)
    assert s.energy(collapsed) == np.inf
    assert np.all(np.isfinite(gradient(s, collapsed)))


def test_with_fabric_shares_the_geometry_only_where_it_may():
    s = shell("flat", 2)
    stiffer = Fabric("other", SILK.law.replace(mu=2e5), SILK.thickness, SILK.areal_density, SILK.bending)
    assert s.with_fabric(stiffer).geometry is s.geometry
    state = moved(s, 1e-3, 0.1)
    assert s.with_fabric(PLATE).energies(state) == pytest.approx(shell("flat", 2, PLATE).energies(state), rel=1e-13)


@pytest.mark.parametrize("order", [1, 2])
def test_membrane_matches_bilinear_form(order):
    """scikit-fem assembles the same matrix (flat sheet; order 2 in an affine state, where Regge interpolation is exact)."""
    from mfar_fem.benchmarks.assembly import affine_state
    from mfar_fem.benchmarks.bilinear_form import MembraneForm
    from mfar_fem.shell import Shell

    surface = Surface.from_pattern(strip(0.3, 0.3, 9, 9, jitter=0.2), order)
    assert len(surface.elements) <= 200
    s = Shell(surface, SILK, bending=False)
    state = affine_state(s) if order == 2 else moved(s, 2e-3, 0.0)
    K = tangent(s, state)
    for intorder in (2, None):
        oracle = MembraneForm(s, intorder)
        expected = oracle.renumbered(oracle.matrix(oracle.fields(state))).toarray()
        assert abs(K - expected).max() < 1e-10 * abs(K).max()
