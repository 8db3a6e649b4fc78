"""The file of keypoints: what a detector (or a person) says about every image, as JSON.

.. code-block:: json

    {
      "format": "mfar keypoints", "version": 1, "garment": "round-collar-robe",
      "landmarks": ["left_shoulder", "right_shoulder", "..."],
      "images": [{
        "path": "robe.png", "kind": "textile", "figure": null, "height": null, "size": [768, 1024],
        "keypoints": [[402.1, 88.0], null, "..."], "confidence": [0.93, 0.0, "..."], "present": [true, false, "..."],
        "sigma": 1.0, "mask": "robe_mask.png",
        "scale": {"marks": [[10, 20], [410, 20]], "length": 0.1, "sigma": 1.0},
        "curves": {"lapel": [[380, 120], [372, 300], [365, 900]]}
      }]
    }

``path`` and ``mask`` are relative to the file. ``height`` is that of the figure in m, if it is known better than by its sex.
``keypoints`` follow :data:`reconstruction.landmarks.LANDMARKS` (12 points, px, null where absent); ``confidence`` and ``present``
may be left out (1 and "has a point"). ``sigma`` is the standard deviation of the points in pixels, one number or twelve. The mask
(non-zero = garment) covers the outer face of the garment only: where the collar opens onto the lining there is no garment.
``scale`` is one of ``{"marks": [a, b], "length": m, "sigma": px}`` (two points at a known distance), ``{"dpi": number}``,
``{"metres_per_pixel": number, "relative_sigma": number}``, ``{"head": [x, y], "foot": [x, y]}`` (crown and sole of the figure: its
stature sets the scale), or absent: the proportions of the figure set it. ``curves`` are edges traced by hand which no silhouette
shows (``lapel``, ``collar``).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import DataFileError
from mfar_fem.tomlfile import suggest
from reconstruction.landmarks import KINDS, LANDMARKS, STATURE

FORMAT, VERSION = "mfar keypoints", 1
DEFAULT_SIGMA = 1.0
"""Standard deviation of a keypoint where the file gives none, px."""
SCALE_FORMS: tuple[tuple[set[str], set[str]], ...] = (
    ({"marks", "length"}, {"sigma"}),
    ({"dpi"}, set()),
    ({"metres_per_pixel"}, {"relative_sigma"}),
    ({"head", "foot"}, {"sigma"}),
)
"""Allowed forms of ``scale``: keys that must and keys that may be there."""
_IMAGE_KEYS = ("path", "kind", "figure", "height", "size", "keypoints", "confidence", "present", "sigma", "mask", "scale", "curves")


@dataclass(frozen=True)
class ImageKeypoints:
    """Keypoints of one image.

    Attributes
    ----------
    path : Path
        The image.
    kind : str
        One of :data:`reconstruction.landmarks.KINDS`.
    points : (12, 2) array
        Pixels (x right, y down, origin at the centre of the top-left pixel); NaN where absent.
    confidence : (12,) array
        In [0, 1].
    present : (12,) bool array
    sigma : (12,) array
        Standard deviation of each point, px.
    figure : str, optional
        ``male`` or ``female``; None for a garment without a figure.
    mask : Path, optional
        Image of the garment's outer face.
    scale : mapping, optional
        What sets the scale (see the module).
    curves : mapping of str to (n, 2) array
        Traced edges, px.
    size : (int, int), optional
        Width and height of the image, px.
    height : float, optional
        Of the figure, m, if known.
    """

    path: Path
    kind: str
    points: np.ndarray
    confidence: np.ndarray
    present: np.ndarray
    sigma: np.ndarray
    figure: str | None = None
    mask: Path | None = None
    scale: Mapping[str, Any] | None = None
    curves: Mapping[str, np.ndarray] = field(default_factory=dict)
    size: tuple[int, int] | None = None
    height: float | None = None

    @classmethod
    def of(cls, path, kind: str, points, *, confidence=None, present=None, sigma=DEFAULT_SIGMA, **more) -> ImageKeypoints:
        """Build with defaults: present where finite, confidence 1 where present."""
        points = np.array(points, dtype=float)
        here = np.isfinite(points).all(axis=1) if present is None else np.asarray(present, dtype=bool)
        points = np.where(here[:, None], points, np.nan)
        sure = here.astype(float) if confidence is None else np.asarray(confidence, dtype=float)
        return cls(Path(path), kind, points, sure, here, np.broadcast_to(np.asarray(sigma, dtype=float), (12,)).copy(), **more)

    @property
    def stature(self) -> float:
        """Height of the figure, m: as known, else of its sex, else a man's."""
        return self.height if self.height is not None else STATURE[self.figure or "male"]

    @property
    def name(self) -> str:
        """Name for tables: the file's name."""
        return self.path.name

    def to_dict(self, base: Path) -> dict[str, Any]:
        """The JSON form; paths relative to the folder `base` where they lie in it."""
        data: dict[str, Any] = {"path": _relative(self.path, base), "kind": self.kind, "figure": self.figure}
        if self.height is not None:
            data["height"] = float(self.height)
        if self.size is not None:
            data["size"] = list(self.size)
        data["keypoints"] = [[float(x), float(y)] if ok else None for (x, y), ok in zip(self.points, self.present, strict=True)]
        data["confidence"] = [float(c) for c in self.confidence]
        data["present"] = [bool(p) for p in self.present]
        data["sigma"] = [float(s) for s in self.sigma]
        if self.mask is not None:
            data["mask"] = _relative(self.mask, base)
        if self.scale is not None:
            data["scale"] = {key: np.asarray(value).tolist() for key, value in self.scale.items()}
        if self.curves:
            data["curves"] = {key: np.asarray(value).tolist() for key, value in self.curves.items()}
        return data


@dataclass(frozen=True)
class KeypointsFile:
    """All images of one garment, its type if known, and what whoever uses the points should know (``notes``)."""

    images: tuple[ImageKeypoints, ...]
    garment: str | None = None
    notes: tuple[str, ...] = ()


def write_keypoints(path, contents: KeypointsFile) -> None:
    """Write the JSON file."""
    path = Path(path)
    data: dict[str, Any] = {"format": FORMAT, "version": VERSION, "garment": contents.garment, "landmarks": list(LANDMARKS)}
    if contents.notes:
        data["notes"] = list(contents.notes)
    data["images"] = [image.to_dict(path.parent) for image in contents.images]
    path.write_text(json.dumps(data, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def read_keypoints(path) -> KeypointsFile:
    """Read and validate the JSON file.

    Raises
    ------
    DataFileError
        It cannot be read, is no JSON, or a value is missing, unknown or of the wrong shape; names the file, the image and the key.
    """
    path = Path(path)
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise DataFileError("there is no such file; `mfar keypoints PICTURES --out DIR` writes one (keypoints.json in DIR)",
                            path=path) from None  # fmt: skip
    except (OSError, UnicodeDecodeError) as error:
        raise DataFileError(f"cannot be read: {error}", path=path) from error
    except json.JSONDecodeError as error:
        raise DataFileError(f"is not valid JSON: {error.msg}", path=path, line=error.lineno) from error
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise DataFileError(f"is no keypoints file: the key 'format' must be '{FORMAT}'", path=path)
    if data.get("version") != VERSION:
        raise DataFileError(f"has version {data.get('version')!r}; this program reads version {VERSION}", path=path)
    if data.get("landmarks", list(LANDMARKS)) != list(LANDMARKS):
        raise DataFileError(f"lists other landmarks; they must be, in this order: {', '.join(LANDMARKS)}", path=path,
                            column="landmarks")
    garment = data.get("garment")
    if not (garment is None or isinstance(garment, str)):
        raise DataFileError(f"must be a garment type or null, not {garment!r}", path=path, column="garment")
    notes = data.get("notes", [])
    if not (isinstance(notes, list) and all(isinstance(note, str) for note in notes)):
        raise DataFileError("must be a list of texts", path=path, column="notes")
    images = data.get("images")
    if not isinstance(images, list) or not images:
        raise DataFileError("must be a list with at least one image", path=path, column="images")
    return KeypointsFile(tuple(_Entry(path, i, entry).image() for i, entry in enumerate(images)), garment, tuple(notes))


def _relative(path: Path, base: Path) -> str:
    try:
        return path.resolve().relative_to(base.resolve()).as_posix()
    except ValueError:
        return str(path.resolve())  # what is relative to the working directory means nothing to who reads the file later


class _Entry:
    """One entry of ``images`` while it is validated."""

    def __init__(self, path: Path, number: int, data: Any):
        self.path, self.number, self.data = path, number, data

    def error(self, key: str, message: str) -> DataFileError:
        return DataFileError(message, path=self.path, column=f"images[{self.number}]" + (f".{key}" if key else ""))

    def image(self) -> ImageKeypoints:
        data = self.data
        if not isinstance(data, dict):
            raise self.error("", "must be an object with path, kind and keypoints")
        for key in data:
            if key not in _IMAGE_KEYS:
                raise self.error(key, f"unknown key{suggest(key, _IMAGE_KEYS)}")
        if not isinstance(data.get("path"), str):
            raise self.error("path", "must be the path of the image")
        if data.get("kind") not in KINDS:
            raise self.error("kind", f"must be one of {', '.join(KINDS)}, not {data.get('kind')!r}")
        if data.get("figure") not in (None, *STATURE):
            raise self.error("figure", f"must be one of {', '.join(STATURE)} or null, not {data.get('figure')!r}")
        height = data.get("height")
        if height is not None and not (_is_number(height) and 0.5 < height < 2.5):
            raise self.error("height", f"must be the height of a grown figure in m, between 0.5 and 2.5, or null, not {height!r}")
        points = self.points()
        finite = np.isfinite(points).all(axis=1)
        present = self.vector("present", finite, bool)
        if (present & ~finite).any():
            raise self.error("keypoints", f"'{LANDMARKS[int(np.argmax(present & ~finite))]}' is present but has no point")
        confidence = self.vector("confidence", present.astype(float), float)
        if ((confidence < 0) | (confidence > 1)).any():
            raise self.error("confidence", "must lie in [0, 1]")
        sigma = self.vector("sigma", np.full(12, DEFAULT_SIGMA), float, scalar=True)
        if (sigma <= 0).any():
            raise self.error("sigma", "must be positive (px)")
        size = data.get("size")
        if size is not None and not (isinstance(size, list) and len(size) == 2 and all(type(s) is int and s > 0 for s in size)):
            raise self.error("size", f"must be [width, height] in pixels, not {size!r}")
        mask = data.get("mask")
        if not (mask is None or isinstance(mask, str)):
            raise self.error("mask", "must be the path of an image or null")
        curves = data.get("curves") or {}
        if not isinstance(curves, dict):
            raise self.error("curves", "must be an object of lists of points")
        base = self.path.parent
        return ImageKeypoints(
            base / data["path"], data["kind"], np.where(present[:, None], points, np.nan), confidence, present, sigma,
            data.get("figure"), None if mask is None else base / mask, self.scale(),
            {key: self.polyline(f"curves.{key}", value) for key, value in curves.items()}, tuple(size) if size else None,
            height,
        )

    def points(self) -> np.ndarray:
        given = self.data.get("keypoints")
        if not isinstance(given, list) or len(given) != 12:
            raise self.error("keypoints", "must be a list of 12 points [x, y] (null where absent)")
        points = np.full((12, 2), np.nan)
        for i, value in enumerate(given):
            if value is not None and value != [None, None]:
                points[i] = self.point(f"keypoints[{i}] ({LANDMARKS[i]})", value)
        return points

    def point(self, key: str, value: Any) -> np.ndarray:
        if not (isinstance(value, list) and len(value) == 2 and all(_is_number(v) for v in value)):
            raise self.error(key, f"must be a point [x, y] in pixels, not {value!r}")
        return np.array(value, dtype=float)

    def polyline(self, key: str, value: Any) -> np.ndarray:
        if not isinstance(value, list) or len(value) < 2:
            raise self.error(key, "must be a list of at least two points")
        return np.array([self.point(f"{key}[{i}]", v) for i, v in enumerate(value)])

    def vector(self, key: str, default: np.ndarray, kind: type, scalar: bool = False) -> np.ndarray:
        value = self.data.get(key)
        if value is None:
            return default
        good = (lambda v: isinstance(v, bool)) if kind is bool else _is_number
        if scalar and good(value):
            return np.full(12, value, dtype=float)
        if not isinstance(value, list) or len(value) != 12 or not all(good(v) for v in value):
            raise self.error(key, f"must be a list of 12 {'true/false' if kind is bool else 'numbers'}, one for each landmark")
        return np.array(value, dtype=kind)

    def scale(self) -> dict[str, Any] | None:
        value = self.data.get("scale")
        if value is None:
            return None
        keys = set(value) if isinstance(value, dict) else set()
        if not any(must <= keys <= must | may for must, may in SCALE_FORMS):
            forms = "; ".join("{" + ", ".join(sorted(must)) + "}" for must, _ in SCALE_FORMS)
            raise self.error("scale", f"must have the keys of one of {forms}; found {sorted(keys) or value!r}")
        result: dict[str, Any] = {}
        for key, item in value.items():
            if key == "marks":
                result[key] = self.polyline("scale.marks", item)
                if len(result[key]) != 2:
                    raise self.error("scale.marks", "must be two points")
            elif key in ("head", "foot"):
                result[key] = self.point(f"scale.{key}", item)
            elif not _is_number(item) or item < 0 or (item == 0 and "sigma" not in key):
                raise self.error(f"scale.{key}", f"must be a positive number, not {item!r}")
            else:
                result[key] = float(item)
        return result


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and bool(np.isfinite(value))
