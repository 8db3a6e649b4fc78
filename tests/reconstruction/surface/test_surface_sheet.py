"""Trimming to the extent of a sheet: rims that no closed curve parts on its own."""

import numpy as np
import pytest
from surface_shapes import euler, noisy_grid

from mfar_fem.errors import ParameterError
from reconstruction.surface.connectivity import boundary_loops, loop_lengths
from reconstruction.surface.sheet import trim_by_sheet
from reconstruction.surface.triangles import TriangleMesh
from reconstruction.surface.trimming import OpeningsError

pytest.importorskip("igl")


def grid(n, m, place):
    """Triangles of a parameter square, (0, 0) to (1, 1), put in space."""
    u, v = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, m + 1))
    i, j = np.meshgrid(np.arange(n), np.arange(m))
    a = (j * (n + 1) + i).ravel()
    faces = np.vstack([np.stack([a, a + 1, a + n + 2], axis=1), np.stack([a, a + n + 2, a + n + 1], axis=1)])
    return TriangleMesh(np.stack(place(u.ravel(), v.ravel()), axis=1), faces)


def strip(n=60, m=6):
    """A ribbon 1.2 m long along a wave, 0.12 m wide."""
    return grid(n, m, lambda u, v: (1.2 * u, 0.12 * v, 0.1 * np.sin(2 * np.pi * u)))


def slit_tube(n=48, m=20, gap=0.02):
    """A tube of radius 0.2 m slit all along one side: one rim, round hem, slit and collar."""
    turn = 2 * np.pi - gap / 0.2
    return grid(n, m, lambda u, v: (0.2 * np.cos(turn * u), 0.2 * np.sin(turn * u), 0.5 * v))


def opened_beyond(sheet, by, cells):
    """A surface that goes on beyond the sheet: the same map over a larger parameter square."""
    return grid(*cells, lambda u, v: sheet((1 + 2 * by) * u - by, (1 + 2 * by) * v - by))


def test_a_wider_surface_is_cut_to_the_ribbon():
    ribbon = strip()
    wider = opened_beyond(lambda u, v: (1.2 * u, 0.12 * v, 0.1 * np.sin(2 * np.pi * u)), 0.3, (150, 24))
    cut = trim_by_sheet(wider, ribbon, 0.05)
    assert cut.mesh.areas.sum() == pytest.approx(ribbon.areas.sum(), rel=2e-3)
    assert len(cut.loops) == 1 and euler(cut.mesh) == 1
    assert cut.lengths[0] == pytest.approx(loop_lengths(ribbon)[0], rel=5e-3)
    assert cut.removed_area == pytest.approx(wider.areas.sum() - cut.mesh.areas.sum())
    assert (np.einsum("ij,ij->i", cut.mesh.face_normals, [[0, 0, 1.0]]) > 0).all()


def test_the_web_over_a_slit_goes():
    tube = slit_tube()
    closed = grid(80, 40, lambda u, v: (0.2 * np.cos(2 * np.pi * u), 0.2 * np.sin(2 * np.pi * u), 0.7 * v - 0.1))
    cut = trim_by_sheet(closed, tube, 0.05)
    across = [len(boundary_loops(tube.faces)), len(cut.loops)]
    assert across == [1, 1]
    assert cut.mesh.areas.sum() == pytest.approx(tube.areas.sum(), rel=5e-3)


def test_the_far_side_of_a_closed_surface_goes():
    sheet = noisy_grid(20, np.random.default_rng(0))  # z = 0, unit square
    x = sheet.vertices * (1.1, 1.1, 0) - (0.05, 0.05, 0)
    both = TriangleMesh(np.vstack([x, x - (0, 0, 0.03)]), np.vstack([sheet.faces, sheet.faces[:, ::-1] + len(x)]))
    cut = trim_by_sheet(both, sheet, 0.08)
    assert cut.mesh.areas.sum() == pytest.approx(1.0, rel=5e-3)
    assert "1 islands or far sides" in cut.actions[0]
    assert np.abs(cut.mesh.vertices[:, 2]).max() < 1e-9


def test_what_does_not_fit_is_named():
    sheet = strip()
    with pytest.raises(OpeningsError, match="nothing of the surface"):
        trim_by_sheet(TriangleMesh(sheet.vertices + np.array([0, 0, 1.0]), sheet.faces), sheet, 0.05)
    with pytest.raises(OpeningsError, match="normals turned"):
        trim_by_sheet(TriangleMesh(sheet.vertices, sheet.faces[:, ::-1]), sheet, 0.05)
    with pytest.raises(ParameterError, match="positive reach"):
        trim_by_sheet(sheet, sheet, 0.0)
    middle = np.abs(sheet.vertices[sheet.faces].mean(axis=1)[:, 0] - 0.6) < 0.05
    with pytest.raises(OpeningsError, match="2 openings, expected 1"):
        trim_by_sheet(sheet.submesh(~middle), sheet, 0.05)
