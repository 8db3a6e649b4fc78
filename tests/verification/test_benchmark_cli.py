"""`mfar benchmark`: JSON keys, exit codes, assembly timing on a small mesh."""

import json

import pytest

from mfar_fem.cli.main import main


def call(capsys, *args):
    code = main(["benchmark", *args])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_benchmark_json(capsys):
    code, out, _ = call(capsys, "cantilever-shear", "--order", "2", "--mesh", "4x1", "--json")
    result = json.loads(out)
    assert code == 0
    for key in ("values", "reference", "error_percent", "newton_iterations", "assembly_ms_per_iteration", "solve_ms_per_iteration",
                "wall_s", "elements", "unknowns"):
        assert key in result
    assert result["elements"] == 8 and abs(result["error_percent"]["W"]) < 0.1


def test_benchmark_table(capsys):
    code, out, _ = call(capsys, "scordelis-lo", "--order", "1", "--mesh", "4x4")
    assert code == 0 and "reference" in out and "0.3024" in out
    code, out, _ = call(capsys, "list")
    assert code == 0 and "slit-annulus" in out


@pytest.mark.parametrize("args", [("cantilever-shear", "--mesh", "8"), ("cantilever-shear", "--mesh", "0x1"),
                                  ("cantilever-shear", "--order", "3"), ("no-such",), ("heavy-elastica", "--jitter", "0.7")])
def test_bad_input(capsys, args):
    code, out, _ = call(capsys, *args, "--json")
    assert code == 2 and json.loads(out)["error"]["exit_code"] == 2


def test_not_converged_is_exit_code_3_with_the_partial_result(capsys, monkeypatch):
    from mfar_fem import benchmarks

    real = benchmarks.run

    def stopped(*args, **options):
        return {**real(*args, **options), "converged": False, "status": "Diverged", "message": "stopped", "error_percent": None}

    monkeypatch.setattr(benchmarks, "run", stopped)
    code, out, _ = call(capsys, "cantilever-shear", "--mesh", "2x1", "--json")
    assert code == 3 and json.loads(out)["status"] == "Diverged"
    code, out, _ = call(capsys, "cantilever-shear", "--mesh", "2x1")
    assert code == 3 and "not converged" in out


def test_assembly_keys(capsys):
    code, out, _ = call(capsys, "assembly", "--cells", "6", "--repeats", "2", "--json")
    result = json.loads(out)
    assert code == 0 and result["elements"] == 72 and result["law"] == "eight-chain-silk"
    for key in ("order1_us_per_element", "order2_us_per_element", "order2_safe_us_per_element", "membrane_ratio_to_bilinearform"):
        assert result[key] > 0
