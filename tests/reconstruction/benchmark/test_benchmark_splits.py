"""Splits do not leak and can grow."""

from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mfar_fem.errors import ParameterError
from reconstruction.benchmark.identity import shots
from reconstruction.benchmark.splits import FOLDS, HELD_OUT, HELD_OUT_DAMAGE, SEEN, identities


def test_seventy_identities_split_40_10_20_and_ten_of_the_held_out_type():
    made = identities(70, 0)
    assert Counter(i.split for i in made) == {"train": 40, "validation": 10, "test": 20, "test-type": 10}
    for split in ("train", "validation", "test"):
        kinds = Counter(i.kind for i in made if i.split == split)
        assert set(kinds) == set(SEEN) and max(kinds.values()) - min(kinds.values()) <= 1
    for fold in range(FOLDS):
        kinds = Counter(i.kind for i in made if i.fold == fold)
        assert set(kinds) == set(SEEN) and 12 <= sum(kinds.values()) <= 16


@given(st.integers(1, 150), st.integers(0, 2**40))
@settings(max_examples=30)
def test_nothing_is_shared_and_a_benchmark_can_grow(count, seed):
    made = identities(count, seed)
    for name in ("garment_seed", "body_seed", "texture_seed", "name", "stem"):
        assert len({getattr(i, name) for i in made}) == len(made)
    assert {i.kind for i in made if i.split == "test-type"} == {HELD_OUT}
    assert all((i.kind == HELD_OUT) == (i.split == "test-type") == (i.fold == -1) for i in made)
    longer = {i.name: i for i in identities(count + 9, seed)}
    assert all(longer[i.name] == i for i in made)


def test_the_held_out_damage_is_in_test_pictures_only():
    for identity in identities(21, 3):
        plan = shots(identity)
        assert [s.style for s in plan[:8]] == ["figurine"] * 4 + ["mural"] * 3 + ["textile"]
        assert any(s.damage == HELD_OUT_DAMAGE for s in plan) == identity.split.startswith("test")
        assert all(s.damage < HELD_OUT_DAMAGE for s in plan[:8])
        assert len({s.damage for s in plan if s.style == "figurine" and s.view < 4}) == 1  # one object, several cameras
        assert len({s.seed for s in plan}) == len(plan) and len({s.label for s in plan}) == len(plan)


def test_another_seed_gives_others_and_nonsense_is_refused():
    a, b = ({i.garment_seed for i in identities(70, s)} for s in (0, 1))
    assert not a & b
    with pytest.raises(ParameterError, match="at least 1"):
        identities(0, 0)
    with pytest.raises(ParameterError, match="negative"):
        identities(3, -1)


def test_few_pictures_are_some_of_the_full_set():
    for identity in identities(21, 3):
        full, few = shots(identity), shots(identity, 3)
        assert len(few) == 3 and set(few) <= set(full) and few == shots(identity, 3)
        assert shots(identity, 99) == full
    styles = {s.style for i in identities(21, 3) for s in shots(i, 3)}
    assert styles == {"figurine", "mural", "textile"}
