"""Fills the page: one HTML file with everything in it."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from mfar_fem.errors import InputError
from reconstruction.report.content import Cost, Evidence, ReportContent, Table
from reconstruction.report.packing import MAX_FACES, packed
from reconstruction.report.pictures import data_uri
from reconstruction.report.still import still

HERE = Path(__file__).parent
MAX_MB = 40.0
"""Size of the page; a larger one is refused."""


def write_report(content: ReportContent, path: str | Path, most_faces: int = MAX_FACES, max_MB: float = MAX_MB) -> Path:
    """Write a report.

    Parameters
    ----------
    content : ReportContent
    path : path-like
        The HTML file; its folder is made. Written as a whole or not at all. The same content gives the same bytes.
    most_faces : int
        Models of more triangles are simplified for the page, and that is said there.
    max_MB : float
        Largest size of the page, 10⁶ bytes.

    Returns
    -------
    Path

    Raises
    ------
    DataFileError, InputError
        A picture cannot be read; the page would be larger than `max_MB` (the message names its largest parts).
    """
    path = Path(path)
    data = render(content, most_faces).encode("utf-8")
    if len(data) > 1e6 * max_MB:
        raise InputError(f"the report would have {len(data) / 1e6:.1f} MB, {max_MB:g} are allowed; largest parts: "
                         f"{_largest(content, most_faces)}. Give smaller pictures or lower most_faces")  # fmt: skip
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(path.name + ".part")
    partial.write_bytes(data)
    partial.replace(path)
    return path


def render(content: ReportContent, most_faces: int = MAX_FACES) -> str:
    """The page of a report as text; see :func:`write_report`."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    from mfar_fem import __version__

    page = Environment(loader=FileSystemLoader(HERE), autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    page.filters |= {
        "uri": data_uri, "cell": cell, "numeric": numeric, "paragraphs": paragraphs,
        "tenth": lambda x: cell(None if x is None else f"{x:.1f}"), "whole": lambda x: cell(None if x is None else f"{x:.0f}"),
    }  # fmt: skip
    links = [(f"section-{i}", s.title) for i, s in enumerate(content.sections, 1)]
    links = ([("models", "Models")] if content.models else []) + links
    links += [("evidence", "Evidence and prior")] if content.evidence else []
    links += [("costs", "Costs")] if content.costs else []
    links += [("provenance", "How this was made")] if content.provenance else []
    models = packed(content.models, content.backdrop, most_faces) if content.models else {}
    largest = max((max(m["size"]) for m in models.get("models", [])), default=0.0)
    return page.get_template("report.html.j2").render(
        c=content, links=links, version=__version__, style=Markup((HERE / "style.css").read_text(encoding="utf-8")),
        script=Markup((HERE / "viewer.js").read_text(encoding="utf-8")),
        models=Markup(json.dumps(models, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")),
        fallback=still(content.models[-1].mesh, content.backdrop) if content.models else b"",
        rounding=f"{1000 * largest / 131070:.2g}", evidence=grouped(content.evidence), total=_total(content.costs),
    )  # fmt: skip


def cell(value: object) -> str:
    """A value of a table as text: four digits, a dash for None and NaN."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float) or hasattr(value, "dtype"):
        number = float(value)  # type: ignore[arg-type]
        if number.is_integer() and abs(number) < 1e6:
            return f"{number:.0f}"
        return f"{number:.4g}"
    return str(value)


def numeric(table: Table) -> set[int]:
    """Columns that hold numbers or nothing, set to the right."""
    def number(value: object) -> bool:
        return value is None or hasattr(value, "dtype") or (isinstance(value, int | float) and not isinstance(value, bool))

    return {i for i in range(len(table.columns))
            if all(number(r[i]) for r in table.rows) and any(r[i] is not None for r in table.rows)}  # fmt: skip


def paragraphs(text: str) -> list[str]:
    """Parts of a text between empty lines."""
    return [p.strip() for p in text.split("\n\n") if p.strip()]


def grouped(entries: Sequence[Evidence]) -> list[dict[str, Any]]:
    """Shares by what they are of, in the order given: ``what``, ``evidence``, ``prior``, ``unknown`` (the rest), ``detail``."""
    found: dict[str, dict[str, Any]] = {}
    for e in entries:
        row = found.setdefault(e.what, {"what": e.what, "evidence": 0.0, "prior": 0.0, "detail": []})
        row[e.source] += e.share
        if e.detail:
            row["detail"].append(e.detail)
    return [row | {"unknown": max(0.0, 1 - row["evidence"] - row["prior"])} for row in found.values()]


def _total(costs: Sequence[Cost]) -> SimpleNamespace:
    cpu = [k.cpu_s for k in costs if k.cpu_s is not None]
    peak = [k.peak_MB for k in costs if k.peak_MB is not None]
    return SimpleNamespace(
        seconds=sum(k.seconds for k in costs), cpu_s=sum(cpu) if len(cpu) == len(costs) and cpu else None,
        peak_MB=max(peak, default=None), cached=any(k.cached for k in costs),
    )  # fmt: skip


def _largest(content: ReportContent, most_faces: int) -> str:
    sizes = [(len(json.dumps(m)), f"model '{m['name']}'") for m in packed(content.models, None, most_faces)["models"]] \
        if content.models else []  # fmt: skip
    for s in content.sections:
        sizes += [(len(data_uri(p.data)), f"picture '{p.alt[:40]}' of '{s.title}'") for p in s.pictures]
    return ", ".join(f"{name} {size / 1e6:.1f} MB" for size, name in sorted(sizes, reverse=True)[:3])
