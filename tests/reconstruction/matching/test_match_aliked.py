"""ALIKED through kornia with published weights: checked like SIFT, and every wrong file refused by name."""

from __future__ import annotations

import numpy as np
import pytest
from match_scenes import VISION, needs

from mfar_fem.errors import DataFileError
from reconstruction import images
from reconstruction.matching import MatchSettings, cameras, detect, match_pair

torch = pytest.importorskip("torch")
pytest.importorskip("kornia")


def settings(path):
    return MatchSettings(detector="aliked", weights=str(path), estimator="magsac")


@needs["weights"]
@needs["middlebury_templeRing"]
def test_neighbouring_views_agree_with_the_cameras():
    folder = VISION / "middlebury_templeRing"
    known = cameras.read_middlebury(folder / "templeR_par.txt")
    names = ("templeR0013.png", "templeR0014.png")
    use = settings(VISION / "weights" / "aliked-t16.pth")
    found = []
    for name in names:
        image = images.load(folder / name)
        found.append(detect(image.grey, use, image.rgb))
    assert np.allclose(np.linalg.norm(found[0].descriptors, axis=1), 1, atol=1e-4)
    result = match_pair(*found, use, names, (known[names[0]], known[names[1]]))
    assert result.status == "matched" and result.inliers > 200 and result.sampson_cameras < 0.3


def test_wrong_files_of_weights_are_refused(tmp_path):
    grey = np.random.default_rng(0).integers(0, 255, (64, 64), dtype=np.uint8)
    (tmp_path / "aliked-n16.pth").write_bytes(b"not weights")
    torch.save({"a": torch.zeros(3)}, tmp_path / "aliked-t16.pth")
    torch.save([1, 2], tmp_path / "aliked-n32.pth")
    for name, says in (
        ("other.pth", "not named after"),
        ("aliked-n16rot.pth", "no such file"),
        ("aliked-n16.pth", "not a file of torch"),
        ("aliked-t16.pth", "does not hold the weights"),
        ("aliked-n32.pth", "does not hold"),
    ):
        with pytest.raises(DataFileError, match=says):
            detect(grey, settings(tmp_path / name))
