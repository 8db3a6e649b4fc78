"""Multigrid for shells: it works on the elimination of the rotations, is symmetric, and gives up by name."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags

from mfar_fem.benchmarks.assembly import affine_state, silk
from mfar_fem.benchmarks.linear_solvers import hanging_square
from mfar_fem.solve import Problem
from mfar_fem.solve.amg import ShellMultigrid
from mfar_fem.solve.krylov import conjugate_gradients
from mfar_fem.solve.linear import LinearSolver, rigid_body_modes
from mfar_fem.solve.ordering import Reordered, nested_dissection
from mfar_fem.solve.solver_choice import choose, layout, wave_travel
from mfar_fem.supports import Hinge, Support
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import strip


def sheet(order: int, cells: int = 16, bending: bool = True):
    """A stretched sheet, one corner of it held in z only: problem, matrix, modes."""
    surface = Surface.from_pattern(strip(0.1, 0.1, cells, cells), order)
    corner = np.flatnonzero(np.linalg.norm(surface.nodes - [0.05, 0.1, 0.0], axis=1) < 1e-9)
    problem = Problem(surface, silk(), [Hinge("left"), Support(corner, (2,), by_node=True)], bending=bending)
    state = affine_state(problem.shell)
    _, data = problem.tangent(state, 0.0, False)
    return problem, problem.system(data), rigid_body_modes(problem.shell, state)[problem.free]


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("bending", [True, False])
def test_the_preconditioner_is_symmetric_and_positive_with_partly_held_nodes(order, bending):
    problem, A, modes = sheet(order, 6, bending)
    M = ShellMultigrid(A, layout(problem).positions, modes)
    columns = np.array([M(column) for column in np.eye(A.shape[0])])
    assert np.abs(columns - columns.T).max() < 1e-9 * np.abs(columns).max()
    assert np.linalg.eigvalsh(0.5 * (columns + columns.T)).min() > 0


def test_without_lumping_error_the_block_factorisation_is_exact():
    """Rotations that do not couple among themselves are eliminated exactly, and few nodes are solved directly."""
    rng = np.random.default_rng(0)
    B = rng.normal(size=(30, 30))
    K = B @ B.T + 30 * np.eye(30)
    K[12:, 12:] = np.diag(np.diag(K[12:, 12:]) + 500.0)
    M = ShellMultigrid(csr_matrix(K), np.arange(12), rng.normal(size=(30, 3)))
    b = rng.normal(size=30)
    assert M(b) == pytest.approx(np.linalg.solve(K, b), rel=1e-8, abs=1e-12)


def test_eliminated_rotations_need_far_fewer_iterations_than_multigrid_on_all_unknowns():
    dynamics = hanging_square(1, 24, dt=1e-2)
    assert dynamics.run(3e-2).converged
    problem, state = dynamics.problem, dynamics.motion.state
    _, data = problem.tangent(state, 1.0, False)
    A, modes = problem.system(data), rigid_body_modes(problem.shell, state)[problem.free]
    b = np.random.default_rng(1).normal(size=A.shape[0])
    counts = []
    for where in (layout(problem), None):
        solver = LinearSolver("amg", modes, layout=where)
        x = solver.factor(A)(b)
        assert np.linalg.norm(A @ x - b) < 1e-6 * np.linalg.norm(b)
        counts.append(solver.iterations if not solver.notes else 500)
    assert counts[0] < 60 and counts[0] < 0.6 * counts[1]


def test_the_hierarchy_serves_the_next_matrices_and_is_renewed_when_it_does_not_fit():
    problem, A, modes = sheet(1)
    solver = LinearSolver("amg", modes, cache={}, layout=layout(problem))
    b = np.random.default_rng(2).normal(size=A.shape[0])
    solver.factor(A)(b)
    kept = solver.cache["amg"][1]
    solver.factor((1.1 * A).tocsr())(b)
    assert solver.cache["amg"][1] is kept
    other = (A + diags(1e3 * np.abs(A.diagonal()).max() * (np.arange(A.shape[0]) % 2))).tocsr()
    x = solver.factor(other)(b)
    assert solver.cache["amg"][1] is not kept and np.linalg.norm(other @ x - b) < 1e-7 * np.linalg.norm(b)


def test_tolerances_follow_the_residuals_of_newton():
    solver = LinearSolver("amg", adaptive=True)
    tolerances = [solver._tolerance(np.array([size])) for size in (1.0, 5.0, 0.5, 1e-4, 1e-12)]
    assert tolerances == pytest.approx([1e-2, 1e-2, 0.9e-2, 0.9 * 4e-8, 1e-8])


def test_dynamics_with_amg_takes_the_same_iterations_and_reaches_the_same_state():
    motions = []
    for method in ("superlu", "amg"):
        dynamics = hanging_square(1, 16, linear_solver=method)
        result = dynamics.run(6e-3)
        assert result.converged and result.notes == ()
        motions.append((result.newton_iterations, dynamics.motion.state.u))
    assert motions[0][0] == motions[1][0]
    assert motions[0][1] == pytest.approx(motions[1][1], abs=1e-8)


def test_conjugate_gradients_solve_and_name_what_stops_them():
    rng = np.random.default_rng(3)
    Q, _ = np.linalg.qr(rng.normal(size=(20, 20)))
    A, b = csr_matrix(Q @ np.diag(np.linspace(1, 9, 20)) @ Q.T), rng.normal(size=20)
    x, iterations, status = conjugate_gradients(A, b, lambda r: r, 1e-12, 100)
    assert status == "converged" and iterations <= 25 and np.asarray(A @ x) == pytest.approx(b, abs=1e-10)
    assert conjugate_gradients(A, b, lambda r: r, 1e-12, 3)[1:] == (3, "iteration limit")
    assert conjugate_gradients(-A, b, lambda r: r, 1e-12, 9)[2] == "negative curvature"
    assert conjugate_gradients(A, b, lambda r: -r, 1e-12, 9)[2] == "negative curvature"
    assert conjugate_gradients(A, b, lambda r: np.nan * r, 1e-12, 9)[2] == "not finite"
    assert conjugate_gradients(A, 0 * b, lambda r: r, 1e-12, 9)[1:] == (0, "converged")


def test_nested_dissection_is_an_order_that_fills_less_than_the_natural_one():
    from mfar_fem.solve.linear import factorise

    problem, A, _ = sheet(1, 20)
    order = nested_dissection(A, layout(problem).places)
    assert np.array_equal(np.sort(order), np.arange(A.shape[0]))
    reordered = Reordered(A, order)
    assert abs(reordered.matrix(A) - A[order][:, order]).max() < 1e-14 * abs(A).max()
    assert factorise(reordered.matrix(A), "NATURAL").nnz < 0.5 * factorise(A.tocsc(), "NATURAL").nnz
    assert factorise(reordered.matrix(A), "NATURAL").nnz < 1.3 * factorise(A.tocsc(), "MMD_AT_PLUS_A").nnz


def test_the_choice_follows_size_and_time_step():
    assert choose(2_000, 1.0, 1, "superlu") == "direct" and choose(300_000, np.inf, 1, "superlu") == "direct"
    assert choose(100_000, 20.0, 1, "superlu") == "amg" and choose(100_000, 20.0, 1, "pardiso") == "direct"
    assert choose(100_000, 20.0, 2, "superlu") == "direct" and choose(100_000, 200.0, 1, "superlu") == "direct"
    dynamics = hanging_square(1, 8)
    assert wave_travel(dynamics.problem) == np.inf
    dynamics.run(2e-3)
    one = wave_travel(dynamics.problem)
    assert one == pytest.approx(2e-3 * np.sqrt(1790 / 0.083) / dynamics.problem.rotation_length, rel=0.6)
    dynamics.inertia.factor *= 0.25
    assert wave_travel(dynamics.problem) == pytest.approx(2 * one)


def test_auto_says_what_it_chose(monkeypatch):
    import mfar_fem.solve.solver_choice as solver_choice

    monkeypatch.setattr(solver_choice, "FEWEST", 100)
    monkeypatch.setattr(solver_choice, "_pardiso", lambda: None)
    notes = [hanging_square(1, 8, dt=dt, linear_solver="auto").run(dt).notes for dt in (1e-3, 2e-1)]
    assert any("'auto': amg" in note for note in notes[0]) and any("'auto': direct" in note for note in notes[1])
