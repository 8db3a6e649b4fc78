"""Meshes come back from every format as they went, and bad files are refused with their name."""

import numpy as np
import pytest

from mfar_fem.errors import DataFileError
from mfar_fem.surface import io, patterns


@pytest.fixture(scope="module")
def mesh():
    return patterns.sphere(0.4, (0, 1.0), (0.1, 1.0), 5, 4, "union")


@pytest.mark.parametrize("suffix", [*io.MESHIO, *io.TRIMESH])
def test_round_trip_keeps_the_order(mesh, suffix, tmp_path):
    path = io.write_mesh(tmp_path / f"a{suffix}", mesh.vertices, mesh.triangles)
    back = io.read_mesh(path)
    assert len(back.vertices) == len(mesh.vertices)
    single = suffix in io.TRIMESH
    exact = mesh.vertices[mesh.triangles]
    np.testing.assert_allclose(back.vertices[back.triangles], exact, rtol=0, atol=2e-8 if single else 1e-15)
    if suffix != ".stl":
        assert np.array_equal(back.triangles, mesh.triangles)
    assert back.vertices.dtype == np.float64 and back.triangles.dtype == np.int64


@pytest.mark.parametrize("suffix", [".vtu", ".vtk", ".msh"])
def test_data_goes_along(mesh, suffix, tmp_path):
    height, number = mesh.vertices[:, 2], np.arange(float(len(mesh.triangles)))
    path = io.write_mesh(tmp_path / f"a{suffix}", mesh.vertices, mesh.triangles, {"height": height}, {"number": number})
    back = io.read_mesh(path, scale=0.001)
    np.testing.assert_array_equal(back.vertex_data["height"], height)
    np.testing.assert_array_equal(back.triangle_data["number"], number)
    np.testing.assert_allclose(back.vertices, 0.001 * mesh.vertices, rtol=1e-15)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n", "quad"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 9\n", "names vertex"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\n", "triangle"),
        ("a.ply", "not a ply", "readable"),
        ("a.vtu", "<VTKFile", "readable"),
        ("a.stl", "", "a.stl"),
        ("a.glb", "nothing", "readable"),
        ("a.msh", "", "readable"),
        ("a.xyz", "", "unknown mesh format"),
        ("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\nnan 1 0\n3 0 1 2\n", "not finite"),
    ],
)
def test_bad_files(name, content, says, tmp_path, capfd):
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(DataFileError, match=says) as caught:
        io.read_mesh(path)
    assert name in str(caught.value) and caught.value.exit_code == 2
    assert capfd.readouterr().out == ""


def test_missing_and_unwritable(mesh, tmp_path):
    with pytest.raises(DataFileError, match="no such file"):
        io.read_mesh(tmp_path / "none.obj")
    for suffix in (".vtu", ".stl", ".obj"):
        with pytest.raises(DataFileError, match="cannot be written"):
            io.write_mesh(tmp_path / "no" / "folder" / f"a{suffix}", mesh.vertices, mesh.triangles)
