"""One picture with many of the benchmark's, keypoints marked, for a person to judge."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from mfar_fem.files import replace_bytes

from .build import SHEET
from .index import BenchmarkIndex, Sample

LEFT, RIGHT = (40, 90, 255), (255, 40, 40)
"""Colours of the wearer's left and right points; hidden ones are rings."""


def marked(sample: Sample, height: int):
    """A sample's picture with its points, `height` pixels high (a PIL image)."""
    from PIL import Image, ImageDraw

    image = sample.image()
    factor = height / image.shape[0]
    picture = Image.fromarray(image).resize((round(image.shape[1] * factor), height), Image.Resampling.LANCZOS)
    pen = ImageDraw.Draw(picture)
    for i, (x, y) in enumerate((sample.keypoints + 0.5) * factor):
        if sample.present[i]:
            colour = RIGHT if i % 2 else LEFT
            pen.ellipse([x - 2.5, y - 2.5, x + 2.5, y + 2.5], outline=colour, fill=colour if sample.visible[i] else None)
    pen.text(
        (4, 3), f"{sample.identity} {sample.style} d{sample.damage}", fill=(255, 255, 255), stroke_width=1, stroke_fill=(0, 0, 0)
    )
    return picture


def contact_sheet(index: BenchmarkIndex, rows: int = 12, columns: int = 8, height: int = 232) -> Path:
    """Write ``contact_sheet.png`` into the benchmark: one identity a row, types and splits mixed.

    Parameters
    ----------
    index : BenchmarkIndex
    rows, columns : int
        Identities and pictures of each.
    height : int
        Pixels of one picture.

    Returns
    -------
    Path
    """
    from PIL import Image

    names = list(index.identities)
    chosen = [names[i] for i in np.unique(np.linspace(0, len(names) - 1, min(rows, len(names))).round().astype(int))]
    width = round(height * 384 / 512)
    sheet = Image.new("RGB", (columns * width, len(chosen) * height), (255, 255, 255))
    for r, name in enumerate(chosen):
        mine = [s for s in index.samples if s.identity == name]
        mine = mine[:3] + mine[4:] + mine[3:4] if len(mine) > columns else mine
        for c, sample in enumerate(mine[:columns]):
            sheet.paste(marked(sample, height), (c * width, r * height))
    data = io.BytesIO()
    sheet.save(data, format="PNG")
    path = index.root / SHEET
    replace_bytes(path, data.getvalue())
    return path
