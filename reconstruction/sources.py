"""A set of historical sources: a folder of pictures and a ``sources.toml`` that says what is known of each.

One ``[[image]]`` table a picture (``mfar fuse FOLDER --template`` writes them, to be filled in)::

    [[image]]
    file = "mural_3.jpg"
    kind = "mural"                  # mural, figurine or textile
    licence = "CC BY 4.0"           # required: may the picture be used, and who is named
    figure = "female"               # male (1.75 m), female (1.65 m) or none
    height = "168 cm"               # only if the figure's height is known better than by its sex
    box = [310, 80, 930, 1400]      # the figure, head to feet, if the picture shows much besides: left, top, right, bottom, px
    mask = "mural_3_mask.png"       # the garment in white (of a tunic its outer face), a picture of the same size
    scale = [{ from = [120, 40], to = [120, 940], length = "30 cm" }]    # marks in the picture, px
    dpi = 600                       # instead of scale: flat scans only
    head = [402, 88]                # instead of scale: crown and sole of a figure that stands upright, px
    foot = [410, 1205]
    camera = "mural_3_P.txt"        # 3x4 projection matrix P, text: pixel (x right, y down) ~ P (X, 1), X in metres
    camera_scale = 0.5              # pixels of this picture to one of the camera's (halved pictures: 0.5)
    date = "8th c."
    place = "Dunhuang, Mogao 130"
    known = "donor figure, repainted below the knee"

``ignore = ["notes.png"]`` at the top names pictures of the folder that are no sources. Every other picture in the folder and its
subfolders must be listed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mfar_fem.errors import DataFileError
from mfar_fem.tomlfile import TomlFile, suggest
from reconstruction.images import KNOWN_EXTENSIONS, ImageError, LoadedImage, load
from reconstruction.landmarks import KINDS, STATURE

NAME = "sources.toml"
FIGURES = (*STATURE, "none")
SCALE_TOLERANCE = 0.05
"""Relative disagreement of several scale marks from which on the picture counts as foreshortened, and is refused."""
_KEYS = ("file", "kind", "licence", "figure", "height", "box", "mask", "scale", "dpi", "head", "foot", "camera", "camera_scale",
         "date", "place", "known")


class SourcesError(DataFileError):
    """``sources.toml`` or its folder is wrong; the message names file, line and key."""


@dataclass(frozen=True)
class ScaleMark:
    """Two points of a picture (px) and the true length between them, m."""

    start: tuple[float, float]
    end: tuple[float, float]
    length: float

    @property
    def metres_per_pixel(self) -> float:
        """Length over distance, m/px."""
        return self.length / math.dist(self.start, self.end)


@dataclass(frozen=True, eq=False)
class Source:
    """One picture and what is known of it.

    Attributes
    ----------
    name : str
        Its path in the folder, with forward slashes.
    path : pathlib.Path
        The file.
    kind : str
        ``mural``, ``figurine`` or ``textile``.
    licence : str
        As written.
    figure : str
        ``male``, ``female`` or ``none``.
    height : float or None
        Height of the figure, m, if it is known better than by :data:`reconstruction.landmarks.STATURE`.
    box : (float, float, float, float) or None
        Of the figure (a textile): left, top, right, bottom, px.
    scale : tuple of ScaleMark
        Marks of known length.
    metres_per_pixel : float or None
        From the marks (their geometric mean) or the resolution.
    dpi : float or None
        Resolution of a flat scan.
    head, foot : (float, float) or None
        Crown and sole, px.
    mask : pathlib.Path or None
        Picture of the garment's outer face (white).
    camera : (3, 4) array or None
        Projection matrix to pixels of this picture.
    date, place, known : str
        As written; empty if not given.
    line : int or None
        Line of its table in ``sources.toml``.
    """

    name: str
    path: Path
    kind: str
    licence: str
    figure: str = "none"
    height: float | None = None
    box: tuple[float, float, float, float] | None = None
    scale: tuple[ScaleMark, ...] = ()
    metres_per_pixel: float | None = None
    dpi: float | None = None
    head: tuple[float, float] | None = None
    foot: tuple[float, float] | None = None
    mask: Path | None = None
    camera: np.ndarray | None = None
    date: str = ""
    place: str = ""
    known: str = ""
    line: int | None = None

    @property
    def stature(self) -> float | None:
        """Height that the figure's picture is normalised to, m; None without a figure."""
        return self.height if self.height is not None else STATURE.get(self.figure)

    def scale_entry(self) -> dict | None:
        """What marks, resolution or crown and sole say, as a file of keypoints takes it; None without any."""
        if self.dpi is not None:
            return {"dpi": self.dpi}
        if self.head is not None and self.foot is not None:
            return {"head": np.array(self.head), "foot": np.array(self.foot)}
        if len(self.scale) == 1:
            (mark,) = self.scale
            return {"marks": np.array([mark.start, mark.end]), "length": mark.length}
        if self.metres_per_pixel is None:
            return None
        sizes = [mark.metres_per_pixel for mark in self.scale]
        spread = {"relative_sigma": float(np.std(np.log(sizes), ddof=1) / np.sqrt(len(sizes)))} if sizes else {}
        return {"metres_per_pixel": self.metres_per_pixel} | spread

    def facts(self) -> dict:
        """What is known, in plain types."""
        return {
            "name": self.name, "kind": self.kind, "licence": self.licence, "figure": self.figure, "height_m": self.stature,
            "mask": None if self.mask is None else self.mask.name,
            "metres_per_pixel": self.metres_per_pixel, "camera": None if self.camera is None else self.camera.tolist(),
            "date": self.date, "place": self.place, "known": self.known,
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class SourceSet:
    """All sources of a folder, in the order of ``sources.toml``."""

    folder: Path
    path: Path
    sources: tuple[Source, ...]

    def load(self, source: Source) -> LoadedImage:
        """Read a picture; what is wrong with it names the line of ``sources.toml`` too.

        Raises
        ------
        ImageError
        """
        try:
            return load(source.path)
        except ImageError as error:
            error.args = (f"{error} (listed in {self.path}, line {source.line})",)
            raise

    def mask(self, source: Source, size: tuple[int, int]) -> np.ndarray | None:
        """The mask of a source, (h, w) bool, for its picture of `size` (width, height); None if it has none.

        Raises
        ------
        SourcesError
            It cannot be read, is empty or has another size; names the line of ``sources.toml``.
        """
        if source.mask is None:
            return None
        from reconstruction.measure.silhouette import read_mask

        try:
            return read_mask(source.mask, size)
        except DataFileError as error:
            raise SourcesError(f"the mask of '{source.name}' is wrong: {error}", path=self.path, line=source.line) from error

    def _check_inside(self, source: Source, size: tuple[int, int]) -> None:
        """What is marked in a picture must lie in it."""
        width, height = size
        marked = [("scale mark", point) for mark in source.scale for point in (mark.start, mark.end)]
        marked += [(name, point) for name, point in (("head", source.head), ("foot", source.foot)) if point is not None]
        for name, (x, y) in marked:
            if not (-0.5 <= x <= width - 0.5 and -0.5 <= y <= height - 0.5):
                raise SourcesError(f"the {name} ({x:g}, {y:g}) of '{source.name}' lies outside the picture of "
                                   f"{width} x {height} px", path=self.path, line=source.line)  # fmt: skip
        if source.box is not None and not (source.box[0] < width and source.box[1] < height and min(source.box[2:]) > 0):
            raise SourcesError(f"the box {list(source.box)} of '{source.name}' lies outside the picture of {width} x {height} px",
                               path=self.path, line=source.line)  # fmt: skip

    def load_each(self, use: Callable[[Source, LoadedImage, np.ndarray | None], object] | None = None) -> None:
        """Read and check every picture, one at a time in memory.

        Parameters
        ----------
        use : callable, optional
            Called with each source that passed, its picture and its mask (see :meth:`mask`).

        Raises
        ------
        ImageError
            A picture cannot be used (see :func:`reconstruction.images.load`).
        SourcesError
            Two pictures are byte for byte the same file, or a scale mark lies outside its picture.
        """
        seen: dict[str, Source] = {}
        for source in self.sources:
            image = self.load(source)
            if (twin := seen.setdefault(image.digest, source)) is not source:
                raise SourcesError(f"'{source.name}' and '{twin.name}' are the same picture, byte for byte; list it once",
                                   path=self.path, line=source.line)  # fmt: skip
            mask = self.mask(source, image.size)
            self._check_inside(source, image.size)
            if use is not None:
                use(source, image, mask)


def read(folder) -> SourceSet:
    """Read the ``sources.toml`` of a folder and check it against what the folder holds.

    Parameters
    ----------
    folder : str or path-like
        The folder, or its ``sources.toml``.

    Raises
    ------
    DataFileError
        A key is missing, wrong or unknown; a listed picture or camera file is missing; a picture is listed twice or not at all.
    """
    folder = Path(folder)
    path = folder if folder.suffix.lower() == ".toml" else folder / NAME
    folder = path.parent
    if not folder.is_dir():
        raise SourcesError("there is no such folder; give the folder of the pictures", path=folder)
    if not path.exists():
        raise SourcesError(f"has no {NAME}; `mfar fuse {folder} --template` writes one to fill in", path=folder)
    file = TomlFile.read(path)
    file.check_keys((), ("image", "ignore"))
    tables = file.get("image", default=[], kind=list)
    if not tables:
        raise SourcesError("lists no picture; write one [[image]] table for each", path=path)
    sources = tuple(_source(file, folder, str(i)) for i in range(len(tables)))
    _check_listing(file, folder, sources)
    return SourceSet(folder, path, sources)


def write_template(folder) -> Path:
    """Write a ``sources.toml`` that lists the pictures of a folder, with what must be filled in marked by ``?``.

    Raises
    ------
    SourcesError
        The folder does not exist or holds no picture, or there is a ``sources.toml`` already.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise SourcesError("there is no such folder", path=folder)
    path = folder / NAME
    if path.exists():
        raise SourcesError("exists already; it is not overwritten", path=path)
    names = _pictures(folder)
    if not names:
        raise SourcesError(f"holds no picture ({', '.join(sorted(KNOWN_EXTENSIONS))})", path=folder)
    lines = ["# Sources of a reconstruction. Replace every '?'; what is not known may be left out, except kind and licence.",
             "# ignore = []                # pictures that are no sources"]  # fmt: skip
    for name in names:
        lines += ["", "[[image]]", f"file = {_quoted(name)}", f'kind = "?"                   # {", ".join(KINDS)}',
                  'licence = "?"                # e.g. "CC BY 4.0, name of the holder"',
                  f'figure = "none"              # {", ".join(FIGURES)}',
                  '# mask = "mask.png"           # the garment in white',
                  '# scale = [{ from = [0, 0], to = [100, 0], length = "10 cm" }]', "# dpi = 300",
                  '# camera = "camera.txt"      # 3x4 projection matrix', 'date = ""', 'place = ""', 'known = ""']  # fmt: skip
    try:
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise SourcesError(f"cannot be written: {error.strerror or error}", path=path) from error
    return path


def _quoted(text: str) -> str:
    """A TOML basic string."""
    import json

    return json.dumps(text, ensure_ascii=False)


def _pictures(folder: Path) -> list[str]:
    """Names of all picture files in a folder and its subfolders, without hidden ones."""
    found = (path.relative_to(folder) for path in folder.rglob("*") if path.suffix.lower() in KNOWN_EXTENSIONS and path.is_file())
    return sorted(path.as_posix() for path in found if not any(part.startswith(".") for part in path.parts))


def _check_listing(file: TomlFile, folder: Path, sources: tuple[Source, ...]) -> None:
    first: dict[Path, Source] = {}
    for source in sources:
        twin = first.setdefault(source.path.resolve(), source)
        if twin is not source:
            raise SourcesError(f"'{source.name}' is listed twice, first in line {twin.line}", path=file.path, line=source.line)
    ignored = file.get("ignore", default=[], kind=list)
    for name in ignored:
        if not isinstance(name, str) or not (folder / name).is_file():
            raise file.error(f"'{name}' is to be ignored, but there is no such file in {folder}", "ignore")
        if (folder / name).resolve() in first:
            raise file.error(f"'{name}' is both listed and ignored", "ignore")
    known = set(first) | {(folder / name).resolve() for name in ignored} | {s.mask.resolve() for s in sources if s.mask}
    if extra := [name for name in _pictures(folder) if (folder / name).resolve() not in known]:
        raise SourcesError(f"does not list {', '.join(repr(n) for n in extra[:5])}{' ...' if len(extra) > 5 else ''} "
                           f"({len(extra)} in the folder); add an [[image]] table for each, or name it in ignore = [...]",
                           path=file.path)  # fmt: skip


def _source(file: TomlFile, folder: Path, number: str) -> Source:
    """One ``[[image]]`` table, checked."""
    at = ("image", number)
    file.check_keys(at, _KEYS)
    name = file.get(*at, "file", kind=str)
    path = folder / name
    if not path.is_file():
        raise file.error(f"there is no file '{name}' in {folder}{_hint(name, folder)}", *at, "file")
    kind = _choice(file, (*at, "kind"), KINDS)
    figure = _choice(file, (*at, "figure"), FIGURES, default="none")
    licence = _text(file, (*at, "licence"))
    if not licence or licence == "?":
        raise file.error("must say under which licence or permission the picture is used, e.g. 'CC BY 4.0, name of the holder'",
                         *at, "licence")  # fmt: skip
    height = file.quantity(*at, "height", unit="m", default=None)
    if height is not None and figure == "none":
        raise file.error("a height needs a figure: write figure = 'male' or 'female'", *at, "height")
    if height is not None and not 0.5 < height < 2.5:
        raise file.error(f"a figure of {height:g} m is not a grown person: between 0.5 and 2.5 m", *at, "height")
    scale = _scale_marks(file, at)
    dpi, head, foot = _dpi(file, at, scale), _point(file, at, "head"), _point(file, at, "foot")
    _check_stature(file, at, figure, head, foot, scale or dpi)
    return Source(
        name=Path(name).as_posix(), path=path, kind=kind, licence=licence, figure=figure,
        height=height, box=_box(file, at), scale=scale, metres_per_pixel=_resolution(file, at, scale, dpi), dpi=dpi,
        head=head, foot=foot, mask=_mask(file, at, folder),
        camera=_camera(file, at, folder), line=file.line(*at),
        **{key: _text(file, (*at, key), default="") for key in ("date", "place", "known")},
    )  # fmt: skip


def _hint(name: str, folder: Path) -> str:
    there = _pictures(folder)
    return suggest(name, there) if there else "; it holds no pictures"


def _text(file: TomlFile, keys: tuple[str, ...], **default) -> str:
    return file.get(*keys, kind=str, **default).strip()


def _choice(file: TomlFile, keys: tuple[str, ...], known: tuple[str, ...], **default) -> str:
    value = file.get(*keys, kind=str, **default)
    if value not in known:
        raise file.error(f"'{value}' is none of {', '.join(known)}{suggest(value, known) if value != '?' else ''}", *keys)
    return value


def _scale_marks(file: TomlFile, at: tuple[str, ...]) -> tuple[ScaleMark, ...]:
    entries = file.get(*at, "scale", default=[])
    if isinstance(entries, dict):
        entries = [entries]
    usage = "must be [{ from = [x, y], to = [x, y], length = '10 cm' }, ...] with points in pixels"
    if not isinstance(entries, list):
        raise file.error(usage, *at, "scale")
    from mfar_fem import units

    marks = []
    for entry in entries:
        if not isinstance(entry, dict) or set(entry) != {"from", "to", "length"}:
            raise file.error(usage, *at, "scale")
        points = [entry["from"], entry["to"]]
        if not all(_is_point(point) for point in points):
            raise file.error(usage, *at, "scale")
        length = units.parse(entry["length"], "m", name="length of a scale mark", path=file.path, line=file.line(*at, "scale"))
        if not length > 0 or points[0] == points[1]:
            raise file.error("a scale mark needs two different points and a positive length", *at, "scale")
        marks.append(ScaleMark(tuple(map(float, points[0])), tuple(map(float, points[1])), length))  # type: ignore[arg-type]
    return tuple(marks)


def _is_point(value) -> bool:
    numbers = isinstance(value, list) and len(value) == 2
    return numbers and all(isinstance(v, int | float) and not isinstance(v, bool) and math.isfinite(v) for v in value)


def _dpi(file: TomlFile, at: tuple[str, ...], marks: tuple[ScaleMark, ...]) -> float | None:
    if file.get(*at, "dpi", default=None) is None:
        return None
    dpi = file.get(*at, "dpi", kind=(int, float))
    if marks:
        raise file.error("give either dpi or scale, not both", *at, "dpi")
    if not (dpi > 0 and math.isfinite(dpi)):
        raise file.error(f"must be a positive number of pixels per inch, not {dpi}", *at, "dpi")
    return float(dpi)


def _point(file: TomlFile, at: tuple[str, ...], key: str) -> tuple[float, float] | None:
    value = file.get(*at, key, default=None)
    if value is None:
        return None
    if not _is_point(value):
        raise file.error(f"must be a point [x, y] in pixels, not {value!r}", *at, key)
    return float(value[0]), float(value[1])


def _check_stature(file: TomlFile, at: tuple[str, ...], figure: str, head, foot, other) -> None:
    """Crown and sole belong together, to a figure, and to no other scale."""
    if (head is None) != (foot is None):
        there, missing = ("head", "foot") if foot is None else ("foot", "head")
        raise file.error(f"'{there}' needs '{missing}' too: crown and sole of the figure", *at, there)
    if head is None:
        return
    if figure == "none":
        raise file.error("head and foot need a figure: write figure = 'male' or 'female'", *at, "head")
    if other:
        raise file.error("give either head and foot, or scale, or dpi", *at, "head")
    if math.dist(head, foot) < 1:
        raise file.error("head and foot are the same point", *at, "head")


def _box(file: TomlFile, at: tuple[str, ...]) -> tuple[float, float, float, float] | None:
    value = file.get(*at, "box", default=None)
    if value is None:
        return None
    if not (isinstance(value, list) and len(value) == 4 and _is_point(value[:2]) and _is_point(value[2:])
            and value[2] - value[0] >= 1 and value[3] - value[1] >= 1):
        raise file.error(f"must be [left, top, right, bottom] in pixels, left < right and top < bottom, not {value!r}", *at, "box")
    return tuple(map(float, value))  # type: ignore[return-value]


def _resolution(file: TomlFile, at: tuple[str, ...], marks: tuple[ScaleMark, ...], dpi: float | None) -> float | None:
    """Metres per pixel."""
    if dpi is not None:
        return 0.0254 / dpi
    if not marks:
        return None
    sizes = np.array([mark.metres_per_pixel for mark in marks])
    if (spread := float(sizes.max() / sizes.min() - 1)) > SCALE_TOLERANCE:
        raise file.error(f"the marks disagree by {100 * spread:.0f} % ({sizes.min():.3g} to {sizes.max():.3g} m a pixel): the "
                         "picture is foreshortened or a mark is wrong; keep those in its plane", *at, "scale")  # fmt: skip
    return float(np.exp(np.log(sizes).mean()))


def _mask(file: TomlFile, at: tuple[str, ...], folder: Path) -> Path | None:
    """The picture of the garment's mask."""
    if file.get(*at, "mask", default=None) is None:
        return None
    name = file.get(*at, "mask", kind=str)
    if not (folder / name).is_file():
        raise file.error(f"there is no mask '{name}' in {folder}{_hint(name, folder)}", *at, "mask")
    return folder / name


def _camera(file: TomlFile, at: tuple[str, ...], folder: Path) -> np.ndarray | None:
    factor = file.get(*at, "camera_scale", default=1.0, kind=(int, float))
    if not (factor > 0 and math.isfinite(factor)):
        raise file.error(f"must be a positive number, not {factor}", *at, "camera_scale")
    name = file.get(*at, "camera", default=None)
    if name is None:
        return None
    from reconstruction.matching.cameras import read_matrix, scaled

    name = file.get(*at, "camera", kind=str)
    if not (folder / name).is_file():
        raise file.error(f"there is no camera file '{name}' in {folder}", *at, "camera")
    return scaled(read_matrix(folder / name), factor)
