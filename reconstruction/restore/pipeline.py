"""``mfar restore``: from a folder of pictures to a garment on a figure, settled by the solver, and its report.

Everything after the template is in the wearer's axes (x to the left, y backwards, z up, origin in the middle of the neckline).
A surface that cannot be made or a drape that fails ends the run, but not without its report.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import InputError, MfarError, MissingDependencyError, NotConvergedError
from mfar_fem.materials.fabric import Fabric, fabric_names
from reconstruction import images as pictures
from reconstruction.keypoints.weights_file import weights_file
from reconstruction.keypoints_file import read_keypoints
from reconstruction.landmarks import STATURE
from reconstruction.measure.silhouette import read_mask
from reconstruction.measure.vote import check_weighting
from reconstruction.restore.cache import Stages
from reconstruction.restore.calibration import check_pictures, check_scale, depth_findings
from reconstruction.restore.drape import effort, settle, write_scene
from reconstruction.restore.meshing import solver_input, write_surface
from reconstruction.restore.progress import Report, Share, counter
from reconstruction.restore.requirements import check_libraries
from reconstruction.shape.fit import FitSettings, fit_shape
from reconstruction.shape.landmarks3d import triangulate
from reconstruction.shape.points import sample
from reconstruction.sources import SourceSet, read
from reconstruction.stereo.view import View
from reconstruction.surface.triangles import TriangleMesh
from reconstruction.template.dimensions import TDimensions, derive, garment_type, to_dict

ORDER = ("fusion", "keypoints", "template", "points", "surface", "drape", "report")
"""The stages; see :func:`stages_of`."""
REPORT = "report.html"


@dataclass(frozen=True)
class RestoreSettings:
    """What can be set.

    Attributes
    ----------
    garment : str
        Type.
    fabric : str
        Preset, or a fabric file (such as ``mfar calibrate`` writes).
    fidelity : str
        ``draft``, ``standard`` or ``reference``: edges of the mesh and effort of the drape.
    weights : str
        Detector.
    vote : str
        Weights of the kinds of sources.
    surface : str
        ``template`` (the fitted pattern is the mesh) or ``poisson`` ((9): points to a new surface, the pattern lends its warp).
    drape : bool
        Settle the garment.
    seed : int
        Of the matching.
    """

    garment: str = "round-collar-robe"
    fabric: str = "silk-charmeuse"
    fidelity: str = "standard"
    weights: str = "shipped"
    vote: str = "precision"
    surface: str = "template"
    drape: bool = True
    seed: int = 0

    def __post_init__(self):
        garment_type(self.garment)
        effort(self.fidelity)
        check_weighting(self.vote)
        if self.weights != "shipped" and not Path(self.weights).is_file():
            raise InputError(f"there is no detector '{self.weights}'; `mfar train keypoints` makes one")
        if self.surface not in ("template", "poisson"):
            raise InputError(f"the surface is made from the template or by poisson, not by '{self.surface}'")


def stages_of(settings: RestoreSettings) -> tuple[str, ...]:
    """The stages of a run."""
    return tuple(name for name in ORDER if settings.drape or name != "drape")


@dataclass(frozen=True)
class Failure:
    """What ended a run: the stage, why, and what to try instead."""

    stage: str
    reason: str
    advice: tuple[str, ...]

    @classmethod
    def of(cls, stage: str, error: MfarError, s: RestoreSettings) -> Failure:
        """With advice that fits the settings."""
        coarser = [name for name in ("standard", "draft") if effort(name).edge > effort(s.fidelity).edge]
        advice = [f"--fidelity {coarser[0]}: coarser triangles and a shorter drape"] if coarser else []
        if stage == "drape":
            advice = ["--no-drape: the restored shape without the drape", *advice, "--fabric: a stiffer or heavier one"]
        elif s.surface == "poisson":
            advice = ["--surface template, the default: most robes are refused by the Poisson surface", *advice]
        else:
            advice = [*advice, "more or other pictures: arms that lie against the body in all of them make sheets cross"]
        return cls(stage, str(error), tuple(advice))

    def __str__(self) -> str:
        return f"the stage '{self.stage}' failed: {self.reason}. Try {'; or '.join(self.advice)}"


def restore(
    folder, out, settings: RestoreSettings | None = None, fresh: bool = False, progress: Report | None = None
) -> dict[str, Any]:
    """Restore a garment; stages that were finished before are taken as they are.

    Parameters
    ----------
    folder : path-like
        Of the sources; two pictures with cameras and masks at least.
    out : path-like
        A folder for every stage, and the report; one run at a time.
    settings : RestoreSettings, optional
    fresh : bool
        Compute everything again.
    progress : callable, optional
        Told a stage and how much of it is done, 0 to 1.

    Returns
    -------
    dict
        ``out``, ``report`` (path), ``stages`` (rows), ``facts`` by stage, ``seconds``, ``peak_MB``, ``failure`` (None).

    Raises
    ------
    InputError
        Sources that cannot be restored, with what would be needed; or another run is at work in `out`.
    MissingDependencyError
        Something that the settings need is not installed.
    NotConvergedError
        Surface or drape failed. ``result`` is what would have been returned, with ``failure`` (``stage``, ``reason``, ``advice``);
        the report says the same.
    """
    s = settings or RestoreSettings()
    check_libraries(s.surface, s.drape, s.fidelity)
    sources = read(folder)
    check_pictures(sources)
    fabric = _fabric(s.fabric)
    tell = progress or (lambda name, share: None)
    with Stages(out, fresh) as stages:
        failure = _run(stages, sources, s, fabric, tell)
        rows = [d.row() for d in stages.done.values()]
        payload = {
            "out": Path(out),
            "report": stages.done["report"].folder / REPORT,
            "stages": rows,
            "facts": {name: d.facts for name, d in stages.done.items()},
            "seconds": sum(r["seconds"] for r in rows),
            "peak_MB": max(r["peak_MB"] for r in rows),
            "failure": failure,
        }
    if failure is not None:
        raise NotConvergedError(f"{failure}. The report of what was done: {payload['report']}", payload)
    return payload


def _run(stages: Stages, sources: SourceSet, s: RestoreSettings, fabric: Path | None, tell: Report) -> Failure | None:
    """All stages up to the first that fails, and the report."""
    files = [sources.path, *(p for x in sources.sources for p in (x.path, x.mask) if p is not None)]
    cameras = [None if x.camera is None else x.camera.tolist() for x in sources.sources]
    failure = None

    def run(name: str, version: int, work: Callable[[Path, Share], dict[str, Any]], **more) -> None:
        tell(name, 0.0)
        stages.run(name, version, lambda at: work(at, lambda share: tell(name, min(share, 1.0))), **more)
        tell(name, 1.0)

    run(
        "fusion",
        2,
        lambda at, share: _fuse(sources, at, s, share),
        files=files,
        options={"seed": s.seed, "cameras": cameras},
        resumable=True,
    )
    run(
        "keypoints",
        2,
        lambda at, share: _keypoints(sources, at, s, share),
        files=[*files, weights_file(s.weights)],
        options=s.garment,
    )
    points_file = stages.done["keypoints"].folder / "keypoints.json"
    run("template", 2, lambda at, share: _template(points_file, at, s), after=["keypoints"], options=[s.garment, s.vote])
    dimensions = stages.done["template"].folder / "dimensions.json"
    shape_settings = FitSettings(edge=effort(s.fidelity).edge)
    run(
        "points",
        3,
        lambda at, share: _points(sources, points_file, dimensions, at, shape_settings, share),
        after=["keypoints", "template"],
        files=files,
        options=[cameras, repr(shape_settings)],
    )
    shape_file = stages.done["points"].folder / "shape.npz"
    mesh = stages.folder / "surface"
    name = "surface"
    try:
        run(
            name,
            2,
            lambda at, share: _surface(shape_file, at, s.surface, effort(s.fidelity).edge),
            after=["points"],
            options=[s.surface, s.fidelity],
        )
        if s.drape:
            name = "drape"
            run(
                name,
                1,
                lambda at, share: _drape(mesh, shape_file, at, s.fabric if fabric is None else str(fabric), s, share),
                after=["surface", "points"],
                files=[] if fabric is None else [fabric],
                options=[s.fabric if fabric is None else "file", s.fidelity],
                resumable=True,
            )
    except MissingDependencyError:
        raise
    except MfarError as error:
        failure = Failure.of(name, error, s)
    from reconstruction.restore.pages import write_pages

    run(
        "report",
        2,
        lambda at, share: write_pages(sources, dict(stages.done), s, at, failure),
        after=list(stages.done),
        files=[sources.path],
        options=[repr(replace(s, weights="shipped")), None if failure is None else str(failure)],
    )
    return failure


def _fabric(name: str) -> Path | None:
    """The path of a fabric's file; None for a preset. Both are read, so that mistakes show at once."""
    Fabric.load(name)
    return None if name in fabric_names() else Path(name).resolve()


def _fuse(sources: SourceSet, at: Path, s: RestoreSettings, share: Share) -> dict[str, Any]:
    from reconstruction.matching.fusion import fuse, steps
    from reconstruction.matching.settings import MatchSettings
    from reconstruction.measure.stage import measurements

    step = counter(share, steps(len(sources.sources)))
    fusion = fuse(sources.folder, at, MatchSettings(seed=s.seed), stages={"measurements": measurements}, progress=step)
    return {"pictures": len(fusion.pictures), "statuses": fusion.graph.statuses(), "by_kinds": fusion.graph.by_kinds()}


def _keypoints(sources: SourceSet, at: Path, s: RestoreSettings, share: Share) -> dict[str, Any]:
    from reconstruction.keypoints.locate import locate

    found = locate([sources.folder], at, s.weights, garment=s.garment, progress=counter(share))
    return {
        "notes": list(found["notes"]),
        "within_px_of_256x192": found["within_px_of_256x192"],
        "points": {image["name"]: int(np.sum(image["present"])) for image in found["images"]},
    }


def _template(points: Path, at: Path, s: RestoreSettings) -> dict[str, Any]:
    from reconstruction.template.pipeline import make_template, write_template

    keypoints = read_keypoints(points)
    made = make_template(keypoints, s.garment, weighting=s.vote)
    write_template(at, made, keypoints.images)
    dimensions = to_dict(made.dimensions)
    (at / "dimensions.json").write_text(json.dumps({"garment": s.garment, "dimensions": dimensions}, indent=1), encoding="utf-8")
    votes = {name: {"value_m": v.value, "sigma_m": v.sigma} for name, v in made.votes.items()}
    return {
        "dimensions": dimensions,
        "assumed": made.assumed,
        "votes": votes,
        "conflicts": [c.to_dict() for c in made.conflicts],
        "findings": [f"{f.level}: {f.where}: {f.message}" for f in made.findings],
    }


def read_dimensions(path: Path) -> tuple[str, Any]:
    """Type and dimensions of ``dimensions.json``."""
    stored = json.loads(path.read_text(encoding="utf-8"))
    garment, values = stored["garment"], stored["dimensions"]
    kind = type(derive(garment, {})[0])
    if kind is TDimensions:
        values["neckline"] = tuple(tuple(p) for p in values["neckline"])
    return garment, kind(**values)


def stature(sources: SourceSet) -> float:
    """Mean height of the figures in the pictures, m; of a man's without any."""
    known = [x.stature for x in sources.sources if x.stature is not None]
    return float(np.mean(known)) if known else STATURE["male"]


def calibrated_views(sources: SourceSet, keypoints) -> tuple[list[View], np.ndarray, np.ndarray]:
    """Views with masks, their points (n, 12, 2) and standard deviations (n, 12), px."""
    views, points, sigma = [], [], []
    for source, image in zip(sources.sources, keypoints.images, strict=True):
        if source.camera is not None and source.mask is not None:
            picture = pictures.load(source.path)
            views.append(View.of(source.name, picture.rgb, source.camera, read_mask(source.mask, picture.size)))
            points.append(image.points)
            sigma.append(image.sigma)
    return views, np.array(points), np.array(sigma)


def _points(
    sources: SourceSet, points_file: Path, dimensions: Path, at: Path, settings: FitSettings, share: Share
) -> dict[str, Any]:
    from reconstruction.restore.drawings import outlines_picture, support_picture

    garment, d = read_dimensions(dimensions)
    views, points, sigma = calibrated_views(sources, read_keypoints(points_file))
    space = triangulate([v.camera for v in views], points, sigma)
    doubts = check_scale(space, stature(sources))
    step = counter(share, settings.hang + settings.outline + settings.depth)
    shape = fit_shape(garment, d, space, views, stature(sources), settings, progress=step)
    local = shape.frame.to_body(shape.vertices)
    found = sample(shape, local)
    found.write(at)
    figure = shape.body.mesh()
    sewn = shape.sewn
    np.savez_compressed(
        at / "shape.npz",
        **solver_input(shape),  # type: ignore[arg-type]
        panel=sewn.panel,
        sigma=shape.sigma,
        source=shape.source,
        figure_vertices=figure.vertices,
        figure_faces=figure.faces,
        origin=shape.frame.origin,
        axes=shape.frame.axes,
    )
    TriangleMesh(local, sewn.faces).write(at / "shape.ply")
    outlines_picture(at / "outlines.png", views, shape)
    support_picture(at / "support.png", TriangleMesh(local, sewn.faces), shape.source)
    return {
        "points": len(found.points),
        "shares": found.shares(),
        "landmarks_in_space": int(space.found.sum()),
        "landmark_sigma_m": float(np.nanmedian(space.sigma)),
        "sigma_median_m": float(np.median(found.sigma)),
        "stature_m": stature(sources),
        "findings": depth_findings(views) + doubts,
        **shape.facts,
    }


def _surface(shape_file: Path, at: Path, method: str, edge: float) -> dict[str, Any]:
    return write_surface(shape_file, at, method, edge)


def _drape(mesh_folder: Path, shape_file: Path, at: Path, fabric: str, s: RestoreSettings, share: Share) -> dict[str, Any]:
    from mfar_fem.surface.mesh import Surface

    with np.load(mesh_folder / "mesh.npz") as stored, np.load(shape_file) as shape:
        names = {key.removeprefix("opening_"): stored[key] for key in stored if key.startswith("opening_")}
        surface = Surface(stored["vertices"], stored["faces"], 1, stored["warp"], boundary=names)
        figure = TriangleMesh(shape["figure_vertices"], shape["figure_faces"])
    facts: dict[str, Any] = {}
    if not (at / "figure.json").exists():
        fitted = write_scene(at, surface, figure, fabric, s.fidelity, s.garment)
        assert fitted is not None
        (at / "figure.json").write_text(json.dumps(fitted.facts), encoding="utf-8")
    facts |= {"figure": json.loads((at / "figure.json").read_text(encoding="utf-8"))}
    return facts | settle(at, resume=True, progress=lambda row: share(row["time"] / row["until"]))
