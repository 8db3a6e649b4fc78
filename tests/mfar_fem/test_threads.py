"""Shares of elements, their order, and an assembly that does not depend on them."""

import numpy as np
import pytest

from mfar_fem import threads
from mfar_fem.materials import Fabric
from mfar_fem.shell import Shell
from mfar_fem.solve.problem import Problem
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import strip


@pytest.mark.parametrize("n", [0, 1, 499, 999, 1000, 12345])
@pytest.mark.parametrize("given", ["1", "2", "3", "64", "no"])
def test_shares_cover_everything_once_and_in_order(n, given, monkeypatch):
    monkeypatch.setenv(threads.VARIABLE, given)
    parts = threads.shares(n)
    assert np.array_equal(np.concatenate([np.arange(n)[p] for p in parts]), np.arange(n))
    assert 1 <= len(parts) <= max(1, min(threads.count(), n // threads.SHARE))
    assert threads.count() == (min(int(given), threads.MOST) if given.isdigit() else threads.count())


def test_results_come_in_order_and_errors_are_raised():
    parts = [slice(i, i + 1) for i in range(6)]
    assert threads.run(lambda p: p.start, parts) == list(range(6))
    with pytest.raises(ZeroDivisionError):
        threads.run(lambda p: 1 // (p.start - 4), parts)


@pytest.mark.parametrize("order", [1, 2])
def test_energy_gradient_and_tangent_are_the_same_on_one_thread_and_on_three(order, monkeypatch):
    p = strip(0.1, 0.1, 20, 20, "union")
    surface = Surface(p.vertices, p.triangles, order, boundary=p.boundary)
    problem = Problem(surface, Fabric.load("silk-charmeuse"))
    start = problem.start()
    state = start.with_u(start.u + 1e-4 * np.random.default_rng(0).standard_normal(len(start.u)))
    monkeypatch.setattr(threads, "SHARE", 100)
    found = []
    for count in ("1", "3", "3"):
        monkeypatch.setenv(threads.VARIABLE, count)
        assert len(threads.shares(len(surface.elements))) == int(count)
        shell: Shell = problem.shell
        g, data = problem.tangent(state, 1.0, True)
        alone = np.zeros(problem.n)
        shell.gradient(state, alone)
        found.append((shell.energy(state), g, alone, data))
    for a, b, c in zip(*found, strict=True):
        scale = np.abs(a).max()
        assert np.abs(np.subtract(a, b)).max() <= 1e-13 * scale  # summed in another order
        assert np.array_equal(b, c)  # and always in the same one
