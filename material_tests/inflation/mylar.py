r"""The Mylar balloon: two inextensible discs joined at the rim and inflated; meridians keep their length, hoops wrinkle.

With radius a of the flat discs and r of the inflated rim

.. math:: \frac ra = \frac{4\sqrt{2\pi}}{\Gamma(1/4)^2} = 0.76276, \qquad
          \frac{\text{thickness}}{r} = \frac{(2\pi)^{3/2}}{\Gamma(1/4)^2}, \qquad V = \frac{2\pi}{3} a r^2 .

By finite elements the upper disc is a stiff isotropic sheet in tension-field theory
(:class:`mfar_fem.materials.tension_field.TensionField`): no bending, no compression, and what little compression stiffness is
left must be far below the load, ``residual`` << p a/(E h), or it pushes the rim outwards (2.6 % of its radius with residual =
load).

References
----------
1. W. H. Paulsen, "What is the shape of a Mylar balloon?", Am. Math. Monthly 101 (1994) 953–958.
2. I. M. Mladenov, J. Oprea, "The Mylar balloon revisited", Am. Math. Monthly 110 (2003) 761–784.
"""

from __future__ import annotations

import numpy as np

from material_tests.inflation.mesh import membrane, quarter_disc
from mfar_fem.errors import NotConvergedError
from mfar_fem.loads import Pressure
from mfar_fem.materials.st_venant_kirchhoff import StVenantKirchhoff
from mfar_fem.materials.tension_field import SLACK, WRINKLED, TensionField
from mfar_fem.solve import NewtonOptions, Problem
from mfar_fem.solve.newton import newton
from mfar_fem.supports import Support

LADDER = ((1e-2, 1e-4), (1e-3, 1e-6), (1e-4, 1e-7))
"""Loads p a/(E h), with the residual stiffness of each, on the way to the inextensible limit."""


def exact() -> dict[str, float]:
    """Rim radius and thickness over a, and volume over a³."""
    from scipy.special import gamma

    r = 4.0 * np.sqrt(2.0 * np.pi) / gamma(0.25) ** 2
    return {"radius": float(r), "thickness": float(r * (2.0 * np.pi) ** 1.5 / gamma(0.25) ** 2),
            "volume": float(2.0 * np.pi / 3.0 * r**2)}


def solve(order: int = 2, rings: int = 8, sectors: int = 6, nu: float = 0.3, radius: float = 0.1, ladder=LADDER) -> dict:
    """Inflate a quarter of the upper half; the rim stays in the plane z = 0 and moves freely in it.

    Returns
    -------
    dict
        ``steps`` (one for each load of the ladder: radius, thickness, volume, Newton iterations), the last of them with ``exact``
        and ``error_percent``, ``rim_scatter`` (sd of the rim's radius over its mean), ``wrinkled`` and ``slack`` (area fractions),
        ``profile`` (r/a and z/a of a meridian).

    Raises
    ------
    NotConvergedError
    """
    law, thickness = StVenantKirchhoff.isotropic(1e9, nu), 1e-4
    surface = quarter_disc(radius, rings, sectors, order)
    supports = [Support("outer", (2,)), Support("along_x", (1,)), Support("along_y", (0,))]
    rho = np.linalg.norm(surface.nodes, axis=1) / radius
    u = surface.nodes * (1.0 - 0.2 * rho**2)[:, None]
    u[:, 2] = 0.4 * radius * (1.0 - rho**2)
    u, steps, pressure = u.ravel(), [], Pressure(1.0)
    bare = Problem(surface, membrane(law, thickness), supports, [pressure], bending=False)
    bare.conservative = True  # the rim stays in the plane z = 0, so -pV is a potential
    state = bare.start()
    for load, residual in ladder:
        pressure.pressure = load * law.Ew * thickness / radius
        problem = bare.with_fabric(membrane(TensionField(law, residual), thickness))
        u[problem.fixed] = problem.prescribed(1.0)
        result = newton(problem, state.with_u(u), 1.0, NewtonOptions(rtol=1e-7, max_iterations=200))
        if not result.converged:
            raise NotConvergedError(f"Mylar balloon, order {order}, {rings} x {sectors}, load {load:g}: {result.status}", result)
        u = result.state.u.copy()
        x = problem.shell.positions(result.state)
        rim = np.hypot(*x[surface.nodes_of("outer"), :2].T) / radius
        volume = -8.0 * pressure.energy(problem.shell, result.state, 1.0) / pressure.pressure / radius**3
        steps.append({"load": load, "residual": residual, "radius": float(rim.mean()), "volume": float(volume),
                      "thickness": float(2.0 * x[surface.boundary["centre"][0], 2] / radius),
                      "newton_iterations": result.iterations})
    regime = problem.shell.fabric.law.regime(problem.shell.right_cauchy_green(result.state).reshape(-1, 3))
    weight = problem.shell.geometry.area_weights.ravel() / problem.shell.geometry.area_weights.sum()
    side = surface.nodes_of("along_x")
    side = side[np.argsort(surface.nodes[side, 0])]
    closed = exact()
    return {"order": order, "rings": rings, "sectors": sectors, "steps": steps, "exact": closed,
            "error_percent": {key: 100.0 * (steps[-1][key] / value - 1.0) for key, value in closed.items()},
            "rim_scatter": float(rim.std() / rim.mean()), "wrinkled": float(weight[regime == WRINKLED].sum()),
            "slack": float(weight[regime == SLACK].sum()),
            "profile": {"r": np.hypot(*x[side, :2].T) / radius, "z": x[side, 2] / radius}}
