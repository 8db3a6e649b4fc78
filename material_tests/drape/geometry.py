"""The Cusick specimen: a round cloth on a smaller disc, its sizes by the standards, and the ring of it that is free to drape."""

from __future__ import annotations

from dataclasses import dataclass

from mfar_fem.errors import InputError, UnknownNameError
from mfar_fem.loads import gravity
from mfar_fem.solve.rest import resting_problem
from mfar_fem.supports import Clamp
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import annulus

SIZES = {
    "iso-24": (0.24, 0.18, "ISO 9073-9"),
    "iso-30": (0.30, 0.18, "ISO 9073-9"),
    "iso-36": (0.36, 0.18, "ISO 9073-9"),
    "jis-254": (0.254, 0.127, "JIS L 1096"),
}
"""Diameters of specimen and disc, m, and the standard: 24 cm for limp cloth, 36 cm for stiff cloth, 30 cm between."""

CELLS = {"draft": (7, 144), "standard": (10, 192), "reference": (14, 288)}
"""Cells across the ring of the 30 cm specimen and round it, each cut into two order-2 triangles."""

GRADING = 8.0
"""Width of the outermost cells over that of the innermost: half of the bending energy lies within 1 cm of the disc, where cloth
that hardly stretches turns over the edge within a few millimetres."""


@dataclass(frozen=True)
class DrapeTest:
    """A specimen and the mesh it is computed on.

    Parameters
    ----------
    size : str
        A key of :data:`SIZES`.
    fidelity : {'draft', 'standard', 'reference'}
    cells : (int, int), optional
        Cells across the ring and round it, instead of those of the fidelity.

    Raises
    ------
    UnknownNameError, InputError
    """

    size: str = "iso-30"
    fidelity: str = "standard"
    cells: tuple[int, int] | None = None

    def __post_init__(self):
        if self.size not in SIZES:
            raise UnknownNameError(f"no drape specimen '{self.size}'; choose one of {', '.join(SIZES)}")
        if self.fidelity not in CELLS:
            raise UnknownNameError(f"no fidelity '{self.fidelity}'; choose one of {', '.join(CELLS)}")
        if self.cells is not None and not (self.cells[0] >= 1 and self.cells[1] >= 8):
            raise InputError(f"a drape needs at least 1 cell across and 8 round the ring, not {self.cells}")

    @property
    def specimen_radius(self) -> float:
        """m."""
        return 0.5 * SIZES[self.size][0]

    @property
    def disc_radius(self) -> float:
        """m."""
        return 0.5 * SIZES[self.size][1]

    @property
    def standard(self) -> str:
        """The standard whose specimen this is."""
        return SIZES[self.size][2]

    @property
    def mesh(self) -> tuple[int, int]:
        """Cells across the ring and round it."""
        return self.cells or CELLS[self.fidelity]

    def surface(self) -> Surface:
        """The flat ring between disc and edge, order 2; warp along x, finer towards the disc; sides ``inner`` and ``outer``."""
        ring = annulus(self.disc_radius, self.specimen_radius, *self.mesh, pattern="union", grading=GRADING)
        return Surface.from_pattern(ring, 2)

    def problem(self, fabric, loads=()):
        """The ring, clamped level at the disc, under its own weight (and ``loads``), for :func:`mfar_fem.solve.rest.relax`."""
        return resting_problem(self.surface(), fabric, [Clamp("inner")], [gravity(fabric.areal_density), *loads])
