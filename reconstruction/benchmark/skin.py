"""Colours of the figure: face, hair, hands, under-dress."""

from __future__ import annotations

import numpy as np

HAIR = np.array([0.10, 0.09, 0.09])


def colour(position: np.ndarray, head: np.ndarray, stature: float, flesh, dress, skirt: bool = False) -> np.ndarray:
    """Colour of points on the figure.

    Parameters
    ----------
    position : (n, 3) array
        m.
    head : (3,) array
        Middle of the head, m.
    stature : float
        m.
    flesh, dress : (3,) arrays
        Colours, 0 to 1.
    skirt : bool
        Stripe what is below the waist.

    Returns
    -------
    (n, 3) array
    """
    local = (position - head) / stature
    x, y, z = local.T
    out = np.broadcast_to(np.asarray(dress, dtype=float), position.shape).copy()
    stripe = (
        skirt & (z < -0.32) & (np.arctan2(position[:, 0], -position[:, 1]) * (11 / np.pi) % 1.0 < 0.5)
    )  # pieced skirts of two colours
    out[stripe] = 0.45 * out[stripe] + 0.55 * np.asarray(flesh)
    bare = (z > -0.105) & (np.abs(x) < 0.075)
    out[bare] = flesh
    out[(z > -0.06) & (z > 0.024 + 0.9 * (-y - 0.02)) & (np.abs(x) < 0.08)] = HAIR
    for side in (-1.0, 1.0):
        eye = np.hypot((x - side * 0.018) / 1.8, z - 0.003) < 0.0033
        brow = np.hypot((x - side * 0.019) / 3.0, z - 0.013) < 0.0022
        out[(eye | brow) & (y < -0.02)] = HAIR
    out[(np.hypot(x / 1.7, z + 0.033) < 0.0045) & (y < -0.02)] = (0.62, 0.16, 0.14)
    return out
