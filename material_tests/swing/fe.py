"""The swing by finite elements: a flat swatch on a hinge, turned about it, at rest, let go under gravity and drag.

Generalised-alpha (spectral radius 0.5) takes next to nothing from the motion itself, so that what the record loses is the drag's;
the share it does take is reported. With a spectral radius near 1 and long steps the method may *gain* energy and never stop: a run
that gains is a named failure. The swatch hangs by one edge; the axis is that edge.
"""

from __future__ import annotations

import math
import time as clock
from dataclasses import dataclass, field, replace

import numpy as np

from material_tests.swing.model import Pendulum
from mfar_fem.drag import AirDrag
from mfar_fem.errors import InputError, NotConvergedError, UnknownNameError
from mfar_fem.loads import GRAVITY
from mfar_fem.loads import gravity as gravity_load
from mfar_fem.materials.fabric import Fabric
from mfar_fem.solve.dynamics import DynamicResult, Dynamics, DynamicsOptions
from mfar_fem.supports import Hinge
from mfar_fem.surface import Surface, patterns

SIZE = (0.15, 0.10)
"""Swatch of the paper's kind, m: long and short side."""

RHO, LARGEST_GAIN = 0.5, 0.02
"""Spectral radius at infinite frequency; share of the energy at the release that an integrator may gain."""


class EnergyGainedError(NotConvergedError):
    """The time integrator has put energy into the motion: shorter steps or another method are needed."""


@dataclass(frozen=True)
class Level:
    """Order of the shell, cells along and across the swatch, time steps in a period of the rigid plate."""

    order: int
    along: int
    across: int
    steps: int

    def finer(self) -> Level:
        """About 1.5 times as fine in space and time."""
        return replace(self, along=math.ceil(1.5 * self.along), steps=math.ceil(1.5 * self.steps))


LEVELS = {"draft": Level(1, 10, 2, 100), "standard": Level(2, 6, 2, 160), "reference": Level(2, 12, 4, 320)}


def level_of(fidelity: str | Level) -> Level:
    """A level by name, or as it is.

    Raises
    ------
    UnknownNameError
    """
    if isinstance(fidelity, Level):
        return fidelity
    if fidelity not in LEVELS:
        raise UnknownNameError(f"unknown fidelity '{fidelity}'; known: {', '.join(LEVELS)}")
    return LEVELS[fidelity]


@dataclass(frozen=True)
class Specimen:
    """A swatch on its hinge.

    Attributes
    ----------
    fabric : Fabric
    length, width : float
        Below the axis and along it, m.
    angle : float
        From the vertical at the release, rad.
    direction : float
        Of the warp from the way down, rad.
    tangential : float
        Drag along the sheet, N·s²/m⁴.
    """

    fabric: Fabric
    length: float = SIZE[0]
    width: float = SIZE[1]
    angle: float = math.radians(60.0)
    direction: float = 0.0
    tangential: float = 0.02

    def __post_init__(self):
        if not (self.length > 0 and self.width > 0):
            raise InputError(f"length and width of a swatch must be positive, got {self.length}, {self.width} m")
        if not 0 < self.angle < math.pi:
            raise InputError(f"a swatch is released between 0 and a half turn, got {self.angle} rad")

    def plate(self, gamma: float, frequency: float = 1.0) -> Pendulum:
        """The rigid plate of the same size and weight, with the drag ``gamma`` (N·s²/m⁴)."""
        return Pendulum.plate(self.length, self.fabric.areal_density, gamma, frequency)

    @property
    def height_energy(self) -> float:
        """Potential energy of the flat swatch at the release over that at rest, J."""
        weight = self.fabric.areal_density * self.length * self.width * -GRAVITY[2]
        return 0.5 * weight * self.length * (1.0 - math.cos(self.angle))


@dataclass(frozen=True, eq=False)
class Swing:
    """A computed swing.

    Attributes
    ----------
    time, angle : (n,) arrays
        s and rad: angle from the vertical of the chord from the axis to the middle of the lower edge; first the release.
    bow : (n,) array
        What the chord is shorter than the swatch, as a share of its length: 0 for a plate.
    defect : float
        Share of the energy at the release that the integrator itself took (negative: gave).
    dissipated : float
        Share that the drag took.
    result : DynamicResult
    dynamics : Dynamics
    wall_s : float
    """

    time: np.ndarray
    angle: np.ndarray
    bow: np.ndarray
    defect: float
    dissipated: float
    wall_s: float
    result: DynamicResult = field(repr=False)
    dynamics: Dynamics = field(repr=False)

    def at(self, times) -> np.ndarray:
        """Angle (m,), rad, at ``times`` (m,), s, by a cubic spline."""
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.time, self.angle)(times)


def swing(specimen: Specimen, gamma: float, duration: float, fidelity: str | Level = "standard",
          method: str = "generalized-alpha", dt: float | None = None, rho: float = RHO) -> Swing:
    """Let a swatch swing.

    Parameters
    ----------
    specimen : Specimen
    gamma : float
        Drag along the normal, N·s²/m⁴.
    duration : float
        s.
    fidelity : str or Level
    method : str
        Time integrator, see :mod:`mfar_fem.solve.integrators`.
    dt : float, optional
        Time step, s; default that of the level.
    rho : float
        Spectral radius of generalised-alpha.

    Raises
    ------
    InputError
    NotConvergedError
        A time step failed; ``result`` carries the motion up to there.
    EnergyGainedError
        The integrator gained more than :data:`LARGEST_GAIN`.
    """
    level, begin = level_of(fidelity), clock.perf_counter()
    dynamics = _dynamics(specimen, gamma, level, method, dt or specimen.plate(0.0).period() / level.steps, rho)
    shell, surface = dynamics.problem.shell, dynamics.problem.surface
    lower = surface.nodes_of("right")
    middle = lower[np.argmin(np.abs(surface.nodes[lower, 1] - 0.5 * specimen.width))]
    times, chords = [0.0], [surface.nodes[middle]]

    def keep(record) -> None:
        times.append(record.time)
        chords.append(shell.positions(dynamics.motion.state)[middle])
        if record.defect < -LARGEST_GAIN * specimen.height_energy:
            gain = -100 * record.defect / specimen.height_energy
            message = f"{method} with steps of {record.dt:.3g} s has added {gain:.3g} % to the energy by {record.time:.4g} s"
            raise EnergyGainedError(f"swing of '{specimen.fabric.name}': {message}; try shorter steps, smaller rho or bdf2", record)

    result = dynamics.run(duration, keep)
    if not result.converged:
        raise NotConvergedError(f"swing of '{specimen.fabric.name}': {result.message}", result)
    chord, last = np.array(chords), result.records[-1]
    bow = 1.0 - np.hypot(chord[:, 0], chord[:, 2]) / specimen.length
    return Swing(np.array(times), np.arctan2(chord[:, 0], -chord[:, 2]), bow, last.defect / specimen.height_energy,
                 last.dissipated / specimen.height_energy, clock.perf_counter() - begin, result, dynamics)


def _dynamics(specimen: Specimen, gamma: float, level: Level, method: str, dt: float, rho: float) -> Dynamics:
    down = np.array([math.sin(specimen.angle), 0.0, -math.cos(specimen.angle)])
    along = np.array([0.0, 1.0, 0.0])
    sheet = patterns.rectangle(level.along, level.across, (0.0, specimen.length), (0.0, specimen.width),
                               lambda uv: uv @ np.stack([down, along]))
    warp = math.cos(specimen.direction) * down + math.sin(specimen.direction) * along
    surface = Surface.from_pattern(sheet, level.order, warp)
    weight = gravity_load(specimen.fabric.areal_density, GRAVITY, ramp=False)
    return Dynamics(surface, specimen.fabric, [Hinge("left")], [weight], [AirDrag(gamma, specimen.tangential)],
                    options=DynamicsOptions(method=method, dt=dt, rho=rho))
