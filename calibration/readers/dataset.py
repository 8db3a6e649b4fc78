"""Datasets: a folder, a TOML file that lists experiments (or is one), or a U3M/FAB JSON file.

A dataset file::

    name = "my fabric"
    citation = "..."
    default_variant = "preconditioned"          # only with variants
    experiments = ["warp.toml", { file = "weft.toml", weight = 2.0 }]

    [fabric]                                     # optional; every quantity with its unit
    thickness = "0.1 mm"
    areal_density = "60 g/m^2"
    bending = { warp = "2 uN*m", weft = "1 uN*m" }
    sources = { thickness = "ASTM D1777, own measurement" }

    [variants]                                   # optional: name = what it is
    preconditioned = "loading branch of cycle 4"

    [defaults]                                   # merged into every [[experiment]]
    [[experiment]]                               # descriptors written inline
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from calibration.experiments import Dataset, Experiment
from calibration.readers.descriptor import Descriptor, experiment_from, load_toml
from calibration.readers.u3m import read_u3m
from mfar_fem.errors import DataFileError, UnknownNameError

KEYS = {
    "name", "title", "citation", "description", "default_variant", "experiments", "experiment", "fabric",
    "variants", "defaults",
}  # fmt: skip
FABRIC_KEYS = {"thickness": "m", "areal_density": "kg/m^2"}


def read_experiment(path: str | Path) -> Experiment:
    """Read one experiment from its TOML descriptor."""
    values, text = load_toml(path)
    return experiment_from(values, Path(path), text)


def read_dataset(path: str | Path, variant: str | None = None) -> Dataset:
    """Read a dataset.

    Parameters
    ----------
    path : path-like
        Folder (its ``dataset.toml``, else every ``*.toml`` in it is one experiment), TOML file or U3M/FAB JSON file.
    variant : str, optional
        One of the dataset's variants; by default the one the dataset names.
    """
    path = Path(path)
    if path.is_dir():
        return _folder(path, variant)
    if not path.exists():
        raise DataFileError("there is no such file or folder", path)
    if path.suffix.lower() == ".json":
        return read_u3m(path, variant or "preconditioned")
    if path.suffix.lower() != ".toml":
        raise DataFileError(
            "a dataset is a folder, a .toml file or a U3M .json file; a bare table needs a TOML descriptor beside it "
            "that states gauge, width, direction, columns and units",
            path,
        )
    values, text = load_toml(path)
    if "experiment" in values or "experiments" in values:
        return _dataset(values, text, path, variant)
    return _plain((experiment_from(values, path, text),), path, variant)


def _folder(path: Path, variant: str | None) -> Dataset:
    if (path / "dataset.toml").exists():
        return read_dataset(path / "dataset.toml", variant)
    files = sorted(path.glob("*.toml"))
    if not files:
        found = ", ".join(sorted(p.name for p in path.iterdir())[:6]) or "nothing"
        raise DataFileError(f"no *.toml descriptor in this folder (found: {found})", path)
    return _plain(tuple(read_experiment(f) for f in files), path, variant)


def _plain(experiments: tuple[Experiment, ...], path: Path, variant: str | None) -> Dataset:
    if variant is not None:
        raise UnknownNameError(f"the dataset {path} has no variants; leave out '{variant}'")
    return Dataset(name=path.stem, experiments=experiments)


def _dataset(values: dict, text: str, path: Path, variant: str | None) -> Dataset:
    d = Descriptor(values, path, text)
    for key in values:
        if key not in KEYS:
            raise d.fail(f"unknown key; known: {', '.join(sorted(KEYS))}", key)
    variants = values.get("variants", {})
    chosen = variant if variant is not None else values.get("default_variant", "")
    if chosen and chosen not in variants:
        known = f"known: {', '.join(variants)}" if variants else "this dataset has none"
        raise UnknownNameError(f"{path}: unknown variant '{chosen}'; {known}")
    experiments = []
    for entry in values.get("experiments", []):
        entry = {"file": entry} if isinstance(entry, str) else dict(entry)
        if "file" not in entry:
            raise d.fail("every entry is a file name or a table with 'file'", "experiments")
        e = read_experiment(path.parent / entry.pop("file"))
        unknown = set(entry) - {"weight", "role", "name"}
        if unknown:
            raise d.fail(
                f"only weight, role and name may be changed here, not {', '.join(sorted(unknown))}", "experiments"
            )
        experiments.append(replace(e, **entry))
    for inline in values.get("experiment", []):
        merged = _merge(values.get("defaults", {}), inline)
        if variants and chosen not in merged.get("variants", list(variants)):
            continue
        experiments.append(experiment_from(merged, path, text))
    if not experiments:
        raise DataFileError(f"no experiment{f' of variant {chosen}' if chosen else ''}", path)
    fabric = values.get("fabric", {})
    unknown = set(fabric) - {*FABRIC_KEYS, "bending", "sources"}
    if unknown:
        raise d.fail(f"unknown key in [fabric]: {', '.join(sorted(unknown))}", sorted(unknown)[0])
    for key in FABRIC_KEYS:
        if key in fabric and not d.quantity(fabric[key], FABRIC_KEYS[key], key) > 0:
            raise d.fail(f"{fabric[key]}: it must be positive", key)
    return Dataset(
        name=str(values.get("name", path.stem)),
        title=str(values.get("title", "")),
        citation=str(values.get("citation", "")),
        description=str(variants.get(chosen, values.get("description", ""))),
        variant=chosen,
        variants=tuple(variants),
        experiments=tuple(experiments),
        bending={k: d.quantity(v, "N*m", k) for k, v in fabric.get("bending", {}).items()},
        sources={k: str(v) for k, v in fabric.get("sources", {}).items()},
        **{k: d.quantity(fabric[k], u, k) for k, u in FABRIC_KEYS.items() if k in fabric},
    )


def _merge(base: dict, extra: dict) -> dict:
    out = dict(base)
    for key, value in extra.items():
        out[key] = _merge(out[key], value) if isinstance(value, dict) and isinstance(out.get(key), dict) else value
    return out
