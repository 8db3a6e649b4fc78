"""A form for experts: which features a garment has, by two of three votes.

One row a garment and feature; garments have letters, so that who fills it in does not see which method made which, nor which is
the true garment. A letter follows from the garment's name and the contents of its mesh: it is the same in every run, a mesh that
changed is another garment, and a form is extended without touching what was filled in. The questions of texture are left out: the
meshes have no colours. The answers (yes, no, or nothing) are read back with their line numbers.
"""

from __future__ import annotations

import csv
import hashlib
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import DataFileError, InputError
from mfar_fem.files import replace_bytes
from mfar_fem.tomlfile import suggest
from reconstruction.metrics.features import BY_NAME, FEATURES, GROUPS, TEXTURE, agreement, chance
from reconstruction.style.bootstrap import ratio_interval

EXPERTS = ("expert_1", "expert_2", "expert_3")
COLUMNS = ("garment", "feature", "group", "question", *EXPERTS)
ANSWERS = {"yes": True, "y": True, "1": True, "no": False, "n": False, "0": False, "": None}
ASKED = tuple(f for f in FEATURES if f.group != TEXTURE)
"""What can be told from a bare mesh."""
TRUE = "true"
"""Method of the true garments."""
LEAST = 3
"""Garments from which on a rate has an interval."""


def letter(name: str, contents: str) -> str:
    """What a garment is called in the form: from its name and a digest of its mesh."""
    return "G" + hashlib.sha256(f"{name} {contents}".encode()).hexdigest()[:8]


def write_form(path: str | Path, letters: Sequence[str]) -> list[str]:
    """Write an empty form, or extend one.

    Parameters
    ----------
    path : path-like
        CSV. Rows of a form that is there stay if anything was answered of their garment; rows of other garments that are not
        asked for any more go.
    letters : sequence of str
        Of the garments to be judged; they are asked in the order of their letters.

    Returns
    -------
    list of str
        Letters in the form that were not asked for: garments of an earlier mesh that have answers.

    Raises
    ------
    InputError
        No garment, or one twice.
    DataFileError
        The form that is there has not the columns of one.
    """
    if not letters or len(set(letters)) != len(letters):
        raise InputError("a form needs garments, each once")
    path = Path(path)
    kept: dict[str, list[dict[str, str | None]]] = {}
    for _, row in _rows(path) if path.exists() else []:
        kept.setdefault((row["garment"] or "").strip(), []).append(row)
    answered = {name: rows for name, rows in kept.items() if any((row[e] or "").strip() for row in rows for e in EXPERTS)}
    stream = io.StringIO(newline="")
    writer = csv.DictWriter(stream, COLUMNS, restval="", extrasaction="ignore")
    writer.writeheader()
    for name in sorted({*letters, *answered}):
        empty = [[name, f.name, f.group, f.question] for f in ASKED]
        writer.writerows(answered[name] if name in answered else (dict(zip(COLUMNS, row, strict=False)) for row in empty))
    replace_bytes(path, stream.getvalue().encode())
    return sorted(answered.keys() - set(letters))


def _rows(path: Path) -> list[tuple[int, dict[str, str | None]]]:
    """Rows of a form with their line numbers."""
    try:
        stream = path.open(newline="", encoding="utf-8-sig")
    except OSError as error:
        raise DataFileError(f"cannot be read: {error.strerror or error}", path=path) from error
    with stream:
        reader = csv.DictReader(stream)
        missing = [c for c in ("garment", "feature", *EXPERTS) if c not in (reader.fieldnames or [])]
        if missing:
            raise DataFileError(f"has no column {', '.join(missing)}; `mfar study restore` makes a form", path=path, line=1)
        return [(reader.line_num, row) for row in reader]


def read_form(path: str | Path) -> dict[str, dict[str, bool | None]]:
    """Read a filled form.

    Returns
    -------
    dict of str to dict
        Answers by letter and feature: what at least two experts say; None where no two agree.

    Raises
    ------
    DataFileError
        A column is missing, a feature unknown or asked twice, or an answer is neither yes nor no; names line and column.
    """
    path = Path(path)
    out: dict[str, dict[str, bool | None]] = {}
    for line, row in _rows(path):
        name = (row["feature"] or "").strip()
        if name not in BY_NAME:
            hint = suggest(name, list(BY_NAME))
            raise DataFileError(f"unknown feature '{name}'{hint}", path=path, line=line, column="feature")
        answers = out.setdefault((row["garment"] or "").strip(), {})
        if name in answers:
            raise DataFileError(f"'{name}' is asked twice of this garment", path=path, line=line, column="feature")
        votes = [_answer(row[e], path, line, e) for e in EXPERTS]
        answers[name] = next((v for v in (True, False) if votes.count(v) >= 2), None)
    return out


def _answer(text: str | None, path: Path, line: int, column: str) -> bool | None:
    word = (text or "").strip().lower()
    if word not in ANSWERS:
        raise DataFileError(f"'{text}' is neither yes nor no (nothing: no answer)", path=path, line=line, column=column)
    return ANSWERS[word]


def rates(answers: Mapping[str, Mapping[str, bool | None]], key: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """How often the experts say the same of a restored garment as of the true one.

    Parameters
    ----------
    answers : mapping
        Of :func:`read_form`.
    key : mapping
        By letter ``garment`` (its type), ``case`` and ``method`` (:data:`TRUE` for true garments).

    Returns
    -------
    dict
        ``rates``: rows of ``method``, ``group``, ``agree``, ``asked`` (features that two of three experts answered alike of both),
        ``garments``, ``rate``, its 95 % interval ``low`` and ``high`` (None with fewer than three garments) and ``chance``, the
        rate of two different true garments of a type (None where no type has two); all of them in %. ``garments``: judged ones
        with an answer; ``unknown``: letters that the key does not have.
    """
    given = {name: found for name, found in answers.items() if any(v is not None for v in found.values())}
    known = {name: key[name] for name in given if name in key}
    true = {entry["case"]: given[name] for name, entry in known.items() if entry["method"] == TRUE}
    types = {entry["case"]: entry["garment"] for entry in known.values()}
    levels = [chance(some) for kind in sorted(set(types.values())) if len(some := [true[c] for c in true if types[c] == kind]) > 1]
    rows: list[dict[str, Any]] = []
    for method in sorted({entry["method"] for entry in known.values()} - {TRUE}):
        pairs = [(entry["case"], agreement(given[name], true[entry["case"]])) for name, entry in known.items()
                 if entry["method"] == method and entry["case"] in true]  # fmt: skip
        for group in GROUPS:
            found = [(case, *both[group]) for case, both in pairs if both[group][1]]
            if not found:
                continue
            cases, same, asked = ([row[i] for row in found] for i in range(3))
            interval = ratio_interval(np.array(same), np.array(asked), np.array(cases))
            wide = len(set(cases)) >= LEAST
            level = [some[group] for some in levels if group in some]
            rows.append({"method": method, "group": group, "agree": sum(same), "asked": sum(asked), "garments": len(set(cases)),
                         "rate": 100 * interval.value, "low": 100 * interval.low if wide else None,
                         "high": 100 * interval.high if wide else None,
                         "chance": 100 * float(np.mean(level)) if level else None})  # fmt: skip
    return {"rates": rows, "garments": len(known), "unknown": sorted(given.keys() - key.keys())}
