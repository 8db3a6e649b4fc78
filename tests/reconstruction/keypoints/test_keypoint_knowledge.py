"""The knowledge graph: shipped file, round trips, shuffling, faults named by line."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("rdflib")
pytest.importorskip("networkx")

from mfar_fem.errors import DataFileError, ParameterError
from reconstruction.keypoints.knowledge import Knowledge, Order, Ratio, Symmetry
from reconstruction.keypoints.knowledge_file import SHIPPED, dumps, load, parse
from reconstruction.landmarks import LANDMARKS

TEXT = SHIPPED.read_text(encoding="utf-8")

point = st.sampled_from(LANDMARKS)
positive = st.floats(0.01, 5.0)
words = st.text(st.characters(codec="utf-8", exclude_categories=["C"]), min_size=1, max_size=30).filter(lambda t: t.strip())
two = st.lists(point, min_size=2, max_size=2, unique=True)


@st.composite
def graphs(draw):
    constraints = []
    for i in range(draw(st.integers(0, 6))):
        (a, b), weight, source = draw(two), draw(positive), draw(words)
        kind = draw(st.sampled_from([Symmetry, Ratio, Order]))
        if kind is Symmetry:
            constraints.append(Symmetry(f"c{i}", a, b, draw(positive), draw(positive), weight, source))
        elif kind is Order:
            constraints.append(Order(f"c{i}", a, b, draw(st.floats(-2, 2)), weight, source))
        else:
            (c, d), low = draw(two), draw(positive)
            constraints.append(Ratio(f"c{i}", a, b, c, d, low, low + draw(positive), weight, source))
    levels = {"left_waist": 0.5, "left_ankle": 1.0} | draw(st.dictionaries(point, st.floats(0, 1), max_size=3))
    if len(set(levels.values())) < 2:
        levels = {"left_waist": 0.5, "left_ankle": 1.0}
    chosen = draw(st.sets(point, min_size=1, max_size=4))
    return Knowledge(tuple(constraints), {"panel": tuple(sorted(chosen, key=LANDMARKS.index))}, levels)


def test_the_shipped_graph_has_all_points_kinds_and_sources():
    k = load()
    assert len(k.constraints) >= 15 and all(k.of(kind) for kind in (Symmetry, Ratio, Order))
    used = {getattr(c, key) for c in k.constraints for key in "abcd" if hasattr(c, key)}
    assert used == set(LANDMARKS)
    assert all(len(c.source) > 20 for c in k.constraints)


@settings(max_examples=40)
@given(graphs())
def test_round_trips_through_turtle_and_networkx(k):
    assert parse(dumps(k)) == k
    assert Knowledge.from_graph(k.graph()) == k


def test_networkx_view():
    graph = load().graph()
    points = [n for n, d in graph.nodes(data=True) if d["kind"] == "point"]
    assert sorted(points) == sorted(LANDMARKS)
    assert graph.edges["left_shoulder", "right_shoulder", "mirror_shoulder"]["kind"] == "symmetry"
    assert graph.edges["left_wrist", "right_wrist", "span_to_length"]["over"] == ("left_neckline", "left_ankle")


@given(st.integers(0, 1000))
def test_shuffling_moves_points_and_keeps_everything_else(seed):
    k = load()
    s = k.shuffled(seed)
    assert s == k.shuffled(seed)
    assert sorted(s.levels.values()) == sorted(k.levels.values())
    for before, after in zip(k.constraints, s.constraints, strict=True):
        assert (type(before), before.name, before.weight) == (type(after), after.name, after.weight)
    assert {c.name: (c.a, c.b) for c in k.constraints} != {c.name: (c.a, c.b) for c in s.constraints}


def line_of(text, needle):
    return next(i for i, row in enumerate(text.splitlines(), 1) if needle in row)


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        (":across 0.25 ; :along 0.30 ; :weight 1.0 ;", ":across 0.25 : :along", ":mirror_neckline a", "not valid Turtle"),
        (":mirror_waist a :Symmetry ; :a :left_waist", ":mirror_waist a :Symmetry ; :a :left_waste", ":mirror_waist", "left_waist"),
        (":gap 0.02 ; :weight 1.0", ':gap "high" ; :weight 1.0', ":waist_above_ankle_left", "must be a number"),
        (":minimum 0.1 ;\n    :maximum 0.9", ":minimum 0.9 ;\n    :maximum 0.1", ":collar_to_shoulders", "empty"),
        (":span_to_length a :Ratio", ":span_to_length a :Ration", ":span_to_length", "did you mean 'Ratio'"),
        (":left_neckline a :KeyPoint", ":left_necklace a :KeyPoint", ":left_necklace", "left_neckline"),
        (":mirror_ankle a :Symmetry ; :a :left_ankle ;", ":mirror_ankle a :Symmetry ;", ":mirror_ankle", "a is given 0 times"),
        (":mirror_ankle a :Symmetry ;", ":mirror_ankle a :Symmetry ; :acros 1 ;", ":mirror_ankle", "did you mean 'across'"),
    ],
)
def test_faults_are_named_with_their_line(tmp_path, old, new, line, message):
    assert old in TEXT
    path = tmp_path / "mine.ttl"
    text = TEXT.replace(old, new, 1)
    path.write_text(text, encoding="utf-8")
    with pytest.raises(DataFileError, match=message) as caught:
        load(path)
    assert caught.value.path == path
    assert caught.value.line == line_of(text, line)


def test_a_missing_file_and_a_bad_graph():
    with pytest.raises(DataFileError, match=r"nowhere\.ttl"):
        load("nowhere.ttl")
    c = Order("x", "left_waist", "left_ankle", 0.1, 1.0, "assumption: none")
    levels = {"left_waist": 0.0, "left_ankle": 1.0}
    with pytest.raises(ParameterError, match="two constraints are called 'x'"):
        Knowledge((c, c), {}, levels)
    with pytest.raises(ParameterError, match="source is missing"):
        Knowledge((Order("x", "left_waist", "left_ankle", 0.1, 1.0, " "),), {}, levels)
    with pytest.raises(ParameterError, match="two levels"):
        Knowledge((c,), {}, {"left_waist": 0.0})
