"""The study's numbers against what is known: spheres, rims, paired differences."""

import numpy as np
import pytest

from mfar_fem.errors import SurfaceError
from reconstruction.restore import study
from reconstruction.surface.triangles import TriangleMesh

trimesh = pytest.importorskip("trimesh")
pytest.importorskip("igl")


def ball(radius, part=False):
    mesh = trimesh.creation.icosphere(4, radius)
    faces = mesh.faces[mesh.vertices[mesh.faces].min(axis=1)[:, 2] > 0] if part else mesh.faces
    used, inverse = np.unique(faces, return_inverse=True)
    return TriangleMesh(mesh.vertices[used], inverse.reshape(-1, 3))


def test_concentric_spheres_are_their_radii_apart():
    row = study.distances(ball(0.31), ball(0.30))
    for name in ("mean", "off_mean", "off_median", "missing_mean", "missing_95", "largest"):
        assert row[name] == pytest.approx(10.0, abs=0.8), name
    assert "rim_mean" not in row
    assert study.distances(ball(0.3), ball(0.3))["largest"] < 1e-6 < row["floor"] < 10


def test_a_missing_half_counts_in_one_direction_only():
    row = study.distances(ball(0.3, part=True), ball(0.3))
    assert row["off_mean"] < 1e-6 and row["missing_mean"] > 40
    assert row["mean"] == pytest.approx(0.5 * row["missing_mean"])
    assert study.distances(ball(0.3, part=True), ball(0.3, part=True))["rim_mean"] == 0.0


def row(seed, method, mean, why=""):
    values = dict.fromkeys(("off_mean", "off_median", "missing_mean", "missing_95", "largest", "floor", "seconds"), mean)
    return {"garment": "half-sleeve", "seed": seed, "method": method, "why": why} | ({} if why else {"mean": mean} | values)


def test_differences_are_paired_by_garment():
    rows = [row(s, "restored", 10.0 * s) for s in (1, 2, 3)] + [row(s, "MVS", 10.0 * s + 5) for s in (1, 2, 3)]
    found = {r["method"]: r for r in study.summary([*rows, row(4, "MVS", 0.0, "too few points")])}
    mvs = found["MVS"]
    assert (mvs["worse_by"], mvs["worse_by_low"], mvs["worse_by_high"]) == pytest.approx((5.0, 5.0, 5.0))
    assert mvs["cases"] == 4 and mvs["failed"] == 1 and "worse_by" not in found["restored"]
    assert found["restored"]["mean_low"] < 20.0 == found["restored"]["mean"] < found["restored"]["mean_high"]


def test_a_method_that_fails_is_a_row_that_says_why():
    (only,) = study.summary([row(1, "poisson", 0.0, str(SurfaceError("no surface")))])
    assert only["failed"] == 1 and "mean" not in only
