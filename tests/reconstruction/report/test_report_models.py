"""Models go into the page and come out where they were."""

import base64

import numpy as np
import pytest
from report_trial import tube

from mfar_fem.errors import InputError
from reconstruction.report.content import Model, Scalar
from reconstruction.report.packing import NONE, frames, packed, packed_mesh, packed_model
from reconstruction.report.simplify import carried, cluster, simplified
from reconstruction.report.still import still
from reconstruction.report.strokes import warp_strokes
from reconstruction.surface.triangles import TriangleMesh


def numbers(text, kind):
    return np.frombuffer(base64.b64decode(text), kind)


def positions(packed_):
    q = numbers(packed_["positions"], "<u2").reshape(-1, 3)
    return np.array(packed_["low"]) + q / 65535 * np.array(packed_["size"])


def test_coordinates_are_kept_within_half_a_step():
    mesh = tube()
    out = packed_mesh(mesh)
    np.testing.assert_allclose(positions(out), mesh.vertices, atol=1.5 / 131070 * 1.001)
    np.testing.assert_array_equal(numbers(out["triangles"], "<u2").reshape(-1, 3), mesh.faces)


def test_a_flat_mesh_and_one_of_many_vertices():
    flat = TriangleMesh([[0, 0, 2.0], [1, 0, 2], [0, 1, 2]], [[0, 1, 2]])
    np.testing.assert_allclose(positions(packed_mesh(flat)), flat.vertices, atol=1e-5)
    large = tube(around=300, along=250)
    out = packed_mesh(large)
    assert out["wide"]
    np.testing.assert_array_equal(numbers(out["triangles"], "<u4").reshape(-1, 3), large.faces)


def test_values_scale_and_gaps():
    mesh = TriangleMesh([[0, 0, 0.0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 3, 2]])
    s = packed_model(Model("m", mesh, [Scalar("d", np.array([-1.0, 2.0, np.nan, 12.0]), "mm", 0, 10)]))["scalars"][0]
    np.testing.assert_array_equal(numbers(s["values"], "<u2"), [0, round(0.2 * 65534), NONE, 65534])
    assert (s["low"], s["high"], s["gaps"], s["below"], s["above"]) == (0, 10, True, True, True)
    constant = packed_model(Model("m", mesh, [Scalar("d", np.full(4, 3.0))]))["scalars"][0]
    assert (constant["low"], constant["high"], constant["gaps"]) == (3, 3, False)


def test_a_scale_that_falls_is_refused():
    mesh = TriangleMesh([[0, 0, 0.0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    with pytest.raises(InputError, match="goes from 5"):
        packed_model(Model("m", mesh, [Scalar("d", np.zeros(3), "", 5, 1)]))


@pytest.mark.parametrize(("change", "said"), [
    ({"scalars": [Scalar("d", np.zeros(2))]}, "one a vertex"), ({"lines": np.zeros((4, 3))}, r"\(n, 2, 3\)"),
    ({"lines": np.full((1, 2, 3), np.nan)}, "not finite"),
])  # fmt: skip
def test_what_does_not_fit_a_model_is_refused(change, said):
    mesh = TriangleMesh([[0, 0, 0.0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    with pytest.raises(InputError, match=said):
        Model("m", mesh, **change)


def test_models_that_lie_together_share_a_frame_others_do_not():
    mesh = tube()
    near = TriangleMesh(mesh.vertices + 0.05, mesh.faces)
    far = TriangleMesh(mesh.vertices + 9, mesh.faces)
    a, b = frames([mesh, near])
    assert a == b
    a, b = frames([mesh, far])
    assert a != b and a["radius"] == pytest.approx(b["radius"])
    np.testing.assert_allclose(np.subtract(b["centre"], a["centre"]), 9)
    assert frames([mesh], near) == frames([mesh, near])[:1]
    assert frames([mesh], far) == frames([mesh])


def test_fewer_triangles_stay_on_the_tube_and_are_announced():
    mesh = tube(around=120, along=120)
    coarse, to, cell = simplified(mesh, 5000)
    assert 2500 < len(coarse.faces) <= 5000
    # the mean of an arc of length c lies c²/24r inside
    off = np.linalg.norm(coarse.vertices[:, :2], axis=1) - 0.3
    assert off.max() < 1e-9 and -off.min() < 2 * cell**2 / (24 * 0.3) * 2
    assert np.linalg.norm(coarse.vertices[to] - mesh.vertices, axis=1).max() <= cell * np.sqrt(3)
    assert coarse.areas.sum() == pytest.approx(mesh.areas.sum(), rel=0.06)
    out = packed_model(Model("m", mesh, [Scalar("z", mesh.vertices[:, 2])], note="Noted."), 5000)
    assert out["all_faces"] == len(mesh.faces) and out["faces"] == len(coarse.faces)
    assert out["note"].startswith(f"Noted. Shown with {len(coarse.faces)} of {len(mesh.faces)} triangles")
    z = numbers(out["scalars"][0]["values"], "<u2") / 65534
    s = out["scalars"][0]
    np.testing.assert_allclose(s["low"] + z * (s["high"] - s["low"]), coarse.vertices[:, 2], atol=1e-4)
    same, _, none = simplified(mesh, 10**6)
    assert same is mesh and none == 0


def test_joined_values_leave_gaps_out():
    np.testing.assert_array_equal(carried([1, np.nan, np.nan, 5.0], np.array([0, 0, 1, 2])), [1, np.nan, 5])


def test_joined_faces_neither_vanish_nor_double():
    mesh = tube()
    coarse, _ = cluster(mesh, 0.06)
    f = np.sort(coarse.faces, axis=1)
    assert (np.diff(f, axis=1) > 0).all() and len(np.unique(f, axis=0)) == len(f)
    outward = np.sum(coarse.face_normals[:, :2] * coarse.vertices[coarse.faces].mean(axis=1)[:, :2], axis=1)
    assert (outward > 0).all()


def test_strokes_follow_a_helix_on_the_surface():
    mesh = tube()
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    around = np.column_stack([-middle[:, 1], middle[:, 0], np.zeros(len(middle))])
    helix = around / np.linalg.norm(around, axis=1, keepdims=True) + [0, 0, 1.0]
    lines = warp_strokes(mesh, helix, 500, 0.02)
    np.testing.assert_allclose(np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1), 0.02)
    np.testing.assert_allclose((lines[:, 1] - lines[:, 0])[:, 2] / 0.02, np.sqrt(0.5), atol=0.01)
    radius = np.linalg.norm(lines.mean(axis=1)[:, :2], axis=1)
    assert radius.max() <= 0.3 + 1e-9 and radius.min() >= 0.3 * np.cos(np.pi / 48) - 1e-9
    # even over the height: a tenth of them in a tenth of it
    share = np.mean(lines.mean(axis=1)[:, 2] < 0.15)
    assert 0.08 < share < 0.12
    np.testing.assert_array_equal(lines, warp_strokes(mesh, helix, 500, 0.02))


def test_no_strokes_where_there_is_no_direction():
    mesh = tube()
    field = np.tile([0, 0, 1.0], (len(mesh.faces), 1))
    field[mesh.vertices[mesh.faces].mean(axis=1)[:, 2] > 0.75] = np.nan
    lines = warp_strokes(mesh, field, 300, 0.001)
    assert lines[:, :, 2].max() < 0.8
    assert len(warp_strokes(mesh, np.zeros_like(field))) == 0
    with pytest.raises(InputError, match="one a face"):
        warp_strokes(mesh, field[:5])


def test_the_still_picture_shows_front_and_back():
    """Of the half of a tube behind the axis one sees the inside from the front and the outside from the back."""
    import io

    from PIL import Image

    mesh = tube()
    half = mesh.submesh(mesh.vertices[mesh.faces].mean(axis=1)[:, 1] > 0)
    picture = np.asarray(Image.open(io.BytesIO(still(half))).convert("RGB")).astype(int)
    middle = picture.shape[1] // 2
    front, back = picture[150:400, :middle], picture[150:400, middle:]

    def blue(p):
        seen = p[(p.sum(axis=2) < 720)]
        return float(np.mean(seen[:, 2] > seen[:, 0]))

    assert blue(front) > 0.9 and blue(back) < 0.1


def test_packed_is_deterministic_plain_data():
    import json

    mesh = tube()
    one = json.dumps(packed([Model("a", mesh, lines=warp_strokes(mesh, np.tile([0, 0, 1.0], (len(mesh.faces), 1))))], mesh))
    two = json.dumps(packed([Model("a", mesh, lines=warp_strokes(mesh, np.tile([0, 0, 1.0], (len(mesh.faces), 1))))], mesh))
    assert one == two
