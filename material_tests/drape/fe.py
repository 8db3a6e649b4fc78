"""One drape by finite elements: a start (seed), the relaxation to rest, and what the drapemeter reads there."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from material_tests.drape import seeds
from material_tests.drape.geometry import DrapeTest
from material_tests.drape.measure import Reading, flat_triangles, read
from mfar_fem.errors import InputError
from mfar_fem.solve.rest import RestOptions, RestResult, relax

OPTIONS = RestOptions(softening=(0.03, 0.3))
"""Relaxed with 3 and 30 % of the tensile stiffness first, then with the fabric itself."""
FALL_TIME, FALL_STEP, FALL_DRAG = 0.4, 0.02, 0.6
"""A true fall before the relaxation: duration and time step of implicit Euler, s; drag of the air, N·s²/m⁴."""
CONTACT_RANGE = 1e-3
"""Distance at which self-contact begins to act, m."""


@dataclass(frozen=True)
class Seed:
    """Where a drape starts.

    Attributes
    ----------
    kind : {'folds', 'flat', 'fall'}
        n folds; nearly flat and relaxed; nearly flat and let fall through air for 0.4 s, then relaxed.
    number : int
        Number of folds, or seed of the random perturbation.
    amplitude : float
        Of the random perturbation, m.
    """

    kind: str = "folds"
    number: int = 7
    amplitude: float = 1e-3

    def __post_init__(self):
        if self.kind not in ("folds", "flat", "fall"):
            raise InputError(f"a drape starts from folds, flat or fall, not '{self.kind}'")
        if self.number < 0 or not self.amplitude > 0:
            raise InputError(f"a seed needs a number >= 0 and a positive amplitude, not {self.number} and {self.amplitude}")

    @property
    def label(self) -> str:
        """Name in tables."""
        return f"{self.number} folds" if self.kind == "folds" else f"{self.kind} {self.number}"


@dataclass(frozen=True, eq=False)
class Drape:
    """A drape at rest (or where the relaxation ended).

    Attributes
    ----------
    test : DrapeTest
    seed : Seed
    reading : Reading
    rest : RestResult
    gravity : float
        Potential of the weight, J (0 when flat).
    intersecting : bool or None
        Whether the sheet passes through itself (None: ipctk is not installed).
    x : (nn, 3) array
        Deformed nodes, m.
    unknowns : int
    wall_s : float
    """

    test: DrapeTest
    seed: Seed
    reading: Reading
    rest: RestResult
    gravity: float
    intersecting: bool | None
    x: np.ndarray = field(repr=False)
    unknowns: int = 0
    wall_s: float = 0.0

    @property
    def physical(self) -> bool:
        """At rest, stable, and not through itself as far as that is known."""
        return self.rest.converged and self.rest.stable is not False and not self.intersecting

    def row(self) -> dict[str, Any]:
        """The result as plain values, one row of a branch table."""
        r, rest = self.reading, self.rest
        return {
            "seed": self.seed.label, "kind": self.seed.kind, "number": self.seed.number, "amplitude_m": self.seed.amplitude,
            "drape_coefficient_percent": r.drape_coefficient, "nodes": r.nodes, "depth_m": r.depth,
            "energy_J": rest.energy, "membrane_J": rest.membrane, "bending_J": rest.bending, "gravity_J": self.gravity,
            "converged": rest.converged, "status": rest.status, "message": rest.message, "stable": rest.stable,
            "intersecting": self.intersecting, "physical": self.physical,
            "residual_relative": rest.residual_relative, "iterations": rest.iterations, "escapes": rest.escapes,
            "wall_s": self.wall_s, "unknowns": self.unknowns,
            "outline_m": np.round(r.outline, 6).tolist(), "amplitudes_m": np.round(r.amplitudes, 7).tolist(),
            "x_m": np.round(self.x, 7).tolist(),
        }


def drape(fabric, test: DrapeTest | None = None, seed: Seed | None = None, options: RestOptions = OPTIONS,
          self_contact: bool = False, start: np.ndarray | None = None,
          progress: Callable[[int, float, float], None] | None = None) -> Drape:
    """Drape a fabric over the disc.

    Parameters
    ----------
    fabric : Fabric
        Warp along x.
    test : DrapeTest
    seed : Seed
    self_contact : bool
        Keep the sheet from passing through itself (extra ``contact``; slower).
    start : (nn, 3) array, optional
        Deformed nodes to start from, instead of the seed.
    progress : callable, optional
        ``progress(iteration, energy, relative residual)``.

    Returns
    -------
    Drape
        Never raises for a failure to converge: see ``rest.status``.
    """
    clock = time.perf_counter()
    test, seed = test or DrapeTest(), seed or Seed()
    loads = [_barrier(fabric)] if self_contact else []
    problem = test.problem(fabric, loads)
    surface, radii = problem.surface, (test.disc_radius, test.specimen_radius)
    if start is not None:
        x = seeds.admissible(problem, np.ascontiguousarray(start, dtype=float))
        options = replace(options, softening=())
    elif seed.kind == "folds":
        x = seeds.folds(surface, *radii, seed.number)
    else:
        x = seeds.nearly_flat(surface, *radii, seed.number, seed.amplitude)
    state = _fall(fabric, surface, seeds.start(problem, x)) if seed.kind == "fall" and start is None else seeds.start(problem, x)
    report = None if progress is None else lambda iteration, energy, residual, _: progress(iteration, energy, residual)
    rest = relax(problem, state, options, report)
    x = problem.shell.positions(rest.state).copy()
    points, triangles = flat_triangles(surface, x)
    weight = problem.loads[0].energy(problem.shell, rest.state, 1.0)
    return Drape(test, seed, read(points, triangles, *radii), rest, weight, self_intersection(surface, x), x, problem.n,
                 time.perf_counter() - clock)


def _fall(fabric, surface, state):
    """Let the sheet fall through air; the state it has reached."""
    from mfar_fem.drag import AirDrag
    from mfar_fem.loads import gravity
    from mfar_fem.solve.dynamics import Dynamics, DynamicsOptions
    from mfar_fem.supports import Clamp

    options = DynamicsOptions(dt=FALL_STEP, rtol=1e-3)
    motion = Dynamics(surface, fabric, [Clamp("inner")], [gravity(fabric.areal_density)], [AirDrag(FALL_DRAG)], options=options,
                      start=state)
    return motion.run(FALL_TIME).state


def _barrier(fabric):
    from mfar_fem.contact.barrier import Barrier

    return Barrier(self_contact=True, dhat=CONTACT_RANGE, min_distance=0.0)


def self_intersection(surface, x: np.ndarray) -> bool | None:
    """Whether a sheet with deformed nodes ``x`` (nn, 3) passes through itself; None without ipctk."""
    from mfar_fem.contact.collision_mesh import ipctk
    from mfar_fem.errors import MissingDependencyError

    try:
        ipc = ipctk()
    except MissingDependencyError:
        return None
    rest, triangles = flat_triangles(surface, surface.nodes)
    points = np.asfortranarray(flat_triangles(surface, x)[0])
    mesh = ipc.CollisionMesh(np.asfortranarray(rest), ipc.edges(triangles), triangles)
    return bool(ipc.has_intersections(mesh, points))
