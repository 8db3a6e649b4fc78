"""Multi-view stereo on a ball: near it where it is seen, named errors where nothing can be seen."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from mfar_fem.errors import InputError
from reconstruction.baselines.mvs import MvsSettings, around, mvs
from reconstruction.stereo.view import View

pytest.importorskip("cv2")
pytest.importorskip("gpytoolbox")


def _scene():
    path = Path(__file__).parents[1] / "stereo" / "stereo_scene.py"
    if "stereo_scene" not in sys.modules:
        spec = importlib.util.spec_from_file_location("stereo_scene", path)
        module = importlib.util.module_from_spec(spec)
        sys.modules["stereo_scene"] = module
        spec.loader.exec_module(module)
    return sys.modules["stereo_scene"]


def test_the_seen_side_of_a_ball():
    scene = _scene()
    views = [scene.ball(a)[0] for a in (-40, -20, 0, 20, 40)]
    made = mvs(views, MvsSettings(voxel=0.012))
    off = np.abs(np.linalg.norm(made.mesh.vertices, axis=1) - scene.RADIUS)
    assert np.median(off) < 0.006 and np.percentile(off, 90) < 0.03
    assert made.facts["consistent"] <= made.facts["depths"] and made.facts["views"] == 5
    front = made.mesh.vertices[:, 1] < -0.1
    assert front.mean() > 0.5 and len(made.mesh.boundary_edges) > 0  # the back is not made up


def test_the_box_holds_the_ball():
    scene = _scene()
    box = around([scene.ball(a)[0] for a in (-40, 0, 40)])
    assert (box.min(axis=0) <= -scene.RADIUS + 0.02).all() and (box.max(axis=0) >= scene.RADIUS - 0.02).all()
    assert np.ptp(box, axis=0).max() < 4 * scene.RADIUS


def test_too_little_is_named():
    scene = _scene()
    front, back = scene.ball(0)[0], scene.ball(180)[0]
    with pytest.raises(InputError, match="there are 1"):
        mvs([front])
    with pytest.raises(InputError, match="60 degrees"):
        mvs([front, back])
    empty = View(front.name, front.image, front.camera, np.zeros_like(front.mask))
    with pytest.raises(InputError, match="mask of 'ball 0' is empty"):
        mvs([empty, scene.ball(20)[0]])
