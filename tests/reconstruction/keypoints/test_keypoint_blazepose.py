"""BlazePose on a rendered body with known joints; its offsets; its errors."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

cv2 = pytest.importorskip("cv2")

from mfar_fem.errors import DataFileError  # noqa: E402
from reconstruction.keypoints.blazepose import COUNTERPARTS, BlazePose, debiased  # noqa: E402
from reconstruction.keypoints.crops import apply  # noqa: E402
from reconstruction.keypoints.data import Sample  # noqa: E402
from reconstruction.landmarks import INDEX, LANDMARKS  # noqa: E402

SHARED = Path(__file__).resolve().parents[4] / "shared/data/vision"
MODEL = SHARED / "weights/pose_landmark_full.tflite"


def render(folder):
    """A body seen from the front, shaded, and the joints in its picture."""
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.load(SHARED / "bodies/anny_male_rest.obj", process=False)
    joints = json.loads((SHARED / "bodies/coco23_keypoints.json").read_text())["anny_male_rest"]
    v, f = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    scale, foot = 430 / np.ptp(v[:, 2]), v[:, 2].min()

    def project(p):
        return np.stack([192 + scale * p[..., 0], 480 - scale * (p[..., 2] - foot)], axis=-1)

    shade = np.clip(np.asarray(mesh.face_normals) @ [-0.3, -0.8, 0.5], 0, 1)
    image, corners = np.full((512, 384, 3), 200, np.uint8), np.round(16 * project(v)).astype(np.int32)
    for i in np.argsort(-v[f][:, :, 1].mean(axis=1)):
        c = int(60 + 150 * shade[i])
        cv2.fillConvexPoly(image, corners[f[i]], (int(0.7 * c), int(0.8 * c), c), cv2.LINE_AA, 4)
    path = folder / "body.png"
    cv2.imwrite(str(path), image)
    return path, {name: project(np.array(joints[name])) for name in COUNTERPARTS}, 430


@pytest.mark.skipif(not MODEL.exists(), reason="needs the weights of BlazePose")
def test_it_finds_the_joints_of_a_rendered_body(tmp_path):
    pytest.importorskip("ai_edge_litert")
    path, joints, height = render(tmp_path)
    all_points = np.ones(12, bool)
    found = BlazePose(MODEL).predict([Sample(path, np.zeros((12, 2)), all_points, all_points)])[0]
    for name in LANDMARKS:
        if name in joints:
            assert np.linalg.norm(found[INDEX[name]] - joints[name]) < 0.045 * height, name
        else:
            assert np.isnan(found[INDEX[name]]).all()


def test_offsets_turn_and_grow_with_the_figure():
    rng = np.random.default_rng(0)
    joints, offset = rng.normal(0, 30, (12, 2)), rng.normal(0, 5, (12, 2))
    joints -= joints.mean(axis=0)

    def seen(angle, scale, shift):
        c, s = scale * np.cos(angle), scale * np.sin(angle)
        matrix = np.array([[c, -s, shift], [s, c, 3.0]])
        return apply(matrix, joints), apply(matrix, joints + offset)

    views = [seen(*v) for v in ((0.0, 1.0, 5.0), (0.4, 2.0, -9.0), (-0.3, 0.5, 70.0))]
    every = np.ones(12, bool)
    training = [Sample(Path("x"), truth, every, every) for _, truth in views[:2]]
    made = debiased(np.array([views[2][0]]), np.array([p for p, _ in views[:2]]), training)
    columns = [INDEX[name] for name in COUNTERPARTS]
    assert made[0, columns] == pytest.approx(views[2][1][columns], abs=1e-6)


def test_wrong_files_are_named(tmp_path):
    pytest.importorskip("ai_edge_litert")
    with pytest.raises(DataFileError, match="no such file"):
        BlazePose(tmp_path / "none.tflite")
    (tmp_path / "text.tflite").write_text("hello")
    with pytest.raises(DataFileError, match="LiteRT"):
        BlazePose(tmp_path / "text.tflite")
