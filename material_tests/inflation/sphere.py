r"""The spherical neo-Hookean balloon: pressure against stretch, over the pressure maximum.

.. math:: p = \frac{2\mu h}{R}\big(\lambda^{-1} - \lambda^{-7}\big), \qquad
          \hat p R/(\mu h) = 1.23946 \text{ at } \lambda = 7^{1/6} = 1.38309

with the undeformed radius R and thickness h (I. Müller, P. Strehlow, "Rubber and Rubber Balloons", Lect. Notes Phys. 637,
Springer 2004, doi 10.1007/b93853).
"""

from __future__ import annotations

import numpy as np

from material_tests.inflation.mesh import membrane, sphere_octant
from material_tests.inflation.volume import at_volume
from mfar_fem.loads import Pressure
from mfar_fem.materials import get_law
from mfar_fem.solve import Problem
from mfar_fem.supports import Support

STRETCHES = (1.05, 1.1, 1.2, 1.3, 1.36, 1.38, 1.40, 1.5, 1.75, 2.0)


def exact(stretch) -> np.ndarray:
    """p R/(mu h) at the stretches."""
    stretch = np.asarray(stretch, dtype=float)
    return 2.0 * (1.0 / stretch - stretch**-7)


def peak() -> tuple[float, float]:
    """Stretch and p R/(mu h) at the maximum."""
    stretch = 7.0 ** (1.0 / 6.0)
    return stretch, float(exact(stretch))


def solve(order: int = 2, n: int = 4, radius: float = 0.1, stretches=STRETCHES) -> dict:
    """Inflate an eighth of the balloon to the volumes of the given stretches.

    Returns
    -------
    dict
        ``stretch`` ((V/V0)^(1/3)), ``pressure`` (p R/(mu h)), ``exact``, ``largest_error_percent``, ``peak_stretch`` and
        ``peak_pressure`` (of the parabola through the highest three points) with their errors, ``sphericity`` (sd of the
        nodes' distance from the centre over its mean, at the last stretch).
    """
    law, thickness = get_law("neo-hookean", mu=1e5), 1e-3
    surface = sphere_octant(radius, n, order)
    load = Pressure(law.mu * thickness / radius)
    supports = [Support(name, (axis,)) for axis, name in enumerate("xyz")]
    problem = Problem(surface, membrane(law, thickness), supports, [load], bending=False)
    state = problem.start()
    rest = -load.energy(problem.shell, state, 1.0) / load.pressure
    u, factor, found, iterations, before = state.u, float(exact(stretches[0])), [], 0, 1.0
    for stretch in stretches:
        state, factor, used = at_volume(problem, load, rest * stretch**3, state.with_u(u * stretch / before), factor)
        u, before, iterations = state.u, stretch, iterations + used
        found.append(factor)
    pressure, closed = np.array(found), exact(stretches)
    top = int(np.clip(np.argmax(pressure), 1, len(pressure) - 2))
    a, b, c = np.polyfit(stretches[top - 1 : top + 2], pressure[top - 1 : top + 2], 2)
    at, value = -0.5 * b / a, c - 0.25 * b * b / a
    distance = np.linalg.norm(problem.shell.positions(state), axis=1)
    expected = peak()
    return {"order": order, "divisions": n, "stretch": np.array(stretches), "pressure": pressure, "exact": closed,
            "largest_error_percent": float(100 * np.abs(pressure / closed - 1).max()), "peak_stretch": float(at),
            "peak_pressure": float(value), "peak_stretch_error_percent": float(100 * (at / expected[0] - 1)),
            "peak_pressure_error_percent": float(100 * (value / expected[1] - 1)),
            "sphericity": float(distance.std() / distance.mean()), "newton_iterations": iterations}
