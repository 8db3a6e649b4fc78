"""Rigid motion on a prescribed path: x(t) = pivot + R(t) (X - pivot) + T(t)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from mfar_fem.errors import InputError


class Motion:
    """Rigid motion through keyframes, held before the first and after the last.

    The translation is linear between keys, the rotation turns at constant angular velocity (slerp). Where two neighbouring
    rotation vectors are parallel their difference is the turn, full turns included (0 to 4π about z is two turns); otherwise
    the shorter way is taken.

    Parameters
    ----------
    times : (k,) array_like
        Key times, strictly increasing, s.
    translations : (k, 3) array_like, optional
        T at the keys, m; zero where absent.
    rotations : (k, 3) array_like, optional
        Rotation vectors at the keys, rad; zero where absent.
    pivot : (3,) array_like
        The reference point the rotation leaves in place, m.

    Raises
    ------
    InputError
        Shapes that do not fit, values that are not finite, times that do not increase.
    """

    def __init__(self, times, translations=None, rotations=None, pivot=(0.0, 0.0, 0.0)):
        self.times = np.array(times, dtype=float)
        k = len(self.times) if self.times.ndim == 1 else 0
        self.translations = _keys("translations", translations, k)
        self.rotations = _keys("rotations", rotations, k)
        self.pivot = _pivot(pivot)
        if k < 1 or not np.all(np.isfinite(self.times)) or np.any(np.diff(self.times) <= 0):
            raise InputError("motion: key times must be a finite, strictly increasing sequence (s)")
        self.moving = bool(np.any(np.diff(self.translations, axis=0)) or np.any(np.diff(self.rotations, axis=0)))
        steps = np.diff(self.times)[:, None]
        self._speeds = np.diff(self.translations, axis=0) / steps
        self._spins = _turns(self.rotations) / steps

    @classmethod
    def from_functions(cls, translation: Callable | None = None, rotation: Callable | None = None, pivot=(0.0, 0.0, 0.0),
                       speed: Callable | None = None, spin: Callable | None = None, step: float = 1e-4) -> Motion:
        """Motion by functions of time.

        Parameters
        ----------
        translation, rotation : callable, optional
            ``f(t) -> (3,)``: translation, m, and rotation vector, rad.
        pivot : (3,) array_like
            The reference point the rotation leaves in place, m.
        speed, spin : callable, optional
            ``f(t) -> (3,)``: time derivative of the translation, m/s, and spatial angular velocity, rad/s. Where absent they
            are central differences of fourth order with ``step``, s.
        """
        return _FunctionMotion(translation, rotation, pivot, speed, spin, step)

    def pose(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Rotation matrix (3, 3) and translation (3,), m, at time t."""
        i = int(np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.times) - 1))
        after = min(max(t - self.times[i], 0.0), np.inf if i < len(self._speeds) else 0.0)
        R = Rotation.from_rotvec(self.rotations[i])
        if after == 0.0:
            return R.as_matrix(), self.translations[i].copy()
        return (Rotation.from_rotvec(after * self._spins[i]) * R).as_matrix(), self.translations[i] + after * self._speeds[i]

    def rates(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Spatial angular velocity (3,), rad/s, and translation speed (3,), m/s; at a key those of what follows it."""
        i = int(np.searchsorted(self.times, t, side="right")) - 1
        if 0 <= i < len(self._speeds):
            return self._spins[i].copy(), self._speeds[i].copy()
        return np.zeros(3), np.zeros(3)

    def position(self, X: np.ndarray, t: float) -> np.ndarray:
        """Where the reference points (n, 3) are at time t, m."""
        R, T = self.pose(t)
        return (X - self.pivot) @ R.T + (self.pivot + T)

    def reference(self, x: np.ndarray, t: float) -> np.ndarray:
        """Reference points (n, 3) of the places x (n, 3) at time t, m."""
        R, T = self.pose(t)
        return (x - (self.pivot + T)) @ R + self.pivot

    def velocity(self, x: np.ndarray, t: float) -> np.ndarray:
        """Velocity (n, 3), m/s, of the material that is at the places x (n, 3) at time t."""
        omega, speed = self.rates(t)
        _, T = self.pose(t)
        return np.cross(omega, x - (self.pivot + T)) + speed


class _FunctionMotion(Motion):
    """Motion whose translation and rotation are functions of time."""

    def __init__(self, translation, rotation, pivot, speed, spin, step):
        if not 0.0 < step < np.inf:
            raise InputError(f"motion: the step of the finite difference must be positive and finite, got {step} s")
        self._translation, self._rotation, self._speed, self._spin = translation, rotation, speed, spin
        self.pivot, self._step = _pivot(pivot), float(step)
        self.moving = translation is not None or rotation is not None

    def pose(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        T = np.zeros(3) if self._translation is None else _value(self._translation, t)
        return self._turn(t).as_matrix(), T

    def rates(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        h = self._step
        if self._speed is not None:
            speed = _value(self._speed, t)
        elif self._translation is None:
            speed = np.zeros(3)
        else:
            near, far = (_value(self._translation, t + s) - _value(self._translation, t - s) for s in (h, 2 * h))
            speed = (8.0 * near - far) / (12.0 * h)
        if self._spin is not None:
            return _value(self._spin, t), speed
        if self._rotation is None:
            return np.zeros(3), speed
        near, far = ((self._turn(t + s) * self._turn(t - s).inv()).as_rotvec() for s in (h, 2 * h))
        return (8.0 * near - far) / (12.0 * h), speed

    def _turn(self, t: float) -> Rotation:
        return Rotation.from_rotvec(np.zeros(3) if self._rotation is None else _value(self._rotation, t))


def _value(function: Callable, t: float) -> np.ndarray:
    value = np.array(function(t), dtype=float)
    if value.shape != (3,) or not np.all(np.isfinite(value)):
        raise InputError(f"motion: at t = {t} s a function gave {value}; it must give three finite numbers")
    return value


def _pivot(pivot) -> np.ndarray:
    p = np.array(pivot, dtype=float)
    if p.shape != (3,) or not np.all(np.isfinite(p)):
        raise InputError(f"motion: the pivot must be three finite coordinates (m), got {pivot!r}")
    return p


def _keys(name: str, values, k: int) -> np.ndarray:
    array = np.zeros((k, 3)) if values is None else np.array(values, dtype=float)
    if array.shape != (k, 3) or not np.all(np.isfinite(array)):
        raise InputError(f"motion: {name} must be finite with shape ({k}, 3), one row per key time, got shape {array.shape}")
    return array


def _turns(rotations: np.ndarray) -> np.ndarray:
    """Spatial rotation vectors (k - 1, 3) from one key to the next."""
    a, b = rotations[:-1], rotations[1:]
    turns = (Rotation.from_rotvec(b) * Rotation.from_rotvec(a).inv()).as_rotvec() if len(a) else np.zeros((0, 3))
    parallel = np.linalg.norm(np.cross(a, b), axis=1) <= 1e-12 * np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
    return np.where(parallel[:, None], b - a, turns)
