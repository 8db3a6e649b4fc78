"""The numba kernels against the numpy twin; the jets of the twin against finite differences."""

import numpy as np
import pytest
from shell_cases import PLATE, SHAPES, SILK, gradient, moved, shell, tangent

from mfar_fem.shell import twin
from mfar_fem.shell.jets import Jet, angle, cross, dot, unit


@pytest.mark.parametrize("shape, order", SHAPES)
@pytest.mark.parametrize("fabric", [SILK, PLATE], ids=["silk", "plate"])
def test_numba_and_numpy_agree(shape, order, fabric):
    s = shell(shape, order, fabric)
    state = moved(s, 2e-3, 0.1)
    reference = twin.evaluate(s, state)
    membrane, bending = s.energies(state)
    assert membrane > 0 and bending > 0
    assert membrane == pytest.approx(reference.membrane.sum(), rel=1e-12)
    assert bending == pytest.approx(reference.bending.sum(), rel=1e-12)
    g = gradient(s, state)
    for exact in (True, False):
        expected_g, expected_K = twin.assemble(s, reference, exact)
        assert abs(g - expected_g).max() <= 1e-12 * abs(g).max()
        K = tangent(s, state, exact)
        assert abs(K - expected_K).max() <= 1e-12 * abs(K).max()


@pytest.mark.parametrize("shape, order", SHAPES)
def test_twin_without_bending_is_the_membrane_part(shape, order):
    s = shell(shape, order, bending=False)
    state = moved(s, 2e-3, 0.0)
    g, K = twin.assemble(s, twin.evaluate(s, state), False)
    assert abs(gradient(s, state) - g).max() <= 1e-12 * abs(g).max()
    assert abs(tangent(s, state, False) - K).max() <= 1e-12 * abs(K).max()


def test_jets_are_derivatives():
    rng = np.random.default_rng(1)
    a, b, c = (rng.normal(size=(3, 4)) for _ in range(3))

    def quantity(u):  # an angle between two normalised vectors that are linear in u (4,)
        p, q, r = (Jet((m @ u)[None], m[None], np.zeros((1, 3, 4, 4))) for m in (a, b, c))
        n = unit(cross(p, q))
        return angle(dot(n, r), dot(unit(p), r))

    u, h = rng.normal(size=4), 1e-5
    jet = quantity(u)
    for i, e in enumerate(np.eye(4)):
        up, down = quantity(u + h * e), quantity(u - h * e)
        assert (up.value - down.value)[0] / (2 * h) == pytest.approx(jet.first[0, i], rel=1e-7, abs=1e-8)
        assert (up.first - down.first)[0] / (2 * h) == pytest.approx(jet.second[0, i], rel=1e-6, abs=1e-7)
