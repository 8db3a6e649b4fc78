r"""The scaling laws of wrinkle wavelength and amplitude.

Sheared strip between clamped long edges, height H, thickness t, shear :math:`\gamma = \delta/H` (ref. 1): the half wavelength

.. math:: \lambda = \frac{\sqrt{\pi H t}}{[3(1-\nu^2)\gamma]^{1/4}}, \qquad A = \frac{\lambda}{\pi}\sqrt{2(1-\nu)\gamma},

wrinkles at 45°. Stretched sheet between clamped short edges (refs. 2, 3): the full wavelength of a sheet of length L, bending
stiffness B and tension T per width

.. math:: \lambda = 2\sqrt\pi\,(B/T)^{1/4} L^{1/2} .

References
----------
1. Y. W. Wong, S. Pellegrino, "Wrinkled membranes Part II: analytical models", J. Mech. Mater. Struct. 1 (2006) 27–61,
   doi 10.2140/jomms.2006.1.27.
2. E. Cerda, L. Mahadevan, "Geometry and physics of wrinkling", Phys. Rev. Lett. 90 (2003) 074302,
   doi 10.1103/PhysRevLett.90.074302.
3. E. Cerda, K. Ravi-Chandar, L. Mahadevan, "Wrinkling of an elastic sheet under tension", Nature 419 (2002) 579–580,
   doi 10.1038/419579b.
"""

from __future__ import annotations

import math

from mfar_fem.errors import ParameterError


def sheared(height: float, thickness: float, shear: float, nu: float) -> tuple[float, float]:
    """Half wavelength and amplitude, m, of a strip (m) at a shear ``delta/height``.

    Raises
    ------
    ParameterError
        A length or the shear is not positive.
    """
    if not min(height, thickness, shear) > 0:
        raise ParameterError(f"height, thickness and shear must be positive, not {height} m, {thickness} m, {shear}")
    half = math.sqrt(math.pi * height * thickness) / (3.0 * (1.0 - nu**2) * shear) ** 0.25
    return half, half / math.pi * math.sqrt(2.0 * (1.0 - nu) * shear)


def stretched(length: float, thickness: float, strain: float, nu: float) -> float:
    """Full wavelength, m, of a linear elastic sheet (m) at an engineering strain: B = E h³/(12 (1 - nu²)), T = E h strain.

    Raises
    ------
    ParameterError
        A length or the strain is not positive.
    """
    if not min(length, thickness, strain) > 0:
        raise ParameterError(f"length, thickness and strain must be positive, not {length} m, {thickness} m, {strain}")
    ratio = thickness**2 / (12.0 * (1.0 - nu**2) * strain)
    return 2.0 * math.sqrt(math.pi) * ratio**0.25 * math.sqrt(length)
