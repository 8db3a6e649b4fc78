"""A form for experts: which features a garment has, by two of three votes.

One row a garment and feature; garments have letters, so that who fills it in does not see which method made which. The answers
(yes, no, or nothing) are read back with their line numbers.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mfar_fem.errors import DataFileError, InputError
from mfar_fem.tomlfile import suggest
from reconstruction.metrics.features import BY_NAME, FEATURES

EXPERTS = ("expert_1", "expert_2", "expert_3")
COLUMNS = ("garment", "feature", "group", "question", *EXPERTS)
ANSWERS = {"yes": True, "y": True, "1": True, "no": False, "n": False, "0": False, "": None}


def write_form(path: str | Path, garments: Sequence[str], seed: int = 0) -> dict[str, str]:
    """Write an empty form.

    Parameters
    ----------
    path : path-like
        CSV.
    garments : sequence of str
        What is to be judged, such as ``robe-1/restored``.
    seed : int
        Of the letters.

    Returns
    -------
    dict of str to str
        Garment by letter, to be kept from the experts.

    Raises
    ------
    InputError
        No garment, or one twice.
    """
    if not garments or len(set(garments)) != len(garments):
        raise InputError("a form needs garments, each once")
    order = np.random.default_rng(seed).permutation(len(garments))
    width = len(str(len(garments)))
    key = {f"G{i + 1:0{width}d}": garments[k] for i, k in enumerate(order)}
    with Path(path).open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(COLUMNS)
        for letter in key:
            writer.writerows([letter, f.name, f.group, f.question, "", "", ""] for f in FEATURES)
    return key


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
    try:
        stream = path.open(newline="", encoding="utf-8-sig")
    except OSError as error:
        raise DataFileError(f"cannot be read: {error.strerror or error}", path=path) from error
    out: dict[str, dict[str, bool | None]] = {}
    with stream:
        reader = csv.DictReader(stream)
        missing = [c for c in ("garment", "feature", *EXPERTS) if c not in (reader.fieldnames or [])]
        if missing:
            raise DataFileError(f"has no column {', '.join(missing)}; `write_form` makes one to fill in", path=path, line=1)
        for row in reader:
            line = reader.line_num
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
