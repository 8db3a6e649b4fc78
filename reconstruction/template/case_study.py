"""How far a template made from pictures is from the pattern that was sewn: synthetic garments, detected and true points."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import InputError
from reconstruction.keypoints_file import ImageKeypoints, KeypointsFile, read_keypoints
from reconstruction.measure.silhouette import read_mask
from reconstruction.measure.vote import WEIGHTINGS
from reconstruction.template.pipeline import make_template

TRUTH: dict[str, dict[str, tuple[str, float]]] = {
    "tunic": {
        "length": ("length", 1.0), "cross_sleeve_width": ("cross_sleeve", 1.0), "body_width": ("chest_width", 1.0),
        "armhole_depth": ("sleeve_depth", 1.0), "cuff_width": ("cuff_width", 1.0), "hem_width": ("hem_width", 1.0),
        "neck_width": ("collar_radius", 2.0),
    },
    "flying-ribbon": {"length": ("length", 1.0), "width": ("width", 1.0)},
    "veil-hat": {"brim_diameter": ("brim_radius", 2.0), "crown_height": ("crown_height", 1.0), "veil_length": ("veil_length", 1.0)},
}
"""Dimension of the template to the parameter of the cut and its factor."""
ROUGH = 2.0
"""Standard deviation of an outline drawn by hand, px (assumption), over stretches of :data:`STRETCH`; of scale marks half of it."""
STRETCH = 12.0
"""Length over which a hand stays on one side of the true outline, px (assumption)."""
SOURCES = {"all": None, "textile": ("textile",), "figures": ("figurine", "mural")}
"""Kinds of pictures that a template is made from."""


def compare(folder: Path, detected: Path, garment: str, rough: Path | None = None) -> list[dict[str, Any]]:
    """Errors of the templates of one case.

    Parameters
    ----------
    folder : Path
        Of ``mfar benchmark-case``.
    detected : Path
        The keypoints file that a detector made of its pictures.
    garment : str
        Type.
    rough : Path, optional
        Folder for masks drawn roughly (:func:`roughened`): what comes of them is compared too.

    Returns
    -------
    list of dict
        ``garment``, ``points`` (detected; detected, rough masks; true), ``sources``, ``vote``, ``dimension``, ``true_m``,
        ``found_m``, ``error`` (relative), ``assumed`` (whether no picture showed it); ``found_m`` is None, with ``why``, where
        no template came about.
    """
    cut = json.loads((folder / "truth" / "truth.json").read_text(encoding="utf-8"))["cut"]
    truth = {name: factor * cut[key] for name, (key, factor) in TRUTH.get(garment, TRUTH["tunic"]).items() if cut.get(key)}
    rows: list[dict[str, Any]] = []
    found = read_keypoints(detected).images
    given = {"detected": found, "true": read_keypoints(folder / "truth" / "keypoints.json").images}
    if rough is not None:
        given["detected, rough masks"] = roughened(found, rough)
    for points, images in given.items():
        for sources, kinds in SOURCES.items():
            chosen = tuple(i for i in images if kinds is None or i.kind in kinds)
            for vote in WEIGHTINGS if kinds is None else WEIGHTINGS[:1]:
                known = {"garment": garment, "points": points, "sources": sources, "vote": vote}
                rows += [known | row for row in _errors(chosen, garment, vote, truth)]
    return rows


def roughened(images: Sequence[ImageKeypoints], folder: Path, sigma: float = ROUGH, seed: int = 0) -> tuple[ImageKeypoints, ...]:
    """Images with outlines and scale marks as a hand would draw them: moved by smooth noise.

    Parameters
    ----------
    images : sequence of ImageKeypoints
    folder : Path
        For the masks.
    sigma : float
        Standard deviation of the outline, px; of the marks half of it.
    seed : int
    """
    from PIL import Image
    from scipy.ndimage import distance_transform_edt, gaussian_filter

    folder.mkdir(parents=True, exist_ok=True)
    made = []
    for number, image in enumerate(images):
        rng = np.random.default_rng([seed, number])
        changes: dict[str, Any] = {}
        if image.mask is not None:
            mask = read_mask(image.mask, image.size)
            noise = gaussian_filter(rng.standard_normal(mask.shape), STRETCH)
            inside = np.where(mask, distance_transform_edt(mask) - 0.5, 0.5 - distance_transform_edt(~mask))
            path = folder / f"{number:03d}.png"
            Image.fromarray((inside + noise * (sigma / noise.std()) > 0).astype(np.uint8) * 255).save(path)
            changes["mask"] = path
        if image.scale is not None and "marks" in image.scale:
            marks = np.asarray(image.scale["marks"]) + rng.normal(0, sigma / 2, (2, 2))
            changes["scale"] = {**image.scale, "marks": marks, "sigma": max(1.0, sigma / 2)}
        made.append(replace(image, **changes))
    return tuple(made)


def _errors(images, garment: str, vote: str, truth: dict[str, float]) -> list[dict[str, Any]]:
    try:
        made = make_template(KeypointsFile(images, garment), garment, weighting=vote)
    except InputError as error:
        none = {"found_m": None, "error": None, "assumed": None, "why": str(error)}
        return [{"dimension": n, "true_m": t} | none for n, t in truth.items()]
    found = {n: float(getattr(made.dimensions, n)) for n in truth}
    return [{"dimension": n, "true_m": t, "found_m": found[n], "error": found[n] / t - 1.0, "assumed": n in made.assumed, "why": ""}
            for n, t in truth.items()]  # fmt: skip


def study(out: Path, garments: Sequence[str], seeds: int, weights: str = "shipped", progress: Callable[[], None] | None = None,
          ) -> dict[str, Any]:  # fmt: skip
    """Cases of several garments and seeds, made (or found) in ``out/cases``, detected, fitted, compared.

    Returns
    -------
    dict
        ``rows`` (:func:`compare`, with ``seed``) and ``summary``: by garment, points, sources, vote and dimension the median and
        largest of the absolute relative errors over the seeds, and the number within 3 %.
    """
    from reconstruction.benchmark.case import make_case
    from reconstruction.keypoints.locate import FILE, locate

    rows: list[dict[str, Any]] = []
    for garment in garments:
        for seed in range(seeds):
            folder = out / "cases" / f"{garment}-{seed}"
            if not (folder / "sources.toml").exists():
                make_case(folder, garment, seed)
            points = out / "keypoints" / folder.name
            if not (points / FILE).exists():
                locate([folder], points, weights, garment=garment)
            rows += [{"seed": seed} | row for row in compare(folder, points / FILE, garment, out / "rough" / folder.name)]
            if progress is not None:
                progress()
    return {"rows": rows, "summary": summary(rows)}


def summary(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Errors over the seeds, see :func:`study`."""
    keys = ("garment", "points", "sources", "vote", "dimension")
    groups: dict[tuple, list[dict[str, Any]]] = {}
    for row in rows:
        groups.setdefault(tuple(row[k] for k in keys), []).append(row)
    out = []
    for key, group in groups.items():
        errors = np.abs([r["error"] for r in group if r["error"] is not None])
        out.append(dict(zip(keys, key, strict=True)) | {
            "cases": len(group), "without": len(group) - len(errors),
            "median_error": float(np.median(errors)) if len(errors) else None,
            "largest_error": float(errors.max()) if len(errors) else None,
            "within_3_percent": int((errors <= 0.03).sum()), "assumed": sum(bool(r["assumed"]) for r in group),
        })  # fmt: skip
    return out
