"""An identity's folder: pictures, truth, geometry; written completely or not at all."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import InputError

from . import keypoints
from .identity import SIZE, model, shoot, shots
from .scene import look
from .splits import Identity

Figure = tuple[str, str] | None
"""OBJ file and keypoints file of a body."""
VERSION = 1
"""Of the generator: pictures of different versions are not comparable."""
QUALITY = 92
"""Of the JPEG files."""


def complete(root: Path, identity: Identity, light: bool, size: float = SIZE, figure: Figure = None,
             pictures: int = 0) -> dict[str, Any] | None:  # fmt: skip
    """The record of an identity that is already there in this version (and with truth, unless `light`), or None."""
    try:
        record = json.loads((root / identity.stem / "identity.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    fits = (
        record.get("version") == VERSION
        and (light or not record.get("light"))
        and record.get("mesh_size") == size
        and len(record.get("images", ())) == len(shots(identity, pictures))
        and record.get("figure") == (None if figure is None else list(figure))
        and record.get("facts", {}).get("identity", {}).get("split") == identity.split
    )
    if not fits:
        return None
    files = [record["geometry"], *(f for e in record["images"] for f in (e["file"], e.get("truth")) if f)]
    return record if all((root / f).exists() for f in files) else None


def make(root: Path, identity: Identity, light: bool = False, size: float = SIZE, figure: Figure = None,
         pictures: int = 0) -> dict[str, Any]:  # fmt: skip
    """Make an identity's folder, in place of what is there.

    Parameters
    ----------
    root : Path
        Folder of the benchmark.
    identity : Identity
    light : bool
        Without depth, normals and labels.
    size : float
        Edge length of the cloth's mesh, m.
    figure : (str, str), optional
        OBJ file and keypoints of a body that all identities wear their garments on: then the splits no longer separate bodies.
    pictures : int
        At most so many; 0 for all.

    Returns
    -------
    dict
        The record: facts of the identity and one entry a picture.

    Raises
    ------
    InputError
        The folder cannot be written.
    """
    from PIL import Image

    scratch = root / f".part-{identity.stem}-{os.getpid()}"
    try:
        scratch.mkdir(parents=True)
        made = model(identity, size, figure)
        arrays = made.arrays
        save_arrays(scratch / f"{identity.stem}_geometry.npz", arrays)
        entries = []
        for shot in shots(identity, pictures):
            image, intact, camera, scene = shoot(made, shot)
            points = arrays["flat_keypoints" if shot.style == "textile" else "keypoints"]
            there = arrays["present"]
            pixels = np.full((len(points), 2), np.nan)
            pixels[there] = camera.project(points[there])[0]
            seen = keypoints.visible(points, camera, scene.caster)
            name = f"{identity.stem}_{shot.label}"
            Image.fromarray(image).save(scratch / f"{name}.jpg", quality=QUALITY, subsampling=0)
            entry = {
                "file": f"{identity.stem}/{name}.jpg",
                "style": shot.style,
                "view": shot.view,
                "damage": shot.damage,
                "seed": shot.seed,
                "camera": camera.to_dict(),
                "keypoints": [None if not ok else [float(x) for x in p] for ok, p in zip(there, pixels, strict=True)],
                "visible": seen.tolist(),
                "intact": _at(intact, pixels).tolist(),
            }
            if not light:
                save_arrays(scratch / f"{name}_truth.npz", _truth(scene, camera, intact))
                entry["truth"] = f"{identity.stem}/{name}_truth.npz"
            entries.append(entry)
        record = {
            "version": VERSION,
            "light": light,
            "mesh_size": size,
            "figure": None if figure is None else list(figure),
            "facts": made.facts,
            "present": arrays["present"].tolist(),
            "geometry": f"{identity.stem}/{identity.stem}_geometry.npz",
            "images": entries,
        }
        (scratch / "identity.json").write_text(json.dumps(record, indent=1), encoding="utf-8")
        final = root / identity.stem
        if final.exists():
            shutil.rmtree(final)
        os.replace(scratch, final)
    except OSError as error:
        raise InputError(f"cannot write '{root / identity.stem}': {error.strerror or error}") from error
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    return record


def save_arrays(path: Path, arrays: dict[str, Any]) -> None:
    """Write an npz file."""
    np.savez_compressed(path, **arrays)


def _truth(scene, camera, intact) -> dict[str, np.ndarray]:
    """Depth (float16, relative to `depth_offset` so that its step stays under 1 mm), normals (int8, times 127) and labels (0
    background, 1 figure, 2 garment)."""
    view = look(scene, camera)
    offset = float(np.round(np.nanmean(view.depth), 3))
    return {
        "depth": (view.depth - offset).astype(np.float16),
        "depth_offset": np.array(offset),
        "normals": np.round(view.normal * 127).astype(np.int8),
        "labels": (view.hit.astype(np.uint8) + view.cloth),
        "intact": intact,
    }


def _at(mask: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Values of a mask at pixels (n, 2), False outside or where NaN."""
    out = np.zeros(len(pixels), dtype=bool)
    ok = np.isfinite(pixels).all(axis=1)
    x, y = np.round(np.where(ok[:, None], pixels, 0)).astype(int).T
    ok &= (x >= 0) & (y >= 0) & (x < mask.shape[1]) & (y < mask.shape[0])
    out[ok] = mask[y[ok], x[ok]]
    return out
