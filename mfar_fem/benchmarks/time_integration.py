r"""What the time integrators are proved by: order, amplitude on a linear mode, momenta, energy, damping, adaptive steps.

The sheet of most cases is *soft* (10 N/m), so that the time steps resolve its membrane waves too and orders in time can be seen.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mfar_fem.benchmarks.free_vibration import DENSITY, SIZE, cantilever, sheet, swing
from mfar_fem.errors import NotConvergedError
from mfar_fem.loads import gravity
from mfar_fem.shell import State
from mfar_fem.solve.dynamics import DynamicResult, Dynamics, DynamicsOptions
from mfar_fem.solve.mass import Mass
from mfar_fem.solve.modes import natural_frequencies
from mfar_fem.supports import Hinge
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import strip

INTEGRATORS = (("implicit-euler", 1.0), ("bdf2", 1.0), ("generalized-alpha", 1.0), ("generalized-alpha", 0.8))
"""Method and spectral radius of all that is measured here."""


def label(method: str, rho: float) -> str:
    """Name of an integrator in the tables."""
    return f"{method} {rho:g}" if method == "generalized-alpha" else method


def reached(result: DynamicResult) -> DynamicResult:
    """The result, or the error that it did not converge."""
    if not result.converged:
        raise NotConvergedError(result.message, result)
    return result


def soft_swing(order: int, method: str, dt: float, rho: float = 1.0, cells: tuple[int, int] = (4, 2), **options) -> Dynamics:
    """Soft strip, 0.1 m x 0.05 m, hinged at one edge, that falls from the horizontal: large rotation and stretch."""
    surface = Surface.from_pattern(strip(SIZE, 0.5 * SIZE, *cells), order)
    options = {"rtol": 1e-10, "atol": 1e-14} | options
    return Dynamics(surface, sheet(10.0, 1e-6, 0.3), [Hinge("left")], [gravity(DENSITY)],
                    options=DynamicsOptions(method=method, dt=dt, rho=rho, **options))


def rms(a: np.ndarray, b: np.ndarray) -> float:
    """Root mean square distance of nodes (3 nn,), m."""
    return float(np.sqrt(3.0 * np.mean((a - b) ** 2)))


def order_in_time(order: int = 1, steps: tuple[int, ...] = (40, 80, 160), reference_steps: int = 1280, until: float = 0.06,
                  cells: tuple[int, int] = (4, 2)) -> dict:
    """Errors of position and observed rates of every integrator against a fine run of the trapezoidal rule.

    Returns
    -------
    dict
        By integrator ``errors`` (m) and ``rates`` (one between each two numbers of steps).
    """
    def positions(method, rho, n):
        return reached(soft_swing(order, method, until / n, rho, cells).run(until)).motion.kinematics.x

    exact = positions("generalized-alpha", 1.0, reference_steps)
    out: dict[str, Any] = {"shell_order": order, "steps": list(steps), "reference_steps": reference_steps, "integrators": {}}
    for method, rho in INTEGRATORS:
        errors = np.array([rms(positions(method, rho, n), exact) for n in steps])
        rates = np.log(errors[:-1] / errors[1:]) / np.log(np.array(steps[1:]) / np.array(steps[:-1]))
        out["integrators"][label(method, rho)] = {"errors": errors.tolist(), "rates": rates.tolist()}
    return out


def varying_steps(order: int = 1, levels: tuple[int, ...] = (10, 20, 40), until: float = 0.06,
                  reference_steps: int = 1280) -> dict:
    """BDF2 with steps that alternate 1 : 2 (``2 n`` of them): errors and rates."""
    exact = reached(soft_swing(order, "generalized-alpha", until / reference_steps).run(until)).motion.kinematics.x
    errors = []
    for n in levels:
        dynamics = soft_swing(order, "bdf2", until)
        for dt in np.tile([until / n / 3, 2 * until / n / 3], n):
            outcome = dynamics.step(float(dt))
            if isinstance(outcome, str):
                raise NotConvergedError(outcome)
        errors.append(rms(dynamics.motion.kinematics.x, exact))
    e = np.array(errors)
    return {"steps": [2 * n for n in levels], "errors": errors, "rates": np.log2(e[:-1] / e[1:]).tolist()}


def root(method: str, z: float, rho: float = 1.0) -> complex:
    """Principal root of an integrator on q'' = -ω² q per step, z = ω Δt: its modulus is the amplitude factor."""
    if method == "implicit-euler":
        return 1.0 / (1.0 - 1j * z)
    if method == "bdf2":
        return complex(max(np.roots([1.5 - 1j * z, -2.0, 0.5]), key=abs))
    am, af = (2 * rho - 1) / (rho + 1), rho / (rho + 1)
    gamma, beta = 0.5 - am + af, 0.25 * (1 - am + af) ** 2
    left = np.array([[1.0, 0.0, -beta], [0.0, 1.0, -gamma], [(1 - af) * z**2, 0.0, 1 - am]])  # of (q, Δt q', Δt² q'')
    right = np.array([[1.0, 1.0, 0.5 - beta], [0.0, 1.0, 1 - gamma], [-af * z**2, 0.0, -am]])
    roots = np.linalg.eigvals(np.linalg.solve(left, right))
    return complex(max(roots[roots.imag > 1e-12], key=abs))


def measured_root(q: np.ndarray) -> complex:
    """The root λ of a sequence q_n = Re(c λⁿ): least squares of its two-term recursion (Prony)."""
    (a, b), *_ = np.linalg.lstsq(np.column_stack([q[1:-1], q[:-2]]), q[2:], rcond=None)
    return complex(0.5 * a, np.sqrt(max(-b - 0.25 * a * a, 0.0)))


def amplitude(method: str, z: float, rho: float = 1.0, order: int = 2, n: int = 2, kind: str = "consistent", **options) -> dict:
    """Amplitude factor and phase per step on the first mode of a cantilever strip at ω Δt = ``z``, beside the exact ones."""
    case = cantilever(order, n)
    state, mass = case.problem.start(), Mass(case.problem.shell, DENSITY, kind)
    omega, modes = natural_frequencies(case.problem, state, mass, 2)
    settle, count = (0, 6) if method == "implicit-euler" else (25, 40)
    size = 1e-4 if method == "generalized-alpha" else 0.01  # what decays must stay above rounding
    _, q, _ = swing(case.problem, state, modes[:, 0], omega[0], mass, size * case.problem.shell.fabric.thickness,
                           periods=count * z / (2 * np.pi), method=method, rho=rho, dt=z / omega[0], **options)
    q = q[settle:]
    found, exact = measured_root(q), root(method, z, rho)
    return {"method": label(method, rho), "z": z, "omega": float(omega[0]), "amplitude": abs(found), "exact_amplitude": abs(exact),
            "phase": float(np.angle(found)) / z, "exact_phase": float(np.angle(exact)) / z}


def spinning_sheet(method: str, dt: float, rho: float = 1.0, order: int = 1, spin=(3.0, 5.0, 40.0), shake: float = 0.3,
                   **options) -> Dynamics:
    """Free soft sheet with an angular velocity (rad/s) and a random velocity (m/s, seed 1) of its nodes besides a drift."""
    surface = Surface.from_pattern(strip(SIZE, 0.7 * SIZE, 3, 2), order)
    x = surface.nodes - surface.nodes.mean(axis=0)
    velocity = np.cross(np.asarray(spin), x) + [0.5, -0.2, 0.1] + shake * np.random.default_rng(1).standard_normal(x.shape)
    options = {"rtol": 1e-12, "atol": 1e-16} | options
    return Dynamics(surface, sheet(30.0, 1e-5, 0.3), velocity=velocity,
                    options=DynamicsOptions(method=method, dt=dt, rho=rho, **options))


def momenta(dynamics: Dynamics) -> tuple[np.ndarray, np.ndarray]:
    """Linear (kg·m/s) and angular momentum (kg·m²/s) about the origin."""
    x, v = dynamics.motion.kinematics.x.reshape(-1, 3), dynamics.motion.kinematics.v.reshape(-1, 3)
    p = dynamics.inertia.mass(v)
    return p.sum(axis=0), np.cross(x, p).sum(axis=0)


def momentum(method: str, rho: float = 1.0, kind: str = "consistent", order: int = 1, dt: float = 5e-4, steps: int = 40) -> dict:
    """Change of the momenta of a free sheet, relative to their size.

    Returns
    -------
    dict
        ``linear``: largest relative change; ``angular``: the same of the angular momentum; ``identity``: largest relative violation
        of implicit Euler's L(n+1) = L(n) + Δt Σ v(n+1) × M v(n) in a step (None for the others).
    """
    dynamics = spinning_sheet(method, dt, rho, order, mass=kind)
    p0, L0 = momenta(dynamics)
    linear = angular = identity = 0.0
    for _ in range(steps):
        before, L = dynamics.motion.kinematics.v.reshape(-1, 3), momenta(dynamics)[1]
        outcome = dynamics.step(dt)
        if isinstance(outcome, str):
            raise NotConvergedError(outcome)
        p, L_new = momenta(dynamics)
        after = dynamics.motion.kinematics.v.reshape(-1, 3)
        predicted = L + dt * np.cross(after, dynamics.inertia.mass(before)).sum(axis=0)
        linear = max(linear, float(np.linalg.norm(p - p0) / np.linalg.norm(p0)))
        angular = max(angular, float(np.linalg.norm(L_new - L0) / np.linalg.norm(L0)))
        identity = max(identity, float(np.linalg.norm(L_new - predicted) / np.linalg.norm(L0)))
    return {"method": label(method, rho), "mass": kind, "shell_order": order, "steps": steps, "linear": linear, "angular": angular,
            "identity": identity if method == "implicit-euler" else None}


def energy_drift(method: str, rho: float = 1.0, periods: int = 100, steps_per_period: int = 80, stretch: float = 0.05,
                 order: int = 1) -> dict:
    """Energy of a free nonlinear vibration over many periods: a strip flung up by half its length at its free end.

    Parameters
    ----------
    stretch : float
        Membrane stiffness, N/m. With the default the time step resolves the membrane waves; with 30 N/m it does not.

    Returns
    -------
    dict
        ``end``: relative change of the energy at the end, ``largest``: the largest on the way; ``amplitude`` of the tip, m. Where
        the run failed or the energy has grown a hundredfold, ``unstable_after`` (periods) says when.
    """
    case = cantilever(order, 4)
    period = 2 * np.pi / (case.exact[0] * case.unit)
    nodes = case.problem.surface.nodes
    velocity = np.zeros_like(nodes)
    velocity[:, 2] = 3.0 * SIZE / period * (nodes[:, 0] / SIZE) ** 2
    dynamics = Dynamics(case.problem.surface, sheet(stretch, 1e-5), case.problem.supports, velocity=velocity,
                        options=DynamicsOptions(method=method, rho=rho, dt=period / steps_per_period, rtol=1e-9))
    tip, first = case.problem.surface.nodes_of("right"), dynamics.motion.first_energy
    energy, height, unstable = [0.0], 0.0, None
    for k in range(periods):
        result = dynamics.run((k + 1) * period)
        energy += [record.total / first - 1.0 for record in result.records]
        height = max(height, float(np.abs(dynamics.motion.kinematics.x.reshape(-1, 3)[tip, 2]).max()))
        if not result.converged or energy[-1] > 100.0:
            unstable = k + 1
            break
    return {"method": label(method, rho), "periods": periods, "steps_per_period": steps_per_period, "stretch": stretch,
            "end": float(energy[-1]), "largest": float(np.abs(energy).max()), "amplitude": height, "unstable_after": unstable}


def damping(method: str, mass_damping: float = 0.0, stiffness_share: float = 0.0, rho: float = 1.0,
            steps_per_period: int = 200) -> dict:
    """Decay of the first mode of a cantilever against c/2 + β ω²/2; ``mass_damping`` is c/ω, ``stiffness_share`` β ω."""
    z = 2 * np.pi / steps_per_period
    case = cantilever(2, 2)
    omega = natural_frequencies(case.problem, case.problem.start(), Mass(case.problem.shell, DENSITY), 2)[0][0]
    beta = stiffness_share / omega
    found = amplitude(method, z, rho, stiffness_damping=beta, mass_damping=mass_damping * omega)
    rate = -np.log(found["amplitude"]) / z * omega
    exact = 0.5 * (mass_damping * omega + beta * omega**2)
    return {"method": label(method, rho), "rate": float(rate), "exact": float(exact),
            "error_percent": float(100 * (rate / exact - 1))}


def adaptive(method: str = "bdf2", tolerance: float = 1e-5, order: int = 1, reference_steps: int = 1200) -> dict:
    """A heavily damped fall: the adaptive steps against as many fixed ones (errors at four times, the largest counts)."""
    stops, until, common = (0.03, 0.1, 0.3), 1.0, {"mass_damping": 20.0, "stiffness_damping": 2e-3}

    def run(dt, name, **options):
        dynamics, seen = soft_swing(order, name, dt, **(common | options)), []
        result = reached(dynamics.run(until, lambda r: seen.append((r.time, dynamics.motion.kinematics.x)), stops))
        at = [next(x for t, x in seen if abs(t - stop) < 1e-9) for stop in (*stops, until)]
        return at, result

    exact = run(until / reference_steps, "bdf2")[0]
    at, result = run(0.05, method, tolerance=tolerance)
    count = len(result.records)
    fixed = run(until / count, method)[0]
    return {"method": method, "tolerance": tolerance, "steps": count, "error": max(map(rms, at, exact)),
            "fixed_error": max(map(rms, fixed, exact)), "smallest_step": min(r.dt for r in result.records),
            "largest_step": max(r.dt for r in result.records), "largest_local_error": max(r.error for r in result.records)}


def run(thorough: bool = True) -> dict:
    """Everything: the payload of ``mfar benchmark dynamics``.

    Parameters
    ----------
    thorough : bool
        False: fewer periods and orders, for a quick look.
    """
    from mfar_fem.benchmarks.free_vibration import CASES, frequencies, pendulum

    orders = (1, 2) if thorough else (1,)
    second = [item for item in INTEGRATORS if item[0] != "implicit-euler"]
    return {
        "benchmark": "dynamics",
        "order_in_time": [order_in_time(order) for order in orders],
        "varying_steps": varying_steps(),
        "amplitude": [amplitude(method, z, rho) for method, rho in INTEGRATORS for z in (0.1, 0.5, 2.0)
                      if (method, z) != ("bdf2", 2.0)],
        "momentum": [momentum(method, rho, kind, order) for method, rho in INTEGRATORS for kind in ("consistent", "lumped")
                     for order in orders],
        "energy_drift": [energy_drift(method, rho, 100 if thorough else 10, count, stretch)
                         for count, stretch in ((80, 0.05), (40, 30.0)) for method, rho in second],
        "damping": [damping("bdf2", mass_damping=0.05), damping("bdf2", stiffness_share=0.05),
                    damping("generalized-alpha", stiffness_share=0.05)],
        "adaptive": [adaptive(method) for method in ("implicit-euler", "bdf2", "generalized-alpha")],
        "frequencies": [frequencies(name, order) for name in CASES for order in ((2, 1) if thorough else (2,))],
        "pendulum": [pendulum(angle) for angle in (5.0, 30.0, 60.0, 90.0)],
    }


def rotated(state: State, rotation: np.ndarray, n_x: int) -> State:
    """A state turned as a rigid body by a rotation matrix (3, 3)."""
    u = state.u.copy()
    u[:n_x] = (u[:n_x].reshape(-1, 3) @ rotation.T).ravel()
    return State(u, state.directors @ rotation.T)
