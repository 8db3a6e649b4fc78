"""What a report holds: plain frozen values that the stages fill in; nothing here computes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from mfar_fem.errors import InputError
from reconstruction.surface.triangles import TriangleMesh

SOURCES = ("evidence", "prior")
"""Where a part of the result comes from: pictures and finds, or what was assumed."""


@dataclass(frozen=True)
class Picture:
    """A picture of a section.

    Attributes
    ----------
    data : bytes or Path
        PNG, JPEG or SVG, as content or as a file.
    alt : str
        What it shows, in words, for who cannot see it; required.
    caption : str
        Below it.
    narrow : bytes or Path, optional
        The same for screens of up to 600 px.

    Raises
    ------
    InputError
        No `alt`.
    """

    data: bytes | Path
    alt: str
    caption: str = ""
    narrow: bytes | Path | None = None

    def __post_init__(self):
        if not self.alt.strip():
            raise InputError(f"the picture '{self.caption or self.data!r:.60}' has no alternative text; say in words what it shows")


@dataclass(frozen=True)
class Table:
    """A table; floats are shown with four digits, None as a dash.

    Attributes
    ----------
    columns : sequence of str
        Heads, with their units.
    rows : sequence of sequences
        str, int, float, bool or None; the first of each is the head of its row.
    caption : str
        Above it.

    Raises
    ------
    InputError
        No columns, or a row of another length.
    """

    columns: Sequence[str]
    rows: Sequence[Sequence[object]]
    caption: str = ""

    def __post_init__(self):
        if not self.columns:
            raise InputError(f"the table '{self.caption}' has no columns")
        for i, row in enumerate(self.rows):
            if len(row) != len(self.columns):
                raise InputError(f"row {i} of the table '{self.caption}' has {len(row)} values for {len(self.columns)} columns")


@dataclass(frozen=True)
class Section:
    """A section of the report: text, pictures, tables, then notes (limits, what failed) in a box.

    `text` has paragraphs parted by empty lines; it is plain text.
    """

    title: str
    text: str = ""
    pictures: Sequence[Picture] = ()
    tables: Sequence[Table] = ()
    notes: Sequence[str] = ()

    def __post_init__(self):
        if not self.title.strip():
            raise InputError("a section has no title")


@dataclass(frozen=True, eq=False)
class Scalar:
    """A quantity at the vertices of a model, shown as colour.

    Attributes
    ----------
    label, unit : str
        For the legend.
    values : (nv,) array
        In `unit`; NaN is grey.
    low, high : float, optional
        Ends of the scale; by default the least and the largest value. What lies outside has the colour of the end.
    """

    label: str
    values: np.ndarray
    unit: str = ""
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True, eq=False)
class Model:
    """A surface that can be turned.

    Attributes
    ----------
    name : str
        In the list of models.
    mesh : TriangleMesh
        m; z is up and the front faces -y.
    scalars : sequence of Scalar
    lines : (n, 2, 3) array, optional
        Ends of strokes, m, such as :func:`reconstruction.report.strokes.warp_strokes` makes.
    lines_label : str
        What they are.
    note : str
        Below the model.

    Raises
    ------
    InputError
        An empty mesh, lines of another shape, or not as many values as vertices.
    """

    name: str
    mesh: TriangleMesh
    scalars: Sequence[Scalar] = ()
    lines: np.ndarray | None = None
    lines_label: str = "warp"
    note: str = ""

    def __post_init__(self):
        if not len(self.mesh.faces):
            raise InputError(f"the model '{self.name}' has no triangles")
        for s in self.scalars:
            if np.shape(s.values) != (len(self.mesh.vertices),):
                raise InputError(f"'{s.label}' of the model '{self.name}' has values of shape {np.shape(s.values)}; "
                                 f"({len(self.mesh.vertices)},) is needed, one a vertex")  # fmt: skip
        if self.lines is not None and (np.ndim(self.lines) != 3 or np.shape(self.lines)[1:] != (2, 3)):
            raise InputError(f"the lines of the model '{self.name}' have shape {np.shape(self.lines)}; (n, 2, 3) is needed")
        if self.lines is not None and not np.isfinite(self.lines).all():
            raise InputError(f"the lines of the model '{self.name}' hold coordinates that are not finite")


@dataclass(frozen=True)
class Cost:
    """What a stage cost: wall time and processor time, s; peak of memory, MB; whether a kept result was taken instead."""

    stage: str
    seconds: float
    cpu_s: float | None = None
    peak_MB: float | None = None
    cached: bool = False


@dataclass(frozen=True)
class Evidence:
    """How much of something rests on what.

    Attributes
    ----------
    what : str
        A dimension, a part of the surface, the warp field. Several entries may name the same thing.
    share : float
        0 to 1.
    source : str
        ``evidence`` or ``prior``.
    detail : str
        Which pictures, which assumption.

    Raises
    ------
    InputError
        Another source, or a share outside 0 to 1.
    """

    what: str
    share: float
    source: str
    detail: str = ""

    def __post_init__(self):
        if self.source not in SOURCES:
            raise InputError(f"the source of '{self.what}' is '{self.source}'; it must be one of {', '.join(SOURCES)}")
        if not 0 <= self.share <= 1:
            raise InputError(f"the share of '{self.what}' is {self.share}; it must lie between 0 and 1")


@dataclass(frozen=True, eq=False)
class ReportContent:
    """All of a report.

    Attributes
    ----------
    title, garment : str
    summary : str
        The result in a few plain sentences, above all else.
    facts : mapping of str to str
        Label to value, shown large.
    sections : sequence of Section
    models : sequence of Model
        Shown in the order of the stages; the view begins with the last one.
    backdrop : TriangleMesh, optional
        Shown behind every model, such as the figure that wears the garment.
    costs : sequence of Cost
    evidence : sequence of Evidence
    notes : sequence of str
        What the reader must know before believing anything; a box on top.
    provenance : mapping of str to str
        Versions, seeds, settings, date, licences of the sources.
    """

    title: str
    garment: str
    summary: str = ""
    facts: Mapping[str, str] = field(default_factory=dict)
    sections: Sequence[Section] = ()
    models: Sequence[Model] = ()
    backdrop: TriangleMesh | None = None
    costs: Sequence[Cost] = ()
    evidence: Sequence[Evidence] = ()
    notes: Sequence[str] = ()
    provenance: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self):
        if not self.title.strip():
            raise InputError("the report has no title")
        names = [m.name for m in self.models]
        if len(set(names)) != len(names):
            raise InputError(f"models need different names, not {', '.join(names)}")
        total = dict.fromkeys((e.what for e in self.evidence), 0.0)
        for e in self.evidence:
            total[e.what] += e.share
            if total[e.what] > 1 + 1e-6:
                raise InputError(f"the shares of '{e.what}' sum to more than one ({total[e.what]:.3g})")
