"""Features of shapes that have them, chance, and the experts' form."""

import csv

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mfar_fem.errors import DataFileError, InputError
from reconstruction.metrics.experts import EXPERTS, read_form, write_form
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


@given(st.lists(st.tuples(*[st.sampled_from(["yes", "no", "", "Y", "0"])] * 3), min_size=27, max_size=27))
def test_two_of_three_experts_decide(tmp_path_factory, answers):
    path = tmp_path_factory.mktemp("form") / "form.csv"
    key = write_form(path, ["robe"])
    fill(path, lambda i: answers[i])
    (found,) = read_form(path).values()
    assert list(key.values()) == ["robe"] and len(found) == 27
    for value, votes in zip(found.values(), answers, strict=True):
        yes, no = (sum(v.lower() in words for v in votes) for words in (("yes", "y"), ("no", "0")))
        assert value is (True if yes >= 2 else False if no >= 2 else None)


def test_the_form_hides_the_methods_and_names_mistakes(tmp_path):
    path = tmp_path / "form.csv"
    key = write_form(path, ["robe/restored", "robe/MVS", "robe/true"], seed=1)
    assert "restored" not in path.read_text(encoding="utf-8") and set(key.values()) == {"robe/restored", "robe/MVS", "robe/true"}
    fill(path, lambda i: ("yes", "maybe" if i == 3 else "no", ""))
    with pytest.raises(DataFileError, match=r"form.csv, line 5, column 'expert_2': 'maybe' is neither yes nor no"):
        read_form(path)
    path.write_text(path.read_text(encoding="utf-8").replace("neck-dips", "neck-dip", 1), encoding="utf-8")
    with pytest.raises(DataFileError, match=r"line 4, column 'feature'.*did you mean 'neck-dips'"):
        read_form(path)
    path.write_text("garment,feature\n", encoding="utf-8")
    with pytest.raises(DataFileError, match="has no column expert_1"):
        read_form(path)
    with pytest.raises(InputError, match="each once"):
        write_form(path, ["a", "a"])
