"""Which part of a picture the detector looks at: it knows pictures that are framed on one figure, as its training pictures are."""

from __future__ import annotations

import numpy as np

from reconstruction.keypoints.crops import crop_matrix, image_box

Box = tuple[float, float, float, float]
ROOM = {"textile": 1.07, "figurine": 1.47, "mural": 1.47}
"""Size of the frame over that of the garment's box: median of the training pictures (a figure has a head and feet besides)."""
MOST_ROOM = {"textile": 1.25, "figurine": 2.1, "mural": 2.1}
"""The same where 97.5 % of the training pictures are below: a picture up to this is looked at as it is."""
OFF_CENTRE = 40.0
"""Distance of the garment's middle from the frame's, pixels of the 256 × 192 input, that training pictures do not exceed."""


def frame(kind: str, size: tuple[int, int], garment: Box | None = None, figure: Box | None = None) -> Box | None:
    """The box to look at.

    Parameters
    ----------
    kind : str
        ``mural``, ``figurine`` or ``textile``.
    size : (int, int)
        Width and height of the picture, px.
    garment : (x0, y0, x1, y1), optional
        Box of the garment's mask.
    figure : (x0, y0, x1, y1), optional
        Box of the figure with head and feet (of a textile of all of it), if somebody drew one: it is taken as it is.

    Returns
    -------
    (x0, y0, x1, y1) or None
        None for the whole picture: without any box, or where the garment fills the picture about as it does in training. The box
        may reach beyond the picture.
    """
    if figure is not None or garment is None:
        return figure
    width, height = size
    whole, tight = crop_matrix(image_box((height, width)), 0.0)[0, 0], crop_matrix(garment, 0.0)[0, 0]
    middle = np.array([garment[0] + garment[2], garment[1] + garment[3]]) / 2
    off = whole * np.abs(middle - (np.array(size) - 1) / 2).max()
    if tight / whole <= MOST_ROOM[kind] and off <= OFF_CENTRE:
        return None
    half = np.array([garment[2] - garment[0], garment[3] - garment[1]]) * ROOM[kind] / 2
    return (*(middle - half), *(middle + half))
