"""Pictures of the three kinds, and the patches that training draws from them."""

from __future__ import annotations

import csv
import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from mfar_fem.errors import DataFileError, ParameterError
from mfar_fem.tomlfile import suggest
from reconstruction import images
from reconstruction.landmarks import KINDS
from reconstruction.style.scenes import draw_scene, view


@dataclass(frozen=True)
class StyledImage:
    """Where a picture is and what it is.

    Attributes
    ----------
    path : pathlib.Path
    kind : str
        One of :data:`reconstruction.landmarks.KINDS`.
    subject : str
        Pictures of one subject and one size are taken to be registered to the pixel if training asks for registered pairs.
    """

    path: Path
    kind: str
    subject: str = ""


@dataclass(frozen=True, eq=False)
class Pool:
    """Pictures in memory.

    Attributes
    ----------
    pictures : tuple of (h, w, 3) uint8 arrays
    kinds : tuple of int
        Index into :data:`KINDS` of each.
    subjects : tuple of str
    patch : int
        Side of the patches, px.
    """

    pictures: tuple[np.ndarray, ...]
    kinds: tuple[int, ...]
    subjects: tuple[str, ...]
    patch: int = 128
    names: tuple[str, ...] = field(default=())

    def __post_init__(self):
        if len(set(self.kinds)) < 2:
            raise ParameterError("style is learnt between kinds: pictures of at least two of "
                                 f"{', '.join(KINDS)} are needed, and there are {len(self.pictures)} of {len(set(self.kinds))}")
        for k, picture in enumerate(self.pictures):
            if min(picture.shape[:2]) < self.patch:
                name = self.names[k] if self.names else f"picture {k}"
                size = f"{picture.shape[1]} x {picture.shape[0]}"
                raise DataFileError(f"has {size} pixels; patches need {self.patch} a side", path=name)

    @property
    def digest(self) -> str:
        """Of pictures and kinds, so that a run is not continued on other data."""
        total = hashlib.sha256(str((self.kinds, self.subjects, self.patch)).encode())
        for picture in self.pictures:
            total.update(picture.tobytes())
        return total.hexdigest()

    def batch(self, rng: np.random.Generator, count: int, registered: bool = False) -> Batch:
        """Pairs of patches of two different kinds.

        Parameters
        ----------
        rng : numpy.random.Generator
        count : int
            Pairs.
        registered : bool
            Both patches from the same window of pictures of one subject (formula (4) as printed needs that).

        Raises
        ------
        ParameterError
            Registered pairs are wanted, and no two pictures of different kinds share a subject and a size.
        """
        pairs = self._registered_pairs() if registered else None
        chosen = []
        present = sorted(set(self.kinds))
        for _ in range(count):
            if pairs is not None:
                a, b = pairs[rng.integers(len(pairs))]
                box = self._window(rng, a)
                boxes = (box, box)
            else:
                kind_a, kind_b = rng.choice(present, 2, replace=False)
                a, b = (int(rng.choice(np.flatnonzero(np.array(self.kinds) == kind))) for kind in (kind_a, kind_b))
                boxes = (self._window(rng, a), self._window(rng, b))
            mirror = bool(rng.random() < 0.5)
            chosen.append((self._cut(a, boxes[0], mirror), self._cut(b, boxes[1], mirror), self.kinds[a], self.kinds[b]))
        like, image, kind_like, kind_image = zip(*chosen, strict=True)
        return Batch(np.stack(like), np.stack(image), np.array(kind_like), np.array(kind_image))

    def _registered_pairs(self) -> list[tuple[int, int]]:
        groups: dict[tuple, list[int]] = {}
        for k, (subject, picture) in enumerate(zip(self.subjects, self.pictures, strict=True)):
            if subject:
                groups.setdefault((subject, picture.shape), []).append(k)
        pairs = [(a, b) for group in groups.values() for a in group for b in group if self.kinds[a] != self.kinds[b]]
        if not pairs:
            raise ParameterError("registered pairs need pictures of one subject and one size in two kinds, and there are none")
        return pairs

    def _window(self, rng, k: int) -> tuple[int, int, int]:
        """Left, top and side of a square between the patch and the whole picture, px."""
        height, width = self.pictures[k].shape[:2]
        side = int(rng.integers(self.patch, min(height, width) + 1))
        return int(rng.integers(width - side + 1)), int(rng.integers(height - side + 1)), side

    def _cut(self, k: int, box: tuple[int, int, int], mirror: bool) -> np.ndarray:
        from PIL import Image

        left, top, side = box
        window = Image.fromarray(self.pictures[k][top : top + side, left : left + side])
        patch = np.asarray(window.resize((self.patch, self.patch), Image.Resampling.BILINEAR))
        return np.ascontiguousarray(patch[:, ::-1] if mirror else patch)


@dataclass(frozen=True, eq=False)
class Batch:
    """Patches (n, p, p, 3) uint8 of I_A (`like`) and I_B (`image`), and their kinds (n,)."""

    like: np.ndarray
    image: np.ndarray
    kind_like: np.ndarray
    kind_image: np.ndarray


def read_list(path) -> list[StyledImage]:
    """A CSV file with the columns ``path``, ``kind`` and (optional) ``subject``; paths are relative to it.

    Raises
    ------
    DataFileError
        No such file, a missing column, an unknown kind (with the line).
    """
    path = Path(path)
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file)
            missing = {"path", "kind"} - set(reader.fieldnames or ())
            if missing:
                raise DataFileError(f"needs the columns path and kind; missing: {', '.join(sorted(missing))}", path=path, line=1)
            found = []
            for row in reader:
                if row["kind"] not in KINDS:
                    raise DataFileError(f"unknown kind '{row['kind']}'{suggest(str(row['kind']), KINDS)}", path=path,
                                        line=reader.line_num, column="kind")
                found.append(StyledImage(path.parent / row["path"], row["kind"], row.get("subject") or ""))
    except OSError as error:
        raise DataFileError(f"cannot be read: {error.strerror or error}", path=path) from error
    except UnicodeDecodeError as error:
        raise DataFileError("is not a UTF-8 text file", path=path) from error
    if not found:
        raise DataFileError("lists no pictures", path=path)
    return found


def from_folders(folders: Mapping[str, str | Path]) -> list[StyledImage]:
    """All pictures in one folder a kind; the subject is the name of the file without extension.

    Raises
    ------
    DataFileError
        No such folder, or no picture in it.
    """
    found = []
    for kind, folder in folders.items():
        if kind not in KINDS:
            raise ParameterError(f"unknown kind '{kind}'{suggest(kind, KINDS)}")
        entries = sorted(Path(folder).iterdir()) if Path(folder).is_dir() else []
        inside = [p for p in entries if p.suffix.lower() in images.KNOWN_EXTENSIONS]
        if not inside:
            raise DataFileError(f"is not a folder with pictures ({kind})", path=folder)
        found += [StyledImage(p, kind, p.stem) for p in inside]
    return found


def from_benchmark(folder: str | Path, split: str = "train") -> list[StyledImage]:
    """Pictures of one split of a folder of ``mfar benchmark-data``; views of a garment are not registered, so there is no subject.

    Raises
    ------
    DataFileError
        No ``benchmark.json``, or nothing of that split in it.
    """
    from reconstruction.benchmark.index import load_index

    found = [StyledImage(sample.path, sample.style) for sample in load_index(folder).samples if sample.split == split]
    if not found:
        raise DataFileError(f"has no pictures of the split '{split}'", path=folder)
    return found


def load_pool(listed: Iterable[StyledImage], patch: int = 128) -> Pool:
    """Read pictures (see :func:`reconstruction.images.load` for what is refused)."""
    listed = list(listed)
    for entry in listed:
        if entry.kind not in KINDS:
            raise DataFileError(f"unknown kind '{entry.kind}'{suggest(entry.kind, KINDS)}", path=entry.path)
    pictures = tuple(images.load(entry.path).rgb for entry in listed)
    return Pool(pictures, tuple(KINDS.index(e.kind) for e in listed), tuple(e.subject for e in listed), patch,
                tuple(str(e.path) for e in listed))


def drawn_pool(seed: int, scenes: int, size: int = 256, patch: int = 128) -> Pool:
    """Drawn scenes in all kinds, registered; subject ``seed-number``."""
    pictures, kinds, subjects = [], [], []
    for number in range(scenes):
        scene = draw_scene(np.random.default_rng([seed, number]))
        for k, kind in enumerate(KINDS):
            pictures.append(view(scene, kind, np.random.default_rng([seed, number, k]), size))
            kinds.append(k)
            subjects.append(f"{seed}-{number}")
    return Pool(tuple(pictures), tuple(kinds), tuple(subjects), patch)
