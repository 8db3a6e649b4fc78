"""Figures say in words what they show, and refuse what could not be read."""

import re

import numpy as np
import pytest
from report_trial import benchmark, invented

from mfar_fem.errors import InputError
from reconstruction.report import paper
from reconstruction.report.estimates import Estimate, estimate_table, time_table
from reconstruction.report.figures import benchmark_section, distance_figure, feature_figure, keypoint_figure, spectrum_figure


def test_the_papers_numbers_are_those_of_its_text():
    assert np.mean(list(paper.FEATURES_PERCENT["MFAR"].values())) == pytest.approx(91.9, abs=0.05)
    for first, second, both in paper.TIMES_S.values():
        assert first + second == pytest.approx(both, abs=0.051)
    assert sum(paper.GROUP_SIZES) == 27
    assert all(low < mean < high for mean, low, high in paper.KEYPOINTS_PX.values())


@pytest.mark.parametrize(("change", "said"), [
    ({"low": 1.0}, "one end"), ({"low": 3.0, "high": 4.0}, "outside its interval"), ({"value": float("nan")}, "leave out"),
])  # fmt: skip
def test_rows_without_sense_are_refused(change, said):
    with pytest.raises(InputError, match=said):
        Estimate(**({"of": "robe", "method": "MFAR", "value": 2.0} | change))


def test_doubled_and_missing_rows_are_refused():
    with pytest.raises(InputError, match="two rows"):
        distance_figure([Estimate("robe", "MFAR", 1.0), Estimate("robe", "MFAR", 2.0)])
    with pytest.raises(InputError, match="at least one row"):
        keypoint_figure([])


def test_words_hold_every_value_and_the_papers():
    rows = [Estimate("half-sleeve", "MFAR", 7.25, 6.5, 8.125, 5), Estimate("half-sleeve", "template only", 9.0)]
    p = distance_figure(rows)
    assert "half-sleeve, MFAR: 7.25 mm (6.5 to 8.12)" in p.alt and "template only: 9 mm" in p.alt
    assert "paper, other data: half-sleeve, MFAR: 4.2." in p.alt
    assert "not public" in p.caption and "not public" not in distance_figure(rows, beside=False).caption


def test_a_similarity_needs_a_null_and_says_how_many_lie_in_it():
    rows = [Estimate("pair 1", "MFAR", 0.9, 0.8, 0.95), Estimate("pair 2", "MFAR", 0.6), Estimate("pair 3", "MFAR", 0.1)]
    with pytest.raises(InputError, match="null band"):
        spectrum_figure(rows, {})
    p = spectrum_figure(rows, {"shuffled": (0.5, 0.7), "smooth": (0.0, 0.2)})
    assert "2 of 3 values lie in one" in p.caption and "Null, shuffled: 0.5 to 0.7." in p.alt


def test_a_rate_needs_its_chance():
    with pytest.raises(InputError, match="no chance level is given for silhouette"):
        feature_figure([Estimate("silhouette", "MFAR", 80.0)], {"accessories": 50.0})


def test_both_forms_are_svg_of_their_widths_and_deterministic():
    rows = invented()["distances"]
    p, again = distance_figure(rows), distance_figure(rows)
    assert p == again

    def width(svg):
        return float(re.search(rb'<svg[^>]*width="([\d.]+)pt"', svg)[1])

    assert width(p.data) == pytest.approx(7.6 * 72) and width(p.narrow) == pytest.approx(3.7 * 72)


def test_hollow_marks_are_the_papers_values():
    """The marks are read back from the axes: hollow ones lie at the paper's value, filled ones at ours."""
    from matplotlib.figure import Figure

    from reconstruction.report.plotting import points

    ax = Figure().subplots()
    rows = [Estimate(g, m, 20.0 + i) for i, g in enumerate(paper.GARMENTS) for m in paper.METHODS]
    points(ax, rows, paper.DISTANCE_MM, paper.LABEL)
    hollow = [line for line in ax.lines if line.get_markerfacecolor() == "none" and len(line.get_xdata())]
    assert [list(line.get_xdata()) for line in hollow] == [list(paper.DISTANCE_MM[m].values()) for m in paper.METHODS]
    filled = [line for line in ax.lines if line.get_label() in paper.METHODS]
    for line, theirs in zip(filled, hollow, strict=True):
        np.testing.assert_array_equal(line.get_xdata(), [20, 21, 22, 23])
        np.testing.assert_array_equal(line.get_ydata(), theirs.get_ydata())
    assert paper.LABEL in [line.get_label() for line in ax.lines]


def test_tables():
    t = estimate_table([Estimate("veil-hat", "MVS", 80.0, 70.0, 95.0, 5), Estimate("robe", "own", 1.0)], "mm", paper.DISTANCE_MM)
    assert [list(r) for r in t.rows] == [["veil-hat", "MVS", 80.0, "70 to 95", 5, 13.8], ["robe", "own", 1.0, "none", None, None]]
    times = time_table({"MFAR": (41.7, None), "MVS": (10, 5.25)}, "2 cores")
    assert list(times.rows[0]) == ["MFAR", "41.7", None, None, "2 cores"] and times.rows[1][3] == "15.2"
    assert ["MVS", "156.2", "189.5", "345.7", "paper, other data: 18 cores and a P100"] in [list(r) for r in times.rows]


def test_a_section_has_what_it_is_given():
    full = benchmark()
    assert len(full.pictures) == 4 and len(full.tables) == 5
    part = benchmark_section(distances=invented()["distances"])
    assert len(part.pictures) == len(part.tables) == 1
