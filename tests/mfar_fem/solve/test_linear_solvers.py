"""Every linear solver gives the same answer, and says what it had to do."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags

from mfar_fem.benchmarks.assembly import affine_state, silk
from mfar_fem.errors import InputError, MissingDependencyError
from mfar_fem.solve import NewtonOptions, Problem, solve_static
from mfar_fem.solve.linear import LinearSolver, SingularMatrixError, _pardiso, rigid_body_modes
from mfar_fem.supports import Hinge, Support
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import strip


@pytest.fixture(scope="module")
def stretched():
    """A stretched sheet with bending: matrix of its free unknowns, right-hand side, rigid modes."""
    surface = Surface.from_pattern(strip(0.1, 0.1, 10, 10), 1)
    problem = Problem(surface, silk(), [Hinge("left"), Hinge("right")])
    state = affine_state(problem.shell)
    _, data = problem.tangent(state, 0.0, False)
    b = np.random.default_rng(0).normal(size=len(problem.free))
    modes = rigid_body_modes(problem.shell, state)[problem.free]
    return problem.free_block.matrix(data), b, modes


PARDISO = pytest.param("pardiso", marks=pytest.mark.skipif(_pardiso() is None, reason="pypardiso is not installed"))


@pytest.mark.parametrize("method", ["superlu", PARDISO, "direct", "amg"])
def test_same_answer(stretched, method):
    A, b, modes = stretched
    solver = LinearSolver(method, modes, rtol=1e-12, max_iterations=2000)
    x = solver.factor(A)(b)
    assert np.linalg.norm(A @ x - b) < 1e-8 * np.linalg.norm(b)
    y = LinearSolver("superlu").factor(A)(b)
    assert np.linalg.norm(x - y) < 1e-6 * np.linalg.norm(y)


def test_amg_counts_its_iterations_and_needs_no_fallback_on_a_laplacian():
    n = 400
    A = diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(n, n)).tocsr()
    solver = LinearSolver("amg", np.ones((n, 1)))
    b = np.random.default_rng(1).normal(size=n)
    x = solver.factor(A)(b)
    assert np.linalg.norm(A @ x - b) < 1e-7 * np.linalg.norm(b)
    assert solver.iterations > 0 and solver.notes == []


def test_amg_falls_back_with_a_note_on_an_indefinite_matrix():
    rng = np.random.default_rng(2)
    Q, _ = np.linalg.qr(rng.normal(size=(60, 60)))
    A = csr_matrix((Q * np.where(np.arange(60) % 2, 1.0, -1.0) * np.linspace(1, 50, 60)) @ Q.T)
    A = csr_matrix((A + A.T) / 2)
    solver = LinearSolver("amg", np.ones((60, 1)), max_iterations=30)
    b = rng.normal(size=60)
    x = solver.factor(A)(b)
    assert np.linalg.norm(A @ x - b) < 1e-8 * np.linalg.norm(b)
    assert any("direct solver used instead" in note for note in solver.notes)


def test_singular_matrix_is_a_named_error():
    with pytest.raises(SingularMatrixError):
        LinearSolver("superlu").factor(csr_matrix((np.array([1.0, 0.0]), ([0, 1], [0, 1])), shape=(2, 2)))


def test_unknown_and_missing_solvers():
    with pytest.raises(InputError, match="choose one of"):
        LinearSolver("cholesky")
    if _pardiso() is None:
        with pytest.raises(MissingDependencyError, match="pypardiso"):
            LinearSolver("pardiso")


def test_statics_with_amg_reaches_the_same_state():
    surface = Surface.from_pattern(strip(0.1, 0.05, 6, 3), 1)
    states = []
    for method in ("superlu", "amg"):
        problem = Problem(surface, silk(), [Hinge("left"), Hinge("right", displacement=(0.01, 0.0, 0.0)),
                                            Support(np.arange(len(surface.nodes)), (2,), by_node=True)], bending=False)
        result = solve_static(problem, 2, NewtonOptions(linear_solver=method))
        assert result.converged
        states.append(problem.shell.positions(result.state))
    assert states[0] == pytest.approx(states[1], abs=1e-9)


@pytest.mark.parametrize("method", ["superlu", PARDISO])
def test_the_next_matrix_of_a_pattern_is_solved_in_the_order_of_the_first(stretched, method):
    A, b, _ = stretched
    solver = LinearSolver(method)
    solver.factor(A)(b)
    kept = solver.cache[method]
    other = (2.0 * A).tocsr()
    both = np.stack([b, -3.0 * b], axis=1)
    x = solver.factor(other)(both)
    assert solver.cache[method] is kept and solver.memory > 0
    assert np.linalg.norm(other @ x - both) < 1e-8 * np.linalg.norm(both)


def test_another_pattern_is_solved_too(stretched):
    A, b, _ = stretched
    solver = LinearSolver("superlu")
    solver.factor(A)(b)
    wider = (A + 1e-3 * abs(A).max() * diags([1.0, 10.0, 1.0], [-200, 0, 200], shape=A.shape)).tocsr()
    wider.sort_indices()
    x = solver.factor(wider)(b)
    assert np.linalg.norm(wider @ x - b) < 1e-8 * np.linalg.norm(b)


def test_dissected_and_minimum_degree_orders_agree(stretched, monkeypatch):
    import mfar_fem.solve.linear as linear

    A, b, _ = stretched
    monkeypatch.setattr(linear, "DISSECTED", 10)
    rng = np.random.default_rng(5)
    solver = LinearSolver("superlu", layout=linear.Layout(np.zeros(0, dtype=int), rng.normal(size=(len(b), 3))))
    x = solver.factor(A)(b)
    y = LinearSolver("superlu").factor(A)(b)
    assert np.linalg.norm(x - y) < 1e-6 * np.linalg.norm(y)
