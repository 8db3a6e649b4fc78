"""What a place in a file is called in errors, and folders after errors."""

import pytest

from mfar_fem.cli import console
from mfar_fem.errors import DataFileError, InputError


@pytest.mark.parametrize(("path", "name", "shown"), [
    ("a.toml", "law", "a.toml, key 'law': x"),
    ("a.json", "law", "a.json, key 'law': x"),
    ("a.csv", "force", "a.csv, column 'force': x"),
    (None, "law", "key 'law': x"),
    (None, "--loom", "--loom: x"),
])  # fmt: skip
def test_keys_columns_and_options(path, name, shown):
    assert str(DataFileError("x", path=path, column=name)) == shown


def test_a_file_in_the_way_of_a_folder_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(InputError, match="file' is a file; choose another"):
            console.check_writable(folder)


def test_folders_that_stayed_empty_go_after_an_error_and_no_others(tmp_path):
    console.forget_emitted()
    (tmp_path / "there").mkdir()
    console.check_writable(tmp_path / "there")
    console.check_writable(tmp_path / "new" / "deep")
    full = console.check_writable(tmp_path / "full")
    (full / "result").write_text("")
    console.remove_empty()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["full", "there"]
