"""Sheets of pictures in rows and columns, to be looked at."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def save_sheet(rows: Sequence[Sequence[np.ndarray]], columns: Sequence[str], path, names: Sequence[str] = (),
               cell: float = 1.35) -> None:
    """Write pictures as a PNG.

    Parameters
    ----------
    rows : sequence of rows of (h, w, 3) uint8 arrays
    columns, names : sequence of str
        Titles of the columns, and of the rows.
    path : path-like
    cell : float
        Side of a picture on the sheet, inches.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(cell * len(columns) + 0.4, cell * len(rows) + 0.3), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(rows), len(columns), squeeze=False)
    for i, row in enumerate(rows):
        for j, picture in enumerate(row):
            axis = axes[i, j]
            axis.imshow(picture, interpolation="nearest")
            axis.set_xticks([])
            axis.set_yticks([])
            axis.spines[:].set_visible(False)
            if i == 0:
                axis.set_title(columns[j], fontsize=7)
            if j == 0 and names:
                axis.set_ylabel(names[i], fontsize=7)
    figure.savefig(path, dpi=150)
