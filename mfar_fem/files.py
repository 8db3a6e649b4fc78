"""Files that are whole or not there: a kill leaves the old one or the new one, never half of it."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path


def replace_file(path: Path, write: Callable[[Path], object]) -> None:
    """Write a file through ``write(partial_path)`` and put it in place in one move; folders above it are made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.part{os.getpid()}{path.suffix}")
    try:
        write(partial)
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def replace_bytes(path: Path, data: bytes) -> None:
    """Put a file with this content in place."""
    replace_file(path, lambda partial: partial.write_bytes(data))
