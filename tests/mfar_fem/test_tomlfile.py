"""TOML files: where a key stands, in every way TOML lets it be written."""

from __future__ import annotations

import pytest

from mfar_fem.errors import DataFileError
from mfar_fem.tomlfile import TomlFile

TEXT = '''# a comment = 1, with """
top = 1
dotted.inner = 2
"quoted key" = 3
text = """
top = 'not a key'
[law]
"""
inline = { a = 1, b = 2 }

[law]   # the real one
name = 'x'
[law.parameters]
"law.G" = "5 N/m"
[[runs]]
file = "a.csv"
'''


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "t.toml"
    path.write_text(TEXT, encoding="utf-8")
    return TomlFile.read(path)


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        (("top",), 2),
        (("dotted", "inner"), 3),
        (("quoted key",), 4),
        (("text",), 5),
        (("inline", "b"), 9),
        (("law",), 11),
        (("law", "name"), 12),
        (("law", "parameters"), 13),
        (("law", "parameters", "law.G"), 14),
        (("law", "parameters", "absent"), 13),
        (("runs", "file"), 16),
        (("absent",), None),
    ],
)
def test_line_of_a_key(file, keys, line):
    assert file.line(*keys) == line
    assert file.error("wrong", *keys).line == line


def test_values_types_and_defaults(file):
    assert file.get("dotted", "inner", kind=int) == 2
    assert file.get("absent", default=None) is None
    assert file.get("law", "absent", default=7) == 7
    assert file.quantity("law", "parameters", "law.G", unit="N/m") == 5.0
    assert file.quantity("law", "thickness", unit="m", default=None) is None
    with pytest.raises(DataFileError, match="line 2, key 'top': must be a string, not 1"):
        file.get("top", kind=str)
    with pytest.raises(DataFileError, match=r"line 2.*must be a table"):
        file.get("top", "below")
    with pytest.raises(DataFileError, match=r"the key 'law\.absent' is missing"):
        file.get("law", "absent")
    with pytest.raises(DataFileError, match=r"line 12.*unknown key 'name'; did you mean 'names'"):
        file.check_keys(("law",), ["names", "parameters"])


def test_without_a_file_the_message_still_names_the_key():
    with pytest.raises(DataFileError, match=r"^key 'law\.name': must be a string"):
        TomlFile({"law": {"name": 3}}).get("law", "name", kind=str)


def test_not_toml(tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text("a = 1\na = 2\n")
    with pytest.raises(DataFileError, match="not valid TOML") as caught:
        TomlFile.read(path)
    assert caught.value.line == 2
