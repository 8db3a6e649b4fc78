"""Printing: JSON of anything a command returns, tables, progress, and the output folder."""

from __future__ import annotations

import dataclasses
import enum
import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mfar_fem.cli import console
from mfar_fem.errors import InputError, SurfaceError


@dataclasses.dataclass
class Point:
    x: float
    tags: tuple[str, ...]


class Colour(enum.Enum):
    RED = "red"


class Report:
    def to_dict(self):
        return {"rmse": np.float32(0.5)}


def test_everything_a_result_holds_becomes_plain_json():
    payload = {
        "array": np.array([[1.0, np.nan], [np.inf, 2.0]]),
        "scalar": np.float64(3.0),
        "count": np.int64(4),
        "flag": np.bool_(True),
        "none": None,
        "nan": math.nan,
        "path": Path("a") / "b.toml",
        "point": Point(1.0, ("a", "b")),
        "colour": Colour.RED,
        "report": Report(),
        3: {1.5},
    }
    expected = {
        "array": [[1.0, None], [None, 2.0]],
        "scalar": 3.0,
        "count": 4,
        "flag": True,
        "none": None,
        "nan": None,
        "path": str(Path("a") / "b.toml"),
        "point": {"x": 1.0, "tags": ["a", "b"]},
        "colour": "red",
        "report": {"rmse": 0.5},
        "3": [1.5],
    }
    assert console.jsonable(payload) == expected


def test_what_has_no_json_form_is_named():
    with pytest.raises(TypeError, match=r"payload\.a\[1\] is a object"):
        console.jsonable({"a": [1, object()]})


values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=10,
)


@settings(deadline=None, max_examples=50)
@given(values)
def test_jsonable_is_strict_json_and_changes_nothing_that_is_json_already(value):
    plain = console.jsonable(value)
    assert json.loads(json.dumps(plain, allow_nan=False)) == plain
    assert console.jsonable(plain) == plain


def test_emit_renders_for_people_or_prints_one_object(capsys):
    from rich.table import Table

    def render(payload):
        table = Table("name")
        table.add_row(payload["name"])
        return [table, None, f"[bold]{payload['name']}[/bold] done"]

    console.emit({"name": "silk"}, False, render)
    shown = capsys.readouterr().out
    assert "│ silk │" in shown and "silk done" in shown
    console.emit({"name": "silk", "x": math.inf}, True, render)
    assert json.loads(capsys.readouterr().out) == {"name": "silk", "x": None}
    console.emit({"name": "silk"}, False)
    assert json.loads(capsys.readouterr().out) == {"name": "silk"}


def test_error_payload_carries_ids():
    error = console.error_payload(SurfaceError("degenerate triangle", ids=np.array([3, 7])), 2)["error"]
    assert console.jsonable(error["ids"]) == [3, 7]
    assert error["message"] == "degenerate triangle"


def test_error_text_is_not_markup(capsys):
    console.report_error(InputError("unknown key 'a' in [law]; see [bold]"), 2, False)
    assert "error: unknown key 'a' in [law]; see [bold]" in capsys.readouterr().err


def test_progress_is_silent_where_stderr_is_no_terminal(capsys):
    with console.progress("fitting", total=3) as advance:
        advance()
        advance(2, description="refining")
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.strip() == ""


def test_output_folder_is_made_and_left_empty(tmp_path):
    folder = console.check_writable(tmp_path / "a" / "b")
    assert folder.is_dir() and list(folder.iterdir()) == []


def test_output_folder_that_cannot_be_written_fails_before_computing(tmp_path):
    (tmp_path / "file").write_text("")
    for bad in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(InputError, match="cannot write into the output folder") as caught:
            console.check_writable(bad)
        assert caught.value.exit_code == 2
