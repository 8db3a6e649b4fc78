"""``mfar test``: one JSON object, files, and errors with exit code 2."""

import json

import pytest

from mfar_fem.cli.main import main


def run(capsys, *args):
    code = main(["test", *args])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_strip_json(capsys):
    options = ("--gauge", "80 mm", "--width", "50mm", "--angle", "45", "--strain", "0.05", "--json")
    code, out, _ = run(capsys, "strip", "silk-charmeuse", *options)
    payload = json.loads(out)
    assert code == 0 and payload["converged"] and payload["angle_deg"] == pytest.approx(45)
    assert payload["gauge_m"] == 0.08 and payload["width_m"] == 0.05
    free, held = (payload["curves"][name] for name in ("free", "held"))
    assert held["force_N"][-1] > free["force_N"][-1] > 0
    assert free["force_N"][-1] == pytest.approx(0.05 * free["line_force_N_per_m"][-1])


@pytest.mark.parametrize("option", ["A", "B"])
def test_cantilever_files(capsys, tmp_path, option):
    args = ("cantilever", "faille", "--option", option, "--loop-length", "10 cm", "--out", str(tmp_path / "o"), "--json")
    code, out, _ = run(capsys, *args)
    payload = json.loads(out)
    assert code == 0 and len(payload["files"]) == 2
    assert payload["exact_rigidity_Nm"] == pytest.approx(payload["rigidity_Nm"], rel=1e-8)
    table, picture = (tmp_path / "o" / name for name in ("cantilever.csv", "cantilever.png"))
    assert table.read_text().startswith("s_m,x_m,y_m\n") and len(table.read_text().splitlines()) > 50
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_strip_files_and_table(capsys, tmp_path):
    code, out, _ = run(capsys, "strip", "paper-silk", "--out", str(tmp_path))
    assert code == 0 and "strip.csv" in out and "N/m" in out
    assert (tmp_path / "strip.csv").read_text().startswith("curve,strain_-,line_force_N_per_m,force_N\n")
    assert (tmp_path / "strip.png").read_bytes().startswith(b"\x89PNG")


def test_locked_fabric_is_exit_3_with_what_was_reached(capsys):
    code, out, err = run(capsys, "strip", "cupro-su1098", "--strain", "0.3", "--json")
    payload = json.loads(out)
    assert code == 3 and not payload["converged"] and "locks" in err
    assert 0 < len(payload["curves"]["free"]["strain"]) < 41


@pytest.mark.parametrize(
    ("args", "says"),
    [
        (("strip", "nosuch"), "neither a fabric preset nor a file"),
        (("strip", "faille", "--gauge", "0 mm"), "--gauge must be positive"),
        (("strip", "faille", "--gauge=-8 cm"), "--gauge must be positive"),
        (("strip", "faille", "--width", "0 mm"), "--width must be positive"),
        (("strip", "faille", "--gauge", "80"), "unit missing"),
        (("strip", "faille", "--gauge", "80 g"), "length"),
        (("strip", "faille", "--strain", "0"), "--strain"),
        (("strip", "faille", "--points", "1"), "--points"),
        (("strip", "faille", "--angle", "up"), "direction 'up'"),
        (("strip", "faille", "--level", "magic"), "levels"),
        (("cantilever", "faille", "--option", "C"), "options A"),
        (("cantilever", "faille", "--option", "B", "--loop-length", "0 mm"), "--loop-length"),
        (("cantilever", "nosuch"), "neither"),
    ],
)
def test_bad_input_is_exit_2(capsys, args, says):
    code, out, err = run(capsys, *args, "--json")
    assert code == 2
    error = json.loads(out)["error"]
    assert says in error["message"] and error["exit_code"] == 2
    assert says.split()[0] in " ".join(err.split())


def test_unwritable_folder_is_refused_first(capsys, tmp_path):
    (tmp_path / "file").write_text("")
    code, _, err = run(capsys, "strip", "faille", "--out", str(tmp_path / "file" / "o"))
    assert code == 2 and "output folder" in err
