r"""Free vibrations with closed forms: strips, plates, membranes and the pendulum, by eigenvalues and by integration in time.

==================== ======================================================================== ==============================
case                 what                                                                     unit of the frequency
==================== ======================================================================== ==============================
cantilever           strip clamped at one end (Euler–Bernoulli, ν = 0)                        :math:`\sqrt{B/\rho}/L^2`
plate                simply supported square plate (Kirchhoff)                                :math:`\sqrt{B/\rho}/a^2`
membrane             square membrane under uniform tension T                                  :math:`\sqrt{T/\rho}/a`
hanging-strip        limp strip hung from one end: :math:`j_{0n}/2`                            :math:`\sqrt{g/L}`
==================== ======================================================================== ==============================

The hanging strip is limp along and stiff across, so that only its pendulum-like modes are slow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ellipk, jn_zeros

from mfar_fem.errors import NotConvergedError
from mfar_fem.loads import GRAVITY, gravity
from mfar_fem.materials.bending import Bending
from mfar_fem.materials.fabric import Fabric
from mfar_fem.materials.st_venant_kirchhoff import StVenantKirchhoff
from mfar_fem.shell import State
from mfar_fem.solve import Problem, solve_static
from mfar_fem.solve.dynamics import Dynamics, DynamicsOptions
from mfar_fem.solve.mass import Mass
from mfar_fem.solve.modes import natural_frequencies
from mfar_fem.supports import Clamp, Hinge
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import strip

G = -GRAVITY[2]
DENSITY, RIGIDITY, SIZE = 0.1, 1e-5, 0.1
"""kg/m², N·m and m of the cases (the results do not depend on them)."""


@dataclass(frozen=True)
class Vibration:
    """A case: its problem, the equilibrium is sought from its start; ``exact`` frequencies in the ``unit`` (rad/s)."""

    problem: Problem
    exact: tuple[float, ...]
    unit: float


def sheet(stretch: float, bend: float, nu: float = 0.0, density: float = DENSITY) -> Fabric:
    """Isotropic sheet of membrane stiffness E h (N/m), bending rigidity (N·m) and areal density (kg/m²)."""
    h = float(np.sqrt(12.0 * (1 - nu**2) * bend / stretch))
    return Fabric("sheet", StVenantKirchhoff.isotropic(stretch / h, nu), h, density, Bending.isotropic(stretch / h, nu, h))


def cantilever(order: int, n: int) -> Vibration:
    """Strip clamped at one end."""
    surface = Surface.from_pattern(strip(SIZE, 0.2 * SIZE, n, max(1, n // 8)), order)
    problem = Problem(surface, sheet(1e3, RIGIDITY), [Clamp("left")])
    return Vibration(problem, (3.51601527, 22.03449156), np.sqrt(RIGIDITY / DENSITY) / SIZE**2)


def plate(order: int, n: int) -> Vibration:
    """Simply supported square plate: π² (m² + n²)."""
    surface = Surface.from_pattern(strip(SIZE, SIZE, n, n), order)
    problem = Problem(surface, sheet(1e3, RIGIDITY, 0.3), [Hinge(side) for side in ("left", "right", "top", "bottom")])
    return Vibration(problem, tuple(np.pi**2 * np.array([2.0, 5.0, 5.0, 8.0])), np.sqrt(RIGIDITY / DENSITY) / SIZE**2)


def membrane(order: int, n: int) -> Vibration:
    """Square membrane, drawn out by supports on all sides until the tension is uniform: π √(m² + n²)."""
    surface = Surface.from_pattern(strip(SIZE, SIZE, n, n), order)
    stretch, strain = 1e3, 0.01
    sides = []
    for axis, names in ((0, ("left", "right")), (1, ("bottom", "top"))):
        other = 1 - axis
        for name in names:
            x = surface.nodes[surface.nodes_of(name)]
            move = np.zeros_like(x)
            move[:, axis], move[:, other] = strain * x[:, axis], strain * x[:, other]
            sides.append(Hinge(name, displacement=move))
    problem = Problem(surface, sheet(stretch, 1e-12), sides)
    tension = stretch * (strain + 0.5 * strain**2)  # second Piola-Kirchhoff: what bears on slopes per reference length
    return Vibration(problem, tuple(np.pi * np.sqrt([2.0, 5.0, 5.0, 8.0])), np.sqrt(tension / DENSITY) / SIZE)


def hanging_strip(order: int, n: int) -> Vibration:
    """Limp strip that hangs from one end (along x, as the gravity does)."""
    surface = Surface.from_pattern(strip(SIZE, 0.2 * SIZE, n, 1), order)
    fabric = sheet(1e4, 1e-6).replace(bending=Bending(1e-10, 1e-3, 1e-3))
    problem = Problem(surface, fabric, [Hinge("left")], [gravity(DENSITY, (G, 0.0, 0.0))])
    return Vibration(problem, tuple(0.5 * jn_zeros(0, 3)), np.sqrt(G / SIZE))


CASES: dict[str, tuple[Callable[[int, int], Vibration], dict[int, int]]] = {
    "cantilever": (cantilever, {1: 64, 2: 8}),
    "plate": (plate, {1: 40, 2: 10}),
    "membrane": (membrane, {1: 32, 2: 8}),
    "hanging-strip": (hanging_strip, {1: 64, 2: 16}),
}
"""Builder of every case and its mesh by order."""


def equilibrium(problem: Problem) -> State:
    """The state the sheet vibrates about: its reference where nothing acts on it."""
    if not problem.loads and not problem.change.any():
        return problem.start()
    result = solve_static(problem)
    if not result.converged:
        raise NotConvergedError(f"no equilibrium to vibrate about: {result.message}", result)
    return result.state


def swing(problem: Problem, state: State, mode: np.ndarray, omega: float, mass: Mass, size: float = 1e-6, periods: float = 1.3,
          **options) -> tuple[np.ndarray, np.ndarray, Dynamics]:
    """Release the sheet from ``state`` displaced along a mode (n,); its longest displacement is ``size`` metres.

    Returns
    -------
    t, q : (m,) arrays
        Times, s, and the coordinate of the mode relative to its start.
    dynamics : Dynamics
    """
    scale = size / np.linalg.norm(mode[: problem.shell.alpha_offset].reshape(-1, 3), axis=1).max()
    chosen: dict[str, Any] = {"dt": 2 * np.pi / omega / 100, "method": "generalized-alpha", "rho": 1.0, "rtol": 1e-9, "atol": 0.0}
    chosen |= options
    start = problem.shell.accept(state.with_u(state.u + scale * mode))
    dynamics = Dynamics(problem.surface, problem.shell.fabric, problem.supports, problem.loads, start=start,
                        options=DynamicsOptions(mass=mass.kind, **chosen))
    n_x = problem.shell.alpha_offset
    weight = mass((scale * mode[:n_x]).reshape(-1, 3)).ravel()
    weight /= weight @ (scale * mode[:n_x])
    t, q = [0.0], [1.0]

    def note(record):
        t.append(record.time)
        q.append(float(weight @ (dynamics.motion.kinematics.x - state.u[:n_x])))

    result = dynamics.run(periods * 2 * np.pi / omega, note)
    if not result.converged:
        raise NotConvergedError(f"the vibration did not converge: {result.message}", result)
    return np.array(t), np.array(q), dynamics


def crossings(t: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Times at which q changes its sign, by cubic interpolation through four samples."""
    found = []
    for i in np.flatnonzero(q[:-1] * q[1:] < 0):
        k = int(np.clip(i - 1, 0, len(t) - 4))
        at, values = t[k:k + 4] - t[i], q[k:k + 4]
        roots = np.roots(np.polyfit(at, values, 3))
        real = roots[np.abs(roots.imag) < 1e-9 * (t[i + 1] - t[i])].real
        found.append(t[i] + real[np.argmin(np.abs(real - 0.5 * (t[i + 1] - t[i])))])
    return np.array(found)


def frequencies(name: str, order: int = 2, n: int | None = None, kind: str = "consistent", integrate: bool = True) -> dict:
    """A case of :data:`CASES`.

    Returns
    -------
    dict
        ``exact``, ``eigenvalues`` (dimensionless frequencies), ``error_percent``, and by integration in time of the first mode
        ``integrated`` with ``integrated_error_percent``.
    """
    build, meshes = CASES[name]
    case = build(order, n or meshes[order])
    state, mass = equilibrium(case.problem), Mass(case.problem.shell, DENSITY, kind)
    omega, modes = natural_frequencies(case.problem, state, mass, 4)
    exact = np.array(case.exact)
    values = omega[: len(exact)] / case.unit
    if name == "cantilever":  # a strip also twists
        bending = [i for i in range(len(omega)) if _symmetric(case.problem, modes[:, i])][: len(exact)]
        values = omega[bending] / case.unit
    out = {"case": name, "order": order, "mass": kind, "elements": len(case.problem.surface.elements), "exact": exact.tolist(),
           "eigenvalues": values.tolist(), "error_percent": (100 * (values / exact - 1)).tolist()}
    if integrate:
        t, q, _ = swing(case.problem, state, modes[:, 0], omega[0], mass)
        times = crossings(t, q)
        integrated = np.pi / (times[1] - times[0]) / case.unit
        out |= {"integrated": float(integrated), "integrated_error_percent": float(100 * (integrated / exact[0] - 1))}
    return out


def _symmetric(problem: Problem, mode: np.ndarray) -> bool:
    """Whether the deflection at the free end has one sign."""
    z = mode[: problem.shell.alpha_offset].reshape(-1, 3)[problem.surface.nodes_of("right"), 2]
    return bool(abs(z.mean()) > 0.5 * np.abs(z).max())


def pendulum(degrees: float, order: int = 1, steps: int = 200, method: str = "generalized-alpha", rho: float = 0.8) -> dict:
    """A stiff plate released at rest from an angle to the vertical: a physical pendulum of the length 2 L / 3.

    Returns
    -------
    dict
        ``period_ratio``: period over 2π √(2L/3g), ``exact`` ``2 K(sin(θ/2)) / π``, ``error_percent``.
    """
    surface = Surface.from_pattern(strip(SIZE, 0.2 * SIZE, 4, 1), order)
    angle = np.radians(degrees)
    down, across = np.array([np.sin(angle), 0.0, -np.cos(angle)]), np.array([0.0, 1.0, 0.0])
    x = surface.nodes[:, :1] * down + surface.nodes[:, 1:2] * across
    problem = Problem(surface, sheet(1e5, 0.1), [Hinge("left")], [gravity(DENSITY)])
    reference = problem.start()
    normal = np.cross(down, across)
    u = reference.u.copy()
    u[: problem.shell.alpha_offset] = x.ravel()
    start = State(u, np.broadcast_to(normal, reference.directors.shape).copy())
    natural = 2 * np.pi * np.sqrt(2 * SIZE / (3 * G))
    exact = 2 / np.pi * float(ellipk(np.sin(angle / 2) ** 2))
    options = DynamicsOptions(method=method, rho=rho, dt=natural * exact / steps, rtol=1e-8)
    dynamics = Dynamics(surface, problem.shell.fabric, problem.supports, problem.loads, start=start, options=options)
    tip, t, q = surface.nodes_of("right"), [0.0], [angle]

    def note(record):
        x = dynamics.problem.shell.positions(dynamics.motion.state)[tip].mean(axis=0)
        t.append(record.time)
        q.append(float(np.arctan2(x[0], -x[2])))

    result = dynamics.run(0.85 * exact * natural, note)
    if not result.converged:
        raise NotConvergedError(f"the pendulum did not converge: {result.message}", result)
    times = crossings(np.array(t), np.array(q))
    ratio = 2 * (times[1] - times[0]) / natural
    return {"degrees": degrees, "order": order, "period_ratio": float(ratio), "exact": exact,
            "error_percent": float(100 * (ratio / exact - 1))}
