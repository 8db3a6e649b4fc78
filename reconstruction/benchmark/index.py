"""Reading a benchmark: its index, its samples, the truth of a picture."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import DataFileError
from reconstruction.landmarks import LANDMARKS

from .camera import Camera

FORMAT = "mfar-benchmark-images"
INDEX = "benchmark.json"


@dataclass(frozen=True)
class Sample:
    """One picture with its labels.

    Parameters
    ----------
    path : Path
        JPEG, 384 x 512.
    keypoints : (12, 2) array
        Pixels, NaN where absent.
    visible, present, intact : (12,) bool arrays
        Seen (not hidden by cloth, body or the frame); part of this garment's cut; paint or cloth is left there.
    style, kind, split, identity : str
    damage, view, fold : int
    camera : Camera
    truth, geometry : Path or None
        npz files (``truth`` is None in a light benchmark).
    """

    path: Path
    keypoints: np.ndarray
    visible: np.ndarray
    present: np.ndarray
    intact: np.ndarray
    style: str
    kind: str
    split: str
    identity: str
    damage: int
    view: int
    fold: int
    camera: Camera
    truth: Path | None
    geometry: Path

    def image(self) -> np.ndarray:
        """(512, 384, 3) uint8 array."""
        from PIL import Image

        try:
            with Image.open(self.path) as picture:
                return np.asarray(picture.convert("RGB"))
        except OSError as error:
            raise DataFileError(
                f"cannot be read as a picture: {error}; make it again with `mfar benchmark-data`", path=self.path
            ) from error

    def load_truth(self) -> dict[str, np.ndarray]:
        """Truth at the centres of the pixels, (512, 384, ...) arrays.

        Returns
        -------
        dict
            ``depth`` (m, as the camera defines it, NaN for background), ``normals`` (unit, world axes, towards the camera, 0 for
            background), ``labels`` (0 background, 1 figure, 2 garment), ``intact`` (paint or cloth is left).

        Raises
        ------
        DataFileError
            The benchmark is a light one, or the file cannot be read.
        """
        if self.truth is None:
            raise DataFileError(
                "has no depth or normals: the benchmark was made with --light; make it again without", path=self.path
            )
        stored = load_arrays(self.truth)
        return {
            "depth": stored["depth"].astype(np.float32) + np.float32(stored["depth_offset"]),
            "normals": stored["normals"].astype(np.float32) / 127,
            "labels": stored["labels"],
            "intact": stored["intact"],
        }


@dataclass(frozen=True)
class BenchmarkIndex:
    """The index of a benchmark.

    Parameters
    ----------
    root : Path
    version, seed : int
    light : bool
    identities : dict of str to dict
        Records by identity name: cut, body, pattern, panels, seams, drape.
    samples : tuple of Sample
    """

    root: Path
    version: int
    seed: int
    light: bool
    identities: dict[str, dict[str, Any]]
    samples: tuple[Sample, ...]

    def geometry(self, identity: str) -> dict[str, np.ndarray]:
        """Arrays of an identity.

        Returns
        -------
        dict
            ``vertices`` (n, 3) of the worn mid-surface, m; ``faces`` (m, 3), counter-clockwise from outside; ``uv`` (m, 3, 2) panel
            coordinates of their corners, m; ``panel`` (m,) index into the record's draped and hidden panels; ``warp`` (m, 3) unit
            vectors; ``flat`` (m, 3, 3) their corners laid out flat, m; ``body_vertices``, ``body_faces``; ``keypoints`` and
            ``flat_keypoints`` (12, 3), m, NaN where absent; ``present`` (12,).
        """
        return load_arrays(self.root / self.identities[identity]["geometry"])


def load_arrays(path: Path) -> dict[str, np.ndarray]:
    """All arrays of an npz file.

    Raises
    ------
    DataFileError
        It is missing or damaged.
    """
    try:
        with np.load(path) as stored:
            return {name: stored[name] for name in stored.files}
    except Exception as error:
        raise DataFileError(f"cannot be read: {error}; delete its folder and run `mfar benchmark-data` again", path=path) from error


def load_index(folder) -> BenchmarkIndex:
    """Read a benchmark's index.

    Parameters
    ----------
    folder : str or path-like
        Made by ``mfar benchmark-data --out``.

    Raises
    ------
    DataFileError
        There is no ``benchmark.json``, it is not one, or a picture it names is missing.
    """
    root = Path(folder)
    path = root / INDEX
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise DataFileError(
            "there is no such file; make the benchmark with `mfar benchmark-data --out FOLDER`", path=path
        ) from None
    except (OSError, ValueError) as error:
        raise DataFileError(f"cannot be read as JSON: {error}", path=path) from error
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise DataFileError(f"is not a benchmark index (its 'format' must be '{FORMAT}')", path=path)
    if data.get("landmarks") != list(LANDMARKS):
        raise DataFileError("has another list of landmarks than this version of the package; make the benchmark again", path=path)
    found = []
    for name, record in data["identities"].items():
        who = record["facts"]["identity"]
        for entry in record["images"]:
            picture = root / entry["file"]
            if not picture.exists():
                raise DataFileError(
                    f"names the picture '{entry['file']}', which is missing; run `mfar benchmark-data` again", path=path
                )
            pixels = np.array([[np.nan, np.nan] if p is None else p for p in entry["keypoints"]], dtype=float)
            found.append(
                Sample(
                    picture,
                    pixels,
                    np.array(entry["visible"]),
                    np.array(record["present"]),
                    np.array(entry["intact"]),
                    entry["style"],
                    who["kind"],
                    who["split"],
                    name,
                    entry["damage"],
                    entry["view"],
                    who["fold"],
                    Camera.from_dict(entry["camera"]),
                    root / entry["truth"] if "truth" in entry else None,
                    root / record["geometry"],
                )
            )
    return BenchmarkIndex(root, data["version"], data["seed"], data["light"], data["identities"], tuple(found))


def samples(
    index: BenchmarkIndex,
    split: str | None = None,
    style: str | None = None,
    kind: str | None = None,
    fold: int | None = None,
    damage: int | None = None,
) -> Iterator[Sample]:
    """Samples that match all given values, in the order of the index."""
    wanted = {"split": split, "style": style, "kind": kind, "fold": fold, "damage": damage}
    for sample in index.samples:
        if all(value is None or getattr(sample, name) == value for name, value in wanted.items()):
            yield sample
