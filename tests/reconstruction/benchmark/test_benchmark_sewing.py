"""Sewing: topology, what stays open, panel coordinates."""

import numpy as np
import pytest

from reconstruction.benchmark.body import draw_body
from reconstruction.benchmark.cutting import KINDS, draw_cut
from reconstruction.benchmark.sewing import sew
from reconstruction.benchmark.wearing import cut_for

# Euler characteristic of a sphere with as many holes as the garment has openings: robe and half-sleeve four (neck, hem, two cuffs).
EULER = {"round-collar-robe": -2, "half-sleeve": -2, "flying-ribbon": 1, "veil-hat": 1}


def sewn(kind, seed=4, size=0.03):
    return sew(cut_for(draw_cut(kind, seed), draw_body(seed, kind)), size)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", [1, 4, 9])
def test_seams_are_closed_and_openings_open(kind, seed):
    mesh = sewn(kind, seed)
    assert len(mesh.flat) - len(mesh.edges) + len(mesh.faces) == EULER[kind]
    sides = mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    assert len(np.unique(sides, axis=0)) == len(sides)  # oriented manifold: no directed edge twice
    n = len(mesh.flat)
    on_edge = np.isin(mesh.edges[:, 0] * n + mesh.edges[:, 1], mesh.boundary[:, 0] * n + mesh.boundary[:, 1])
    wanted = sum(mesh.garment.panel(p).edge(e).length for p, e in mesh.garment.openings)
    assert mesh.rest_lengths[on_edge].sum() == pytest.approx(wanted, rel=0.01)


@pytest.mark.parametrize("kind", KINDS)
def test_flat_pieces_are_undistorted_and_the_warp_is_vertical(kind):
    mesh = sewn(kind)
    pieces = mesh.unsewn()
    assert np.array_equal(pieces.panel, mesh.panel)
    corners = pieces.flat[pieces.faces][..., :2]
    for i, j in ((0, 1), (1, 2), (2, 0)):
        flat = np.linalg.norm(corners[:, i] - corners[:, j], axis=1)
        assert flat == pytest.approx(np.linalg.norm(mesh.uv[:, i] - mesh.uv[:, j], axis=1), abs=1e-9)
    axis = 0 if kind == "flying-ribbon" else 1  # the ribbon lies across the page
    assert np.abs(pieces.warp(pieces.flat)[:, axis]) == pytest.approx(1.0, abs=0.05)


def test_locate_gives_the_panel_coordinates_back():
    mesh = sewn("round-collar-robe")
    rng = np.random.default_rng(0)
    for face in rng.integers(0, len(mesh.faces), 30):
        weights = rng.dirichlet(np.ones(3))
        uv = weights @ mesh.uv[face]
        found, w = mesh.locate(mesh.garment.panels[mesh.panel[face]].name, uv)
        assert w @ mesh.uv[found] == pytest.approx(uv, abs=1e-12)


def test_trim_distance_at_hem_and_far_from_it():
    mesh = sewn("flying-ribbon")
    u, v = mesh.uv[..., 0], mesh.uv[..., 1]
    cut_width = mesh.garment.panel("band").polygon[:, 0].max()
    half = mesh.garment.panel("band").polygon[:, 1].max()
    exact = np.minimum(np.minimum(u, cut_width - u), half - np.abs(v))
    assert np.abs(mesh.corner_trim - exact).max() < 0.004  # edges are sampled every quarter of a mesh edge
