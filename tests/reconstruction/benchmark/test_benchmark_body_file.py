"""A body from a file: the parametric figure written out and read back, and wrong files."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from mfar_fem.errors import DataFileError
from reconstruction.benchmark.body import direction, draw_body, field, joints
from reconstruction.benchmark.body_field import surface
from reconstruction.benchmark.body_file import load_body, signed_distance, wearing_body
from reconstruction.benchmark.identity import model
from reconstruction.benchmark.splits import Identity

SHARED = Path(__file__).resolve().parents[4] / "shared" / "data" / "vision" / "bodies"
SPEC = dataclasses.replace(draw_body(3), topknot=False, skirt=False)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The figure as an OBJ, shifted as a foreign file would be, with its joints."""
    folder = tmp_path_factory.mktemp("body")
    vertices, faces = surface(field(SPEC), 0.02)
    shift = np.array([0.0, 0.1, -0.9])
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in vertices + shift] + [f"f {a} {b} {c}" for a, b, c in faces + 1]
    (folder / "figure.obj").write_text("\n".join(lines))
    at = joints(SPEC) | {"left_ear": joints(SPEC)["head"] + [0.08, 0, 0], "right_ear": joints(SPEC)["head"] - [0.08, 0, 0]}
    names = [f"{s}_{p}" for s in ("left", "right") for p in ("ear", "shoulder", "elbow", "wrist")]
    (folder / "joints.json").write_text(json.dumps({"figure": {n: (at[n] + shift).tolist() for n in names}}))
    return folder, vertices, faces


def test_pose_and_lengths_come_back(written):
    folder = written[0]
    body, left, right = load_body(str(folder / "figure.obj"), str(folder / "joints.json"))
    h = SPEC.stature
    assert (body.upper, body.fore) == pytest.approx((0.178 * h, 0.146 * h), abs=1e-5)
    for arm, wanted, sign in ((left, SPEC.left_arm, 1.0), (right, SPEC.right_arm, -1.0)):
        for k in (0, 2):  # as directions: the azimuth of a hanging limb is nearly free
            assert direction(*arm[k : k + 2], sign) == pytest.approx(direction(*wanted[k : k + 2], sign), abs=1e-3)
    assert body.vertices[:, 2].min() == pytest.approx(0.0)
    made = joints(wearing_body((body, left, right), draw_body(1)))
    assert made["left_wrist"][0] > 0 > made["right_wrist"][0]


def test_signed_distance_is_that_of_the_analytic_figure(written):
    _, vertices, faces = written
    grid = signed_distance(vertices, faces)
    rng = np.random.default_rng(0)
    points = vertices[rng.integers(0, len(vertices), 3000)] + rng.normal(0, 0.02, (3000, 3))
    exact, wanted = field(SPEC)(points), field(SPEC).with_gradient(points)[1]
    got, gradient = grid.with_gradient(points)
    near = np.abs(exact) < 0.03
    assert np.quantile(np.abs(got - exact)[near], 0.95) < 0.004
    assert np.median(np.einsum("ij,ij->i", gradient, wanted)[near]) > 0.99
    assert grid([[0.0, 0.0, 0.6 * SPEC.stature], [2.0, 0.0, 1.0]]) @ [1, 0] < -0.05
    assert grid([[2.0, 0.0, 1.0]])[0] > 0.5


def test_a_garment_is_draped_on_it(written):
    folder = written[0]
    pytest.importorskip("embreex")
    files = (str(folder / "figure.obj"), str(folder / "joints.json"))
    made = model(Identity("I0000", "half-sleeve", "test", 0, 1, 2, 3), 0.045, files)
    assert made.facts["body"]["file"] == "figure.obj"
    assert made.draped.mean_stretch < 0.03 and made.draped.max_penetration < 0.002
    json.dumps(made.facts)


@pytest.mark.parametrize("change, message", [
    (lambda d: {"figure": {k: v for k, v in d["figure"].items() if k != "left_wrist"}}, r"joints\.json.*left_wrist"),
    (lambda d: {"figure": d["figure"] | {"left_ear": [0, 1]}}, "left_ear.*three finite"),
    (lambda d: {"figure": d["figure"] | {"left_ear": "x"}}, "in metres"),
    (lambda d: {"figure": {k: (-np.array(v) * [1, -1, -1]).tolist() for k, v in d["figure"].items()}}, "face -y"),
    (lambda d: [], "no joint"),
])  # fmt: skip
def test_wrong_joints_are_named(written, tmp_path, change, message):
    folder = written[0]
    wrong = tmp_path / "joints.json"
    wrong.write_text(json.dumps(change(json.loads((folder / "joints.json").read_text()))))
    with pytest.raises(DataFileError, match=message):
        load_body(str(folder / "figure.obj"), str(wrong))


def test_wrong_meshes_are_named(written, tmp_path):
    folder = written[0]
    good = (folder / "figure.obj").read_text().splitlines()
    joints_file = tmp_path / "joints.json"  # without the body's name: any OBJ may use it
    joints_file.write_text(json.dumps(json.loads((folder / "joints.json").read_text())["figure"]))
    inches = [_scaled(line) for line in good]
    cases = {"open.obj": (good[:-3], "not closed"), "inches.obj": (inches, "in metres"), "empty.obj": ([], "OBJ|triangles")}
    for name, (lines, message) in cases.items():
        (tmp_path / name).write_text("\n".join(lines))
        with pytest.raises(DataFileError, match=message):
            load_body(str(tmp_path / name), str(joints_file))
    with pytest.raises(DataFileError, match="no such file"):
        load_body(str(tmp_path / "none.obj"), str(joints_file))


def _scaled(line):
    kind, *numbers = line.split()
    return " ".join([kind, *(str(39.37 * float(n)) for n in numbers)]) if kind == "v" else line


@pytest.mark.skipif(not SHARED.is_dir(), reason="the anny bodies are not here")
def test_the_joints_of_a_scanned_like_body_lie_inside_it():
    body, left, _ = load_body(str(SHARED / "anny_female_armX.obj"), str(SHARED / "coco23_keypoints.json"))
    assert body.shape(body.shoulder[None])[0] < -0.02
    assert 1.6 < np.ptp(body.vertices[:, 2]) < 1.8
    assert left[1] > 30  # armX: held forwards
