"""Pictures and height fields: reading, checking, and bringing two of them to one physical scale."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mfar_fem.errors import DataFileError, InputError

SMALLEST = 16
"""Fewest pixels a side: with less there is no spectrum to speak of."""


class FieldError(InputError):
    """A picture or height field cannot be used."""


class TooSmallError(FieldError):
    """Too few pixels, or too little of the field left after both were cut to the same extent."""


class ConstantFieldError(FieldError):
    """A constant, or a plane: no spectrum is left once the plane is removed."""


class NotFiniteError(FieldError):
    """The field contains NaN or infinite values."""


class ScaleMismatchError(FieldError):
    """The physical scales of the two fields are not known well enough to compare wavelengths."""


@dataclass(frozen=True, eq=False)
class Field:
    """A picture (brightness) or a height field on square pixels.

    Attributes
    ----------
    values : (ny, nx) array
        Any unit.
    spacing : float or None
        Side of a pixel, m; None: unknown.
    name : str

    Raises
    ------
    TooSmallError, NotFiniteError, ConstantFieldError, FieldError
    """

    values: np.ndarray
    spacing: float | None = None
    name: str = "field"

    def __post_init__(self):
        values = np.ascontiguousarray(self.values, dtype=float)
        object.__setattr__(self, "values", values)
        if values.ndim != 2:
            raise FieldError(f"'{self.name}' must be a (ny, nx) array, not one of shape {values.shape}")
        if min(values.shape) < SMALLEST:
            raise TooSmallError(f"'{self.name}' has {values.shape[1]} x {values.shape[0]} pixels; "
                                f"at least {SMALLEST} a side are needed")
        bad = int(np.size(values) - np.isfinite(values).sum())
        if bad:
            raise NotFiniteError(f"'{self.name}' has {bad} values that are NaN or infinite: fill or cut them out first")
        if self.spacing is not None and not (math.isfinite(self.spacing) and self.spacing > 0):
            raise FieldError(f"'{self.name}': the spacing of the pixels must be positive, not {self.spacing} m")
        rest = without_plane(values)
        if np.abs(rest).max() <= 1e-10 * max(np.abs(values).max(), 1e-300):
            raise ConstantFieldError(f"'{self.name}' is constant or a plane: nothing is left to compare")


def read_field(path: str | os.PathLike, spacing: float | None = None) -> Field:
    """Read a picture (PNG, JPEG …: its luminance) or a table (``.npy``, ``.csv``, ``.txt``: heights).

    Parameters
    ----------
    path : path
    spacing : float, optional
        Side of a pixel, m.

    Raises
    ------
    DataFileError
        The file is missing or not readable as a picture or a table.
    FieldError
        See :class:`Field`.
    """
    path = Path(path)
    if not path.is_file():
        raise DataFileError("no such file: a picture (PNG, JPEG) or a table of heights (.npy, .csv, .txt) is needed", path)
    try:
        if path.suffix == ".npy":
            values = np.load(path, allow_pickle=False)
        elif path.suffix in (".csv", ".txt"):
            values = np.loadtxt(path, delimiter="," if path.suffix == ".csv" else None)
        else:
            from PIL import Image

            with Image.open(path) as picture:
                values = np.asarray(picture.convert("F"))
    except (OSError, ValueError) as error:
        raise DataFileError(f"cannot be read as a picture or a table of heights: {error}", path) from error
    return Field(values, spacing, path.name)


def without_plane(values: np.ndarray) -> np.ndarray:
    """The field (ny, nx) less its least-squares plane."""
    ny, nx = values.shape
    x, y = np.arange(nx) - 0.5 * (nx - 1), np.arange(ny)[:, None] - 0.5 * (ny - 1)
    rest = values - values.mean()
    return rest - x * (np.sum(rest * x) / (ny * np.sum(x * x))) - y * (np.sum(rest * y) / (nx * np.sum(y * y)))


def common_grid(first: Field, second: Field) -> tuple[np.ndarray, np.ndarray, float | None]:
    """Both fields on the same pixels: the coarser spacing, cut round their centres to the smaller extent.

    Returns
    -------
    first, second : (ny, nx) arrays
    spacing : float or None
        m; None where both fields have no scale, which needs equal shapes.

    Raises
    ------
    ScaleMismatchError
        Only one has a scale, or neither has and the shapes differ.
    TooSmallError
        Too few pixels are left.
    """
    if first.spacing is None or second.spacing is None:
        for a, b in ((first, second), (second, first)):
            if a.spacing is not None:
                raise ScaleMismatchError(f"'{a.name}' has a scale ({1e3 * a.spacing:.4g} mm a pixel), "
                                         f"'{b.name}' has none: give both")
        if first.values.shape != second.values.shape:
            raise ScaleMismatchError(f"'{first.name}' has {first.values.shape[::-1]} pixels and '{second.name}' "
                                     f"{second.values.shape[::-1]}: without a scale for both, wavelengths cannot be compared")
        return first.values, second.values, None
    spacing = max(first.spacing, second.spacing)
    ny, nx = (int(min(a * first.spacing, b * second.spacing) / spacing * (1 + 1e-12))
              for a, b in zip(first.values.shape, second.values.shape, strict=True))
    if min(ny, nx) < SMALLEST:
        raise TooSmallError(f"'{first.name}' and '{second.name}' share {nx} x {ny} pixels of {1e3 * spacing:.4g} mm; "
                            f"at least {SMALLEST} a side are needed")
    return _sample(first, spacing, (ny, nx)), _sample(second, spacing, (ny, nx)), spacing


def _sample(field: Field, spacing: float, shape: tuple[int, int]) -> np.ndarray:
    """The middle of a field on coarser pixels: smoothed against aliasing, cubic splines."""
    from scipy import ndimage

    assert field.spacing is not None
    step = spacing / field.spacing
    values = field.values
    if step > 1.0 + 1e-9:
        values = ndimage.gaussian_filter(values, 0.5 * math.sqrt(step**2 - 1.0), mode="reflect")
    axes = [0.5 * (n - 1) + step * (np.arange(m) - 0.5 * (m - 1)) for n, m in zip(values.shape, shape, strict=True)]
    if all(np.allclose(axis, np.round(axis), atol=1e-9) for axis in axes) and step < 1.0 + 1e-9:
        return values[np.ix_(*(np.round(axis).astype(int) for axis in axes))]
    return ndimage.map_coordinates(values, np.meshgrid(*axes, indexing="ij"), order=3, mode="reflect")
