"""Known cameras: 3x4 projection matrices from files, and the fundamental matrix that two of them give."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from mfar_fem.errors import DataFileError, InputError


def read_matrix(path) -> np.ndarray:
    """Read a 3x4 projection matrix: twelve numbers in a text file.

    Returns
    -------
    (3, 4) array
        Homogeneous world points to homogeneous pixels.

    Raises
    ------
    DataFileError
        Not readable, not twelve finite numbers, or of rank below 3.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise DataFileError(f"cannot be read as text: {error}", path=path) from error
    words = re.split(r"[\s,;]+", text.strip())
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError:
        bad = next(word for word in words if not _is_number(word))
        raise DataFileError(f"'{bad[:40]}' is not a number; a camera is the 12 numbers of a 3x4 matrix", path=path) from None
    if len(numbers) != 12 or not np.isfinite(numbers).all():
        raise DataFileError(f"holds {len(numbers)} numbers; a camera is the 12 finite numbers of a 3x4 matrix", path=path)
    matrix = numbers.reshape(3, 4)
    if np.linalg.matrix_rank(matrix[:, :3] / np.abs(matrix[:, :3]).max(axis=1, keepdims=True).clip(1e-300), tol=1e-9) < 3:
        raise DataFileError("its left 3x3 block is singular: the camera would have no centre in space", path=path)
    return matrix


def read_middlebury(path) -> dict[str, np.ndarray]:
    """Read the ``*_par.txt`` of a Middlebury multi-view set: a count, then a line ``name K(9) R(9) t(3)`` a picture.

    Returns
    -------
    dict of str to (3, 4) array
        Projection matrix K [R t] by file name.

    Raises
    ------
    DataFileError
        Not of that form, with the line.
    """
    try:
        lines = Path(path).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise DataFileError(f"cannot be read as text: {error}", path=path) from error
    cameras = {}
    for number, line in enumerate(lines[1:], 2):
        if not (words := line.split()):
            continue
        if len(words) != 22 or not all(map(_is_number, words[1:])):
            raise DataFileError("must be a file name and 21 numbers: K (9), R (9), t (3)", path=path, line=number)
        values = np.array(words[1:], dtype=float)
        cameras[words[0]] = values[:9].reshape(3, 3) @ np.column_stack([values[9:18].reshape(3, 3), values[18:]])
    if not lines or lines[0].strip() != str(len(cameras)):
        raise DataFileError(f"its first line must be the number of cameras; {len(cameras)} follow", path=path, line=1)
    return cameras


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def scaled(camera: np.ndarray, factor: float) -> np.ndarray:
    """Camera of the picture resized by a factor: diag(f, f, 1) P (the shift of pixel centres, (f-1)/2 px, is neglected)."""
    return np.diag([factor, factor, 1.0]) @ camera


def centre(camera: np.ndarray) -> np.ndarray:
    """Centre of projection, (3,), in the units of the world."""
    return -np.linalg.solve(camera[:, :3], camera[:, 3])


def baseline_angle(first: np.ndarray, second: np.ndarray) -> float:
    """Angle between the viewing directions of two cameras, rad."""
    axes = []
    for camera in (first, second):
        axis = camera[2, :3] * np.sign(np.linalg.det(camera[:, :3]))
        axes.append(axis / np.linalg.norm(axis))
    return float(np.arccos(np.clip(axes[0] @ axes[1], -1, 1)))


def fundamental(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Fundamental matrix of two cameras, x2' F x1 = 0.

    F = [e2]_x P2 P1^+ with e2 = P2 C1 (Hartley & Zisserman, Multiple View Geometry, 2nd ed., 2004, eq. 9.1).

    Parameters
    ----------
    first, second : (3, 4) array
        Projection matrices.

    Returns
    -------
    (3, 3) array
        Of Frobenius norm 1.

    Raises
    ------
    InputError
        The cameras have one centre: no epipolar geometry.
    """
    origin = np.append(centre(first), 1.0)
    epipole = second @ origin
    if np.linalg.norm(epipole) <= 1e-9 * np.linalg.norm(second) * np.linalg.norm(origin):
        raise InputError("the two cameras have the same centre of projection: there is no fundamental matrix, only a homography")
    x, y, z = epipole
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = cross @ second @ np.linalg.pinv(first)
    return matrix / np.linalg.norm(matrix)
