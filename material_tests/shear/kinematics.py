r"""Kinematics of the two shear tests with inextensible yarns, and the shear moment both are reduced to.

The *shear moment* per area :math:`m(\gamma) = d\Psi/d\gamma` (N/m) is the work per area and shear angle (loss of the right angle
between warp and weft). In pure trellis shear :math:`C_{11} = C_{22} = 1`, :math:`C_{12} = \sin\gamma`, so that
:math:`m = S_{12}\cos\gamma`. The literature's shear force per length is :math:`F_{sh} = m/\cos\gamma = S_{12}`.

Picture frame, side L, arm angle :math:`\varphi = \pi/4 - \gamma/2` from the pulled diagonal, :math:`F\,d\delta = A\,m\,d\gamma`:

.. math:: F = \frac{A}{L}\frac{m}{\sin\varphi}

Bias extension, length H >= 2 W, zone C (area :math:`HW - \tfrac32W^2`) sheared by γ, zones B (:math:`W^2`) by γ/2:

.. math:: \delta = (H - W)\big(\sqrt2\cos\varphi - 1\big), \qquad
          F\,\frac{H-W}{2}\Big(\cos\frac\gamma2 - \sin\frac\gamma2\Big)
          = \Big(H - \frac32W\Big)W\,m(\gamma) + \frac{W^2}{2}\,m(\gamma/2)

References
----------
1. J. Cao, R. Akkerman, P. Boisse et al., "Characterization of mechanical behavior of woven fabrics: experimental methods and
   benchmark results", Composites A 39 (2008) 1037–1053, doi 10.1016/j.compositesa.2008.02.016.
2. P. Harrison, M. J. Clifford, A. C. Long, "Shear characterisation of viscous woven textile composites: a comparison between
   picture frame and bias extension experiments", Compos. Sci. Technol. 64 (2004) 1453–1465, doi 10.1016/j.compscitech.2003.10.015.
"""

from __future__ import annotations

import numpy as np

from mfar_fem.errors import InputError


def frame_displacement(angle, side: float) -> np.ndarray:
    """Elongation of the frame's diagonal, m, at shear angles (rad)."""
    return side * (2.0 * np.cos(0.25 * np.pi - 0.5 * _angles(angle)) - np.sqrt(2.0))


def frame_force(angle, moment, side: float, specimen: float | None = None) -> np.ndarray:
    """Force along the diagonal, N, from the shear moment (N/m); ``specimen``: side of the square, m, if less than the frame's."""
    area = (specimen or side) ** 2
    return area / side * np.asarray(moment, dtype=float) / np.sin(0.25 * np.pi - 0.5 * _angles(angle))


def frame_normalise(angle, force, side: float, specimen: float | None = None) -> np.ndarray:
    """Shear moment, N/m, from the force along the diagonal: the inverse of :func:`frame_force`."""
    return np.asarray(force, dtype=float) / frame_force(angle, 1.0, side, specimen)


def bias_displacement(angle, length: float, width: float) -> np.ndarray:
    """Displacement of the grips, m, at shear angles (rad) of the central zone."""
    _proportions(length, width)
    return (length - width) * (np.sqrt(2.0) * np.cos(0.25 * np.pi - 0.5 * _angles(angle)) - 1.0)


def bias_angle(displacement, length: float, width: float) -> np.ndarray:
    """Shear angle, rad, of the central zone at displacements (m) of the grips; NaN beyond the yarns' full alignment."""
    _proportions(length, width)
    cosine = (1.0 + np.asarray(displacement, dtype=float) / (length - width)) / np.sqrt(2.0)
    with np.errstate(invalid="ignore"):
        return 0.5 * np.pi - 2.0 * np.arccos(np.where(cosine <= 1.0, cosine, np.nan))


def bias_force(angle, moment, length: float, width: float) -> np.ndarray:
    """Force on the grips, N; ``moment(angle) -> N/m`` is the shear moment as a function."""
    _proportions(length, width)
    angle = _angles(angle)
    work = (length - 1.5 * width) * width * moment(angle) + 0.5 * width**2 * moment(0.5 * angle)
    return work / (0.5 * (length - width) * (np.cos(0.5 * angle) - np.sin(0.5 * angle)))


def bias_normalise(angle, force, length: float, width: float) -> np.ndarray:
    """Shear moment, N/m, at increasing angles (rad) from the forces (N) there: the inverse of :func:`bias_force`.

    The moment at half the angle is interpolated linearly between the unknowns themselves (zero at zero), so one linear system
    gives all of them.

    Raises
    ------
    InputError
        Angles not increasing or not positive, or a strip shorter than twice its width.
    """
    _proportions(length, width)
    angle, force = _angles(angle), np.asarray(force, dtype=float)
    if angle.shape != force.shape or angle.ndim != 1 or not np.all(np.diff(angle, prepend=0.0) > 0):
        raise InputError("the shear angles must be positive and strictly increasing, with one force each")
    knots = np.append(0.0, angle)
    half = np.array([np.interp(0.5 * angle, knots, unit) for unit in np.eye(len(knots))[1:]]).T
    left = (length - 1.5 * width) * width * np.eye(len(angle)) + 0.5 * width**2 * half
    return np.linalg.solve(left, 0.5 * (length - width) * (np.cos(0.5 * angle) - np.sin(0.5 * angle)) * force)


def zone(x, y, length: float, width: float) -> np.ndarray:
    """Zone (0: A at the grips, 1: B, 2: C) of reference points, x along the strip from one grip, y across from one edge."""
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    x = np.minimum(x, length - x)  # distance from the nearer grip
    y = np.minimum(y, width - y)
    return np.where(x <= y, 0, np.where(x >= width - y, 2, 1))


def law_moment(law, scale: float):
    """Shear moment of a law in pure trellis shear as a function ``angle -> N/m``; ``scale``: the fabric's membrane scale."""
    def moment(angle):
        angle = np.asarray(angle, dtype=float)
        C = np.stack([np.ones_like(angle), np.ones_like(angle), np.sin(angle)], axis=-1).reshape(-1, 3)
        return scale * law.stress(C)[:, 2].reshape(angle.shape) * np.cos(angle)

    return moment


def _angles(angle) -> np.ndarray:
    angle = np.asarray(angle, dtype=float)
    if not np.all((np.abs(angle) < 0.5 * np.pi) | np.isnan(angle)):
        raise InputError("shear angles must be smaller than a right angle, in rad")
    return angle


def _proportions(length: float, width: float) -> None:
    if not (np.isfinite(length) and width > 0 and length >= 2.0 * width * (1 - 1e-12)):
        raise InputError(f"a bias-extension strip is at least twice as long as wide, not {length} x {width} m: "
                         "without the central zone there is no pure shear")
