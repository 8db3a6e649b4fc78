r"""The Hencky membrane: a flat circular sheet clamped at its rim, under pressure, without prestress.

Föppl's equations of a membrane of moderate rotations, in :math:`\rho = r/a` and :math:`n = N_r/(E h p^2 a^2)^{1/3}`:

.. math:: n'' + \frac{3}{\rho} n' = -\frac{1}{8 n^2}, \qquad n'(0) = 0, \quad n'(1) + (1-\nu)\,n(1) = 0, \qquad
          \frac{w_0}{a} = \Big(\frac{p a}{E h}\Big)^{1/3} \int_0^1 \frac{\rho}{2 n}\,d\rho

(radial equilibrium :math:`N_\theta = (r N_r)'`, vertical :math:`N_r w' = -p r/2`, compatibility, no radial displacement
at the rim).

References
----------
1. H. Hencky, "Über den Spannungszustand in kreisrunden Platten mit verschwindender Biegungssteifigkeit", Z. Math. Phys. 63
   (1915) 311–317.
2. W. B. Fichter, "Some solutions for the large deflections of uniformly loaded circular membranes", NASA TP-3658, 1997.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from material_tests.inflation.mesh import membrane, quarter_disc
from mfar_fem.errors import NotConvergedError, ParameterError
from mfar_fem.loads import Pressure
from mfar_fem.materials.st_venant_kirchhoff import StVenantKirchhoff
from mfar_fem.solve import NewtonOptions, Problem
from mfar_fem.solve.newton import newton
from mfar_fem.supports import Hinge, Support


@dataclass(frozen=True, eq=False)
class Hencky:
    """Exact solution: radius over a, radial force, deflection over ``a (pa/Eh)^(1/3)``, (m,) each, and its value at the centre."""

    rho: np.ndarray
    force: np.ndarray
    deflection: np.ndarray

    @property
    def centre(self) -> float:
        """w0/a over (p a/(E h))^(1/3)."""
        return float(self.deflection[0])


def exact(nu: float, points: int = 101) -> Hencky:
    """Integrate the equations above; ``nu`` in (-1, 0.5].

    Raises
    ------
    ParameterError
        Poisson's ratio out of range.
    NotConvergedError
    """
    from scipy.integrate import solve_ivp
    from scipy.optimize import brentq

    if not -1.0 < nu <= 0.5:
        raise ParameterError(f"Poisson's ratio must lie in (-1, 0.5], not {nu}")

    def slopes(rho, y):
        n, dn, _ = y
        return [dn, -0.125 / n**2 - (3.0 * dn / rho if rho > 0 else 0.75 * -0.125 / n**2), 0.5 * rho / n]

    # the equations have the scaling n(rho) -> s^(2/3) n(rho/s): one integration to the radius where the rim condition holds
    def reached(rho, y):
        return y[0] - 0.05

    def at(rho, tail):
        return rho * tail[1] + (1.0 - nu) * tail[0]

    start = 1e-4
    first = [1.0 - start**2 / 64.0, -start / 32.0, 0.25 * start**2]  # n'' = -1/32 at the centre
    reached.terminal = True  # type: ignore[attr-defined]
    path = solve_ivp(slopes, (start, 20.0), first, rtol=1e-12, atol=1e-14, dense_output=True, events=reached)
    end = path.t[-1]
    if at(end, path.y[:, -1]) > 0:
        raise NotConvergedError(f"Hencky membrane: the rim condition is not met up to a radius of {end:.3g} for nu = {nu}")
    rim = brentq(lambda r: at(r, path.sol(r)), 1e-2, end, xtol=1e-13)
    rho = np.linspace(0.0, 1.0, points)
    y = path.sol(np.maximum(rho * rim, start))
    return Hencky(rho, y[0] * rim ** (-2.0 / 3.0), (y[2, -1] - y[2]) * rim ** (-4.0 / 3.0))


def solve(order: int = 2, rings: int = 8, sectors: int = 6, nu: float = 0.3, load: float = 1e-6, radius: float = 0.1) -> dict:
    """The same by finite elements (finite strain, follower pressure), a quarter of the disc.

    Parameters
    ----------
    load : float
        p a/(E h); small, because the exact solution is the limit of small slopes.

    Returns
    -------
    dict
        ``centre`` (w0/a over load^(1/3)), ``exact``, ``error_percent``, ``profile_error`` (largest difference over the centre's
        deflection), ``rho``, ``deflection``, mesh and Newton iterations.
    """
    law, thickness = StVenantKirchhoff.isotropic(1e9, nu), 1e-4
    surface = quarter_disc(radius, rings, sectors, order)
    supports = [Hinge("outer"), Support("along_x", (1,)), Support("along_y", (0,))]
    pressure = Pressure(load * law.Ew * thickness / radius)
    problem = Problem(surface, membrane(law, thickness), supports, [pressure], bending=False)
    solution, state = exact(nu), problem.start()
    u = state.u.copy()
    rho = np.linalg.norm(surface.nodes, axis=1) / radius
    size = radius * load ** (1.0 / 3.0)
    u.reshape(-1, 3)[:, 2] = 0.6 * size * (1.0 - rho**2)
    u[problem.fixed] = problem.prescribed(1.0)
    result = newton(problem, state.with_u(u), 1.0, NewtonOptions(rtol=1e-8))
    if not result.converged:
        raise NotConvergedError(f"Hencky membrane, order {order}, {rings} x {sectors}: {result.status}", result)
    w = problem.shell.positions(result.state)[:, 2] / size
    expected = np.interp(rho, solution.rho, solution.deflection)
    centre = float(w[surface.boundary["centre"][0]])
    return {"order": order, "rings": rings, "sectors": sectors, "nu": nu, "load": load, "centre": centre, "exact": solution.centre,
            "error_percent": 100.0 * (centre / solution.centre - 1.0),
            "profile_error": float(np.abs(w - expected).max() / solution.centre),
            "newton_iterations": result.iterations, "rho": rho, "deflection": w}
