"""The two sheets by finite elements, and what is measured on them.

Order-2 shells with bending. Wrinkled sheets have many equilibria, which keep the number of wrinkles they started from: so each
sheet is started from several wavelengths and the one of least energy counts. A start is the compressed flat sheet plus a small
wave; Newton's descent (energy line search) does the rest.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import numpy as np

from material_tests.spectrum.radial import dominant
from material_tests.wrinkles import scalings
from mfar_fem.errors import NotConvergedError
from mfar_fem.materials import Bending, Fabric, get_law
from mfar_fem.materials.st_venant_kirchhoff import StVenantKirchhoff
from mfar_fem.shell import State
from mfar_fem.solve import NewtonOptions, Problem
from mfar_fem.solve.newton import newton
from mfar_fem.supports import Clamp
from mfar_fem.surface import Surface, patterns


@dataclass(frozen=True, eq=False)
class Branch:
    """One wrinkled state.

    Attributes
    ----------
    seed : float
        Wavelength of the start over that of the scaling law.
    wavelength, uncertainty, amplitude : float
        m, in the convention of the scaling law (sheared: half wavelength; stretched: full).
    direction : float
        Of the wave vector from the x axis, rad.
    energy : float
        J; ``bending`` the part of the bending.
    status : str
        ``converged``, or why Newton's descent stopped; ``residual`` relative to the reactions.
    """

    seed: float
    wavelength: float
    uncertainty: float
    amplitude: float
    direction: float
    energy: float
    bending: float
    status: str
    residual: float
    iterations: int
    wall_s: float
    problem: Problem = field(repr=False)
    state: State = field(repr=False)

    def to_dict(self) -> dict:
        """The figures for a report."""
        return {"seed": self.seed, "wavelength_m": self.wavelength, "wavelength_uncertainty_m": self.uncertainty,
                "amplitude_m": self.amplitude, "wave_direction_deg": float(np.degrees(self.direction)), "energy_J": self.energy,
                "bending_J": self.bending, "status": self.status, "residual": self.residual, "iterations": self.iterations,
                "wall_s": self.wall_s}


def sheared_strip(height: float, length: float, thickness: float, shear: float, nu: float, seed: float, cells: tuple[int, int],
                  E: float = 3.5e9, options: NewtonOptions | None = None) -> Branch:
    """Strip along x, lower edge clamped, upper edge clamped and moved by ``shear * height`` along it; short edges free.

    Parameters
    ----------
    height, length, thickness : float
        m.
    seed : float
        Wavelength of the start over the scaling law's.
    cells : (nx, ny)
        Two order-2 triangles each, the diagonals along the tension.

    Returns
    -------
    Branch
        Measured on the middle 40 % of the length and 70 % of the height (wavelength by Fourier, amplitude √2 of the root mean
        square along the middle line).
    """
    half, amplitude = scalings.sheared(height, thickness, shear, nu)
    law = StVenantKirchhoff.isotropic(E, nu)
    surface = Surface.from_pattern(patterns.strip(length, height, *cells), 2)
    fabric = Fabric("film", law, thickness, 1.4e3 * thickness, Bending.derived(law, thickness))
    problem = Problem(surface, fabric, [Clamp("bottom"), Clamp("top", displacement=(shear * height, 0.0, 0.0))])
    x, y = surface.nodes[:, 0], surface.nodes[:, 1]
    edge = np.clip(np.minimum(y, height - y) / half, 0.0, 1.0)
    wave = seed * amplitude * edge * np.sin(np.pi * (x - y) / (np.sqrt(2.0) * seed * half) + 0.7)
    state, result, wall = _descend(problem, np.column_stack([x + shear * y, y, wave]), options)
    step = half / 14.0
    w = _sample(surface, problem.shell.positions(state)[:, 2], np.arange(0.3 * length, 0.7 * length, step),
                np.arange(0.15 * height, 0.85 * height, step))
    peak = dominant(w, step)
    middle = w[w.shape[0] // 2]
    return _branch(seed, 0.5 * peak.wavelength, 0.5 * peak.uncertainty, float(np.sqrt(2.0) * middle.std()), peak.direction,
                   result, wall, problem, state)


def stretched_sheet(length: float, width: float, thickness: float, strain: float, seed: float, cells: tuple[int, int],
                    mu: float = 1e6, options: NewtonOptions | None = None) -> Branch:
    """Neo-Hookean sheet along x, short edges clamped and pulled apart by ``strain * length``; half of the length is solved.

    Parameters
    ----------
    length, width, thickness : float
        m.
    seed : float
        Wavelength of the start over the scaling law's.
    cells : (nx, ny)
        On half the length.

    Returns
    -------
    Branch
        Measured across the middle: wavelength twice the mean distance between neighbouring extrema of more than a fifth of the
        largest, its uncertainty from their scatter; amplitude half the largest height difference.

    Raises
    ------
    NotConvergedError
        The flat sheet did not stretch.
    """
    law = get_law("neo-hookean", mu=mu)
    surface = Surface.from_pattern(patterns.strip(0.5 * length, width, *cells, "union"), 2)
    fabric = Fabric("sheet", law, thickness, 1e3 * thickness, Bending.derived(law, thickness))
    pulled = Clamp("right", displacement=(0.5 * strain * length, 0.0, 0.0), components=(0,))
    problem = Problem(surface, fabric, [Clamp("left"), pulled])
    x, y = surface.nodes[:, 0], surface.nodes[:, 1] - 0.5 * width
    narrow = 1.0 - (1.0 - (1.0 + strain) ** -0.5) * np.clip(2.0 * x / width, 0.0, 1.0)
    start = problem.start()
    u = start.u.copy()
    u[: problem.shell.alpha_offset] = np.column_stack([x * (1.0 + strain), 0.5 * width + y * narrow, 0.0 * x]).ravel()
    u[problem.fixed] = problem.prescribed(1.0)
    flat = newton(problem, start.with_u(u), 1.0, NewtonOptions(rtol=1e-8))
    if not flat.converged:
        raise NotConvergedError(f"stretched sheet, strain {strain:g}: the flat sheet did not converge ({flat.status})", flat)
    wavelength = seed * scalings.stretched(length, thickness, strain, 0.5)
    place = problem.shell.positions(flat.state).copy()
    place[:, 2] += (thickness * np.cos(2 * np.pi * y / wavelength + 0.4) * np.exp(-((4.0 * y / width) ** 2))
                    * np.sin(np.pi * x / length) ** 2)
    state, result, wall = _descend(problem, place, options)
    line = surface.nodes_of("right")
    deformed = problem.shell.positions(state)[line[np.argsort(surface.nodes[line, 1])]]
    spacing, scatter = extrema_spacing(deformed[:, 1], deformed[:, 2])
    return _branch(seed, 2.0 * spacing, 2.0 * scatter, 0.5 * float(np.ptp(deformed[:, 2])), 0.5 * np.pi, result, wall, problem,
                   state)


def extrema_spacing(y: np.ndarray, w: np.ndarray, share: float = 0.2) -> tuple[float, float]:
    """Mean distance of neighbouring extrema of w(y) that exceed ``share`` of the largest, and its standard error.

    NaN if there are fewer than two. The extrema are those of a cubic spline through the points (n,).
    """
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(y, w)
    at = spline.derivative().roots(extrapolate=False)
    at = at[np.isfinite(at)]
    at = at[np.abs(spline(at)) > share * np.abs(w).max()]
    if len(at) < 2:
        return float("nan"), float("nan")
    gaps = np.diff(np.sort(at))
    return float(gaps.mean()), float(gaps.std(ddof=1) / np.sqrt(len(gaps))) if len(gaps) > 1 else float("nan")


def _descend(problem: Problem, place: np.ndarray, options: NewtonOptions | None):
    """Minimise the energy from given nodes (nn, 3)."""
    clock, start = time.perf_counter(), problem.start()
    u = start.u.copy()
    u[: problem.shell.alpha_offset] = place.ravel()
    u[problem.fixed] = problem.prescribed(1.0)
    options = options or NewtonOptions(rtol=1e-5, plain_iterations=0, max_iterations=150)
    result = newton(problem, start.with_u(u), 1.0, options)
    return result.state, result, time.perf_counter() - clock


def _branch(seed, wavelength, uncertainty, amplitude, direction, result, wall, problem, state) -> Branch:
    membrane, bending = problem.shell.energies(state)
    return Branch(seed, wavelength, uncertainty, amplitude, direction, membrane + bending, bending, result.status,
                  float(result.residual_relative), result.iterations, wall, problem, state)


def _sample(surface: Surface, w: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Heights on a regular grid of reference points, (ny, nx)."""
    from scipy.interpolate import CloughTocher2DInterpolator

    return CloughTocher2DInterpolator(surface.nodes[:, :2], w)(*np.meshgrid(x, y))
