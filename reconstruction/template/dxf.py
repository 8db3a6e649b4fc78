"""A pattern as DXF in millimetres, layers after ASTM D6673 (the successor of the AAMA format)."""

from __future__ import annotations

from mfar_fem.errors import MissingDependencyError
from reconstruction.template.layout import arrange
from reconstruction.template.panel import Pattern
from reconstruction.template.svg import arrow

LAYERS = {
    "CUT": (7, "cut line (ASTM D6673 layer 1, piece boundary)"),
    "NOTCH": (3, "notches (layer 4)"),
    "GRAIN": (5, "grain line, the warp (layer 7)"),
    "SEW": (1, "sewing line (layer 14)"),
    "TEXT": (8, "names (layer 15, annotation)"),
}
"""Layers: colour and meaning. The numbers are those of the standard; the file is plain DXF, not certified ASTM."""


def write_dxf(path, pattern: Pattern) -> None:
    """Write the drawing.

    Raises
    ------
    MissingDependencyError
        ezdxf is not installed.
    """
    try:
        import ezdxf
        from ezdxf import units
        from ezdxf.enums import TextEntityAlignment
    except ImportError as error:
        raise MissingDependencyError("writing DXF needs ezdxf: pip install 'mfar-fem[recon]'") from error
    document = ezdxf.new("R2010", units=units.MM)  # sets $INSUNITS to 4
    document.header["$MEASUREMENT"] = 1
    for name, (colour, meaning) in LAYERS.items():
        document.layers.add(name, color=colour).description = meaning
    space = document.modelspace()
    for placed in arrange(pattern):
        for layer, polygon in (("CUT", placed.cut), ("SEW", placed.sew)):
            space.add_lwpolyline((1000 * polygon).tolist(), close=True, dxfattribs={"layer": layer})
        space.add_lwpolyline(arrow(1000 * placed.grain).tolist(), dxfattribs={"layer": "GRAIN"})
        for a, b in 1000 * placed.notches:
            space.add_line(tuple(a), tuple(b), dxfattribs={"layer": "NOTCH"})
        text = space.add_text(placed.panel.name, height=700 * placed.text_height, dxfattribs={"layer": "TEXT"})
        align = TextEntityAlignment.CENTER if placed.text_centred else TextEntityAlignment.LEFT
        text.set_placement(tuple(1000 * placed.text), align=align)
    document.saveas(path)
