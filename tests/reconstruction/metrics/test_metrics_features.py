"""Features of shapes that have them, chance, and the experts' form."""

import csv

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mfar_fem.errors import DataFileError, InputError
from reconstruction.metrics.experts import ASKED, EXPERTS, letter, rates, read_form, write_form
from reconstruction.metrics.features import FEATURES, GROUPS, agreement, chance, extract
from reconstruction.shape.sewn_hat import in_space, sew_hat
from reconstruction.surface.triangles import TriangleMesh
from reconstruction.template.dimensions import HatDimensions


def tube(top, bottom, height, n=64, m=40):
    v, t = np.meshgrid(2 * np.pi * np.arange(n) / n, np.linspace(0, 1, m + 1))
    r = bottom + (top - bottom) * t
    x = np.stack([r * np.cos(v), 0.6 * r * np.sin(v), t * height], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(n), np.arange(m))
    a, b = j * n + i, j * n + (i + 1) % n
    faces = [np.stack([a, b, b + n], -1).reshape(-1, 3), np.stack([a, b + n, a + n], -1).reshape(-1, 3)]
    return TriangleMesh(x, np.concatenate(faces))


def hat():
    d = HatDimensions(0.2, 0.22, 0.46, 0.4)
    sewn = sew_hat(d, 0.02)
    return TriangleMesh(in_space(sewn, d), sewn.faces)


def test_the_checklist_has_the_papers_groups():
    assert len(FEATURES) == 27 == len({f.name for f in FEATURES})
    assert [sum(f.group == g for f in FEATURES) for g in GROUPS] == [7, 6, 5, 5, 4]


def test_a_hat_has_a_closed_pointed_top_with_a_brim_and_no_neck():
    found = extract(hat())
    assert all(found[n] for n in ("closed-top", "pointed-top", "brim"))
    assert not any(found[n] for n in ("neck-opening", "cuffs", "sleeves-long", "hem-long", "belt"))


def test_a_flared_tube_and_a_straight_one():
    flared, straight = extract(tube(0.12, 0.28, 1.2)), extract(tube(0.2, 0.2, 0.6))
    assert flared["flared"] and flared["hem-long"] and flared["hem-open"] and flared["taller"] and flared["neck-opening"]
    assert not straight["flared"] and not straight["hem-long"] and straight["hem-open"]
    assert flared["full"] and not flared["closed-top"] and not flared["cuffs"]
    assert all(flared[f.name] is None for f in FEATURES if f.group == GROUPS[4])  # a bare mesh has no texture


def test_agreement_and_chance():
    a, b = extract(hat()), extract(tube(0.12, 0.28, 1.2))
    assert all(same == asked for same, asked in agreement(a, a).values())
    assert agreement(a, b)["texture and pattern"] == (0, 0)
    level = chance([a, b, a])
    assert set(level) == set(GROUPS[:4])
    same, asked = agreement(a, b)["accessories"]
    assert level["accessories"] == pytest.approx((2 * same / asked + 1) / 3)
    with pytest.raises(InputError, match="two garments"):
        chance([a])


def fill(path, answer):
    rows = list(csv.DictReader(path.open(encoding="utf-8")))
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        for i, row in enumerate(rows):
            row |= dict(zip(EXPERTS, answer(i), strict=True))
            writer.writerow(row)


@given(st.lists(st.tuples(*[st.sampled_from(["yes", "no", "", "Y", "0"])] * 3), min_size=len(ASKED), max_size=len(ASKED)))
def test_two_of_three_experts_decide(tmp_path_factory, answers):
    path = tmp_path_factory.mktemp("form") / "form.csv"
    write_form(path, ["G1"])
    fill(path, lambda i: answers[i])
    (found,) = read_form(path).values()
    assert len(found) == 23
    for value, votes in zip(found.values(), answers, strict=True):
        yes, no = (sum(v.lower() in words for v in votes) for words in (("yes", "y"), ("no", "0")))
        assert value is (True if yes >= 2 else False if no >= 2 else None)


def test_the_form_hides_the_methods_and_names_mistakes(tmp_path):
    path = tmp_path / "form.csv"
    letters = [letter(f"robe-1/{method}", "digest") for method in ("restored", "MVS", "true")]
    write_form(path, letters)
    text = path.read_text(encoding="utf-8")
    assert "restored" not in text and "true" not in text and all(name in text for name in letters)
    assert "pattern" not in text  # bare meshes have none
    fill(path, lambda i: ("yes", "maybe" if i == 3 else "no", ""))
    with pytest.raises(DataFileError, match=r"form.csv, line 5, column 'expert_2': 'maybe' is neither yes nor no"):
        read_form(path)
    path.write_text(path.read_text(encoding="utf-8").replace("neck-dips", "neck-dip", 1), encoding="utf-8")
    with pytest.raises(DataFileError, match=r"line 4, column 'feature'.*did you mean 'neck-dips'"):
        read_form(path)
    path.write_text("garment,feature\n", encoding="utf-8")
    for again in (lambda: read_form(path), lambda: write_form(path, letters)):
        with pytest.raises(DataFileError, match="has no column expert_1"):
            again()
    with pytest.raises(InputError, match="each once"):
        write_form(path, ["a", "a"])


def test_a_form_is_extended_and_keeps_what_was_answered(tmp_path):
    path = tmp_path / "form.csv"
    assert letter("robe-1/MVS", "a") == letter("robe-1/MVS", "a") != letter("robe-1/MVS", "b")
    write_form(path, ["Gb", "Gc"])
    fill(path, lambda i: ("yes", "yes", "") if i < len(ASKED) else ("", "", ""))
    assert write_form(path, ["Gb", "Gc", "Ga"]) == []
    found = read_form(path)
    assert list(found) == ["Ga", "Gb", "Gc"] and all(found["Gb"].values()) and not any(found["Gc"].values())
    assert write_form(path, ["Ga"]) == ["Gb"]  # answered, of an earlier mesh
    assert list(read_form(path)) == ["Ga", "Gb"] and all(read_form(path)["Gb"].values())


def test_rates_compare_a_garment_with_its_own_true_one():
    yes = {f.name: True for f in ASKED}
    no = {f.name: False for f in ASKED}
    half = yes | {f.name: False for f in ASKED if f.group == GROUPS[0]}
    key = {f"{m}{i}": {"case": f"robe-{i}", "garment": "robe", "method": m} for i in (1, 2, 3) for m in ("true", "MVS", "restored")}
    answers = {"true1": yes, "true2": yes, "true3": no, "MVS1": half, "MVS2": half, "MVS3": no, "restored1": yes, "G9": yes,
               "restored2": dict.fromkeys(yes)}  # fmt: skip
    found = rates(answers, key)
    by = {(r["method"], r["group"]): r for r in found["rates"]}
    assert set(by) == {(m, g) for m in ("MVS", "restored") for g in GROUPS[:4]}
    collar, sleeve, only = by["MVS", GROUPS[0]], by["MVS", GROUPS[1]], by["restored", GROUPS[0]]
    assert (collar["agree"], collar["asked"], collar["garments"]) == (7, 21, 3) and collar["rate"] == pytest.approx(100 / 3)
    assert collar["low"] < collar["rate"] < collar["high"] and sleeve["rate"] == 100.0
    assert only["rate"] == 100.0 and only["low"] is None and only["garments"] == 1
    assert collar["chance"] == pytest.approx(100 / 3)  # of three pairs of true garments one is alike
    assert found["unknown"] == ["G9"] and found["garments"] == 7
    assert rates({"true1": yes, "true2": dict.fromkeys(yes)}, key) == {"rates": [], "garments": 1, "unknown": []}
