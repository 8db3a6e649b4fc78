"""What the report of a restoration says."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from reconstruction.report.content import Cost, Evidence, Model, Picture, ReportContent, Scalar, Section, Table
from reconstruction.report.strokes import warp_strokes
from reconstruction.report.write import write_report
from reconstruction.restore.cache import Done
from reconstruction.restore.drape import FIGURE
from reconstruction.restore.meshing import ANGLES, TRIMMED
from reconstruction.sources import SourceSet
from reconstruction.surface.triangles import TriangleMesh

PAPER_S = {"reconstruction": 48.3, "simulation": 112.7}
"""What the paper states for one garment, s (18 cores and a P100)."""
KINDS = {"kinds": "kinds", "pairs": "pairs", "matched": "matched", "failed": "failed", "median_rate": "inlier rate",
         "inliers": "inliers", "median_sampson_px": "own lines, px", "median_sampson_cameras_px": "cameras' lines, px"}  # fmt: skip
"""Columns of the matches by kinds of pictures."""
LIMITS = (
    "What no picture shows is prior: the back, the figure, hidden folds. The pictures of the stage 'points' say where.",
    "The drape takes the restored shape as free of stress; a garment that hangs already sags once more.",
    "Widths of belted, folded garments are those of the template; folds finer than the mesh are not restored.",
)


def write_pages(sources: SourceSet, done: Mapping[str, Done], settings, at: Path, failure=None) -> dict[str, Any]:
    """Write ``report.html`` from the folders of the stages.

    Parameters
    ----------
    sources : SourceSet
    done : mapping of str to Done
        Stages up to ``points`` at least.
    settings : RestoreSettings
    at : Path
        The report's folder.
    failure : Failure, optional
        What ended the run (:class:`reconstruction.restore.pipeline.Failure`).

    Returns
    -------
    dict
        ``report_MB``.
    """
    template, points = done["template"].facts, done["points"].facts
    with np.load(done["points"].folder / "shape.npz") as stored:
        shape = {key: stored[key] for key in stored}
    costs = [Cost(d.name, d.seconds, d.cpu_s, d.peak_MB, d.cached) for d in done.values()]
    sections = [_sources(sources, done), _keypoints(done), _template(template, done), _shape(points, done)]
    models, mesh = _meshes(shape, done)
    if "surface" in done:
        sections.append(_surface(done["surface"].facts, done))
    figure = TriangleMesh(shape["figure_vertices"], shape["figure_faces"])
    facts = {
        "largest width": f"{np.ptp(mesh.vertices[:, 0]):.2f} m",
        "height": f"{np.ptp(mesh.vertices[:, 2]):.2f} m",
        "triangles": f"{len(mesh.faces)}",
        "supported by pictures": f"{100 * (1 - points['shares'].get('template', 0.0)):.0f} %",
    }
    if "drape" in done:
        settled = np.load(done["drape"].folder / "settled.npz")["nodes"][: len(mesh.vertices)]
        moved = np.linalg.norm(settled - mesh.vertices, axis=1)
        figure = TriangleMesh.read(done["drape"].folder / FIGURE)
        models.append(
            Model(
                "Settled",
                TriangleMesh(settled, mesh.faces),
                [Scalar("moved", 1e3 * moved, "mm", 0.0)],
                note="After the drape by the solver.",
            )
        )
        sections.append(_drape(done["drape"].facts, settings))
        facts["sag in the drape"] = f"{1e3 * done['drape'].facts['sag_m']:.0f} mm"
    if failure is not None:
        sections.insert(0, _failure(failure, done))
    sections.append(_costs(costs))
    seconds = sum(c.seconds for c in costs)
    garment = settings.garment.replace("-", " ")
    summary = _summary(points, template, len(sources.sources), seconds)
    content = ReportContent(
        title=f"Restored {garment}" if failure is None else f"Unfinished restoration of a {garment}",
        garment=settings.garment,
        summary=summary if failure is None else f"The run ended at the stage '{failure.stage}', which failed. {summary}",
        facts=facts,
        sections=sections,
        models=models,
        backdrop=figure,
        costs=costs,
        evidence=_evidence(points, template, done["surface"].facts if "surface" in done else None),
        notes=[*([] if failure is None else [_sentence(failure.reason)]), *points["findings"], *LIMITS],
        provenance={
            "sources": str(len(sources.sources)),
            "licences": "; ".join(sorted({s.licence for s in sources.sources})),
            "fabric": Path(settings.fabric).name,
            "fidelity": settings.fidelity,
            "surface": settings.surface,
            "votes": settings.vote,
            "seed": str(settings.seed),
        },
    )
    path = write_report(content, at / "report.html")
    return {"report_MB": path.stat().st_size / 1e6}


def _meshes(shape, done: Mapping[str, Done]) -> tuple[list[Model], TriangleMesh]:
    """The meshes to be shown, each once, and the one that came last."""
    fitted = TriangleMesh(shape["vertices"], shape["faces"])
    spread = [Scalar("standard deviation", 1e3 * shape["sigma"], "mm", 0.0)]
    sewn = "The sewn template after landmarks, outlines and depths"
    if "surface" not in done:
        return [Model("Fitted", fitted, spread, note=f"{sewn}.")], fitted
    stage = done["surface"]
    with np.load(stage.folder / "mesh.npz") as stored:
        mesh, warp = TriangleMesh(stored["vertices"], stored["faces"]), stored["warp"]
    strokes = warp_strokes(mesh, warp)
    if stage.facts["method"] != "poisson":  # the same triangles
        note = f"{sewn}, with its warp: the solver takes these triangles, there is no mesh between."
        return [Model("Fitted, for the solver", mesh, spread, lines=strokes, note=note)], mesh
    trimmed = TriangleMesh.read(stage.folder / TRIMMED)
    return [
        Model("Fitted", fitted, spread, note=f"{sewn}."),
        Model("Trimmed Poisson", trimmed, note="A new surface through its points, before its triangles are made even."),
        Model("For the solver", mesh, lines=strokes, note="With even triangles and the pattern's warp."),
    ], mesh


def _sentence(text: str) -> str:
    """With a capital letter and a full stop."""
    return f"{text[:1].upper()}{text[1:]}{'' if text.endswith(('.', '!', '?')) else '.'}"


def _failure(failure, done: Mapping[str, Done]) -> Section:
    return Section(
        "What failed",
        f"The stage '{failure.stage}'; done before it and kept: {', '.join(done)}. What follows is of these.",
        (),
        [Table(["try", "why"], [advice.split(": ", 1) for advice in failure.advice], "What to try")],
        [_sentence(failure.reason)],
    )


def _summary(points, template, pictures: int, seconds: float) -> str:
    shares = points["shares"]
    seen = ", ".join(
        f"{100 * shares[name]:.0f} % {what}"
        for name, what in (
            ("stereo", "by depth from several pictures"),
            ("outline", "by outlines only"),
            ("landmark", "by landmarks only"),
        )
    )
    assumed = _words(template["assumed"]) or "nothing"
    return (
        f"Restored from {pictures} pictures in {seconds:.0f} s. Of the surface {seen}; {100 * shares['template']:.0f} % is placed "
        f"by the template and the figure alone.\n\nAssumed of the cut: {assumed}."
    )


def _words(names) -> str:
    return ", ".join(name.replace("_", " ") for name in names)


def _picture(path: Path, alt: str, caption: str) -> list[Picture]:
    return [Picture(path, alt, caption)] if path.exists() else []


def _sources(sources: SourceSet, done: Mapping[str, Done]) -> Section:
    rows = [
        [s.name, s.kind, s.figure, "yes" if s.camera is not None else "no", "yes" if s.mask is not None else "no", s.licence]
        for s in sources.sources
    ]
    fusion = done["fusion"]
    statuses = ", ".join(f"{n} {name}" for name, n in fusion.facts["statuses"].items())
    kinds = [[row[key] for key in KINDS] for row in fusion.facts["by_kinds"]]
    tables = [Table(["picture", "kind", "figure", "camera", "mask", "licence"], rows, "Sources")]
    if kinds:
        tables.append(Table(list(KINDS.values()), kinds, "Matches by kinds of pictures"))
    return Section(
        "Sources and matches",
        f"Pairs of pictures: {statuses}. The matches tell how alike the pictures are; nothing that follows is computed from them. "
        "Depths come from pictures that look from similar sides by their cameras, outlines and landmarks from every picture with "
        "camera and mask, dimensions from every picture with a scale or a figure.",
        _picture(fusion.folder / "graph.png", "The pictures and which of them match", "Match graph"),
        tables,
    )


def _keypoints(done: Mapping[str, Done]) -> Section:
    stage = done["keypoints"]
    rows = [[name, n] for name, n in stage.facts["points"].items()]
    return Section(
        "Keypoints",
        "The twelve structural points as the detector finds them.",
        _picture(stage.folder / "predictions.png", "The points drawn on every picture", "Detected points"),
        [Table(["picture", "points present (of 12)"], rows)],
        stage.facts.get("notes", ()),
    )


def _template(facts, done: Mapping[str, Done]) -> Section:
    rows = [
        [name.replace("_", " "), value, "assumed" if name in facts["assumed"] else "measured"]
        for name, value in facts["dimensions"].items()
        if name != "neckline"
    ]
    notes = [
        f"{c['name']}: {c['first']} and {c['second']} disagree by {c['z']:.1f} standard deviations" for c in facts["conflicts"]
    ]
    notes += [f for f in facts["findings"] if ": keypoints: " not in f]  # those stand by the keypoints
    return Section(
        "Cutting template",
        "Voted from all pictures; what no picture shows is assumed.",
        _picture(done["template"].folder / "overview.png", "The panels beside the pictures they were measured on", "Template"),
        [Table(["dimension", "m", "from"], rows)],
        notes,
    )


def _shape(facts, done: Mapping[str, Done]) -> Section:
    folder = done["points"].folder
    rows = [[name, 100 * share] for name, share in facts["shares"].items()]
    outline = [
        [name, 100 * v, None if (left := facts["depth_m"].get(name)) is None else 1e3 * left]
        for name, v in facts["outline"].items()
    ]
    belt = f"Taken to be belted; gathered to {100 * facts['gathered']:.0f} % of its girth." if facts["belt"] else "No belt."
    return Section(
        "Shape",
        f"The sewn template, hung on a figure and drawn to the evidence. {belt}",
        [
            *_picture(folder / "outlines.png", "Outlines of the fitted shape on every picture", "Outlines"),
            *_picture(
                folder / "support.png", "Front and back of the garment, coloured by what supports each part", "What supports what"
            ),
        ],
        [
            Table(["supported by", "share of the points, %"], rows),
            Table(["picture", "area covered by only one of mask and shape, %", "median difference of depth left, mm"], outline),
        ],
    )


def _surface(facts, done: Mapping[str, Done]) -> Section:
    folder = done["surface"].folder
    columns = ["stage", "faces", "least_angle", "angle_1", "below_20", "largest_aspect", "degenerate"]
    rows = [[row[c] for c in columns] for row in facts["quality"]]
    notes = [*facts["actions"][:12], f"{len(facts['singularities'])} singular vertices of the warp field"]
    between = (
        "A new surface through the points of the fitted pattern, opened along its rims, with even triangles"
        if facts["method"] == "poisson"
        else "The triangles are those of the fitted pattern: there is no mesh between, so one is shown, not a before and an after"
    )
    return Section(
        "Mesh and warp",
        f"The mesh for the solver, its triangles, and the warp carried from the panels. {between}.",
        [
            *_picture(folder / "warp.png", "Front and back with strokes along the warp", "Warp"),
            *_picture(
                folder / ANGLES,
                "The trimmed Poisson surface, even triangles and the final mesh, coloured by smallest angles, with histograms",
                "Smallest angles before and after",
            ),
        ],
        [Table(columns, rows, "Triangles")],
        notes,
    )


def _drape(facts, settings) -> Section:
    rows = [
        ["simulated time, s", facts["time_s"]],
        ["steps", facts["steps"]],
        ["mean sag, mm", 1e3 * facts["sag_m"]],
        ["root mean square movement, mm", 1e3 * facts["moved_m"]],
        ["kinetic energy at the end, J", facts["kinetic_J"]],
        ["largest kinetic energy, J", facts["kinetic_most_J"]],
        ["unknowns", facts["unknowns"]],
        ["volume taken from the figure to make room, %", 100 * facts["figure"]["volume_taken"]],
    ]
    return Section(
        "Drape",
        f"Settled by the shell solver with {Path(settings.fabric).name} at '{settings.fidelity}'.",
        (),
        [Table(["", ""], rows)],
    )


def _costs(costs) -> Section:
    first = sum(c.seconds for c in costs if c.stage in ("fusion", "keypoints", "template", "points", "surface"))
    drape = sum(c.seconds for c in costs if c.stage == "drape")
    rows = [["images to mesh", first, PAPER_S["reconstruction"]], ["simulation", drape or None, PAPER_S["simulation"]]]
    return Section(
        "Time beside the paper's",
        "The paper's times are for 18 cores and a P100; what exactly they hold is not said there.",
        (),
        [Table(["part", "here, s", "paper, s"], rows)],
    )


def _evidence(points, template, surface) -> list[Evidence]:
    out = []
    for name, share in points["shares"].items():
        out.append(Evidence("surface", float(share), "prior" if name == "template" else "evidence", name))
    measured = [n for n in template["dimensions"] if n not in template["assumed"] and n != "neckline"]
    total = len([n for n in template["dimensions"] if n != "neckline"])
    out.append(Evidence("dimensions of the cut", len(measured) / total, "evidence", _words(measured)))
    if len(measured) < total:
        out.append(Evidence("dimensions of the cut", 1 - len(measured) / total, "prior", _words(template["assumed"])))
    if surface is not None:
        prior = float(surface["warp_prior_share"])
        detail = f"grain of straight-cut panels is upright; {100 * prior:.0f} % of it follows the surface's curvature instead"
        out.append(Evidence("warp", 1.0, "prior", detail))
    out.append(Evidence("figure", 1.0, "prior", "drawn under the landmarks with usual proportions"))
    return out
