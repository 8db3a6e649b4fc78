"""Checks that any law, the user's too, should pass: consistency, symmetry, rest state, stability, locking."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from .homogeneous import respond
from .law import Law

_D = np.array([2.0, 2.0, 1.0])
_REST = np.array([[1.0, 1.0, 0.0]])


@dataclass(frozen=True)
class Check:
    """One named check.

    Attributes
    ----------
    name : str
    value : float
        What was measured (a relative error, an eigenvalue ratio, a stretch).
    tolerance : float
        What it is compared with.
    passed : bool
    detail : str
        How to read the value.
    """

    name: str
    value: float
    tolerance: float
    passed: bool
    detail: str


def check_law(law: Law, points: int = 60, seed: int = 0) -> list[Check]:
    """Run all checks.

    Parameters
    ----------
    law : Law
    points : int
        Random admissible states used by the pointwise checks.
    seed : int
        Seed of these states.

    Returns
    -------
    list of Check
    """
    rng = np.random.default_rng(seed)
    C, amplitude = sample_states(law, points, rng)
    checks = [
        _stress_free(law),
        _stress(law, C, amplitude),
        _tangent(law, C, amplitude),
        _tangent_symmetry(law, C),
        _sensitivities(law, C),
        _objectivity(law, C, rng),
        _orthotropy(law, C),
        _positive_at_rest(law),
        _inadmissible(law),
        _locking(law),
    ]
    for direction in ("warp", "weft", "bias"):
        checks += stability(law, direction)
    return checks


def sample_states(law: Law, points: int, rng) -> tuple[np.ndarray, float]:
    """Random admissible C around the identity.

    Returns
    -------
    C : (points, 3) array
    amplitude : float
        Half width of the box they were drawn from; halved from 0.2 until nine draws of ten are admissible.
    """
    amplitude = 0.2
    while amplitude > 1e-6:
        C = _REST[0] + rng.uniform(-amplitude, amplitude, (4 * points, 3))
        good = np.isfinite(law.energy(_REST[0] + 1.05 * (C - _REST[0])))
        if good.mean() > 0.9:
            return C[good][:points], amplitude
        amplitude *= 0.5
    return np.repeat(_REST, points, axis=0), 0.0


def _difference(function, C, h):
    """Fourth-order central difference of a batched function with respect to the columns of C."""
    columns = []
    for unit in np.eye(3):
        one, two = (function(C + k * h * unit) - function(C - k * h * unit) for k in (1.0, 2.0))
        columns.append((8.0 * one - two) / (12.0 * h))
    return np.stack(columns, axis=-1)


def _record(name, value, tolerance, detail, passed=None):
    value = float(value)
    return Check(name, value, tolerance, bool(value <= tolerance) if passed is None else bool(passed), detail)


def _worst(error, scale):
    """Largest error over the scale of its point; infinite if anything is not finite."""
    error = np.abs(error).reshape(len(error), -1).max(axis=1)
    ratio = error / np.maximum(scale, 1e-300)
    return float(ratio.max()) if np.isfinite(ratio).all() else np.inf


def _stress_free(law):
    _, S, T = law.evaluate(_REST)
    return _record("stress-free reference", np.abs(S).max() / np.abs(T).max(), 1e-10, "|S| / |tangent| at C = I")


def _stress(law, C, amplitude):
    S, T = law.evaluate(C)[1:]
    error = _difference(law.energy, C, 2e-3 * amplitude) * _D - S
    scale = np.abs(S).max(axis=1) + amplitude * np.abs(T).max(axis=(1, 2))
    return _record("stress", _worst(error, scale), 1e-6, "against differences of the energy, relative")


def _tangent(law, C, amplitude):
    T = law.tangent(C)
    error = _difference(law.stress, C, 2e-3 * amplitude) * _D - T
    value = _worst(error, np.abs(T).max(axis=(1, 2)))
    return _record("tangent", value, 1e-5, "against differences of the stress, relative")


def _tangent_symmetry(law, C):
    T = law.tangent(C)
    value = _worst(T - T.transpose(0, 2, 1), np.abs(T).max(axis=(1, 2)))
    return _record("tangent symmetry", value, 1e-12, "|T - T'| / |T|")


def _sensitivities(law, C):
    names = [p.name for p in law.parameters]
    if not names:
        return _record("parameter sensitivities", 0.0, 1e-5, "no parameters")
    analytic = law.stress_sensitivity(C, names)
    worst = 0.0
    for j, p in enumerate(law.parameters):
        value = law.values[p.name]
        h = 1e-4 * max(abs(value), 1e-3)
        # two-sided where the bounds allow it, one-sided (second order) at a bound
        if value - 2 * h >= p.lower and value + 2 * h <= p.upper:
            one, two = (_shift(law, p.name, k * h, C) - _shift(law, p.name, -k * h, C) for k in (1.0, 2.0))
            numeric = (8.0 * one - two) / (12.0 * h)
        else:
            h = h if value + 4 * h <= p.upper else -h
            s = [_shift(law, p.name, k * h, C) for k in range(5)]
            numeric = (-25 * s[0] + 48 * s[1] - 36 * s[2] + 16 * s[3] - 3 * s[4]) / (12.0 * h)
        scale = np.abs(analytic[..., j]).max() + 1e-4 * np.abs(law.stress(C)).max() / max(abs(value), 1e-3)
        worst = max(worst, _worst(analytic[..., j] - numeric, np.full(len(C), scale)))
    return _record("parameter sensitivities", worst, 1e-5, "against differences in the parameters, relative")


def _shift(law, name, by, C):
    return law.replace(**{name: law.values[name] + by}).stress(C)


def _objectivity(law, C, rng):
    F = deformation_gradient(C)
    Q, _ = np.linalg.qr(rng.normal(size=(len(C), 3, 3)))
    Q *= np.sign(np.linalg.det(Q))[:, None, None]
    G = Q @ F
    rotated = np.stack([(G[:, :, i] * G[:, :, j]).sum(axis=1) for i, j in ((0, 0), (1, 1), (0, 1))], axis=1)
    energy, turned = law.energy(C), law.energy(rotated)
    scale = np.full(len(C), np.abs(energy).max())
    value = _worst(energy - turned, scale)
    return _record("frame indifference", value, 1e-9, "energy of Q F against F, Q a 3-D rotation")


def deformation_gradient(C) -> np.ndarray:
    """A 3 x 2 gradient of the mid-surface with ``F' F = C``. *Shape:* (n, 3, 2)."""
    C = np.asarray(C, dtype=float)
    F = np.zeros((len(C), 3, 2))
    F[:, 0, 0] = np.sqrt(C[:, 0])
    F[:, 0, 1] = C[:, 2] / F[:, 0, 0]
    F[:, 1, 1] = np.sqrt(C[:, 1] - F[:, 0, 1] ** 2)
    return F


def _orthotropy(law, C):
    mirror = np.array([1.0, 1.0, -1.0])
    energy, S, _ = law.evaluate(C, 1)
    energy_m, S_m, _ = law.evaluate(C * mirror, 1)
    value = max(
        _worst(energy - energy_m, np.full(len(C), np.abs(energy).max())),
        _worst(S - S_m * mirror, np.full(len(C), np.abs(S).max())),
    )
    return _record("orthotropy", value, 1e-9, "mirror C12 -> -C12: energy even, S12 odd")


def _positive_at_rest(law):
    values = np.linalg.eigvalsh(law.tangent_at_rest())
    ratio = values[0] / max(values[-1], 1e-300)
    return _record("positive definite at rest", ratio, 0.0, "smallest / largest eigenvalue at C = I, > 0", ratio > 0.0)


def _inadmissible(law):
    bad = np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 1.5], [-1.0, 1.0, 0.0], [np.nan, 1.0, 0.0], [np.inf, 1.0, 0.0]])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        energy, S, T = law.evaluate(bad)
    wrong = int(np.sum(energy != np.inf) + np.sum(S != 0.0) + np.sum(T != 0.0)) + len(caught)
    return _record("inadmissible states", wrong, 0.0, "det C <= 0, NaN: energy +inf, stress and tangent 0, no warning")


def _locking(law):
    """Stretch far beyond use: the energy grows to +inf or stays finite, never NaN, never falls."""
    stretch = np.geomspace(1.0, 1e3, 200)
    zero, one = np.zeros_like(stretch), np.ones_like(stretch)
    paths = [(stretch**2, stretch**2, zero), (stretch**2, one, zero), (one, stretch**2, zero)]
    wrong, lock = 0, np.inf
    for path in paths:
        energy, S, T = law.evaluate(np.stack(path, axis=1))
        past = np.isinf(energy)
        wrong += int(np.isnan(energy).sum() + (~np.isfinite(S)).sum() + (~np.isfinite(T)).sum())
        wrong += int(np.any(S[past])) + int(np.any(T[past])) + int(past.any() and not past[np.argmax(past) :].all())
        finite = energy[~past]
        wrong += int(np.sum(np.diff(finite) < -1e-12 * np.abs(finite).max()))
        if past.any():
            lock = min(lock, stretch[np.argmax(past)])
    text = f"energy +inf from a stretch of about {lock:.3g} on" if np.isfinite(lock) else "no locking stretch"
    return _record("locking", wrong, 0.0, text + "; grows to it, no NaN")


def stability(law: Law, direction, lower: float = 0.8, upper: float = 1.5, count: int = 60) -> list[Check]:
    """Range of uniaxial stretch around 1 in which the law stays stable.

    Two records: positive definite tangent dS/dE (Drucker), and strong ellipticity in the plane (Legendre–Hadamard):
    ``(N.S.N) C^-1 + N.T.N`` positive definite for every direction N. The first is reported; the second must hold up to
    a stretch of 1.05 or as far as the law reaches, if that is less.

    Parameters
    ----------
    law : Law
    direction : str or float
        Pulling direction.
    lower, upper : float
        Range searched.
    count : int
        Points on either side of 1.
    """
    ranges = {"drucker": [1.0, 1.0], "elliptic": [1.0, 1.0]}
    reach = 1.0
    for side, end in enumerate((lower, upper)):
        stretch = np.linspace(1.0, end, count)
        r = respond(law, "uniaxial", direction, stretch, strict=False)
        last = len(stretch) if r.converged.all() else int(np.argmin(r.converged))
        C = r.C[:last]
        S, T = law.evaluate(C)[1:]
        for key, good in (("drucker", np.linalg.eigvalsh(T)[:, 0] > 0.0), ("elliptic", _elliptic(C, S, T))):
            n = len(good) if good.all() else int(np.argmin(good))
            if n:
                ranges[key][side] = float(stretch[n - 1])
        if side == 1 and last:
            reach = float(stretch[last - 1])
    need = min(1.05, reach)
    text = "stretch {0[0]:.3g} to {0[1]:.3g} " + f"(searched {lower:g} to {min(upper, reach):.3g})"
    label = direction if isinstance(direction, str) else f"{np.degrees(direction):.4g} deg"
    convex, elliptic = ranges["drucker"], ranges["elliptic"]
    passed = elliptic[1] >= need - 1e-9 and need > 1.0
    return [
        _record(f"positive definite tangent, {label}", convex[1], 1.0, text.format(convex), passed=True),
        _record(f"strong ellipticity, {label}", elliptic[1], need, text.format(elliptic), passed=passed),
    ]


def _elliptic(C, S, T, directions: int = 36):
    good = np.ones(len(C), dtype=bool)
    det = C[:, 0] * C[:, 1] - C[:, 2] ** 2
    inverse = np.stack([C[:, 1], -C[:, 2], -C[:, 2], C[:, 0]], axis=1).reshape(-1, 2, 2) / det[:, None, None]
    for angle in np.arange(directions) * np.pi / directions:
        c, s = np.cos(angle), np.sin(angle)
        B = np.array([[c, 0.0], [0.0, s], [s, c]])  # strain [E11, E22, 2 E12] of a rank-one rate a N
        pull = S[:, 0] * c * c + S[:, 1] * s * s + 2.0 * S[:, 2] * c * s
        good &= np.linalg.eigvalsh(pull[:, None, None] * inverse + B.T @ T @ B)[:, 0] > 0.0
    return good
