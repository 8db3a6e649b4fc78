"""Picture frame and bias extension: kinematics, exact forces, recovery of the law's shear."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from material_tests.shear import run
from material_tests.shear.bias import bias_extension, reduce_record
from material_tests.shear.kinematics import (
    bias_angle,
    bias_displacement,
    bias_force,
    bias_normalise,
    frame_displacement,
    frame_force,
    frame_normalise,
    law_moment,
    zone,
)
from material_tests.shear.picture_frame import homogeneous_force, picture_frame
from material_tests.shear.plots import save_pictures
from mfar_fem.errors import InputError
from mfar_fem.materials import Bending, Fabric, get_law

SHARED = Path(__file__).parents[3] / "shared" / "data" / "shear" / "cao2008_bias_extension_glass_plain_150_450.csv"
G = 3e5


def fabric(ratio=1e3, law=None):
    law = law or get_law("st-venant-kirchhoff", Ew=ratio * G, Ef=ratio * G, nu=0.0, G=G)
    return Fabric("test", law, 1e-4, 0.1, Bending.from_rigidities(1e-5, 1e-5))


@settings(max_examples=20, deadline=None)
@given(st.floats(0.01, 1.2), st.floats(2.0, 6.0))
def test_forces_do_the_work_that_the_law_stores(largest, ratio):
    """Integral of F d(displacement) = stored energy, by the trapezoidal rule on a fine path."""
    angle = np.linspace(0.0, largest, 4001)
    width, length = 0.1, 0.1 * ratio

    def moment(g):
        return 30.0 * np.sin(g) * np.cos(g)  # energy 15 sin^2

    def work(force, displacement):
        return np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(displacement))

    area = length * width
    stored = (area - 1.5 * width**2) * 15 * np.sin(largest) ** 2 + width**2 * 15 * np.sin(0.5 * largest) ** 2
    done = work(bias_force(angle, moment, length, width), bias_displacement(angle, length, width))
    assert done == pytest.approx(stored, rel=1e-5)
    done = work(frame_force(angle, moment(angle), 0.2), frame_displacement(angle, 0.2))
    assert done == pytest.approx(0.04 * 15 * np.sin(largest) ** 2, rel=1e-5)


def test_normalisation_inverts_the_forces():
    angle = np.linspace(0.01, 0.9, 300)
    moment = 3.0 * np.sin(angle) + 40.0 * angle**5
    np.testing.assert_allclose(frame_normalise(angle, frame_force(angle, moment, 0.2, 0.15), 0.2, 0.15), moment, rtol=1e-12)
    force = bias_force(angle, lambda g: 3.0 * np.sin(g) + 40.0 * g**5, 0.3, 0.1)
    np.testing.assert_allclose(bias_normalise(angle, force, 0.3, 0.1), moment, rtol=1e-3)
    np.testing.assert_allclose(bias_angle(bias_displacement(angle, 0.3, 0.1), 0.3, 0.1), angle, rtol=1e-10)
    assert np.isnan(bias_angle(0.2, 0.3, 0.1))


def test_published_normalisation():
    """Formula of Cao et al. 2008 (eq. for the normalised shear force) written out for a linear shear moment."""
    H, W, angle, k = 0.45, 0.15, np.array([0.1, 0.4]), 7.0
    F = bias_force(angle, lambda g: k * g, H, W)
    own = k * angle / np.cos(angle)
    half = k * 0.5 * angle / np.cos(0.5 * angle)
    c, s = np.cos(0.5 * angle), np.sin(0.5 * angle)
    published = ((H / W - 1) * F * (c - s) - W * half * c) / ((2 * H - 3 * W) * np.cos(angle))
    np.testing.assert_allclose(published, own, rtol=1e-12)


def test_zones_have_the_areas_of_the_geometry():
    x, y = np.meshgrid((np.arange(600) + 0.5) / 2000, (np.arange(200) + 0.5) / 2000)
    where = zone(x, y, 0.3, 0.1)
    np.testing.assert_allclose([np.mean(where == k) for k in range(3)], [1 / 6, 1 / 3, 1 / 2], atol=0.005)


@pytest.mark.parametrize("name", ["st-venant-kirchhoff", "yarn-network", "eight-chain-silk"])
@pytest.mark.parametrize("misalignment", [0.0, 0.02])
def test_frame_force_is_exact(name, misalignment):
    law = {"st-venant-kirchhoff": fabric().law}.get(name) or get_law(name)
    angles = np.radians([2.0, 5.0, 9.0])
    r = picture_frame(fabric(law=law), angles, 0.2, misalignment, "draft")
    np.testing.assert_allclose(r.force, homogeneous_force(fabric(law=law), angles, 0.2, misalignment), rtol=1e-7)
    assert r.scatter.max() < 1e-9
    if misalignment == 0.0:
        np.testing.assert_allclose(r.fabric_angle, angles, rtol=1e-8)
        np.testing.assert_allclose(r.moment, law_moment(law, fabric(law=law).membrane_scale)(angles), rtol=1e-6)
    for order in (1, 2):
        np.testing.assert_allclose(picture_frame(fabric(law=law), angles[:1], 0.2, misalignment, "draft", order).force, r.force[:1],
                                   rtol=1e-6)


def test_frame_recovers_the_modulus_and_misalignment_spoils_it():
    angles = np.radians([10.0, 20.0])
    r = picture_frame(fabric(), angles, fidelity="draft")
    np.testing.assert_allclose(r.moment / (1e-4 * np.sin(angles) * np.cos(angles)), G, rtol=1e-8)
    off = picture_frame(fabric(), angles, misalignment=np.radians(1.0), fidelity="draft").moment / r.moment - 1
    # stretch of both yarns by ± sin 2a sin g / 2: m gains E (sin 2a)^2 sin g cos g / 2
    np.testing.assert_allclose(off, 1e3 * np.sin(np.radians(2.0)) ** 2 / 2 + np.cos(np.radians(2.0)) ** 2 - 1, rtol=1e-6)


def test_bias_recovers_the_shear_of_a_fabric_with_stiff_yarns():
    errors = []
    for ratio in (1e2, 1e4):
        r = bias_extension(fabric(ratio), np.radians([10.0, 20.0, 30.0]), fidelity="draft")
        errors.append(np.abs(r.moment / r.law_moment - 1).max())
    assert 0.05 < errors[0] < 0.2  # the yarns stretch instead
    assert errors[1] < 0.01
    assert r.yarn_strain.max() < 2e-3
    np.testing.assert_allclose(r.zone_angle[:, 2], r.angle, rtol=0.03)
    np.testing.assert_allclose(r.zone_angle[:, 1], 0.5 * r.angle, rtol=0.08)
    assert np.all(r.zone_angle[:, 0] < 0.02 * r.angle)
    assert np.all((0.85 * r.angle < r.centre_angle) & (r.centre_angle < r.angle))
    assert np.all(r.force <= r.expected_force * 1.001)  # uniform zones are a state the strip could take


def test_run_and_pictures(tmp_path):
    cloth = Fabric.load("faille")
    frame = run(cloth, "frame", points=3, fidelity="draft")
    bias = run(cloth, "bias", points=3, fidelity="draft")
    assert frame["largest_error_percent"] < 1e-5
    assert -20 < bias["initial_error_percent"] < -5
    assert bias["zone_angle_deg"].shape == (3, 3) and frame["angle_deg"][-1] == pytest.approx(40.0)
    for payload in (frame, bias):
        assert payload["test"] == "shear"
        for path in save_pictures(tmp_path, payload):
            assert Path(path).stat().st_size > 5_000


def test_wrong_input_is_named():
    with pytest.raises(InputError, match="twice as long"):
        bias_displacement(0.1, 0.15, 0.1)
    with pytest.raises(InputError, match="increasing"):
        bias_normalise([0.2, 0.1], [1.0, 2.0], 0.3, 0.1)
    with pytest.raises(InputError, match="right angle"):
        frame_displacement(1.6, 0.2)
    with pytest.raises(InputError, match="right angle"):
        picture_frame(fabric(), [0.1, 1.7])
    with pytest.raises(InputError, match="draft"):
        picture_frame(fabric(), [0.1], fidelity="best")
    with pytest.raises(InputError, match="draft"):
        bias_extension(fabric(), [0.1], fidelity="best")
    with pytest.raises(InputError, match="positive"):
        bias_extension(fabric(), [-0.1])
    with pytest.raises(InputError, match="frame, bias"):
        run(fabric(), "torsion")
    with pytest.raises(InputError, match="at least 2 points"):
        run(fabric(), points=1)


@pytest.mark.skipif(not SHARED.exists(), reason="reference data not present")
def test_glass_record_shows_friction_then_locking():
    d = np.loadtxt(SHARED, delimiter=",", skiprows=2)
    angle, moment = reduce_record(1e-3 * d[:, 0], d[:, 1], 0.45, 0.15)
    assert np.degrees(angle[-1]) == pytest.approx(54.0, abs=3.0)
    assert np.interp(np.radians(23.2), angle, moment) == pytest.approx(9.1, rel=0.05)
    slope = np.gradient(moment, angle)
    assert np.interp(0.85, angle, slope) > 2 * np.interp(0.35, angle, slope)


def test_targets_have_sources():
    path = Path(__file__).parents[2] / "material_tests" / "shear" / "targets.csv"
    rows = list(csv.DictReader(line for line in path.open(encoding="utf-8") if not line.startswith("#")))
    assert rows and all(row["source"] for row in rows)
