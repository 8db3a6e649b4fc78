"""Reading photographs: every picture that cannot be used is refused by name, everything done to it on the way is noted.

Pixels are 8-bit RGB as stored (sRGB unless a note says otherwise), upright (the EXIF orientation is applied), with the origin at
the centre of the top-left pixel, x to the right and y downwards.
"""

from __future__ import annotations

import hashlib
import warnings
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np

from mfar_fem.errors import DataFileError

SMALLEST = 32
"""Fewest pixels a side."""
MOST_PIXELS = 100_000_000
"""Most pixels that a header may claim (10 000 x 10 000); refused before anything is decoded."""
EXTENSIONS = {
    "JPEG": (".jpg", ".jpeg", ".jpe"),
    "MPO": (".jpg", ".jpeg", ".jpe", ".mpo"),  # JPEGs of some cameras, with a preview behind the picture
    "PNG": (".png",),
    "TIFF": (".tif", ".tiff"),
    "BMP": (".bmp",),
    "WEBP": (".webp",),
    "PPM": (".ppm", ".pgm", ".pnm"),
}
"""Formats that are read, and the extensions that each may have."""
KNOWN_EXTENSIONS = frozenset(extension for extensions in EXTENSIONS.values() for extension in extensions)
_EXIF_ORIENTATION = 0x0112
_TIFF_BITS_PER_SAMPLE = 258


class ImageError(DataFileError):
    """A picture cannot be used; the message names the file, what is wrong and what would be right."""


class UnreadableImageError(ImageError):
    """No such file, no permission, or not a picture of a known format."""


class EmptyFileError(ImageError):
    """The file has no bytes."""


class TruncatedImageError(ImageError):
    """The file ends before the picture does, or its compressed data are broken."""


class WrongExtensionError(ImageError):
    """The contents are a picture of another format than the name says."""


class TooSmallImageError(ImageError):
    """Fewer than :data:`SMALLEST` pixels a side."""


class TooLargeImageError(ImageError):
    """The header claims more than :data:`MOST_PIXELS` pixels."""


class ConstantImageError(ImageError):
    """All pixels are equal (for example all black): there is nothing to see."""


class NotFiniteImageError(ImageError):
    """A floating-point picture holds NaN or infinity."""


@dataclass(frozen=True, eq=False)
class LoadedImage:
    """A picture that passed all checks.

    Attributes
    ----------
    rgb : (h, w, 3) uint8 array
        Upright, without transparency; not writable.
    path : pathlib.Path
        Where it came from.
    notes : tuple of str
        What was done to it (turned, composited, scaled to 8 bits, ...); empty if nothing.
    original_size : (int, int)
        Width and height in the file, before it was turned, px.
    digest : str
        SHA-256 of the file's bytes (hexadecimal).
    """

    rgb: np.ndarray
    path: Path
    notes: tuple[str, ...]
    original_size: tuple[int, int]
    digest: str

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, px."""
        return self.rgb.shape[1], self.rgb.shape[0]

    @property
    def grey(self) -> np.ndarray:
        """Luma of ITU-R BT.601, (h, w) uint8, as feature detectors take it."""
        return grey(self.rgb)


def grey(rgb: np.ndarray) -> np.ndarray:
    """Luma of ITU-R BT.601 (h, w) uint8 of an image (h, w, 3)."""
    return np.rint(rgb @ np.array([0.299, 0.587, 0.114])).astype(np.uint8)


def load(path) -> LoadedImage:
    """Read and check a picture.

    Parameters
    ----------
    path : str or path-like
        JPEG, PNG, TIFF, BMP, WebP or PPM.

    Returns
    -------
    LoadedImage

    Raises
    ------
    ImageError
        One of its subclasses, by what is wrong.
    """
    path = Path(path)
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise UnreadableImageError("there is no such file", path=path) from None
    except OSError as error:
        raise UnreadableImageError(f"cannot be read: {error.strerror or error}", path=path) from error
    return decode(data, path)


def decode(data: bytes, path) -> LoadedImage:
    """Check and decode the bytes of a picture; `path` is its name, for the extension and for messages (see :func:`load`)."""
    path = Path(path)
    if not data:
        raise EmptyFileError("has no bytes (an interrupted copy?); copy it again", path=path)
    picture = _open(data, path)
    _check_header(picture, path)
    notes: list[str] = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Pillow warns of odd metadata; the pixels are checked below
        try:
            picture.load()
        except Exception as error:  # decoders raise OSError, SyntaxError, struct.error, zlib.error, ValueError, ...
            raise TruncatedImageError(
                f"ends too early or is damaged ({_reason(error)}); copy or export it again", path=path
            ) from error
        size = picture.size
        rgb = _to_rgb(picture, data, path, notes)
    if not np.ptp(rgb.reshape(-1, 3), axis=0).any():
        colour = "black" if not rgb.any() else "white" if rgb.min() == 255 else f"RGB {tuple(int(v) for v in rgb[0, 0])}"
        raise ConstantImageError(f"is one colour all over ({colour}): there is nothing to match or measure in it", path=path)
    rgb.setflags(write=False)
    return LoadedImage(rgb, path, tuple(notes), size, hashlib.sha256(data).hexdigest())


def _open(data: bytes, path: Path):
    """The Pillow image whose header could be read; nothing is decoded yet."""
    from PIL import Image, UnidentifiedImageError

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return Image.open(BytesIO(data), formats=[name for name in EXTENSIONS if name != "MPO"])
        except Image.DecompressionBombError as error:
            raise TooLargeImageError(
                f"its header claims more than {MOST_PIXELS:,} pixels ({error}); scale it down, or cut out the figure", path=path
            ) from error
        except UnidentifiedImageError:
            raise UnreadableImageError(
                f"is not a picture that can be read; use {', '.join(sorted(set(EXTENSIONS) - {'MPO'}))}", path=path
            ) from None
        except Exception as error:  # see decode
            raise UnreadableImageError(f"its header is damaged ({_reason(error)}); export it again", path=path) from error


def _check_header(picture, path: Path) -> None:
    width, height = picture.size
    if width * height > MOST_PIXELS:
        raise TooLargeImageError(
            f"its header claims {width} x {height} pixels; at most {MOST_PIXELS:,} are taken: scale it down, or cut out the figure",
            path=path,
        )
    if min(width, height) < SMALLEST:
        raise TooSmallImageError(f"has {width} x {height} pixels; at least {SMALLEST} a side are needed", path=path)
    right = EXTENSIONS[picture.format]
    if path.suffix.lower() not in right:
        shown = f"its extension is '{path.suffix}'" if path.suffix else "it has no extension"
        raise WrongExtensionError(f"is a {picture.format} by its contents, but {shown}; rename it to '{right[0]}'", path=path)


def _to_rgb(picture, data: bytes, path: Path, notes: list[str]) -> np.ndarray:
    """Upright 8-bit RGB; what is done goes into `notes`."""
    orientation = _orientation(picture)
    if (frames := getattr(picture, "n_frames", 1)) > 1 and picture.format != "MPO":
        notes.append(f"first of {frames} pages")
    if picture.info.get("icc_profile") and b"sRGB" not in picture.info["icc_profile"]:
        notes.append("embedded colour profile not applied")
    picture = _eight_bit(picture, data, path, notes)
    try:
        if orientation != 1:
            picture = _turn(picture, orientation)
            notes.append(f"turned by its EXIF orientation {orientation}")
        if "A" in picture.getbands() or "transparency" in picture.info:
            picture = _on_white(picture, notes)
        elif picture.mode == "CMYK":
            notes.append("CMYK converted to RGB without a colour profile")
        elif picture.mode in ("L", "1"):
            notes.append("greyscale" if picture.mode == "L" else "black and white")
        return np.array(picture.convert("RGB"), dtype=np.uint8)
    except (OSError, ValueError, SyntaxError) as error:
        raise TruncatedImageError(f"cannot be converted to RGB ({_reason(error)}); export it again", path=path) from error


def _eight_bit(picture, data: bytes, path: Path, notes: list[str]):
    """Modes of more than 8 bits a channel scaled to 8."""
    from PIL import Image

    deep = picture.format == "PNG" and data[24:25] == b"\x10"
    deep |= picture.format == "TIFF" and max(picture.tag_v2.get(_TIFF_BITS_PER_SAMPLE, (8,))) > 8
    if deep and not picture.mode.startswith(("I", "F")):
        notes.append("16 bits a channel scaled to 8")  # Pillow keeps the upper byte
    if not picture.mode.startswith(("I", "F")):
        return picture
    values = np.asarray(picture, dtype=np.float64)
    if not np.isfinite(values).all():
        raise NotFiniteImageError("holds values that are NaN or infinite; export it as an 8-bit or 16-bit picture", path=path)
    if picture.mode.startswith("F"):
        low, high, name = float(values.min()), float(values.max()), "floating point"
    else:
        low, high, name = 0.0, 65535.0 if values.max() <= 65535 else float(values.max()), "16 bits a channel"
    notes.append(f"{name}, greyscale, {low:g} to {high:g} scaled to 8 bits")
    scaled = np.clip((values - low) / max(high - low, np.finfo(float).tiny) * 255.0, 0, 255)
    return Image.fromarray(np.rint(scaled).astype(np.uint8))


def _orientation(picture) -> int:
    """EXIF orientation 1 to 8; 1 if there is none or the tag cannot be read."""
    try:
        value = picture.getexif().get(_EXIF_ORIENTATION, 1)
    except Exception:  # damaged metadata beside sound pixels
        return 1
    return value if value in range(1, 9) else 1


def _turn(picture, orientation: int):
    """What the EXIF orientation asks for (ImageOps.exif_transpose needs the tag, which conversions lose)."""
    from PIL.Image import Transpose

    flip, half, mirror = Transpose.FLIP_LEFT_RIGHT, Transpose.ROTATE_180, Transpose.FLIP_TOP_BOTTOM
    steps = {2: flip, 3: half, 4: mirror, 5: Transpose.TRANSPOSE, 6: Transpose.ROTATE_270, 7: Transpose.TRANSVERSE}
    return picture.transpose(steps.get(orientation, Transpose.ROTATE_90))


def _on_white(picture, notes: list[str]):
    """A picture with transparency on a white ground."""
    from PIL import Image

    layer = picture.convert("RGBA")
    if layer.getchannel("A").getextrema()[0] == 255:
        notes.append("opaque alpha channel dropped")
        return layer.convert("RGB")
    notes.append("transparency composited on white")
    return Image.alpha_composite(Image.new("RGBA", layer.size, (255, 255, 255, 255)), layer)


def _reason(error: BaseException) -> str:
    return str(error) or type(error).__name__
