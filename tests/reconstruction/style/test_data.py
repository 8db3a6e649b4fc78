"""Lists, folders and patches."""

from types import SimpleNamespace

import numpy as np
import pytest

from mfar_fem.errors import DataFileError, ParameterError
from reconstruction.landmarks import KINDS
from reconstruction.style.data import Pool, StyledImage, drawn_pool, from_benchmark, from_folders, load_pool, read_list


@pytest.fixture
def pool():
    return drawn_pool(0, 2, size=80, patch=48)


def save(path, seed=0, size=(70, 60)):
    image = pytest.importorskip("PIL.Image")
    image.fromarray(np.random.default_rng(seed).integers(0, 255, (*size, 3), dtype=np.uint8)).save(path)
    return path


def test_batches_pair_different_kinds_and_repeat_by_seed(pool):
    one, two = (pool.batch(np.random.default_rng(3), 16) for _ in range(2))
    assert one.like.shape == one.image.shape == (16, 48, 48, 3)
    assert (one.kind_like != one.kind_image).all() and set(one.kind_like) | set(one.kind_image) == {0, 1, 2}
    assert np.array_equal(one.like, two.like) and np.array_equal(one.image, two.image)


def test_registered_pairs_show_one_window_of_one_subject():
    """Each picture is its own ramp, the subjects' ramps differ: equal patches mean equal windows of one subject."""
    ramps = [np.add.outer(np.arange(80.0), s * np.arange(80.0)) for s in (0.2, 1.0)]
    pictures = tuple(np.rint(ramp / ramp.max() * 255)[..., None].repeat(3, 2).astype(np.uint8) for ramp in ramps for _ in range(2))
    pool = Pool(pictures, (0, 1, 0, 1), ("a", "a", "b", "b"), 48)
    batch = pool.batch(np.random.default_rng(0), 12, registered=True)
    assert np.array_equal(batch.like, batch.image) and (batch.kind_like != batch.kind_image).all()
    assert len({patch.tobytes() for patch in batch.like}) > 6
    loose = pool.batch(np.random.default_rng(0), 12)
    assert not np.array_equal(loose.like, loose.image)


def test_registered_pairs_need_common_subjects(pool):
    alone = Pool(pool.pictures, pool.kinds, tuple(str(k) for k in range(len(pool.kinds))), 48)
    with pytest.raises(ParameterError, match="one subject"):
        alone.batch(np.random.default_rng(0), 2, registered=True)


def test_one_kind_or_small_pictures_are_refused(pool):
    with pytest.raises(ParameterError, match="at least two"):
        Pool(pool.pictures[:1], (0,), ("",), 48)
    with pytest.raises(DataFileError, match=r"picture 0.*80 x 80 pixels; patches need 100"):
        Pool(pool.pictures, pool.kinds, pool.subjects, 100)


def test_digest_follows_the_pixels(pool):
    changed = [p.copy() for p in pool.pictures]
    changed[0][0, 0, 0] ^= 1
    assert Pool(tuple(changed), pool.kinds, pool.subjects, 48).digest != pool.digest == drawn_pool(0, 2, size=80, patch=48).digest


def test_lists_and_folders(tmp_path):
    for kind in ("mural", "textile"):
        (tmp_path / kind).mkdir()
        save(tmp_path / kind / "robe.png")
    (tmp_path / "list.csv").write_text("path,kind,subject\nmural/robe.png,mural,1\ntextile/robe.png,textile,1\n")
    listed = read_list(tmp_path / "list.csv")
    assert listed[1] == StyledImage(tmp_path / "textile/robe.png", "textile", "1")
    assert [s.subject for s in from_folders({k: tmp_path / k for k in ("mural", "textile")})] == ["robe", "robe"]
    pool = load_pool(listed, patch=48)
    assert pool.kinds == (KINDS.index("mural"), KINDS.index("textile"))
    with pytest.raises(DataFileError, match=r"robe\.png.*60 x 70 pixels; patches need 64"):
        load_pool(listed, patch=64)


@pytest.mark.parametrize(("text", "message"), [
    ("path,kind\nx.png,murals\n", "line 2, column 'kind'.*did you mean 'mural'"),
    ("file,kind\nx.png,mural\n", "missing: path"), ("path,kind\n", "no pictures"),
])
def test_wrong_lists_say_where(tmp_path, text, message):
    (tmp_path / "list.csv").write_text(text)
    with pytest.raises(DataFileError, match=message):
        read_list(tmp_path / "list.csv")


def test_missing_places_are_named(tmp_path):
    with pytest.raises(DataFileError, match="nothing"):
        from_folders({"mural": tmp_path / "nothing"})
    with pytest.raises(ParameterError, match="mural"):
        from_folders({"fresco": tmp_path})
    with pytest.raises(DataFileError, match="cannot be read"):
        read_list(tmp_path / "none.csv")


def test_a_benchmark_gives_one_split_without_subjects(monkeypatch):
    index = pytest.importorskip("reconstruction.benchmark.index")
    entries = [SimpleNamespace(path=f"{k}.jpg", style=style, split=split)
               for k, (style, split) in enumerate([("mural", "train"), ("textile", "test"), ("figurine", "train")])]
    monkeypatch.setattr(index, "load_index", lambda folder: SimpleNamespace(samples=entries))
    assert from_benchmark("x") == [StyledImage("0.jpg", "mural"), StyledImage("2.jpg", "figurine")]
    with pytest.raises(DataFileError, match="split 'validation'"):
        from_benchmark("x", "validation")
