"""Pictures as they go into the page: known by their content, not by their name, made smaller where they are large."""

from __future__ import annotations

import base64
import io
from pathlib import Path

from mfar_fem.errors import DataFileError, InputError

LONGEST = 1600
"""Pixels of the longer side in the page; larger PNG and JPEG pictures are reduced to it."""
_PNG, _JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff"


def kind(data: bytes) -> str:
    """Media type by the first bytes.

    Raises
    ------
    InputError
        It is no PNG, JPEG or SVG.
    """
    if data.startswith(_PNG):
        return "image/png"
    if data.startswith(_JPEG):
        return "image/jpeg"
    if b"<svg" in data[:2000]:
        return "image/svg+xml"
    raise InputError(f"begins with {data[:8]!r}, which is no PNG, JPEG or SVG picture")


def data_uri(picture: bytes | Path, longest: int = LONGEST) -> str:
    """A picture as a data URI.

    Parameters
    ----------
    picture : bytes or Path
    longest : int
        See :data:`LONGEST`.

    Raises
    ------
    DataFileError, InputError
        It cannot be read, or is no picture of a known kind.
    """
    if isinstance(picture, bytes):
        return _encode(picture, longest)
    try:
        return _encode(Path(picture).read_bytes(), longest)
    except OSError as error:
        raise DataFileError(f"cannot be read: {error.strerror or error}", path=Path(picture)) from error
    except InputError as error:
        raise DataFileError(str(error), path=Path(picture)) from error


def _encode(data: bytes, longest: int) -> str:
    media = kind(data)
    if media != "image/svg+xml":
        data = _reduced(data, media, longest)
    return f"data:{media};base64,{base64.b64encode(data).decode('ascii')}"


def _reduced(data: bytes, media: str, longest: int) -> bytes:
    from PIL import Image

    try:
        with Image.open(io.BytesIO(data)) as image:
            if max(image.size) <= longest:
                image.verify()
                return data
            small = image.convert("RGBA" if "A" in image.getbands() or "transparency" in image.info else "RGB")
            small.thumbnail((longest, longest), Image.Resampling.LANCZOS)
            out = io.BytesIO()
            small.save(out, format="PNG") if media == "image/png" else small.save(out, format="JPEG", quality=88)
            return out.getvalue()
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise InputError(f"cannot be decoded as {media}: {error}") from error
