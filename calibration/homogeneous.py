"""The homogeneous level of the forward model: no mesh, one state of strain a reading.

Strip: uniaxial tension at an angle to the warp with free lateral contraction *and* free shear, S22 = S12 = 0 in the
strip's axes; the force over the initial width is ``scale * lambda * S11``. Between clamps that is a poor picture of an
oblique strip (the clamps prevent the shear) and a good one along the yarns; the finite-element level tells by how much.

Cantilever: the overhang at which the tip's chord dips by the given angle, ``L = c Gamma(angle)^(1/3)`` with
``c = (B / w)^(1/3)``, B the rigidity of a narrow strip in that direction and w the weight by area.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from calibration.experiments import Experiment
from calibration.forward import Prediction
from mfar_fem.errors import InputError, UnknownNameError

GRAVITY = 9.80665  # m/s²
HUGE = 1e100  # a tangent beyond this would overflow in products


def rotation(angle: float) -> np.ndarray:
    """R with ``C_law = R C_strip`` for C = [C11, C22, C12], strip axes turned by `angle` from the warp, (3, 3)."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c * c, s * s, -2 * c * s], [s * s, c * c, 2 * c * s], [c * s, -c * s, c * c - s * s]])


def solve_uniaxial(law, angle: float, strain: np.ndarray, *, steps: int = 8, tolerance: float = 1e-10):
    """Free lateral stretch and shear of a strip under uniaxial tension.

    All readings are followed together from rest, the last state extrapolated along the tangent; Newton with a line
    search on the energy, which is infinite past locking. A step that fails for some readings is halved for them.

    Parameters
    ----------
    law : Law
    angle : float
        Of the strip's axis from the warp, rad.
    strain : ndarray, shape (m,)
        Engineering strain.

    Returns
    -------
    C : ndarray, shape (m, 3)
        In the law's (warp/weft) frame.
    reached : ndarray of bool, shape (m,)
    """
    R = rotation(angle)
    strain = np.asarray(strain, float)
    state = np.tile([1.0, 1.0, 0.0], (strain.size, 1))  # in the strip's axes
    done, step = np.zeros(strain.size), np.full(strain.size, 1.0 / steps)
    for _ in range(12 * steps):
        stuck = (done < 1.0) & (step <= 1e-3)
        hopeless = np.abs(strain) >= (np.abs(strain[stuck]).min() if stuck.any() else np.inf)  # no way past a failure
        active = np.flatnonzero((done < 1.0) & ~hopeless)
        if active.size == 0:
            break
        t = np.minimum(1.0, done[active] + step[active])
        trial = _predict(law, R, state[active], (1.0 + t * strain[active]) ** 2)
        trial, ok = _equilibrium(law, R, trial, tolerance)
        good = active[ok]
        state[good], done[good] = trial[ok], t[ok]
        step[good] = np.minimum(2.0 * step[good], 0.5)
        step[active[~ok]] *= 0.25
    return state @ R.T, done >= 1.0


def _response(law, R, C, order=2):
    """Energy, stress and tangent in the strip's axes."""
    T = R.copy()  # S_strip = T^T S_law for the pairing S . E with E = [E11, E22, 2 E12]
    T[2, :2] *= 2.0
    T[:2, 2] *= 0.5
    energy, S, A = law.evaluate(C @ R.T, order)
    if A is None:
        return energy, S @ T, None
    wild = ~(np.abs(A).max(axis=(1, 2)) < HUGE)  # a hair before locking: as good as locked
    if wild.any():
        energy, A = np.where(wild, np.inf, energy), np.where(wild[:, None, None], np.eye(3), A)
    return energy, S @ T, np.einsum("ia,nij,jb->nab", T, A, T)


def _predict(law, R, C, c11):
    _, _, A = _response(law, R, C)
    out = C.copy()
    out[:, 0] = c11
    dE = 0.5 * (c11 - C[:, 0])
    det = A[:, 1, 1] * A[:, 2, 2] - A[:, 1, 2] ** 2
    ok = det > 1e-12 * (A[:, 1, 1] + A[:, 2, 2]) ** 2
    safe = np.where(ok, det, 1.0)
    e22 = -(A[:, 2, 2] * A[:, 0, 1] - A[:, 1, 2] * A[:, 0, 2]) / safe * dE
    e12 = -(A[:, 1, 1] * A[:, 0, 2] - A[:, 1, 2] * A[:, 0, 1]) / safe * dE
    moved = out.copy()
    moved[:, 1] += np.where(ok, 2.0 * e22, 0.0)
    moved[:, 2] += np.where(ok, e12, 0.0)
    energy = law.energy(moved @ R.T)
    return np.where(np.isfinite(energy)[:, None], moved, out)


def _equilibrium(law, R, C, tolerance, iterations: int = 25):
    """Newton for S22 = S12 = 0 at given C11; returns C and where it converged."""
    C = C.copy()
    energy, S, A = _response(law, R, C)
    alive = np.isfinite(energy)
    converged, before = np.zeros(len(C), bool), np.full(len(C), np.inf)
    for _ in range(iterations):
        size = np.abs(A).max(axis=(1, 2)) + 1e-300
        force = np.abs(S[:, 1:]).max(axis=1)
        level = np.maximum(np.abs(S[:, 0]), 1e-4 * size)
        stagnant = (force >= 0.5 * before) & (force <= 1e-6 * level)  # down to the rounding of the law's stress
        converged |= alive & ((force <= tolerance * level) | stagnant)
        before = force
        todo = np.flatnonzero(alive & ~converged)
        if todo.size == 0:
            break
        a, b, c = A[todo, 1, 1], A[todo, 2, 2], A[todo, 1, 2]
        mean, radius = 0.5 * (a + b), np.hypot(0.5 * (a - b), c)
        shift = np.maximum(0.0, 1e-8 * (np.abs(mean) + radius) - (mean - radius))  # make the 2 x 2 block definite
        a, b = a + shift, b + shift
        det = a * b - c * c
        g1, g2 = S[todo, 1], S[todo, 2]
        d1, d2 = -(b * g1 - c * g2) / det, -(a * g2 - c * g1) / det
        slope = g1 * d1 + g2 * d2
        length, open_ = np.ones(todo.size), np.ones(todo.size, bool)
        trial = C[todo].copy()
        for _ in range(30):
            trial[open_, 1] = C[todo][open_, 1] + 2.0 * (length * d1)[open_]
            trial[open_, 2] = C[todo][open_, 2] + (length * d2)[open_]
            new = law.energy(trial @ R.T)
            slack = 1e-12 * np.abs(energy[todo]) + 2e-15 * size[todo]  # rounding of the energy
            open_ = ~(new <= energy[todo] + 1e-4 * length * slope + slack)
            if not open_.any():
                break
            length = np.where(open_, 0.5 * length, length)
        trial[open_] = C[todo][open_]
        stuck = open_ & (np.abs(slope) > 1e-12 * np.abs(energy[todo]))
        C[todo] = trial
        alive[todo[stuck]] = False
        energy[todo], S[todo], A[todo] = _response(law, R, trial)
        small = open_ & ~stuck  # no further descent within rounding: equilibrium to what the numbers allow
        converged[todo[small]] = True
    return _polished(law, R, C, S, A, converged), converged


def _polished(law, R, C, S, A, converged):
    """One more full Newton step where it lowers the residual: down to rounding."""
    block = A[:, 1:, 1:].copy()
    block[~converged] = np.eye(2)
    step = np.linalg.solve(block + 1e-300 * np.eye(2), -S[:, 1:, None])[:, :, 0]
    trial = C + np.stack([np.zeros(len(C)), 2.0 * step[:, 0], step[:, 1]], axis=1)
    energy, new, _ = _response(law, R, trial, 1)
    better = converged & np.isfinite(energy) & (np.abs(new[:, 1:]).max(axis=1) < np.abs(S[:, 1:]).max(axis=1))
    return np.where(better[:, None], trial, C)


def path(law, angle: float, strain: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States C (m, 3) in the law's frame along uniaxial tension, and which were reached."""
    return solve_uniaxial(law, angle, strain)


def line_force(fabric, angle: float, strain: np.ndarray, names: Sequence[str] = ()) -> Prediction:
    """Force over the initial width of a homogeneous strip, N/m, and its derivatives by law parameters.

    The derivative at fixed stretch follows from equilibrium: ``dS11 = dS11|_C - A1b Abb^-1 dSb|_C``.
    """
    law, R, strain = fabric.law, rotation(angle), np.asarray(strain, float)
    C, reached = solve_uniaxial(law, angle, strain)
    stretch = 1.0 + strain
    own = C @ np.linalg.inv(R).T
    _, S, A = _response(law, R, own)
    factor = fabric.membrane_scale * stretch
    y = np.where(reached, factor * S[:, 0], np.nan)
    status = "ok" if reached.all() else "locking or no equilibrium"
    if not names:
        return Prediction(y, None, reached, status)
    J = np.zeros((strain.size, len(names)))
    mine = [k for k, n in enumerate(names) if n.startswith("law.")]
    if mine and reached.any():
        T = R.copy()
        T[2, :2] *= 2.0
        T[:2, 2] *= 0.5
        dS = np.einsum("ia,nip->nap", T, law.stress_sensitivity(C, [names[k][4:] for k in mine]))
        block = A[:, 1:, 1:].copy()
        block[~reached] = np.eye(2)
        row = np.linalg.solve(block, A[:, 1:, 0:1])[:, :, 0]
        J[:, mine] = factor[:, None] * (dS[:, 0] - np.einsum("nb,nbp->np", row, dS[:, 1:]))
        J[~reached] = 0.0
    return Prediction(y, J, reached, status)


class HomogeneousStrip:
    """Forward model of a strip test without a mesh."""

    def __init__(self, experiment: Experiment):
        self.direction = experiment.direction

    def predict(self, fabric, x: np.ndarray, names: Sequence[str] = ()) -> Prediction:
        """Line force (N/m) at the engineering strains x, see `line_force`."""
        return line_force(fabric, self.direction, x, names)


@lru_cache(maxsize=64)
def overhang_factor(angle: float) -> float:
    """L/c of the exact heavy elastica whose chord dips by `angle` (rad) below the horizontal clamp."""
    from material_tests.elastica import gamma_at_chord_angle

    return float(gamma_at_chord_angle(angle)) ** (1.0 / 3.0)


class HomogeneousCantilever:
    """Forward model of the cantilever test: exact heavy elastica with the strip's own rigidity."""

    def __init__(self, experiment: Experiment):
        self.direction = experiment.direction
        self.factors = {float(a): overhang_factor(float(a)) for a in np.unique(experiment.x)}

    def rigidity(self, bending, names: Sequence[str]) -> tuple[float, np.ndarray]:
        """B of a narrow strip in this direction (N·m) and its derivatives by 'bending.*' names, (p,)."""
        c, s = math.cos(self.direction), math.sin(self.direction)
        m = np.array([c * c, s * s, c * s])
        k = np.linalg.solve(bending.matrix, m)  # 1/B = m . D^-1 m, so dB = B² k . dD k
        B = 1.0 / float(m @ k)
        slopes = {
            "bending.warp": k[0] ** 2,
            "bending.weft": k[1] ** 2,
            "bending.twist": k[2] ** 2,
            "bending.coupling": 2 * k[0] * k[1],
        }
        return B, B * B * np.array([slopes.get(n, 0.0) for n in names])

    def predict(self, fabric, x: np.ndarray, names: Sequence[str] = ()) -> Prediction:
        """Overhang (m) at the chord angles x (rad)."""
        B, slope = self.rigidity(fabric.bending, names)
        c = (B / (fabric.areal_density * GRAVITY)) ** (1.0 / 3.0)
        y = c * np.array([self.factors.get(float(a)) or overhang_factor(float(a)) for a in x])
        J = y[:, None] / (3.0 * B) * slope if names else None
        return Prediction(y, J, np.ones(y.size, bool))


def model(experiment: Experiment):
    """The homogeneous forward model of an experiment (level 'homogeneous')."""
    kinds = {"strip": HomogeneousStrip, "cantilever": HomogeneousCantilever}
    if experiment.kind not in kinds:
        raise UnknownNameError(f"no homogeneous model of a '{experiment.kind}' test; known: {', '.join(kinds)}")
    if experiment.kind == "cantilever" and not ((experiment.x > 0) & (experiment.x < 0.5 * math.pi)).all():
        raise InputError(f"experiment '{experiment.name}': the chord angle must lie between 0 and 90 degrees")
    return kinds[experiment.kind](experiment)
