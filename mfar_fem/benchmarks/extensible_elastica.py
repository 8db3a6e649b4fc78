r"""The exact cantilever of the shell's own theory: an elastica that may stretch, without shear.

With the stretch :math:`\lambda` and the slope :math:`\theta` as functions of the undeformed arc length S, the Koiter energy of a
strip with no lateral contraction is

.. math:: W = \int_0^L \tfrac18 EA\,(\lambda^2 - 1)^2 + \tfrac12 EI\,(\lambda\theta')^2\, dS - P z(L), \qquad
          x' = \lambda\cos\theta,\; z' = \lambda\sin\theta ,

the curvature change being that of the second fundamental form. Stationarity, with :math:`m = EI\lambda\theta'`, gives

.. math:: (\lambda m)' = -P\lambda\cos\theta, \qquad m(L) = 0, \qquad
          \tfrac12 EA\,\lambda(\lambda^2 - 1) + \frac{m^2}{EI\,\lambda} = P\sin\theta .

:math:`EA \to \infty` is Euler's elastica. Solved by shooting on the moment at the clamp.
"""

from __future__ import annotations

import numpy as np


def stretch(m: float, theta: float, P: float, EI: float, EA: float) -> float:
    """Stretch λ of a section from its moment and slope: Newton from 1."""
    lam = 1.0
    for _ in range(50):
        f = 0.5 * lam * (lam * lam - 1.0) + (m * m / (EI * lam) - P * np.sin(theta)) / EA
        step = f / (1.5 * lam * lam - 0.5 - m * m / (EI * EA * lam * lam))
        lam -= step
        if abs(step) < 1e-15:
            break
    return lam


def cantilever(P: float, L: float, EI: float, EA: float = np.inf) -> tuple[float, float]:
    """Shortening and deflection (m) of the tip of a cantilever under the dead transverse end force P.

    Parameters
    ----------
    P : float
        N, of the order of EI/L² (a few times).
    L : float
        m.
    EI : float
        N·m².
    EA : float
        N; infinite for the inextensible elastica.

    Returns
    -------
    (float, float)
        ``-U`` and ``W``, to about 1e-10 of L.
    """
    from scipy.integrate import solve_ivp
    from scipy.optimize import brentq

    def rates(s, y):  # y = theta, lambda m, x, z
        theta, lam = y[0], 1.0
        if np.isfinite(EA):
            for _ in range(3):  # lambda enters its own equation through m = y1 / lambda: a fast contraction
                lam = stretch(y[1] / lam, theta, P, EI, EA)
        return [y[1] / (EI * lam * lam), -P * lam * np.cos(theta), lam * np.cos(theta), lam * np.sin(theta)]

    def shoot(m0):
        return solve_ivp(rates, (0.0, L), [0.0, m0, 0.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-13 * L).y[:, -1]

    guess = P * L
    m0 = brentq(lambda m: shoot(m)[1], 0.05 * guess, 1.0 * guess, xtol=1e-13 * guess, rtol=1e-14)
    _, _, x, z = shoot(m0)
    return float(L - x), float(z)
