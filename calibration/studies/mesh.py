"""What the mesh does to an oblique strip of a woven fabric, and to the parameters fitted on it.

Yarns are a thousand times stiffer than the trellis. Elements that no yarn direction runs along lock (tension locking, see
`material_tests.strip.fe`), and shear is carried in thin layers along the yarns that leave the corners of the grips. A mesh that
does not resolve them makes the strip too stiff, and a fit takes that up in the parameters of trellis shear, G and Ls: they belong
to the mesh they were fitted on. This study shows how much.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

import numpy as np

from calibration.experiments import Experiment
from calibration.finite_element import FiniteElementStrip
from calibration.fit import fit
from calibration.homogeneous import HomogeneousCantilever
from calibration.problem import Problem, law_unknowns
from calibration.runs import SERIAL, Workers
from calibration.studies import kept
from material_tests.strip.fe import TRIANGLES, StripTest, strip_cells
from mfar_fem.errors import InputError

REFIT_TOLERANCE = 1e-5


@dataclass(frozen=True)
class Mesh:
    """A mesh of the whole strip.

    Attributes
    ----------
    name : str
    triangles : int
        About so many.
    pattern : str
        Of an oblique strip, see `mfar_fem.surface.grid.triangulate`: 'criss' has both diagonals in a cell, which lie along the
        yarns on the bias; 'union' and 'right' have one.
    grading : float
        0: even cells; towards 1: cells at the ends and sides become small against those in the middle (factor 1 - grading
        against 1 + grading), and their diagonals leave the yarns. Only oblique strips are graded.
    """

    name: str
    triangles: int
    pattern: str = "criss"
    grading: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.grading < 0.95:
            raise InputError(f"grading is {self.grading:g}; it must be at least 0 and below 0.95")

    def test(self, gauge: float, width: float, angle: float) -> StripTest:
        """The strip test on this mesh."""
        even = StripTest(gauge, width, angle)
        if even.aligned:
            return StripTest(gauge, width, angle, cells=strip_cells(gauge, width, max(4, self.triangles // 2), 2))
        total = self.triangles // (4 if self.pattern == "criss" else 2)
        test = GradedStripTest(gauge, width, angle, cells=strip_cells(gauge, width, max(4, total)))
        test.pattern, test.grading = self.pattern, self.grading
        return test

    def __call__(self, experiment: Experiment):
        """The forward model of an experiment: a mesh is a level of the calibration."""
        if experiment.kind == "cantilever":
            return HomogeneousCantilever(experiment)
        model = FiniteElementStrip(experiment)
        model.test = self.test(experiment.gauge, experiment.width, experiment.direction)
        return model


MESHES = (*(Mesh(name, n) for name, n in TRIANGLES.items()), Mesh("graded", TRIANGLES["standard"], grading=0.5),
          Mesh("one diagonal", TRIANGLES["standard"], "union"), Mesh("one diagonal, fine", TRIANGLES["reference"], "union"))
FINEST = Mesh("finest", 4000)
"""What the forces at fixed parameters are compared with."""

REFITTED = ("draft", "standard", "reference", "one diagonal")


class GradedStripTest(StripTest):
    """A strip test whose cells are smaller towards the grips and the free sides."""

    grading = 0.0

    def _build(self, fabric, quarter: bool):
        from mfar_fem.solve import Problem as BoundaryValueProblem
        from mfar_fem.surface import Surface, patterns

        even = super()._build(fabric, quarter)
        if quarter or not self.grading:
            return even
        pattern = patterns.strip(self.gauge, self.width, *self.cells, self.pattern)
        size = np.array([self.gauge, self.width])
        uv = size * graded(pattern.uv / size, self.grading)
        warp = np.array([math.cos(self.angle), -math.sin(self.angle), 0.0])
        pattern = replace(pattern, uv=uv, vertices=patterns.plane(uv))
        return BoundaryValueProblem(Surface.from_pattern(pattern, self.order, warp), fabric, even.supports, bending=False)


def graded(t: np.ndarray, grading: float) -> np.ndarray:
    """Map [0, 1] onto itself with slope 1 - grading at the ends and 1 + grading in the middle."""
    return t - grading * np.sin(2 * np.pi * t) / (2 * np.pi)


def forces(job) -> dict:
    """Line force of the oblique strip on one mesh at fixed parameters (JSON types)."""
    mesh, gauge, width, angle, strain = job
    test = mesh.test(gauge, width, angle)
    result = test.run(_fabric(), strain)
    return {"mesh": mesh.name, "cells": list(test.cells), "pattern": test.pattern,
            "triangles": len(result.problem.surface.triangles), "grading": mesh.grading,
            "line_force_N_per_m": [float(f) if ok else None for f, ok in zip(result.line_force, result.reached, strict=True)],
            "status": result.status, "wall_s": result.wall_s}


def refit(job) -> dict:
    """YarnNetwork fitted on one mesh (JSON types)."""
    mesh, variant = job
    fabric, experiments, clock = _fabric(), _experiments(variant), time.perf_counter()
    f = fit(Problem(fabric, law_unknowns(fabric.law), experiments, level=mesh), tolerance=REFIT_TOLERANCE)
    return {"mesh": mesh.name, "parameters": {k.removeprefix("law."): v for k, v in f.parameters.items()},
            "rmse_percent_of_range": f.rmse_percent_of_range, "rmse_by_experiment": f.rmse_by_experiment,
            "converged": f.converged, "evaluations": f.n_evaluations, "wall_s": time.perf_counter() - clock}


def _fabric():
    """The cupro preset with the law's own default values."""
    from mfar_fem.materials import YarnNetwork
    from mfar_fem.materials.fabric import Fabric

    return Fabric.load("cupro-su1098").replace(law=YarnNetwork())


def _experiments(variant: str):
    from calibration.datasets import load

    return load("cupro-su1098", variant).select(role="fit")


def run(*, strain=(0.04, 0.08, 0.12, 0.16), meshes=MESHES, finest: Mesh | None = FINEST, refitted=REFITTED,
        variant: str = "preconditioned", folder=None, resume: bool = True, where: Workers = SERIAL, progress=None) -> dict:
    """The whole study.

    Parameters
    ----------
    strain : sequence of float
        Engineering strains of the bias strip at fixed parameters (the law's defaults).
    meshes : sequence of Mesh
    finest : Mesh, optional
        Reference of the forces; None: the last of `meshes`.
    refitted : sequence of str
        Names of the meshes that YarnNetwork is fitted on (all three directions at once).

    Returns
    -------
    dict
        ``forces`` by mesh with ``error_percent`` against the finest, ``refits`` by mesh, ``words``.
    """
    clock = time.perf_counter()
    unknown = sorted(set(refitted) - {m.name for m in meshes})
    if unknown:
        raise InputError(f"no mesh '{unknown[0]}' to refit on; known: {', '.join(m.name for m in meshes)}")
    bias = next(e for e in _experiments(variant) if e.direction_name == "bias")

    def at(stage):
        return None if progress is None else (lambda done, total: progress(stage, done, total))

    common = {"folder": folder, "resume": resume, "where": where}
    every = [*meshes, *([finest] if finest else [])]
    jobs = [(m, bias.gauge, bias.width, bias.direction, tuple(strain)) for m in every]
    rows = kept.run_kept(forces, jobs, [f"force-{_slug(m.name)}" for m in every], progress=at("forces"), **common)
    best = [np.nan if f is None else f for f in rows[-1]["line_force_N_per_m"]]
    for row in rows:
        row["error_percent"] = [None if f is None else 100.0 * (f / b - 1.0)
                                for f, b in zip(row["line_force_N_per_m"], best, strict=True)]
    chosen = [m for m in meshes if m.name in refitted]
    pairs, names = [(m, variant) for m in chosen], [f"refit-{variant}-{_slug(m.name)}" for m in chosen]
    refits = kept.run_kept(refit, pairs, names, progress=at("refits"), **common) if chosen else []
    return {"law": "yarn-network", "strain": list(strain), "forces": rows, "refits": refits, "words": words(strain, rows, refits),
            "wall_s": time.perf_counter() - clock}


def _slug(name: str) -> str:
    return name.replace(",", "").replace(" ", "-")


def words(strain, rows: list[dict], refits: list[dict]) -> list[str]:
    """What the numbers mean for a user."""
    last, out = rows[-1], []
    for k in sorted({len(strain) // 2, len(strain) - 1}):
        parts = ", ".join(f"{r['mesh']} ({r['triangles']} triangles) {r['error_percent'][k]:+.1f} %" for r in rows[:-1]
                          if r["error_percent"][k] is not None)
        if parts:
            out.append(f"Force of the bias strip at {100 * strain[k]:g} % and fixed parameters, against {last['triangles']} "
                       f"triangles: {parts}.")
    out.append("Triangles that no yarn runs along lock (one diagonal, or a grading that turns the diagonals); what is left on "
               "meshes that follow the yarns is the shear layers from the corners of the grips.")
    if refits:
        parts = ", ".join(f"{r['mesh']} G {r['parameters']['G']:.3g} N/m, Ls {r['parameters']['Ls']:.3g} "
                          f"(RMSE {r['rmse_percent_of_range']:.2f} %)" for r in refits)
        out.append(f"Refitted on each mesh: {parts}. The fit takes up the error of the mesh, so G and Ls belong to the mesh they "
                   "were fitted on: use them with that mesh, or refit.")
    return out
