"""The command line: quick help, lazily loaded groups, exit codes, one JSON object."""

from __future__ import annotations

import importlib.metadata
import json
import subprocess
import sys

import pytest
import typer
from typer.testing import CliRunner

from mfar_fem import __version__
from mfar_fem.cli import console, fabrics, main
from mfar_fem.errors import DataFileError, InputError, MissingDependencyError, NotConvergedError

HEAVY = ("numba", "matplotlib", "scipy", "pint", "skfem", "gmsh", "numpy", "calibration", "material_tests")


def python(code):
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)


@pytest.fixture
def group(monkeypatch):
    """Install a command group for the test: `install(app)` makes it the entry point 'probe'."""

    def install(target):
        class Point(importlib.metadata.EntryPoint):
            def load(self):
                return target

        point = Point("probe", "somewhere:app", main.ENTRY_POINT_GROUP)
        monkeypatch.setattr(main, "command_entry_points", lambda: {"probe": point})

    return install


def test_help_lists_all_groups_and_imports_none_of_them():
    code = "import sys; from mfar_fem.cli.main import main; main(['--help']);"
    code += f"print('HEAVY', [m for m in {HEAVY} if m in sys.modules])"
    done = python(code)
    assert done.returncode == 0, done.stderr
    assert "HEAVY []" in done.stdout
    for name in main.SHORT_HELP:
        assert name in done.stdout


def test_one_group_does_not_import_the_others():
    code = "import sys; from mfar_fem.cli.main import main; main(['fabrics', '--help']);"
    code += "print('OTHERS', [m for m in ('calibration', 'material_tests', 'numba', 'pint') if m in sys.modules])"
    assert "OTHERS []" in python(code).stdout


def test_version_and_installed_program():
    done = subprocess.run([sys.executable, "-m", "mfar_fem.cli.main", "--version"], capture_output=True, text=True)
    assert (done.returncode, done.stdout.strip()) == (0, f"mfar {__version__}")


def test_fabrics_list_and_show_as_json(capsys):
    assert main.main(["fabrics", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["fabrics"]
    faille = next(row for row in rows if row["name"] == "faille")
    assert faille["bending_warp_Nm"] == pytest.approx(1.86326e-6, rel=1e-5)
    assert main.main(["fabrics", "show", "faille", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    thickness = next(row for row in shown["quantities"] if row["key"] == "thickness")
    assert thickness["value"] == 0.000226 and thickness["unit"] == "m" and "10.4188/jte.61.69" in thickness["source"]
    assert shown["bending_over_derived"]["warp"] == pytest.approx(0.140, abs=0.001)


def test_fabrics_for_people():
    runner = CliRunner()
    listed = runner.invoke(fabrics.app, [])
    assert listed.exit_code == 0 and "silk-charmeuse" in listed.stdout
    shown = runner.invoke(fabrics.app, ["show", "silk-charmeuse"])
    assert shown.exit_code == 0
    for words in ("SECONDARY", "ASSUMED", "law.Ew", "1.8145e+06", "bending.twist"):
        assert words in shown.stdout


def test_bad_input_is_exit_code_2_with_a_message_and_one_json_object(capsys, tmp_path):
    assert main.main(["fabrics", "show", "fail"]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and "did you mean 'faille'" in captured.err
    path = tmp_path / "f.toml"
    path.write_text('name = "x"\nthickness = "1"\n')
    assert main.main(["fabrics", "show", str(path), "--json"]) == 2
    captured = capsys.readouterr()
    error = json.loads(captured.out)["error"]
    assert error["type"] == "DataFileError" and error["exit_code"] == 2
    assert (error["path"], error["line"], error["column"]) == (str(path), 2, "thickness")
    assert "unit missing" in error["message"] and "unit missing" in captured.err


@pytest.mark.parametrize("args", [["fabric"], ["fabrics", "show"], ["--bogus"], ["fabrics", "show", "a", "b"]])
def test_usage_errors(args, capsys):
    assert main.main([*args, "--json"]) == 2
    error = json.loads(capsys.readouterr().out)["error"]
    assert error["type"] == "UsageError" and error["message"]


def test_no_arguments_show_the_help(capsys):
    assert main.main([]) == 2
    assert "Commands" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (InputError("no grips"), 2, "no grips"),
        (DataFileError("empty", path="a.csv", line=1), 2, "a.csv, line 1: empty"),
        (NotConvergedError("stopped at 12 %"), 3, "stopped at 12 %"),
        (KeyboardInterrupt(), 130, "interrupted"),
        (ZeroDivisionError("division by zero"), 1, "unexpected error"),
    ],
)
def test_exit_codes_of_errors(group, capsys, error, code, words):
    def probe(as_json: bool = typer.Option(False, "--json")) -> None:
        raise error

    group(probe)
    assert main.main(["probe"]) == code
    captured = capsys.readouterr()
    assert captured.out == "" and words in captured.err
    assert main.main(["probe", "--json"]) == code
    assert json.loads(capsys.readouterr().out)["error"]["exit_code"] == code


def test_partial_result_stays_the_only_json_object(group, capsys):
    def probe(as_json: bool = typer.Option(False, "--json")) -> None:
        console.emit({"converged": False, "reached": 0.12}, as_json)
        raise NotConvergedError("stopped at 12 %")

    group(probe)
    assert main.main(["probe", "--json"]) == 3
    assert json.loads(capsys.readouterr().out) == {"converged": False, "reached": 0.12}


def test_return_value_of_a_command_is_not_an_exit_code_but_typer_exit_is(group):
    def probe(code: int = 0) -> int:
        if code:
            raise typer.Exit(code)
        return 7

    group(probe)
    assert main.main(["probe"]) == 0
    assert main.main(["probe", "--code", "3"]) == 3


def test_group_that_cannot_be_imported_says_so(monkeypatch, capsys):
    point = importlib.metadata.EntryPoint("probe", "no_such_module_here:app", main.ENTRY_POINT_GROUP)
    monkeypatch.setattr(main, "command_entry_points", lambda: {"probe": point})
    assert main.main(["--help"]) == 0
    assert "no_such_module_here" in capsys.readouterr().out
    assert main.main(["probe"]) == MissingDependencyError.exit_code == 2
    assert "No module named 'no_such_module_here'" in capsys.readouterr().err


def test_entry_points_are_those_of_the_project():
    points = main.command_entry_points()
    assert list(points)[: len(main.SHORT_HELP)] == list(main.SHORT_HELP)
    assert points["fabrics"].load() is fabrics.app
