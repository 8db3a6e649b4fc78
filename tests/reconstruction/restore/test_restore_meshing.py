"""The stage ``surface``: the meshes on the way to the solver's and the numbers of their triangles."""

import json

import numpy as np
import pytest
from PIL import Image
from shape_scene import scene

from reconstruction.restore.meshing import ANGLES, TRIMMED, write_surface
from reconstruction.shape.simulation_mesh import simulation_mesh
from reconstruction.surface.triangles import TriangleMesh

pytest.importorskip("embreex")
pytest.importorskip("igl")


@pytest.fixture(scope="module")
def shape():
    mesh, sewn, *_ = scene()
    return {"vertices": mesh.vertices, "faces": mesh.faces, "warp": sewn.warp_in_space(mesh.vertices),
            "noise": np.full(len(mesh.vertices), 0.01)} | {f"opening_{k}": v for k, v in sewn.openings.items()}  # fmt: skip


def test_a_template_that_needs_no_untangling_has_one_mesh(shape, tmp_path):
    np.savez_compressed(tmp_path / "shape.npz", **shape)
    facts = write_surface(tmp_path / "shape.npz", tmp_path, "template", 0.03)
    assert [row["stage"] for row in facts["quality"]] == ["for the solver"] and facts["actions"] == []
    assert not (tmp_path / ANGLES).exists() and not (tmp_path / TRIMMED).exists()
    json.dumps(facts)


def test_where_sheets_crossed_both_meshes_are_counted(shape):
    x = shape["vertices"].copy()
    front = np.flatnonzero((np.abs(x[:, 0]) < 0.05) & (np.abs(x[:, 2] + 0.35) < 0.05) & (x[:, 1] < 0))
    x[front[0], 1] = x[:, 1].max() + 0.03
    made = simulation_mesh(shape | {"vertices": x}, "template", 0.03)
    assert list(made.stages) == ["fitted"] and "passed through" in made.actions[0]


@pytest.mark.slow
def test_the_poisson_surface_shows_every_step(shape, tmp_path):
    pytest.importorskip("gpytoolbox")
    np.savez_compressed(tmp_path / "shape.npz", **shape)
    facts = write_surface(tmp_path / "shape.npz", tmp_path, "poisson", 0.03)
    rows = {row["stage"]: row for row in facts["quality"]}
    assert list(rows) == ["fitted", "trimmed Poisson", "even triangles", "for the solver"]
    assert rows["for the solver"]["angle_1"] > rows["trimmed Poisson"]["angle_1"]
    assert Image.open(tmp_path / ANGLES).size[0] > 1000
    assert len(TriangleMesh.read(tmp_path / TRIMMED).faces) == rows["trimmed Poisson"]["faces"]
