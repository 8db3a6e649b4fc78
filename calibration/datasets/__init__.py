"""Small datasets that come with the package: figures only, each row with its citation."""

from __future__ import annotations

from pathlib import Path

from calibration.experiments import Dataset
from calibration.readers import read_dataset
from mfar_fem.errors import UnknownNameError

_HERE = Path(__file__).parent


def names() -> list[str]:
    """Names of the datasets, for `load`."""
    return sorted(p.parent.name.replace("_", "-") for p in _HERE.glob("*/dataset.toml"))


def path_of(name: str) -> Path:
    """Path of a dataset's TOML file; underscores and hyphens are alike (``cupro-su1098``)."""
    known = names()
    key = name.replace("_", "-")
    if key not in known:
        raise UnknownNameError(
            f"unknown dataset '{name}'; known: {', '.join(known)}, or give a folder, .toml or .json path"
        )
    return _HERE / key.replace("-", "_") / "dataset.toml"


def load(name: str, variant: str | None = None) -> Dataset:
    """Load a dataset by name.

    Parameters
    ----------
    name : str
        See `names`.
    variant : str, optional
        A state of the fabric, e.g. 'preconditioned' (default), 'virgin', 'envelope' for ``cupro-su1098``.
    """
    return read_dataset(path_of(name), variant)


def resolve(name_or_path: str | Path, variant: str | None = None) -> Dataset:
    """A dataset by name, or read from a path if one exists under that name."""
    text = str(name_or_path)
    if Path(text).exists() or Path(text).suffix.lower() in (".toml", ".json", ".csv") or "/" in text:
        return read_dataset(text, variant)
    return load(text, variant)
