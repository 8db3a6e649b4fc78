"""One synthetic garment as a folder of sources: pictures, masks, cameras and ``sources.toml``, with the truth kept apart."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import InputError
from reconstruction.keypoints_file import ImageKeypoints, KeypointsFile, write_keypoints
from reconstruction.sources import NAME

from . import keypoints
from .identity import SIZE, Model, all_round, model, shoot, shots
from .scene import look
from .splits import HELD_OUT, SEEN, Identity, seeds_of
from .store import QUALITY, save_arrays

KINDS = (*SEEN, HELD_OUT)
"""Types of garment."""
TWO_SIDED = ("flying-ribbon", HELD_OUT)
"""Types whose masks show both faces of the cloth; those of tunics leave the inside out that shows at collar, cuffs and hem."""
PICTURES = 10
"""Of a case: four figurines, three murals and a textile, and a figurine and a mural that are more damaged."""
TRUTH = "truth"
"""Folder of what a reconstruction must not see."""
MARK = 0.2
"""Length of the scale marks on a textile, m."""


def make_case(folder, kind: str, seed: int = 0, size: float = SIZE, progress: Callable[[], None] | None = None,
              around: int = 0) -> dict[str, Any]:  # fmt: skip
    """Make a garment's pictures as a user would have them.

    Parameters
    ----------
    folder : str or path-like
        Gets ``pictures/``, ``masks/``, ``cameras/``, ``sources.toml``, and ``truth/`` with ``keypoints.json`` (points in
        sight), ``geometry.npz`` and ``truth.json`` (the cut and the panels, m).
    kind : str
        One of :data:`KINDS`.
    seed : int
        Of garment, body and textures; shared with no benchmark of ``mfar benchmark-data``.
    size : float
        Edge length of the cloth's mesh, m.
    progress : callable, optional
        Called after each picture.
    around : int
        Take the figurine from so many sides, evenly, as a museum may, instead of from three in front and one behind.

    Returns
    -------
    dict
        ``folder``, ``garment``, ``pictures`` (names), ``stature`` (m), ``sex``, ``cut`` (m).

    Raises
    ------
    InputError
        Unknown type, or the folder cannot be written or holds a ``sources.toml`` already.
    NotConvergedError
        The drape failed.
    """
    if kind not in KINDS:
        raise InputError(f"unknown garment '{kind}'; known: {', '.join(KINDS)}")
    folder = Path(folder)
    if (folder / NAME).exists():
        raise InputError(f"{folder / NAME} exists already; give an empty folder")
    made = model(Identity(f"C{seed:04d}", kind, "test", 0, *seeds_of(seed, 2, KINDS.index(kind))), size)
    try:
        for name in ("pictures", "masks", "cameras", TRUTH):
            (folder / name).mkdir(parents=True, exist_ok=True)
        entries, points = [], []
        for shot in all_round(made.identity, around) if around else shots(made.identity)[:PICTURES]:
            entry, found = _picture(folder, made, shot)
            entries.append(entry)
            points.append(found)
            if progress is not None:
                progress()
        facts = made.facts
        write_keypoints(folder / TRUTH / "keypoints.json", KeypointsFile(tuple(points), kind))
        save_arrays(folder / TRUTH / "geometry.npz", made.arrays)
        (folder / TRUTH / "truth.json").write_text(json.dumps(facts, indent=1), encoding="utf-8")
        (folder / NAME).write_text(_toml(kind, entries), encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot write '{folder}': {error.strerror or error}") from error
    return {"folder": str(folder), "garment": kind, "pictures": [e["file"] for e in entries], "sex": made.spec.sex,
            "stature": made.spec.stature, "cut": {k: v for k, v in facts["cut"].items() if k != "kind"}}  # fmt: skip


def _picture(folder: Path, made: Model, shot) -> tuple[dict[str, Any], ImageKeypoints]:
    """Write one picture, its mask and its camera; its entry of ``sources.toml`` and the points in sight."""
    from PIL import Image

    image, _, camera, scene = shoot(made, shot)
    name = f"{shot.style}{shot.view}_{made.identity.name.lower()}_d{shot.damage}"
    picture, mask = folder / "pictures" / f"{name}.jpg", folder / "masks" / f"{name}.png"
    Image.fromarray(image).save(picture, quality=QUALITY, subsampling=0)
    view = look(scene, camera)
    shown = view.cloth if made.identity.kind in TWO_SIDED else view.cloth & ~view.under
    Image.fromarray((255 * shown).astype(np.uint8)).save(mask)
    textile = shot.style == "textile"
    world = made.arrays["flat_keypoints" if textile else "keypoints"]
    there = made.arrays["present"] & np.asarray(keypoints.visible(world, camera, scene.caster))
    pixels = np.full((len(world), 2), np.nan)
    pixels[there] = camera.project(world[there])[0]
    entry: dict[str, Any] = {"file": f"pictures/{name}.jpg", "kind": shot.style, "mask": f"masks/{name}.png"}
    scale = None
    if textile:
        ends = _marks(camera, scene)
        entry["scale"] = ends
        scale = {"marks": ends, "length": MARK, "sigma": 0.5}
    else:
        entry["figure"] = made.spec.sex
    if not camera.affine:
        entry["camera"] = f"cameras/{name}.txt"
        np.savetxt(folder / entry["camera"], camera.matrix, fmt="%.12g")
    found = ImageKeypoints.of(picture, shot.style, pixels, figure=None if textile else made.spec.sex, mask=mask, scale=scale,
                              size=(camera.width, camera.height))  # fmt: skip
    return entry, found


def _marks(camera, scene) -> np.ndarray:
    """Two pixels that are :data:`MARK` apart on the flat cloth, (2, 2)."""
    middle = scene.cloth.mean(axis=0)
    return camera.project(middle + np.array([[-0.5 * MARK, 0.0, 0.0], [0.5 * MARK, 0.0, 0.0]]))[0]


def _toml(kind: str, entries: list[dict[str, Any]]) -> str:
    """The text of ``sources.toml``."""
    lines = [f"# A synthetic {kind}; what is true of it lies in {TRUTH}/.", ""]
    for e in entries:
        lines += ["[[image]]", f'file = "{e["file"]}"', f'kind = "{e["kind"]}"', 'licence = "made by mfar benchmark-case"',
                  f'mask = "{e["mask"]}"']  # fmt: skip
        if "figure" in e:
            lines.append(f'figure = "{e["figure"]}"')
        if "scale" in e:
            (a, b), (c, d) = e["scale"]
            lines.append(f'scale = [{{ from = [{a:.2f}, {b:.2f}], to = [{c:.2f}, {d:.2f}], length = "{100 * MARK:g} cm" }}]')
        if "camera" in e:
            lines.append(f'camera = "{e["camera"]}"')
        lines.append("")
    return "\n".join(lines)
