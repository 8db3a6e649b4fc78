"""Finished work on disk, so that a run that was killed goes on where it was: whole files only, found by what they depend on."""

from __future__ import annotations

import hashlib
import io
import json
import logging
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.cli.console import jsonable
from mfar_fem.files import replace_bytes
from reconstruction.matching.features import Features
from reconstruction.matching.pair import PairResult

VERSION = 2
"""Raised whenever the same input gives another result: what older versions left is then computed again."""
_ARRAYS = ("fundamental", "homography", "points", "mask")
log = logging.getLogger(__name__)


def key(*parts: Any) -> str:
    """A name for everything that a result depends on (plain types): 32 hexadecimal digits."""
    text = json.dumps(jsonable([VERSION, *parts]), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def save_features(path: Path, features: Features) -> None:
    """Store points and descriptors."""
    _save(path, {"points": features.points, "descriptors": features.descriptors, "size": np.array(features.size)})


def load_features(path: Path) -> Features | None:
    """Stored points and descriptors; None if there are none or the file is damaged."""
    return _load(path, lambda d: Features(d["points"], d["descriptors"], (int(d["size"][0]), int(d["size"][1]))))


def save_pair(path: Path, result: PairResult) -> None:
    """Store the result of a pair."""
    arrays = {name: value for name in _ARRAYS if (value := getattr(result, name)) is not None}
    plain = {name: value for name, value in vars(result).items() if name not in _ARRAYS}
    _save(path, arrays | {"plain": np.array(json.dumps(plain))})


def load_pair(path: Path) -> PairResult | None:
    """Stored result of a pair; None if there is none or the file is damaged."""

    def build(data: Mapping[str, np.ndarray]) -> PairResult:
        plain = json.loads(str(data["plain"]))
        plain["features"] = tuple(plain["features"])
        plain |= {name: data[name] for name in _ARRAYS if name in data}
        return PairResult(**plain)

    return _load(path, build)


def _save(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type]
    replace_bytes(path, buffer.getvalue())


def _load(path: Path, build: Callable[[Mapping[str, np.ndarray]], Any]) -> Any:
    try:
        with np.load(path, allow_pickle=False) as data:
            return build({name: data[name] for name in data.files})
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        log.warning("%s is damaged (%s) and is computed again", path, error)
        return None
