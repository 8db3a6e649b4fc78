"""From oriented points to the final mesh: Poisson, openings, even triangles, adaptive Loop, ARAP with ideal shapes, check."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mfar_fem.errors import ParameterError
from reconstruction.surface.connectivity import loop_lengths
from reconstruction.surface.improve import improve
from reconstruction.surface.openings import trim_by_curves
from reconstruction.surface.poisson import poisson_surface
from reconstruction.surface.quality import Quality, quality_table
from reconstruction.surface.remesh import even_edge, remesh
from reconstruction.surface.repair import repair
from reconstruction.surface.sheet import trim_by_sheet
from reconstruction.surface.subdivision import ANGLE, adaptive_loop, uniform_loop
from reconstruction.surface.triangles import TriangleMesh
from reconstruction.surface.trimming import FACTOR, Trimmed, trim_by_distance, trimmed

EDGE = 1.5
"""Edges before subdivision, in point spacings: the Poisson surface is extracted finer than the points tell."""

REACH = 4.0
"""How far the surface may be from a sheet that bounds it, in point spacings or cells."""


@dataclass(frozen=True)
class SurfaceSettings:
    """What can be set.

    Attributes
    ----------
    depth : int or None
        Of the octree; None by the spacing of the points.
    screening : float
        Of the Poisson surface.
    trim : float
        Distance in point spacings where no curves are given.
    even : bool
        Remesh before subdivision (not in the paper).
    edge : float or None
        Edge of that, m; None takes :data:`EDGE` point spacings, or what the Poisson surface has if that is longer.
    adaptive : bool
        Subdivide by curvature; otherwise not at all (control), or everywhere.
    uniform : int
        Splits of every triangle where `adaptive` is off (control).
    angle : float
        θ of :mod:`reconstruction.surface.subdivision`, rad.
    kappa : float or None
        A fixed κ_th, 1/m, in its place.
    levels : int
        Most splits.
    interpolate : bool
        See :func:`reconstruction.surface.subdivision.adaptive_loop`.
    arap : bool
        Improve the triangles by ARAP with ideal shapes.
    iterations : int
        Of that.
    """

    depth: int | None = None
    screening: float = 4.0
    trim: float = FACTOR
    even: bool = True
    edge: float | None = None
    adaptive: bool = True
    uniform: int = 0
    angle: float = ANGLE
    kappa: float | None = None
    levels: int = 2
    interpolate: bool = True
    arap: bool = True
    iterations: int = 20


@dataclass(frozen=True, eq=False)
class SurfaceResult:
    """What came of every stage.

    Attributes
    ----------
    mesh : TriangleMesh
        The final one; it passes `mfar_fem.surface.quality.check_surface`.
    poisson, trimmed, even, subdivided : TriangleMesh
        After each stage; the same mesh again where a stage is switched off.
    spacing : float
        Of the points, m.
    loop_lengths : tuple of float
        Circumferences of the final openings, m, the largest first.
    quality : tuple of Quality
        A row a stage.
    actions : tuple of str
        What was done, in order.
    timings : dict of str to float
        s.
    energies : tuple of float
        Of the improvement.
    """

    mesh: TriangleMesh
    poisson: TriangleMesh
    trimmed: TriangleMesh
    even: TriangleMesh
    subdivided: TriangleMesh
    spacing: float
    loop_lengths: tuple[float, ...]
    quality: tuple[Quality, ...]
    actions: tuple[str, ...]
    timings: dict[str, float] = field(default_factory=dict)
    energies: tuple[float, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Plain data without the meshes."""
        return {
            "spacing_m": self.spacing, "openings_m": list(self.loop_lengths), "quality": [q.to_dict() for q in self.quality],
            "actions": list(self.actions), "timings_s": self.timings, "energies": list(self.energies),
        }  # fmt: skip


def build_surface(
    points,
    normals,
    sigma=None,
    openings: int | Sequence | TriangleMesh | None = None,
    settings: SurfaceSettings | None = None,
    closed: bool = False,
) -> SurfaceResult:
    """Reconstruct a garment's surface.

    Parameters
    ----------
    points, normals : (n, 3) arrays
        m; outward.
    sigma : float or (n,) array, optional
        Standard deviations of the points, m.
    openings : int, sequence of (k, 3) arrays or TriangleMesh, optional
        Closed curves (hem, cuffs, collar; m) to cut along; or a sheet whose extent is kept
        (:func:`reconstruction.surface.sheet.trim_by_sheet`); or how many openings there must be after trimming by distance;
        None: as many as there are.
    settings : SurfaceSettings, optional
    closed : bool
        The surface has no openings (a figurine): nothing is trimmed.

    Raises
    ------
    SurfaceError
        Points that make no surface (:class:`~reconstruction.surface.poisson.TooFewPointsError`,
        :class:`~reconstruction.surface.poisson.NormalsError`, :class:`~reconstruction.surface.poisson.CoplanarPointsError`),
        other openings than expected (:class:`~reconstruction.surface.trimming.OpeningsError`), or a result that cannot be
        mended.
    ParameterError
        Settings out of range; openings given for a closed surface.
    """
    s = settings or SurfaceSettings()
    if closed and openings is not None and openings != 0:
        raise ParameterError("a closed surface has no openings: leave them out, or closed=False")
    timings: dict[str, float] = {}
    actions: list[str] = []
    clock = time.perf_counter()

    def lap(name: str) -> None:
        nonlocal clock
        now = time.perf_counter()
        timings[name], clock = now - clock, now

    base = poisson_surface(points, normals, sigma, s.depth, s.screening)
    actions += [
        f"Poisson surface at depth {base.depth}: cells of {1e3 * base.cell:.3g} mm, points {1e3 * base.spacing:.3g} mm apart",
        *base.actions,
    ]
    lap("poisson")
    cut = _open(base, openings, s, closed)
    actions += cut.actions
    lap("trimming")
    mended = repair(cut.mesh, openings=len(cut.loops), merge=1e-9)
    actions += [f"{a.what}: {a.count}" for a in mended.actions]
    even = mended.mesh
    if s.even:
        even, what = remesh(even, max(even_edge(even), EDGE * base.spacing) if s.edge is None else s.edge)
        actions += what
    lap("even triangles")
    fine = even
    if s.adaptive and s.levels:
        made = adaptive_loop(even, levels=s.levels, interpolate=s.interpolate, angle=s.angle, kappa=s.kappa)
        fine = made.mesh
        marks = " + ".join(str(m) for m in made.marked)
        actions.append(
            f"{marks} triangles marked by curvature, {len(even.faces)} became {len(fine.faces)}; "
            f"vertices moved {1e3 * made.moved:.2g} mm at most"
        )
    elif s.uniform:
        fine = uniform_loop(even, s.uniform)
        actions.append(f"every triangle split {s.uniform} times, {len(even.faces)} became {len(fine.faces)}")
    lap("subdivision")
    final = fine
    energies: tuple[float, ...] = ()
    if s.arap:
        smooth = uniform_loop(fine, 1) if s.adaptive else fine  # facets would pull the vertices inward by their sagitta
        better = improve(fine, smooth, iterations=s.iterations, smoothing=2)
        final, energies = better.mesh, better.energies
        actions.append(
            f"ARAP with ideal shapes: energy {energies[0]:.3g} to {energies[-1]:.3g} in {len(energies) - 1} steps, vertices moved "
            f"{1e3 * better.moved_mean:.2g} mm on average, faces {1e3 * better.off_max:.2g} mm off the surface at most"
        )
    lap("arap")
    checked = repair(final, openings=len(cut.loops), merge=1e-9)
    actions += [f"{a.what}: {a.count}" for a in checked.actions]
    lap("check")
    rows = quality_table({"poisson": base.mesh, "trimmed": cut.mesh, "even": even, "subdivided": fine, "final": checked.mesh})
    lengths = tuple(sorted(loop_lengths(checked.mesh), reverse=True))
    return SurfaceResult(
        checked.mesh, base.mesh, cut.mesh, even, fine, base.spacing, lengths, rows, tuple(actions), timings, energies
    )


def _open(base, openings, s: SurfaceSettings, closed: bool) -> Trimmed:
    if closed:
        return trimmed(base.mesh, base.mesh, [])
    if openings is None or isinstance(openings, (int, np.integer)):
        return trim_by_distance(base.mesh, base.points, base.spacing, s.trim, None if openings is None else int(openings))
    if isinstance(openings, TriangleMesh):
        return trim_by_sheet(base.mesh, openings, REACH * max(base.spacing, base.cell))
    return trim_by_curves(base.mesh, openings, base.points)
