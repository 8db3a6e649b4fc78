"""How near restored shapes come to the truth of synthetic garments: the method, its controls, oracles, and multi-view stereo."""

from __future__ import annotations

import functools
import json
import logging
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.cli.console import jsonable
from mfar_fem.errors import MfarError, MissingDependencyError
from mfar_fem.files import replace_bytes, replace_file
from reconstruction.baselines.mvs import mvs
from reconstruction.keypoints.weights_file import weights_file
from reconstruction.keypoints_file import read_keypoints
from reconstruction.metrics.distance import distances
from reconstruction.restore.cache import digest, file_digest
from reconstruction.restore.meshing import solver_input
from reconstruction.restore.pipeline import calibrated_views, stature
from reconstruction.shape.evidence import Caster
from reconstruction.shape.fit import FitSettings, Shape, fit_shape
from reconstruction.shape.landmarks3d import SpacePoints, triangulate
from reconstruction.shape.simulation_mesh import simulation_mesh
from reconstruction.sources import read
from reconstruction.style.bootstrap import mean_interval
from reconstruction.surface.analytic import mesh_distance
from reconstruction.surface.pipeline import SurfaceSettings
from reconstruction.surface.study_refinement import at_count
from reconstruction.surface.triangles import TriangleMesh
from reconstruction.template.pipeline import make_template

log = logging.getLogger(__name__)
VERSION = 2
"""Of what makes rows and keypoints: another one computes them again. Count it up with every change that moves numbers; rows without
a key are of version 1."""
METHODS = {
    "restored": "template, landmarks, outlines and stereo",
    "draped": "as restored, then settled by the solver as `mfar restore` does at standard: what it delivers",
    "template only": "template hung on the landmarks; no outline, no depth",
    "outlines only": "the same with outlines, without depths",
    "true points": "as restored, with the true landmarks, in the pictures (for the template) and in space (oracle)",
    "true depth": "as restored, with the true depths of the same pictures (oracle)",
    "poisson": "as restored, then (9) through its points, trimmed, remeshed, ARAP",
    "poisson without ARAP": "the same without the improvement of triangles",
    "poisson adaptive": "the same, remeshed half as coarse again, adaptive Loop subdivision to as many triangles as uniform, ARAP",
    "poisson uniform": "the same, remeshed half as coarse again, every triangle split once, ARAP",
    "MVS": "plane sweep, consistency, fusion, Poisson; no template",
    "Pix2Vex": "smooth differentiable renderer, from a sphere; no template",
    "Pix2Vex from template": "the same from the template hung on the landmarks (edges of 60 mm)",
}
"""What is compared."""
DRAPED = "draped"
MESHED = (DRAPED, "MVS", "Pix2Vex", "Pix2Vex from template")
"""Methods whose mesh is not a fitted shape."""
WITHOUT_DETECTOR = ("true points", "MVS", "Pix2Vex")
"""Methods that no detected point enters: their rows stay when the detector changes."""
RECORD = "made.json"
"""File beside detected keypoints: what they are of."""
MEANS = ("off_mean", "off_median", "missing_mean", "missing_95", "largest", "rim_mean", "floor", "within_2_sigma", "faces",
         "seconds")  # fmt: skip
"""Columns of rows of which the summary gives the mean alone."""
LEAST = 3
"""Garments from which on a mean has an interval: resampling one or two gives widths that mean nothing."""
COARSE = 0.06
"""Edges of the template that Pix2Vex starts from, m: what it can draw in the time."""
ORACLE_SIGMA = 1e-3
"""Standard deviation given to oracles, m."""
Tell = Callable[[int, str], None]
"""Told how many methods are done since it was told last, and what is done now."""


def compare(
    folder: Path, detected: Path, garment: str, edge: float, methods: Sequence[str] = tuple(METHODS), meshes: Path | None = None,
    progress: Callable[[str], None] | None = None,
) -> Iterator[dict[str, Any]]:  # fmt: skip
    """Rows of one case of ``mfar benchmark-case``, one method after the other: ``method``, distances in mm, ``faces``, ``seconds``;
    ``why`` where a method failed.

    What each method made is written to `meshes` as ``<method>.ply``; one that failed leaves none. `progress` is told the name of a
    method before it begins. `detected` is read only for methods that the detector enters; their rows have ``template_s``, what the
    dimensions took, which is not part of ``seconds``.
    """
    sources, drawn = read(folder), read_keypoints(folder / "truth" / "keypoints.json")
    views = calibrated_views(sources, drawn)[0]
    with np.load(folder / "truth" / "geometry.npz") as stored:
        truth = TriangleMesh(stored["vertices"], stored["faces"])
        true_points = SpacePoints(stored["keypoints"], np.full(12, ORACLE_SIGMA), np.full(12, len(views)))
    settings = {
        "template only": FitSettings(edge=edge, outlines=False, depths=False),
        "outlines only": FitSettings(edge=edge, depths=False),
        "Pix2Vex from template": FitSettings(edge=COARSE, outlines=False, depths=False),
    }
    surfaces = _surfaces(edge)
    fitted: list[Any] = []

    @functools.cache
    def measured():
        begin = time.perf_counter()
        points = read_keypoints(detected)
        _, pixels, sigma = calibrated_views(sources, points)
        dimensions = make_template(points, garment, weighting="precision").dimensions
        found = triangulate([v.camera for v in views], pixels, sigma)
        return dimensions, found, time.perf_counter() - begin

    @functools.cache
    def exact():
        out, caster = {}, Caster(truth)
        for view in views:
            depth = caster.cast(view, 1)[1]
            out[view.name] = (np.where(np.isfinite(depth), depth, np.nan), np.full(view.size, ORACLE_SIGMA))
        return out

    def fit(method: str):
        if method == "true points":
            dimensions, found = make_template(drawn, garment, weighting="precision").dimensions, true_points
        else:
            dimensions, found, _ = measured()
        return fit_shape(garment, dimensions, found, views, stature(sources), settings.get(method, FitSettings(edge=edge)),
                         given=exact() if method == "true depth" else None)  # fmt: skip

    def restored():
        if not fitted:
            fitted.append(fit("restored"))
        return fitted[0]

    @functools.cache
    def angle() -> float:
        """Of adaptive subdivision to the number of triangles of the uniform one."""
        even = _poisson(restored(), edge, SurfaceSettings(edge=surfaces["poisson uniform"].edge, adaptive=False, arap=False))
        return at_count(even, 4 * len(even.faces))[1]

    for method in methods:
        if progress is not None:
            progress(method)
        row: dict[str, Any] = {"garment": garment, "method": method}
        written = None if meshes is None else meshes / f"{method.replace(' ', '-')}.ply"
        if written is not None:
            written.unlink(missing_ok=True)  # of an earlier row
        begin = time.perf_counter()
        try:
            if method not in WITHOUT_DETECTOR:
                row["template_s"] = measured()[2]
            if method == "true depth":
                exact()
            if method == DRAPED:
                restored()
            if method in surfaces:
                shape, how = restored(), surfaces[method]
                if method == "poisson adaptive":
                    how = replace(how, angle=angle())
                    row["angle"] = how.angle
            begin = time.perf_counter()  # of what the method itself adds
            if method == "MVS":
                mesh = mvs(views).mesh
            elif method in ("Pix2Vex", "Pix2Vex from template"):
                from reconstruction.baselines.pix2vex import pix2vex  # asks for torch

                hung = fit(method) if method == "Pix2Vex from template" else None
                mesh = pix2vex(views, None if hung is None else hung.sewn.mesh(hung.vertices)).mesh
            elif method == DRAPED:
                mesh = draped(restored(), edge)
            elif method in surfaces:
                mesh = _poisson(shape, edge, how)
            else:
                shape = fit(method)
                if method == "restored":
                    fitted[:] = [shape]
                mesh = shape.sewn.mesh(shape.vertices)
            seconds = time.perf_counter() - begin
            if method not in (*surfaces, *MESHED):
                row["within_2_sigma"] = float(np.mean(mesh_distance(shape.vertices, truth) <= 2 * shape.sigma))
            row |= distances(mesh, truth) | {"faces": len(mesh.faces), "seconds": seconds, "why": ""}
            if written is not None:
                replace_file(written, mesh.write)
        except MissingDependencyError:
            raise  # says nothing of the method, and is not to be kept
        except MfarError as error:
            row |= {"seconds": time.perf_counter() - begin, "why": str(error)}
        yield row


def _surfaces(edge: float) -> dict[str, SurfaceSettings]:
    """How the Poisson surface and its controls are made."""
    coarse = 1.5 * edge
    return {
        "poisson": SurfaceSettings(edge=edge, adaptive=False),
        "poisson without ARAP": SurfaceSettings(edge=edge, adaptive=False, arap=False),
        "poisson adaptive": SurfaceSettings(edge=coarse),
        "poisson uniform": SurfaceSettings(edge=coarse, adaptive=False, uniform=1),
    }


def _poisson(shape: Shape, edge: float, settings: SurfaceSettings) -> TriangleMesh:
    known = {
        "vertices": shape.vertices,
        "faces": shape.sewn.faces,
        "warp": shape.sewn.warp_in_space(shape.vertices),
        "noise": shape.noise,
    }
    return simulation_mesh(known, "poisson", edge, settings).mesh


def draped(shape: Shape, edge: float, fabric: str = "silk-charmeuse", fidelity: str = "standard") -> TriangleMesh:
    """A fitted shape after the solver has settled it on its figure.

    Raises
    ------
    SurfaceError, NotConvergedError
        Triangles pass through each other, or the solver gave up.
    """
    from tempfile import TemporaryDirectory

    from mfar_fem.surface.mesh import Surface
    from reconstruction.restore.drape import settle, write_scene

    made = simulation_mesh(solver_input(shape), "template", edge)
    surface = Surface(made.mesh.vertices, made.mesh.faces, 1, made.warp.directions, boundary=made.openings)
    with TemporaryDirectory() as folder:
        write_scene(Path(folder), surface, shape.body.mesh(), fabric, fidelity)
        settle(Path(folder))
        with np.load(Path(folder) / "settled.npz") as stored:
            nodes = stored["nodes"][: len(made.mesh.vertices)]
    return TriangleMesh(shape.frame.to_world(nodes), made.mesh.faces)


def row_key(method: str, case: str, weights: str, edge: float, around: int = 0) -> str:
    """What a row depends on, as one digest: :data:`VERSION`, method and settings, contents of the case, and of the detector if it
    enters."""
    detector = None if method in WITHOUT_DETECTOR else weights
    return digest(VERSION, method, case, detector, {"edge_mm": round(1e3 * edge, 6), "around": around})


def case_digest(folder: Path) -> str:
    """Of the contents of a case's files, by name."""
    files = sorted(f for f in folder.rglob("*") if f.is_file() and not f.name.startswith("."))
    return digest([f.relative_to(folder).as_posix() for f in files], *files)


def read_rows(path: Path) -> list[dict[str, Any]]:
    """Rows that were kept; none, with a warning, if the file is damaged."""
    if not path.exists():
        return []
    try:
        rows = json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        rows = error
    if isinstance(rows, list) and all(isinstance(row, dict) and {"method", "why", "seconds"} <= row.keys() for row in rows):
        return rows
    log.warning("%s is damaged and is computed again: %s", path, rows if isinstance(rows, ValueError) else "these are no rows")
    return []


def _keypoints(folder: Path, points: Path, garment: str, key: str, weights: str, fresh: bool) -> float:
    """Detect the points of a case, or keep what there is of the same detector; s that it took."""
    from reconstruction.keypoints.locate import FILE, locate

    record = points / RECORD
    if not fresh and (points / FILE).exists() and record.exists():
        try:
            known = json.loads(record.read_text(encoding="utf-8"))
            if known["key"] == key:
                return float(known["seconds"])
        except (ValueError, KeyError, TypeError):
            log.warning("%s is damaged: the points are detected again", record)
    record.unlink(missing_ok=True)  # of points that are about to be replaced
    begin = time.perf_counter()
    locate([folder], points, weights, garment=garment)
    seconds = time.perf_counter() - begin
    replace_bytes(record, json.dumps({"key": key, "version": VERSION, "seconds": seconds}).encode())
    return seconds


def study(out: Path, garments: Sequence[str], seeds: Sequence[int], edge: float = 0.03, methods: Sequence[str] = tuple(METHODS),
          progress: Tell | None = None, around: int = 0, fresh: bool = False,
          weights: str = "shipped") -> dict[str, Any]:  # fmt: skip
    """Cases of several garments and seeds, kept in ``out`` and gone on with, and what came of them.

    Parameters
    ----------
    out : Path
        Gets ``cases``, ``keypoints``, ``rows`` and ``meshes``. A row is kept as long as :func:`row_key` is the same, of named
        failures too; it is written when its method is done.
    garments, seeds, methods
        Which cases, and what is done with each.
    edge : float
        Of the fitted meshes, m.
    progress : callable, optional
        ``progress(done, text)``, see :data:`Tell`; ``len(seeds) * len(garments) * len(methods)`` in all.
    around : int
        See :func:`reconstruction.benchmark.case.make_case`.
    fresh : bool
        Make cases, keypoints and rows again.
    weights : str
        A detector's file, or "shipped".

    Returns
    -------
    dict
        ``rows`` (:func:`compare`, with ``seed``, ``case``, ``edge_mm``, ``key``), ``summary`` (:func:`summary`).
    """
    from reconstruction.benchmark.case import make_case
    from reconstruction.keypoints.locate import FILE

    tell = progress or (lambda done, text: None)
    file = weights_file(weights)
    detector = file_digest(file) if file.exists() else "none"
    rows: list[dict[str, Any]] = []
    for seed in seeds:
        for garment in garments:
            name = case_name(garment, seed, around)
            folder, points = out / "cases" / name, out / "keypoints" / name
            if fresh and (folder / "truth").is_dir():
                shutil.rmtree(folder)
            if not (folder / "sources.toml").exists():
                tell(0, f"{name}: pictures")
                make_case(folder, garment, seed, around=around)
            case = case_digest(folder)
            kept = out / "rows" / f"{name}-{1e3 * edge:g}mm.json"
            known = {row["method"]: row for row in read_rows(kept)}
            keys = {method: row_key(method, case, detector, edge, around) for method in methods}
            missing = [m for m in methods if fresh or m not in known or known[m].get("key") != keys[m]
                       or not (known[m]["why"] or mesh_file(out, known[m]).exists())]  # fmt: skip
            tell(len(methods) - len(missing), name)
            head: dict[str, Any] = {"seed": seed, "case": name, "edge_mm": 1e3 * edge}
            if any(m not in WITHOUT_DETECTOR for m in missing):
                tell(0, f"{name}: keypoints")
                head["keypoints_s"] = _keypoints(folder, points, garment, digest(VERSION, case, detector), weights, fresh)
            begin = functools.partial(_begin, tell, name)
            for row in compare(folder, points / FILE, garment, edge, missing, out / "meshes" / kept.stem, begin):
                method = row["method"]
                own = {k: v for k, v in head.items() if k != "keypoints_s" or method not in WITHOUT_DETECTOR}
                known[method] = jsonable(own | row | {"key": keys[method]})
                replace_bytes(kept, json.dumps(list(known.values()), indent=1).encode())
                tell(1, f"{name}: {method}")
            rows += [known[method] for method in methods]
    return {"rows": rows, "summary": summary(rows)}


def _begin(tell: Tell, name: str, method: str) -> None:
    tell(0, f"{name}: {method}")


def case_name(garment: str, seed: int, around: int = 0) -> str:
    """Name of a case's folders: cases of other pictures are other cases."""
    return f"{garment}-{seed}" + (f"-around{around}" if around else "")


def mesh_file(out: Path, row: Mapping[str, Any]) -> Path:
    """Where the mesh of a row lies."""
    return out / "meshes" / f"{row['case']}-{row['edge_mm']:g}mm" / f"{row['method'].replace(' ', '-')}.ply"


def summary(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """By garment and method: means over the seeds with 95 % intervals, and paired differences to ``restored``, mm.

    Returns
    -------
    list of dict
        ``garment``, ``method``, ``cases`` (of the garment, by any method), ``n`` (those where the method gave a mesh), ``failed``;
        with any: ``mean``, the other distances, ``faces``, ``seconds``; but for ``restored`` itself ``worse_by`` over the
        ``paired`` cases where both gave a mesh: means over other cases are not to be compared. ``_low`` and ``_high`` are None with
        fewer than three cases (:data:`LEAST`).
    """
    out = []
    for garment in dict.fromkeys(row["garment"] for row in rows):
        of_it = [row for row in rows if row["garment"] == garment]
        base = {row["seed"]: row["mean"] for row in of_it if row["method"] == "restored" and not row["why"]}
        cases = len({row["seed"] for row in of_it})
        for method in dict.fromkeys(row["method"] for row in of_it):
            mine = [row for row in of_it if row["method"] == method]
            good = [row for row in mine if not row["why"]]
            entry: dict[str, Any] = {"garment": garment, "method": method, "cases": cases, "n": len(good)}
            entry["failed"] = len(mine) - len(good)
            if good:
                seeds = [row["seed"] for row in good]
                entry |= interval("mean", [row["mean"] for row in good], seeds)
                for name in MEANS:
                    values = [row[name] for row in good if row.get(name) is not None]
                    entry[name] = float(np.mean(values)) if values else None
                paired = [row for row in good if row["seed"] in base]
                if method != "restored" and paired:
                    worse = [row["mean"] - base[row["seed"]] for row in paired]
                    entry |= interval("worse_by", worse, [row["seed"] for row in paired]) | {"paired": len(paired)}
            out.append(entry)
    return out


def interval(name: str, values: Sequence[float], groups: Sequence[Any]) -> dict[str, float | None]:
    """A mean with its 95 % interval over groups; no interval (None) over fewer than :data:`LEAST` of them."""
    found = mean_interval(np.asarray(values), np.asarray(groups))
    if len(set(groups)) < LEAST:
        return {name: found.value, f"{name}_low": None, f"{name}_high": None}
    return {name: found.value, f"{name}_low": min(found.low, found.value), f"{name}_high": max(found.high, found.value)}
