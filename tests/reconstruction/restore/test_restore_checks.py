"""What is checked before and between stages: libraries, the scale of cameras; and how steps become shares."""

import importlib.util

import numpy as np
import pytest

from mfar_fem.errors import InputError, MissingDependencyError
from reconstruction.landmarks import INDEX
from reconstruction.measure.skeleton import Skeleton
from reconstruction.restore import requirements
from reconstruction.restore.calibration import check_scale, scale_of
from reconstruction.restore.pipeline import Failure, RestoreSettings
from reconstruction.restore.progress import counter
from reconstruction.shape.landmarks3d import SpacePoints


def points(size=1.0, without=()):
    at = size * Skeleton.canonical(1.65).points
    for name in without:
        at[INDEX[name]] = np.nan
    return SpacePoints(at, np.full(12, 0.01), np.full(12, 3))


def test_a_figure_of_the_right_size_passes():
    assert scale_of(points(), 1.65) == pytest.approx(1.0, abs=0.15)
    for size in (1 / 1.3, 1.0, 1.3):
        assert check_scale(points(size), 1.65) == []
    for size in (1 / 1.9, 1.9):  # badly found, or uncommon: said, not refused
        (doubt,) = check_scale(points(size), 1.65)
        assert "times too" in doubt and "metres" in doubt
    check_scale(points(1000, without=("left_shoulder", "left_waist")), 1.65)  # nothing to tell it by


@pytest.mark.parametrize(("size", "words"), [
    (1e3, "too large.* but in millimetres.* by 1e\\+03"), (1e2, "too large.*centimetres.* by 100"), (3.28, "too large.*feet.*3.28"),
    (0.2, "times too small for a figure of 1.65 m: the cameras are likely not in metres. .*'height'"),
])  # fmt: skip
def test_cameras_that_are_not_in_metres(size, words):
    with pytest.raises(InputError, match=words):
        check_scale(points(size), 1.65)
    with pytest.raises(InputError, match=words):
        check_scale(points(size, without=("right_shoulder",)), 1.65)


def test_one_mistaken_landmark_is_no_other_unit():
    wrong = points()
    wrong.points[INDEX["left_shoulder"], 0] += 1.0
    check_scale(wrong, 1.65)


def test_what_is_missing_is_named_with_its_extra_before_anything_else(monkeypatch):
    true = importlib.util.find_spec
    monkeypatch.setattr(requirements, "find_spec", lambda name: None if name in ("torch", "ipctk") else true(name) or object())
    with pytest.raises(MissingDependencyError, match=r"needs torch, ipctk: pip install 'mfar-fem\[torch,contact\]'; --no-drape"):
        requirements.check_libraries("template", True, "standard")
    for drape, fidelity in ((True, "draft"), (False, "standard")):  # no contact by barriers
        with pytest.raises(MissingDependencyError, match=r"needs torch: pip install 'mfar-fem\[torch\]'$"):
            requirements.check_libraries("template", drape, fidelity)
    assert "gpytoolbox" in requirements.modules("poisson", False, "draft")
    assert "gpytoolbox" not in requirements.modules("template", True, "draft")


def test_the_command_says_so_first(monkeypatch, tmp_path):
    from reconstruction.restore.pipeline import restore

    monkeypatch.setattr(requirements, "find_spec", lambda name: None)
    with pytest.raises(MissingDependencyError, match="torch"):
        restore(tmp_path / "nothing", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_steps_become_shares():
    told = []
    step = counter(told.append)
    step(3)
    assert told == []
    step(0, total=8)
    step()
    step("a label")
    assert told == [3 / 8, 4 / 8, 5 / 8]


def test_advice_fits_the_settings():
    def advice(stage, **settings):
        return [text.split(":")[0] for text in Failure.of(stage, InputError("why"), RestoreSettings(**settings)).advice]

    assert advice("drape") == ["--no-drape", "--fidelity draft", "--fabric"]
    assert advice("drape", fidelity="draft") == ["--no-drape", "--fabric"]
    assert advice("surface", surface="poisson", fidelity="reference") == ["--surface template, the default", "--fidelity standard"]
    assert advice("surface") == ["--fidelity draft", "more or other pictures"]
