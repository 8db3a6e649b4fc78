"""Reprojection into a held-out view, on a ball whose pictures are known exactly."""

import numpy as np
import pytest
from stereo_scene import RADIUS, ball

pytest.importorskip("igl")
pytest.importorskip("embreex")

from mfar_fem.errors import InputError
from reconstruction.restore import photographs
from reconstruction.restore.photographs import Match, read_views, reconstruct, reprojection
from reconstruction.stereo.view import View
from reconstruction.surface.triangles import TriangleMesh

trimesh = pytest.importorskip("trimesh")
AZIMUTHS = (-30, -15, 0, 15, 30)


def views():
    """Photographs have no masks."""
    return [View(v.name, v.image, v.camera, np.ones(v.size, bool)) for v in (ball(a)[0] for a in AZIMUTHS)]


def meeting(found, a, b):
    rng = np.random.default_rng(a + 10 * b)
    points = rng.normal(size=(300, 3))
    points *= RADIUS / np.linalg.norm(points, axis=1)[:, None]
    for k in (a, b):
        way = found[k].centre - points
        points = points[np.einsum("ni,ni->n", points, way) > 0.4 * RADIUS * np.linalg.norm(way, axis=1)]
    return Match(a, b, found[a].project(points)[0], found[b].project(points)[0], points)


def sphere(radius=RADIUS):
    made = trimesh.creation.icosphere(5, radius)
    return TriangleMesh(np.asarray(made.vertices), np.asarray(made.faces))


def test_the_true_surface_brings_points_back_and_a_smaller_one_does_not():
    found = views()
    pairs = [meeting(found, 2, 1), meeting(found, 3, 2), meeting(found, 0, 4)]
    good, small = (reprojection(sphere(r), found, 2, pairs) for r in (RADIUS, 0.9 * RADIUS))
    assert good["matches"] == len(pairs[0].first) + len(pairs[1].first)  # not those of other views
    assert good["on_mesh"] == 1.0 and good["median_px"] < 0.05 and good["within_2px"] == 1.0
    assert small["median_px"] > 0.8 and good["plane_median_px"] > 10 * good["median_px"]


def test_nothing_is_met_by_a_surface_elsewhere():
    found = views()
    away = TriangleMesh(sphere().vertices + 50.0, sphere().faces)
    assert reprojection(away, found, 2, [meeting(found, 2, 1)])["on_mesh"] == 0.0


def test_the_surface_of_the_other_views_is_near_the_ball():
    found = views()
    pairs = [meeting(found, 0, 1), meeting(found, 3, 4), meeting(found, 1, 3)]
    mesh, facts = reconstruct([v for i, v in enumerate(found) if i != 2], np.concatenate([m.points for m in pairs]))
    front = mesh.vertices[mesh.vertices[:, 1] < -0.6 * RADIUS]
    assert np.abs(np.linalg.norm(front, axis=1) - RADIUS).mean() < 0.03 * RADIUS and facts["views"] == 4
    shown = reprojection(mesh, found, 2, [meeting(found, 2, 1)])
    assert shown["on_mesh"] > 0.8 and shown["median_px"] < 0.5 < shown["plane_median_px"]


def test_sets_are_named(tmp_path):
    with pytest.raises(InputError, match="no set 'temple' with cameras; known: alicevision_buddha"):
        read_views(tmp_path, "temple")
    with pytest.raises(InputError, match="holds no folder 'alicevision_buddha'"):
        read_views(tmp_path, "alicevision_buddha")


def test_rows_of_a_killed_run_are_kept(tmp_path, monkeypatch):
    found = views()
    pairs = [meeting(found, 2, 1), meeting(found, 3, 2), meeting(found, 0, 4)]
    monkeypatch.setattr(photographs, "read_views", lambda folder, name: found)
    monkeypatch.setattr(photographs, "matches", lambda views: pairs)
    made = []
    monkeypatch.setattr(photographs, "reconstruct", lambda rest, points: made.append(1) or (sphere(), {"views": len(rest)}))
    first = photographs.study(tmp_path, "balls", tmp_path, 2)
    assert len(made) == first["held_out"] == 2 and first["summary"]["median_px"] < 0.05
    (tmp_path / "balls-without-ball 0.json").unlink()
    assert photographs.study(tmp_path, "balls", tmp_path, 2)["rows"] == first["rows"] and len(made) == 3


def test_the_table_says_how_a_surface_was_made():
    from rich.console import Console

    from reconstruction.cli_restore import _show_photographs

    row = {"held_out": "a", "matches": 3, "median_px": 0.5, "surface": "trimmed only (ragged)", "why": ""}
    console = Console(width=200)
    with console.capture() as text:
        console.print(_show_photographs({"set": "s", "rows": [row], "matched_pairs": 1, "views": 2, "out": "out"})[0])
    assert "surface" in text.get() and "trimmed only (ragged)" in text.get()
