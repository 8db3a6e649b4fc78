"""From keypoints to the cutting template: measure, vote, derive dimensions, build, check, write."""

from __future__ import annotations

import csv
import json
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mfar_fem.errors import InputError, MfarError
from reconstruction.keypoints_file import ImageKeypoints, KeypointsFile
from reconstruction.landmarks import KINDS
from reconstruction.measure.garment import measure_images
from reconstruction.measure.pose import PoseFit, image_pose
from reconstruction.measure.quantity import Measurement
from reconstruction.measure.scale import image_scale
from reconstruction.measure.skeleton import TORSO
from reconstruction.measure.vote import DEFAULT_WEIGHTING, WEIGHTS, Conflict, Vote, vote
from reconstruction.template.accessories import build_hat, build_ribbon
from reconstruction.template.boundaries import Boundary, find_boundaries
from reconstruction.template.checks import LOOM_WIDTH, Finding, check
from reconstruction.template.dimensions import QUARTER, Dimensions, HatDimensions, RibbonDimensions, derive, garment_type, unusual
from reconstruction.template.neckline import neckline_shape
from reconstruction.template.panel import Pattern
from reconstruction.template.straight_cut import build

log = logging.getLogger(__name__)
DEFAULT_GARMENT = "round-collar-robe"
WITH_SLEEVES = ("round-collar-robe", "half-sleeve")


@dataclass(frozen=True)
class Template:
    """A cutting template and how it came about.

    Attributes
    ----------
    pattern : Pattern
    dimensions : TDimensions, RibbonDimensions or HatDimensions
    measurements : tuple of Measurement
    votes : dict of str to Vote
    conflicts : tuple of Conflict
    boundaries : dict of str to tuple of Boundary
        By path of the image.
    assumed : dict of str to str
        Dimensions that no image showed, and how they were assumed.
    findings : tuple of Finding
    poses : dict of str to PoseFit
        The canonical skeleton behind the figures of garments with sleeves, by path of the image.
    """

    pattern: Pattern
    dimensions: Dimensions
    measurements: tuple[Measurement, ...]
    votes: dict[str, Vote]
    conflicts: tuple[Conflict, ...]
    boundaries: dict[str, tuple[Boundary, ...]]
    assumed: dict[str, str]
    findings: tuple[Finding, ...]
    poses: dict[str, PoseFit] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``."""
        return {
            "garment": self.pattern.name, "panels": list(self.pattern.panels), "seams": len(self.pattern.seams),
            "dimensions_m": vars(self.dimensions), "votes": [v.to_dict() for v in self.votes.values()],
            "conflicts": [c.to_dict() for c in self.conflicts], "assumed": self.assumed,
            "findings": [vars(f) for f in self.findings],
            "boundaries": {path: [b.to_dict() for b in found] for path, found in self.boundaries.items()},
        }


def make_template(keypoints: KeypointsFile, garment: str | None = None, loom_width: float = LOOM_WIDTH,
                  progress: Callable[[], Any] | None = None, weighting: str = DEFAULT_WEIGHTING) -> Template:
    """Make the cutting template of a garment from the keypoints of its images.

    Parameters
    ----------
    keypoints : KeypointsFile
    garment : str, optional
        Type; by default that of the file, else a round-collar robe.
    loom_width : float
        m.
    progress : callable, optional
        Called once an image measured and once an image whose edges are fitted.
    weighting : str
        Of the vote, see :func:`reconstruction.measure.vote.vote`.

    Raises
    ------
    InputError
        Unknown type, nothing measured (an image with too few points or without a scale is left out, with a warning among the
        findings),
        contradicting dimensions, or a pattern that does not pass its checks.
    """
    garment = garment_type(garment or keypoints.garment or DEFAULT_GARMENT)
    left_out: dict[str, str] = {}
    measurements = measure_images(keypoints.images, garment, progress, left_out)
    images = [image for image in keypoints.images if str(image.path) not in left_out]
    votes, conflicts = vote(measurements, weighting=weighting)
    if not votes:
        raise InputError(f"no length of a {garment} could be measured on any of {len(keypoints.images)} images")
    boundaries: dict[str, tuple[Boundary, ...]] = {}
    poses: dict[str, PoseFit] = {}
    for image in images:
        if garment in WITH_SLEEVES or image.curves:
            boundaries[str(image.path)] = tuple(find_boundaries(image, image_scale(image).metres_per_pixel))
        if garment in WITH_SLEEVES and image.kind != "textile" and image.present[list(TORSO)].sum() >= 3:
            poses[str(image.path)] = image_pose(image)
        if progress is not None:
            progress()
    shape = _shape(images, boundaries)
    dimensions, assumed = derive(garment, {name: v.value for name, v in votes.items()}, shape or QUARTER)
    if shape is None and garment in WITH_SLEEVES:
        assumed["neckline"] = "a quarter of an ellipse"
    pattern = build_pattern(garment, dimensions, loom_width)
    findings = check(pattern, loom_width)
    findings += [Finding("warning", "keypoints", note) for note in keypoints.notes]
    findings += [Finding("warning", Path(path).name, f"left out: {reason}") for path, reason in left_out.items()]
    for name, (value, usual) in unusual(garment, {name: v.value for name, v in votes.items()}).items():
        text = f"is {100 * value:.0f} cm, of a {garment} usually about {100 * usual:.0f} cm: are type and scale right?"
        findings.append(Finding("warning", name, text))
    errors = [f"{f.where}: {f.message}" for f in findings if f.level == "error"]
    if errors:
        raise InputError(f"the pattern does not pass its checks: {'; '.join(errors)}. Check the points and the scale of the images")
    for name, how in assumed.items():
        log.info("%s is assumed: %s", name, how)
    return Template(pattern, dimensions, tuple(measurements), votes, tuple(conflicts), boundaries, assumed, tuple(findings), poses)


def build_pattern(garment: str, dimensions: Dimensions, loom_width: float = LOOM_WIDTH) -> Pattern:
    """The pattern of a type with given dimensions."""
    if isinstance(dimensions, RibbonDimensions):
        return build_ribbon(dimensions)
    if isinstance(dimensions, HatDimensions):
        return build_hat(dimensions)
    return build(garment, dimensions, loom_width)


def write_template(folder: Path, template: Template, images: Sequence[ImageKeypoints] = ()) -> dict[str, Path]:
    """Write drawing, pattern, tables and overview into a folder.

    Returns
    -------
    dict of str to Path
        ``svg, dxf, json, measurements, votes, conflicts, boundaries, poses, overview``. A writer whose library is missing is left
        out and logged.
    """
    from reconstruction.template.dxf import write_dxf
    from reconstruction.template.garmentcode import write_garmentcode
    from reconstruction.template.overview import write_overview
    from reconstruction.template.svg import write_svg

    files = {"svg": folder / "template.svg", "dxf": folder / "template.dxf", "json": folder / "template.json"}
    for key, write in (("svg", write_svg), ("dxf", write_dxf), ("json", write_garmentcode)):
        try:
            write(files[key], template.pattern)
        except MfarError as error:
            log.warning("%s is not written: %s", files.pop(key).name, error)
    tables: dict[str, list[dict[str, Any]]] = {
        "measurements": [m.to_dict() for m in template.measurements],
        "votes": [_flat(v) for v in template.votes.values()],
        "conflicts": [c.to_dict() for c in template.conflicts],
        "boundaries": [{"image": path} | b.to_dict() for path, found in template.boundaries.items() for b in found],
    }
    for key, rows in tables.items():
        files[key] = folder / f"{key}.csv"
        _write_csv(files[key], rows, _COLUMNS[key])
    files["poses"] = folder / "poses.json"
    files["poses"].write_text(json.dumps({path: pose.to_dict() for path, pose in template.poses.items()}, indent=1) + "\n",
                              encoding="utf-8")
    files["overview"] = folder / "overview.png"
    write_overview(files["overview"], template, images)
    return files


_COLUMNS = {
    "measurements": ["name", "source", "kind", "value_m", "sigma_m", "point_sigma_m", "scale_sigma_m", "model_sigma_m", "method"],
    "votes": ["name", "value_m", "sigma_m", "spread_m", "chi_square", "p_value",
              *(f"{kind}_{what}" for kind in WEIGHTS for what in ("weight", "value_m", "sigma_m"))],
    "conflicts": ["name", "level", "first", "second", "first_value_m", "second_value_m", "combined_sigma_m", "z"],
    "boundaries": ["image", "name", "length_m", "spans", "rms_px", "max_px", "rms_mm", "max_mm"],
}


def _flat(v: Vote) -> dict[str, Any]:
    row = {key: value for key, value in v.to_dict().items() if key not in ("weights", "kinds")}
    for kind, (value, sigma) in v.values.items():
        row |= {f"{kind}_weight": v.weights[kind], f"{kind}_value_m": value, f"{kind}_sigma_m": sigma}
    return row


def _write_csv(path: Path, rows: Sequence[dict[str, Any]], columns: Sequence[str]) -> None:
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, columns)
        writer.writeheader()
        writer.writerows(rows)


def _shape(images: Sequence[ImageKeypoints], boundaries: dict[str, tuple[Boundary, ...]]):
    """Shape of the neckline: traced collars first, then textiles' contours; of several the one fitted best."""
    found = []
    for image in images:
        if image.kind != "textile" and "collar" not in image.curves:
            continue
        fitted = neckline_shape(image, boundaries.get(str(image.path), ()))
        if fitted is not None:
            found.append(("collar" not in image.curves, -KINDS.index(image.kind), fitted[1], fitted[0]))
    return min(found)[3] if found else None
