"""Multi-view stereo on a ball: near it where it is seen, named errors where nothing can be seen."""

import numpy as np
import pytest
from stereo_scene import RADIUS, ball

from mfar_fem.errors import InputError
from reconstruction.baselines.mvs import MvsSettings, around, mvs
from reconstruction.stereo.view import View

pytest.importorskip("cv2")
pytest.importorskip("gpytoolbox")


def test_the_seen_side_of_a_ball():
    views = [ball(a)[0] for a in (-40, -20, 0, 20, 40)]
    made = mvs(views, MvsSettings(voxel=0.012))
    off = np.abs(np.linalg.norm(made.mesh.vertices, axis=1) - RADIUS)
    assert np.median(off) < 0.006 and np.percentile(off, 90) < 0.03
    assert made.facts["consistent"] <= made.facts["depths"] and made.facts["views"] == 5
    front = made.mesh.vertices[:, 1] < -0.1
    assert front.mean() > 0.5 and len(made.mesh.boundary_edges) > 0  # the back is not made up


def test_the_box_holds_the_ball():
    box = around([ball(a)[0] for a in (-40, 0, 40)])
    assert (box.min(axis=0) <= -RADIUS + 0.02).all() and (box.max(axis=0) >= RADIUS - 0.02).all()
    assert np.ptp(box, axis=0).max() < 4 * RADIUS


def test_too_little_is_named():
    front, back = ball(0)[0], ball(180)[0]
    with pytest.raises(InputError, match="there are 1"):
        mvs([front])
    with pytest.raises(InputError, match="60 degrees"):
        mvs([front, back])
    empty = View(front.name, front.image, front.camera, np.zeros_like(front.mask))
    with pytest.raises(InputError, match="mask of 'ball 0' is empty"):
        mvs([empty, ball(20)[0]])
    with pytest.raises(InputError, match="along one line"):
        around([front, View("again", front.image, front.camera, front.mask)])
