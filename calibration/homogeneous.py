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
from mfar_fem.materials.homogeneous import uniaxial

GRAVITY = 9.80665  # m/s²


def path(law, angle: float, strain: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States C (m, 3) in the law's frame along uniaxial tension, and which were reached, (m,)."""
    r = uniaxial(law, angle, 1.0 + np.asarray(strain, float), strict=False)
    return r.C, r.converged


def line_force(fabric, angle: float, strain: np.ndarray, names: Sequence[str] = ()) -> Prediction:
    """Force over the initial width of a homogeneous strip, N/m, and its derivatives by law parameters.

    Parameters
    ----------
    fabric : Fabric
    angle : float
        Of the strip's axis from the warp, rad.
    strain : ndarray, shape (m,)
        Engineering strain.
    names : sequence of str
        'law.mu', ...; derivatives by anything but law parameters are 0.
    """
    mine = [k for k, n in enumerate(names) if n.startswith("law.")]
    stretch = 1.0 + np.asarray(strain, float)
    r = uniaxial(fabric.law, angle, stretch, [names[k][4:] for k in mine], strict=False)
    scale, ok = fabric.membrane_scale, r.converged
    status = "ok" if ok.all() else "locking or no equilibrium"
    J = None
    if names:
        J = np.zeros((stretch.size, len(names)))
        if mine:
            J[:, mine] = np.where(ok[:, None], scale * r.sensitivity, 0.0)
    return Prediction(np.where(ok, scale * r.stress, np.nan), J, ok, status)


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
