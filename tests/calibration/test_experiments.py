"""Readers: what a good file gives, and what every bad one says."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from calibration.datasets import load, names
from calibration.datasets.make_cupro import HEADER, along_arc, rows
from calibration.experiments import Dataset, Experiment
from calibration.readers import Rules, apply_rules, read_dataset, read_experiment, read_table, read_u3m, split_branches
from mfar_fem.errors import DataFileError, InputError, UnknownNameError

SHARED = Path(__file__).resolve().parents[3] / "shared/data/tensile/u3m_fab_cupro_SU-1098_original.json"
DESCRIPTOR = """
kind = "strip"
data = "curve.csv"
direction = "warp"
gauge = "100 mm"
width = "50 mm"
[columns]
extension = { name = "u", unit = "mm" }
force = { name = "F", unit = "N" }
"""
CURVE = "# a comment\nu,F\n0,0\n1,5\n2,20\n3,45\n"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "curve.csv").write_text(CURVE)
    (tmp_path / "warp.toml").write_text(DESCRIPTOR)
    return tmp_path


def rewrite(folder, old, new):
    text = (folder / "warp.toml").read_text()
    assert old in text
    (folder / "warp.toml").write_text(text.replace(old, new))
    return folder / "warp.toml"


def test_units_become_si(folder):
    e = read_experiment(folder / "warp.toml")
    np.testing.assert_allclose(e.strain, [0, 0.01, 0.02, 0.03], atol=1e-15)
    np.testing.assert_allclose(e.force, [0, 100, 400, 900])
    assert (e.gauge, e.width, e.direction_name, e.scale) == (0.1, 0.05, "warp", 900)
    assert not e.strain.flags.writeable


def test_gram_force_and_oblique_direction(folder):
    path = rewrite(folder, 'unit = "N"', 'unit = "gf"')
    path = rewrite(folder, '"warp"', '"30 deg"')
    e = read_experiment(path)
    assert e.force[-1] == pytest.approx(45 * 9.80665e-3 / 0.05)
    assert e.direction == pytest.approx(math.radians(30)) and e.direction_name == "30°"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"100 mm"', '"100"', "unit"),
        ('"100 mm"', '"-100 mm"', "positive"),
        ('"50 mm"', '"0 mm"', "positive"),
        ('"50 mm"', '"50 g"', "length"),
        ('unit = "mm"', 'unit = "N"', "force"),
        ('name = "F", unit = "N"', 'name = "F"', "unit is missing"),
        ('name = "F"', 'name = "Force"', "no such column"),
        ('"warp"', '"wrap"', "unknown direction"),
        ('kind = "strip"', 'kind = "strap"', "unknown kind"),
        ('gauge = "100 mm"', "", "missing"),
        ("[columns]", 'gage = 1\n[columns]', "did you mean 'gauge'"),
        ("[columns]", 'weight = -1.0\n[columns]', "positive"),
        ("[columns]", '[rules]\ntare = "zero"\n[columns]', "unknown tare"),
        ("[columns]", '[branch]\ncycle = 7\n[columns]', "does not exist"),
        ("[columns]", '[branch\n[columns]', "not valid TOML"),
    ],
)  # fmt: skip
def test_bad_descriptor_names_file_and_reason(folder, old, new, message):
    path = rewrite(folder, old, new)
    with pytest.raises(DataFileError, match=message) as caught:
        read_experiment(path)
    assert caught.value.exit_code == 2
    assert ".toml" in str(caught.value) or ".csv" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "line", "column", "message"),
    [
        ("", None, None, "empty"),
        ("# only a comment\n\n", None, None, "empty"),
        ("u,F\n", 1, None, "no reading"),
        ("u,F\n0,0\n1,nan\n2,3\n", 3, "F", "finite"),
        ("u,F\n0,0\n1,\n2,3\n", 3, "F", "empty"),
        ("u,F\n0,0\n# note\n1,x\n2,3\n", 4, "F", "not a number"),
        ('u,F\n0,0\n1,"1,5"\n2,3\n', 3, "F", "decimal comma"),
        ("u,F\n0,0\n1,2,3\n", 3, None, "3 cells"),
        ("u,u\n0,0\n", 1, None, "repeated"),
        ("u,F\n0,0\n1,2\n2,3\n1.5,4\n3,5\n", 5, "u", "falls back"),
        ("u,F\n1,0\n1,2\n1,3\n", 2, "u", "never changes"),
        ("u,F\n0,0\n1,2\n", None, "u", "only 2"),
    ],
)
def test_bad_table_names_line_and_column(folder, text, line, column, message):
    (folder / "curve.csv").write_text(text)
    with pytest.raises(DataFileError, match=message) as caught:
        read_experiment(folder / "warp.toml")
    assert (caught.value.line, caught.value.column) == (line, column)
    assert "curve.csv" in str(caught.value)


def test_wrong_column_suggests_close_names(folder):
    (folder / "curve.csv").write_text("distance_mm,force_N\n0,0\n")
    with pytest.raises(DataFileError, match="did you mean 'force_N'"):
        read_table(folder / "curve.csv").numbers("force")


def test_missing_data_file_and_folder_without_descriptor(tmp_path):
    with pytest.raises(DataFileError, match="no such file"):
        read_dataset(tmp_path / "nothing.toml")
    (tmp_path / "a.csv").write_text(CURVE)
    with pytest.raises(DataFileError, match=r"a\.csv"):
        read_dataset(tmp_path)
    with pytest.raises(DataFileError, match="descriptor"):
        read_dataset(tmp_path / "a.csv")


def test_rules_tare_slack_and_jitter():
    strain = np.array([-0.02, -0.01, 0.0, 0.01, 0.00999, 0.02, 0.03])
    force = np.array([1.0, 1.0, 1.2, 3.0, 3.1, 9.0, 20.0])
    rules = Rules(tare="first-readings", tare_readings=2, slack="nominal")
    e, f, gauge, notes = apply_rules(strain, force, 0.1, rules)
    np.testing.assert_allclose(e, [0, 0.01, 0.02, 0.03])
    np.testing.assert_allclose(f, [0.2, 2, 8, 19])
    assert gauge == 0.1 and len(notes) == 3
    e, f, gauge, _ = apply_rules(strain, force - 1, 0.1, Rules(slack="preload", preload=1.0))
    assert e[0] == 0 and gauge == pytest.approx(0.101) and e[-1] == pytest.approx(0.02 / 1.01)
    with pytest.raises(DataFileError, match="never exceeds"):
        apply_rules(strain, force, 0.1, Rules(slack="preload", preload=100.0))
    e, _, _, _ = apply_rules(strain, force, 0.1, Rules(max_force=10.0))
    assert e[-1] == 0.02


def test_branches_of_a_continuous_record(folder):
    up, down = np.linspace(0, 3, 31), np.linspace(3, 0.2, 25)
    record = np.concatenate([up, down, np.linspace(0.2, 4, 40)])
    record[10] -= 0.02  # jitter below the turn tolerance
    assert len(split_branches(record)) == 3
    (folder / "curve.csv").write_text("u,F\n" + "".join(f"{u},{u * u}\n" for u in record))
    e = read_experiment(rewrite(folder, "[columns]", '[branch]\ncycle = "last"\n[columns]'))
    assert e.strain[-1] == pytest.approx(0.04) and e.strain[0] == pytest.approx(0.002)
    assert "cycle 2 of 2" in e.notes[0]


def test_dataset_file_with_weights_and_fabric(folder):
    (folder / "dataset.toml").write_text(
        'name = "x"\nexperiments = [{ file = "warp.toml", weight = 2.0 }]\n'
        '[fabric]\nthickness = "0.1 mm"\nareal_density = "60 g/m^2"\n[fabric.bending]\nwarp = "2 uN*m"\n'
    )
    d = read_dataset(folder)
    assert d.experiments[0].weight == 2.0 and d.thickness == pytest.approx(1e-4)
    assert d.bending["warp"] == pytest.approx(2e-6)
    with pytest.raises(UnknownNameError, match="variant"):
        read_dataset(folder, "virgin")
    (folder / "dataset.toml").write_text('experiments = ["warp.toml"]\n[fabric]\nthickness = "-0.1 mm"\n')
    with pytest.raises(DataFileError, match="positive"):
        read_dataset(folder)
    with pytest.raises(InputError, match="repeated"):
        Dataset("twice", (d.experiments[0], d.experiments[0]))


def test_cantilever_descriptor(folder):
    (folder / "curve.csv").write_text("c\n1.8\n1.9\n")
    (folder / "warp.toml").write_text(
        'kind = "cantilever"\ndata = "curve.csv"\ndirection = "weft"\n'
        '[columns]\nbending_length = { name = "c", unit = "cm" }\n'
    )
    e = read_experiment(folder / "warp.toml")
    np.testing.assert_allclose(e.y, [0.036, 0.038])
    assert e.x[0] == pytest.approx(math.radians(41.5)) and e.scale == pytest.approx(0.037)
    with pytest.raises(InputError, match="not a strip"):
        _ = e.strain


def u3m(branches):
    flat = [list(np.ravel(b)) for b in branches]
    return {"raw_data": {"L": {"S2": {"length": 8.0, "width": 5.0, "samplesTree": flat}}}}


def test_u3m_cycles_tare_and_slack(tmp_path):
    slack = [[7.9 + 0.01 * i, 2.0] for i in range(10)]
    first = slack + [[8.0 + 0.02 * i, 2.0 + 50 * i] for i in range(6)]
    second = slack + [[8.0 + 0.02 * i, 2.0 + 40 * i] for i in range(9)]
    down = [[8.2, 100.0], [7.9, 2.0]]
    path = tmp_path / "f.json"
    path.write_text(json.dumps(u3m([first, down, second, down])))
    d = read_u3m(path)
    np.testing.assert_allclose(d.experiments[0].strain, 0.0025 * np.arange(9), atol=1e-12)
    np.testing.assert_allclose(d.experiments[0].force, 40 * np.arange(9) * 9.80665e-3 / 0.05, atol=1e-9)
    assert len(read_u3m(path, "virgin").experiments[0]) == 6
    envelope = read_u3m(path, "envelope").experiments[0]
    np.testing.assert_allclose(envelope.force * 0.05 / 9.80665e-3, [0, 50, 100, 150, 200, 250, 280, 320], atol=1e-9)
    with pytest.raises(DataFileError, match="there are 2"):
        read_u3m(path, cycle=3)
    with pytest.raises(UnknownNameError, match="virgin"):
        read_u3m(path, "vergin")


@pytest.mark.parametrize(
    ("text", "message"),
    [("{", "not valid JSON"), ("{}", "raw_data"), ('{"raw_data": {}}', "no stretch test"),
     (json.dumps(u3m([[[8.0, 1.0, 2.0]]])), "pairs"), ('{"raw_data": {"L": {"S2": {}}}}', "missing"),
     (json.dumps(u3m([[[8.0, float("nan")]]])), "not finite")],
)  # fmt: skip
def test_bad_u3m(tmp_path, text, message):
    (tmp_path / "f.json").write_text(text)
    with pytest.raises(DataFileError, match=message):
        read_u3m(tmp_path / "f.json")


def test_shipped_cupro_figures_are_cited():
    assert names() == ["cupro-su1098"]
    for variant, top in (("preconditioned", 99), ("virgin", 23), ("envelope", 99)):
        d = load("cupro-su1098", variant)
        assert [e.direction_name for e in d.select(role="fit")] == ["warp", "weft", "bias"]
        assert all(e.force.max() > top for e in d.experiments) and all(8 <= len(e) <= 20 for e in d.experiments)
        table = read_table(Path(__file__).parents[2] / f"calibration/datasets/cupro_su1098/{variant}.csv")
        assert all("7ea8941" in row[-1] for row in table.rows)
    with pytest.raises(UnknownNameError, match="cupro-su1098"):
        load("silk-route")


def test_arc_length_resolves_the_j():
    x = np.linspace(0, 1, 201)
    keep = along_arc(x, x**8, 20)
    assert keep[0] == 0 and keep[-1] == 200 and len(keep) == 20
    assert (x[keep] > 0.8).sum() >= 8


@pytest.mark.skipif(not SHARED.exists(), reason="the raw record is not here")
def test_shipped_figures_come_from_the_raw_record():
    document = json.loads(SHARED.read_text())
    for variant in ("preconditioned", "virgin", "envelope"):
        table = read_table(Path(__file__).parents[2] / f"calibration/datasets/cupro_su1098/{variant}.csv")
        assert [tuple(str(c) for c in row) for row in rows(document, variant)] == list(table.rows)
        assert table.header == tuple(HEADER)


def test_experiment_refuses_nonsense():
    with pytest.raises(InputError, match="finite"):
        Experiment("a", [0, 1, np.nan], [0, 1, 2], gauge=0.1, width=0.05)
    with pytest.raises(InputError, match="width"):
        Experiment("a", [0, 1], [0, 1], gauge=0.1, width=-0.05)
    with pytest.raises(UnknownNameError, match="cantilever"):
        Experiment("a", [0, 1], [0, 1], kind="shear")
