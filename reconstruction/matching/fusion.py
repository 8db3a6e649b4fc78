"""The run behind ``mfar fuse``: a folder of sources to corrected pictures, a match graph, tables and pictures.

Everything is computed on corrected pictures of at most ``longest`` pixels a side; coordinates of points, fundamental matrices and
distances are pixels of those ("matching pixels"; ``reduction`` in ``fusion.json`` is their number to one of the picture).
Features, pairs and corrected pictures are kept in ``OUT/cache`` by the contents of the pictures and the settings: a run that is
killed loses at most the pair it was at.
"""

from __future__ import annotations

import hashlib
import io
import itertools
import json
from collections import OrderedDict
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from mfar_fem import threads
from mfar_fem.cli.console import check_writable, jsonable
from mfar_fem.errors import InputError
from mfar_fem.files import replace_bytes
from reconstruction import images, sources
from reconstruction.illumination import HighEmphasis, correct
from reconstruction.libraries import networkx, opencv
from reconstruction.matching import cache, cameras, pictures
from reconstruction.matching.features import Features, detect
from reconstruction.matching.graph import MatchGraph
from reconstruction.matching.pair import PairResult, match_pair
from reconstruction.matching.settings import MatchSettings

LONGEST = 2000
"""Longest side of the pictures that are matched, px: SIFT on more takes gigabytes."""
_THUMBNAIL = 700
_IN_MEMORY = 24

Report = Callable[[str], None]
"""Told what has just been done, once a step; there are :func:`steps` of them."""


@dataclass(frozen=True, eq=False)
class Picture:
    """A source ready to be matched.

    Attributes
    ----------
    source : Source
        What is known of it.
    digest : str
        SHA-256 of the file.
    size : (int, int)
        Width and height, px.
    reduction : float
        Matching pixels to one of the picture, at most 1.
    corrected : pathlib.Path
        The picture with its light evened out, at full size.
    notes : tuple of str
        What was done on reading.
    light : mapping
        ``clipped``, ``nonuniformity_before`` and ``nonuniformity_after``.
    """

    source: sources.Source
    digest: str
    size: tuple[int, int]
    reduction: float
    corrected: Path
    notes: tuple[str, ...]
    light: Mapping[str, float]

    @property
    def camera(self) -> np.ndarray | None:
        """Projection to matching pixels, (3, 4)."""
        return None if self.source.camera is None else cameras.scaled(self.source.camera, self.reduction)


@dataclass(frozen=True, eq=False)
class Fusion:
    """What a run found, as later stages get it."""

    folder: Path
    sources: sources.SourceSet
    pictures: tuple[Picture, ...]
    graph: MatchGraph
    settings: MatchSettings
    light: HighEmphasis
    stages: Mapping[str, Any] = field(default_factory=dict)


Stage = Callable[[Fusion], Mapping[str, Any]]
"""A later stage, for example measurements and votes: takes the fusion with the results of the stages before it, returns plain types
that ``fusion.json`` keeps under ``stages`` by its name."""


def steps(count: int) -> int:
    """Number of reports of a run with so many sources."""
    return 2 * count + count * (count - 1)  # a picture is read and corrected, a pair matched and drawn


def fuse(folder, out, settings: MatchSettings | None = None, light: HighEmphasis | None = None, longest: int = LONGEST,
         stages: Mapping[str, Stage] | None = None, progress: Report | None = None) -> Fusion:
    """Read, correct and match all pictures of a folder and write everything that was found.

    Parameters
    ----------
    folder : str or path-like
        With its ``sources.toml``.
    out : str or path-like
        Output folder, not within `folder`.
    settings : MatchSettings, optional
    light : HighEmphasis, optional
    longest : int
        Longest side of the pictures that are matched, px.
    stages : mapping of str to Stage, optional
        What to do after the matching, in this order.
    progress : callable, optional
        See :data:`Report`.

    Returns
    -------
    Fusion
        Also written as ``fusion.json`` and its companions.

    Raises
    ------
    InputError
        A source, picture or setting is wrong, or the output folder cannot be used.
    MissingDependencyError
        OpenCV, networkx (or, for ALIKED, torch and kornia) is not installed.
    """
    settings, light = settings or MatchSettings(), light or HighEmphasis()
    report = progress or (lambda label: None)
    if longest < images.SMALLEST:
        raise InputError(f"pictures are matched at {images.SMALLEST} pixels or more, not {longest}")
    opencv(), networkx()
    found = sources.read(folder)
    if Path(out).resolve().is_relative_to(found.folder.resolve()):
        raise InputError(f"the output folder '{out}' lies in the folder of the sources, where its pictures would count as sources; "
                         "choose another with --out")  # fmt: skip
    out = check_writable(out)
    found.load_each(lambda source, image, mask: report(f"read {source.name}"))
    ready = []
    for number, source in enumerate(found.sources):
        ready.append(_prepare(number, source, out, light, longest))
        report(f"corrected {source.name}")
    store = FeatureStore(ready, out / "cache", settings, light)
    results, keys = [], []
    pairs = list(itertools.combinations(range(len(ready)), 2))

    def match(pair: tuple[int, int]) -> tuple[str, PairResult]:
        a, b = (ready[i] for i in pair)
        key = _pair_key(a, b, pair, store)
        return key, _pair(a, b, pair, store, out / "cache" / f"pair_{key}.npz")

    # OpenCV leaves Python's lock while it works, and every thread has a random generator of its own, seeded for each search: the
    # results are those of one thread
    with ThreadPoolExecutor(threads.count()) as pool:
        for (a, b), (key, result) in zip(pairs, pool.map(match, pairs), strict=True):
            keys.append(key)
            results.append(result)
            report(f"matched {ready[a].source.name} - {ready[b].source.name}")
    graph = MatchGraph({p.source.name: p.source.kind for p in ready}, tuple(results))
    fusion = Fusion(out, found, tuple(ready), graph, settings, light)
    files = graph.write(out) + _draw(fusion, keys, report)
    _write(fusion, files)  # what a later stage refuses must not take the matches with it
    for name, stage in (stages or {}).items():
        fusion = Fusion(out, found, tuple(ready), graph, settings, light, {**fusion.stages, name: stage(fusion)})
    _write(fusion, files)
    return fusion


class FeatureStore:
    """Features of the pictures of a run, in memory for the last few, on disk for all."""

    def __init__(self, ready: list[Picture], folder: Path, settings: MatchSettings, light: HighEmphasis):
        self.ready, self.folder, self.settings = ready, folder, settings
        weights = _digest(settings.weights) if settings.weights is not None else None
        detection = {k: v for k, v in settings.to_dict().items() if k in _DETECTION} | {"weights": weights}
        shared = [opencv().__version__, detection, asdict(light)]
        self.keys = [cache.key("features", shared, p.digest, p.reduction) for p in ready]
        self._kept: OrderedDict[int, Features] = OrderedDict()
        self._lock = Lock()

    def __call__(self, number: int) -> Features:
        """Features of a picture by its number; one thread at a time."""
        with self._lock:
            return self._get(number)

    def _get(self, number: int) -> Features:
        if number in self._kept:
            self._kept.move_to_end(number)
            return self._kept[number]
        path = self.folder / f"features_{self.keys[number]}.npz"
        features = cache.load_features(path)
        if features is None:
            rgb = matching_pixels(images.load(self.ready[number].corrected), self.ready[number].reduction)
            features = detect(images.grey(rgb), self.settings, rgb)
            cache.save_features(path, features)
        self._kept[number] = features
        if len(self._kept) > _IN_MEMORY:
            self._kept.popitem(last=False)
        return features


_DETECTION = ("detector", "octaves", "contrast", "edge", "root_sift", "most_features")


def _digest(path: str) -> str:
    """SHA-256 of the file of weights."""
    try:
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()
    except OSError as error:
        raise InputError(f"the weights '{path}' cannot be read: {error.strerror or error}") from error


def matching_pixels(image: images.LoadedImage, reduction: float) -> np.ndarray:
    """A picture reduced by averaging over areas, (h, w, 3) uint8."""
    if reduction >= 1:
        return image.rgb
    width, height = (max(1, round(side * reduction)) for side in image.size)
    return opencv().resize(image.rgb, (width, height), interpolation=opencv().INTER_AREA)


def _prepare(number: int, source: sources.Source, out: Path, light: HighEmphasis, longest: int) -> Picture:
    """The corrected picture of a source, from disk if it is there and whole."""
    from PIL import Image

    image = images.load(source.path)
    path = out / "corrected" / f"{number:03d}_{Path(source.name).stem}.png"
    facts_path = out / "cache" / f"light_{cache.key('light', image.digest, asdict(light))}.json"
    try:
        facts = json.loads(facts_path.read_text(encoding="utf-8"))
        whole = images.load(path).digest == facts["png"]
    except (OSError, ValueError, KeyError, TypeError, images.ImageError):
        whole = False
    if not whole:
        result = correct(image.rgb, light)
        buffer = io.BytesIO()
        Image.fromarray(result.rgb).save(buffer, "PNG", compress_level=4)
        replace_bytes(path, buffer.getvalue())
        facts = {"clipped": result.clipped, "nonuniformity_before": result.before, "nonuniformity_after": result.after}
        facts["png"] = hashlib.sha256(buffer.getvalue()).hexdigest()
        replace_bytes(facts_path, json.dumps(facts).encode())
    reduction = min(1.0, longest / max(image.size))
    return Picture(source, image.digest, image.size, reduction, path, image.notes, {k: v for k, v in facts.items() if k != "png"})


def _known(a: Picture, b: Picture) -> tuple[np.ndarray, np.ndarray] | None:
    """Cameras of both pictures, if both are known."""
    return None if a.camera is None or b.camera is None else (a.camera, b.camera)


def _pair_key(a: Picture, b: Picture, numbers: tuple[int, int], store: FeatureStore) -> str:
    names = (a.source.name, b.source.name)
    return cache.key("pair", names, [store.keys[i] for i in numbers], store.settings.to_dict(), _known(a, b))


def _pair(a: Picture, b: Picture, numbers: tuple[int, int], store: FeatureStore, path: Path) -> PairResult:
    """The result of a pair, from disk if it is there."""
    result = cache.load_pair(path)
    if result is None:
        names = (a.source.name, b.source.name)
        result = match_pair(store(numbers[0]), store(numbers[1]), store.settings, names, _known(a, b))
        cache.save_pair(path, result)
    return result


def _draw(fusion: Fusion, keys: list[str], report: Report) -> list[Path]:
    """Pictures of the graph, the matrix and each pair; those of pairs that are there already stay."""
    folder = fusion.folder / "pairs"
    folder.mkdir(exist_ok=True)
    small, scales = {}, {}
    for picture in fusion.pictures:
        scales[picture.source.name] = min(1.0, _THUMBNAIL / (max(picture.size) * picture.reduction))
        reduction = picture.reduction * scales[picture.source.name]
        small[picture.source.name] = matching_pixels(images.load(picture.corrected), reduction)
    files = [pictures.graph_drawing(fusion.folder / "graph.png", fusion.graph, small),
             pictures.matrix(fusion.folder / "matrix.png", fusion.graph)]  # fmt: skip
    number = {p.source.name: i for i, p in enumerate(fusion.pictures)}
    for r, key in zip(fusion.graph.results, keys, strict=True):
        path = folder / f"{number[r.a]:03d}_{number[r.b]:03d}.png"
        if not pictures.is_drawn(path, key):
            pictures.match_lines(path, r, small[r.a], small[r.b], (scales[r.a], scales[r.b]), key)
        files.append(path)
        report(f"drew {r.a} - {r.b}")
    for old in set(folder.glob("[0-9][0-9][0-9]_[0-9][0-9][0-9].png")) - set(files):  # of another set of sources
        old.unlink()
    return files


def _write(fusion: Fusion, files: list[Path]) -> None:
    """``fusion.json``."""
    listed = [
        p.source.facts() | {"file": str(p.source.path), "sha256": p.digest, "size_px": p.size, "reduction": p.reduction,
                            "notes": p.notes, "corrected": p.corrected.relative_to(fusion.folder).as_posix(), **p.light}
        for p in fusion.pictures
    ]  # fmt: skip
    payload = {
        "format": "mfar fusion 1", "sources": listed, "illumination": asdict(fusion.light), "matching": fusion.settings.to_dict(),
        **{key: value for key, value in fusion.graph.to_dict().items() if key != "pictures"},
        "stages": fusion.stages, "files": [path.relative_to(fusion.folder).as_posix() for path in files],
    }  # fmt: skip
    replace_bytes(fusion.folder / "fusion.json", json.dumps(jsonable(payload), indent=1).encode())
