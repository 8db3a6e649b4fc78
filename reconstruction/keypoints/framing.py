"""Which part of a picture the detector looks at: it knows pictures that are framed on one figure, as its training pictures are."""

from __future__ import annotations

from dataclasses import dataclass

from reconstruction.keypoints.crops import INPUT_SIZE

Box = tuple[float, float, float, float]


@dataclass(frozen=True)
class Framing:
    """How training pictures are framed about the garment's box, the box grown to the aspect of the network's input.

    Attributes
    ----------
    room : float
        Size of the picture over that of the box, median (a figure has a head and feet besides).
    most : float
        The largest.
    low : float
        Middle of the garment below that of the picture, over the picture's height, median.
    """

    room: float
    most: float
    low: float


TEXTILE = Framing(1.07, 1.25, 0.0)
FIGURE = Framing(1.44, 2.45, -0.06)
"""Of figures in a garment of unknown type."""
BY_TYPE = {
    "round-collar-robe": Framing(1.29, 1.75, 0.035),
    "half-sleeve": Framing(1.75, 2.45, -0.125),
    "flying-ribbon": Framing(1.39, 2.1, -0.067),
    "veil-hat": Framing(2.09, 3.45, -0.25),
}
"""Measured on `mfar benchmark-data --identities 70`: 90 to 180 figures of each type. (Hats are not in training pictures.)"""


def frame(kind: str, size: tuple[int, int], garment: Box | None = None, figure: Box | None = None,
          worn: str | None = None) -> Box | None:
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
    worn : str, optional
        Type of the garment.

    Returns
    -------
    (x0, y0, x1, y1) or None
        None for the whole picture: without any box, or where the garment fills the picture about as it does in training. The box
        may reach beyond the picture.
    """
    if figure is not None or garment is None:
        return figure
    how = TEXTILE if kind == "textile" else BY_TYPE.get(worn or "", FIGURE)
    tall = INPUT_SIZE[0] / INPUT_SIZE[1]
    height = max(garment[3] - garment[1], (garment[2] - garment[0]) * tall)
    if max(size[1], size[0] * tall) <= how.most * height:
        return None
    height *= how.room
    x, y = (garment[0] + garment[2]) / 2, (garment[1] + garment[3]) / 2 - how.low * height
    return (x - height / tall / 2, y - height / 2, x + height / tall / 2, y + height / 2)
