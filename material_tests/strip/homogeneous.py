"""The strip test without a mesh: the specimen deforms uniformly, between two assumptions about its width.

``free``: no lateral stress and no shear stress, as far from the grips of an infinitely long strip; it contracts and,
off the yarn directions, shears. ``held``: the width stays and nothing shears, as between the grips of a very short
one. The held state is a displacement the gripped strip could take, so the work of a finite-element (or real elastic)
strip up to any elongation is never above that of ``held``: an exact upper bound. The free one is the limit of long
strips, not a bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mfar_fem.errors import InputError

LATERAL = {"free": "uniaxial", "held": "planar"}
"""Assumption about the width, and the mode of `mfar_fem.materials.homogeneous` it is."""


@dataclass(frozen=True)
class StripCurve:
    """Force–elongation curve of a strip.

    Attributes
    ----------
    angle : float
        Of the strip's axis from the warp, rad.
    lateral : {'free', 'held'}
    strain : (m,) array
        Engineering strain: elongation over gauge length.
    line_force : (m,) array
        Force by undeformed width, N/m.
    width : float or None
        m.
    lateral_strain : (m,) array
        Engineering strain across.
    converged : (m,) bool array
        False where the law locks or loses stability: the values there are those of the last state reached.
    names, sensitivity : tuple of str, (m, p) array
        Derivatives of `line_force` by law parameters.
    """

    angle: float
    lateral: str
    strain: np.ndarray
    line_force: np.ndarray
    width: float | None
    lateral_strain: np.ndarray
    converged: np.ndarray
    names: tuple[str, ...] = ()
    sensitivity: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def force(self) -> np.ndarray:
        """Force on the grip, N (needs `width`)."""
        if self.width is None:
            raise InputError("the force needs the width of the strip: force_curve(..., width=0.05)")
        return self.line_force * self.width


def force_curve(
    fabric,
    direction: str | float = "warp",
    strain: Sequence[float] | np.ndarray = (0.01, 0.02),
    lateral: str = "free",
    width: float | None = None,
    sensitivities: Sequence[str] = (),
    strict: bool = False,
) -> StripCurve:
    """Force by width against engineering strain.

    Parameters
    ----------
    fabric : Fabric
    direction : {'warp', 'weft', 'bias'} or float
        Of the strip's axis; a number is the angle from the warp, rad.
    strain : (m,) array_like
        Engineering strains, above -1.
    lateral : {'free', 'held'}
        See the module.
    width : float, optional
        m, for `StripCurve.force`.
    sensitivities : sequence of str
        Law parameters to differentiate by.
    strict : bool
        Raise NotConvergedError where a strain cannot be reached, instead of marking it.

    Raises
    ------
    InputError
        Unknown direction or assumption, width or strains out of range.
    NotConvergedError
        See `strict`.
    """
    from mfar_fem.materials import homogeneous

    if lateral not in LATERAL:
        raise InputError(f"the width of the strip is 'free' or 'held', not '{lateral}'")
    if width is not None and not (np.isfinite(width) and width > 0):
        raise InputError(f"the width of a strip must be positive, not {width} m")
    strain = np.atleast_1d(np.asarray(strain, dtype=float))
    response = homogeneous.respond(fabric.law, LATERAL[lateral], direction, 1.0 + strain, tuple(sensitivities), strict)
    scale = fabric.membrane_scale
    return StripCurve(
        angle=response.angle,
        lateral=lateral,
        strain=strain,
        line_force=scale * response.stress,
        width=width,
        lateral_strain=response.lateral - 1.0,
        converged=response.converged,
        names=response.names,
        sensitivity=scale * response.sensitivity,
    )


def curves(fabric, angle: float, strains, width: float) -> dict[str, dict[str, Any]]:
    """Both homogeneous curves as plain columns, for the payload of ``mfar test strip``.

    Parameters
    ----------
    fabric : Fabric
    angle : float
        Of the strip's axis from the warp, rad.
    strains : (m,) array_like
        Engineering strains.
    width : float
        m.

    Returns
    -------
    dict
        By lateral assumption (`LATERAL`): ``strain``, ``line_force_N_per_m``, ``force_N`` and ``lateral_strain``, (k,) each
        over the k <= m strains reached; ``converged``: whether all were.
    """
    columns = {}
    for lateral in LATERAL:
        curve = force_curve(fabric, angle, strains, lateral, width)
        good = curve.converged
        columns[lateral] = {
            "strain": curve.strain[good],
            "line_force_N_per_m": curve.line_force[good],
            "force_N": curve.force[good],
            "lateral_strain": curve.lateral_strain[good],
            "converged": bool(good.all()),
        }
    return columns
