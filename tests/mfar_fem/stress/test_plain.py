"""The verifier's own energy: it agrees with the solver where it must, and it would notice a wrong state."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from mfar_fem.materials import Bending, Fabric
from mfar_fem.materials.law import get_law, law_names
from mfar_fem.solve import Problem, solve_static
from mfar_fem.solve.mass import Mass
from mfar_fem.stress import Case
from mfar_fem.stress.plain import PlainSheet
from mfar_fem.stress.verify import Verifier
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import strip

orders = pytest.mark.parametrize("order", [1, 2])


def bent(order, law):
    surface = Surface.from_pattern(strip(0.1, 0.05, 4, 3, "union"), order, warp=(np.cos(0.3), np.sin(0.3), 0.0))
    problem = Problem(surface, Fabric("x", law, 1e-4, 0.1, Bending(1e-5, 2e-5, 7e-6, 3e-6)))
    state, k = problem.start(), problem.shell.alpha_offset
    u, rng = state.u.copy(), np.random.default_rng(order)
    u[:k] += 1e-4 * rng.standard_normal(k)
    x = u[:k].reshape(-1, 3)
    x[:, 2] += 2.0 * x[:, 0] ** 2
    u[k:] += 0.1 * rng.standard_normal(len(u) - k)
    return problem, state.with_u(u)


@orders
@pytest.mark.parametrize("name", law_names())
def test_energy_and_gradient_are_those_of_the_solver(order, name):
    problem, state = bent(order, get_law(name, **({"Lw": 0.5, "Lf": 0.5, "Ls": 2.0} if name == "yarn-network" else {})))
    plain = PlainSheet(problem.surface, problem.shell.fabric)
    assert_allclose(plain.energy(state.u, state.directors), problem.shell.energies(state), rtol=1e-11)
    g = problem.gradient(state, 1.0)
    assert np.linalg.norm(plain.gradient(state.u, state.directors) - g) < 2e-9 * np.linalg.norm(g)


@orders
@pytest.mark.parametrize("kind", ["consistent", "lumped"])
def test_mass_from_the_closed_form(order, kind):
    problem, _ = bent(order, get_law("neo-hookean"))
    mass = Mass(problem.shell, 0.1, kind)
    x = np.random.default_rng(0).standard_normal((len(problem.surface.nodes), 3))
    assert_allclose(PlainSheet(problem.surface, problem.shell.fabric).mass_matrix(kind) @ x, mass(x), rtol=1e-11, atol=1e-18)


def test_a_curved_reference_is_refused():
    surface = Surface.from_pattern(strip(0.1, 0.05, 2, 2), 1)
    curved = Surface(surface.vertices + [[0, 0, 1]] * (surface.vertices[:, :1] ** 2), surface.triangles)
    with pytest.raises(ValueError, match="flat"):
        PlainSheet(curved, Fabric("x", get_law("neo-hookean"), 1e-4, 0.1, Bending(1e-5, 1e-5, 1e-5)))


@orders
def test_the_verifier_notices_what_is_wrong(order):
    """A displaced node, a slipped support, another load factor: none passes; the solution does."""
    case = Case(order=order, cells=(4, 2), support="pulled", stretch=0.2)
    problem = Problem(case.surface(), case.fabric(), case.supports(case.surface()), case.loads())
    result = solve_static(problem, 1)
    verifier = Verifier(case, problem.surface, problem.shell.fabric, 1e-8)
    assert verifier.static(result.state).ok
    assert not verifier.static(result.state, 0.99).ok
    k = problem.shell.alpha_offset
    for unknown, amount, reason in ((problem.free[7], 1e-8, "residual"), (problem.fixed[0], 1e-9, "held")):
        u = result.state.u.copy()
        u[unknown] += amount
        verdict = verifier.static(result.state.with_u(u))
        assert not verdict.ok and reason in verdict.reason
    assert len(verifier.free) == problem.n and np.array_equal(np.flatnonzero(verifier.free), problem.free) and k < problem.n
