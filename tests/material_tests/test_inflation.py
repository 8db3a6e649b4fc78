"""Inflated membranes against their exact solutions."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from material_tests.inflation import hencky, mylar, run, sphere
from material_tests.inflation.mesh import quarter_disc, sphere_octant
from material_tests.inflation.plots import save_pictures
from mfar_fem.errors import InputError, NotConvergedError, ParameterError, UnknownNameError

TARGETS = Path(__file__).parents[2] / "material_tests" / "inflation" / "targets.csv"
SHARED = Path(__file__).parents[3] / "shared" / "data" / "verification" / "membrane_inflation_closed_forms.csv"


def test_hencky_integration_against_a_power_series():
    """n = sum b_k rho^(2k); 4k(k+1) b_k n^2-convolution: an independent solution of the same problem."""
    nu, terms = 0.3, 60

    def series(b0):
        b = np.zeros(terms)
        b[0] = b0
        for k in range(1, terms):  # (n'' + 3n'/rho) n^2 = -1/8, coefficient of rho^(2k-2)
            square = np.array([b[: m + 1] @ b[: m + 1][::-1] for m in range(k)])
            known = sum(4 * j * (j + 1) * b[j] * square[k - j] for j in range(1, k))
            b[k] = ((-0.125 if k == 1 else 0.0) - known) / (4 * k * (k + 1) * b0**2)
        return b

    from scipy.optimize import brentq

    powers = 2 * np.arange(terms)
    b0 = brentq(lambda b0: (powers + 1 - nu) @ series(b0), 0.35, 0.6)
    rho, weight = np.polynomial.legendre.leggauss(60)
    rho, weight = 0.5 * (rho + 1), 0.5 * weight
    n = (rho[:, None] ** powers) @ series(b0)
    exact = hencky.exact(nu)
    assert exact.force[0] == pytest.approx(b0, rel=1e-6)
    assert exact.centre == pytest.approx(weight @ (0.5 * rho / n), rel=1e-6)
    assert exact.deflection[-1] == 0.0


def test_hencky_constant_and_bounds():
    assert hencky.exact(0.3).centre == pytest.approx(0.653443, abs=1e-6)
    values = [hencky.exact(nu).centre for nu in (0.0, 0.2, 0.4, 0.5)]
    assert np.all(np.diff(values) < 0)
    with pytest.raises(ParameterError, match="Poisson"):
        hencky.exact(0.6)


@pytest.mark.parametrize("order, rings, sectors, centre, profile",
                         [(1, 8, 6, 0.3, 0.02), (2, 4, 4, 0.02, 0.003), (2, 8, 6, 0.01, 0.001)])
def test_hencky_by_finite_elements(order, rings, sectors, centre, profile):
    found = hencky.solve(order, rings, sectors)
    assert abs(found["error_percent"]) < centre
    assert found["profile_error"] < profile
    assert found["newton_iterations"] <= 10


def test_hencky_with_another_poisson_ratio_and_load():
    assert abs(hencky.solve(2, 6, 4, nu=0.0)["error_percent"]) < 0.02
    assert abs(hencky.solve(2, 6, 4, nu=0.45, load=1e-8)["error_percent"]) < 0.02
    large = hencky.solve(2, 6, 4, load=1e-2)["error_percent"]
    assert 0.1 < abs(large) < 10  # Föppl's small slopes end there


def test_mylar_closed_form_is_its_own_variational_solution():
    """The profile integral r'(s) of the elliptic curve gives the meridian length a and the stated volume."""
    from scipy.integrate import quad

    closed = mylar.exact()
    r = closed["radius"]

    def slope(t):  # z(x): z' = -x^2/sqrt(r^4 - x^4); x = r (1 - t^2) takes the root out of the integrals
        x = r * (1 - t * t)
        return x, 2 * r * t / np.sqrt(r**4 - x**4)

    length = quad(lambda t: slope(t)[1] * r**2, 0, 1)[0]
    height = quad(lambda t: slope(t)[1] * slope(t)[0] ** 2, 0, 1)[0]
    volume = 4 * np.pi * quad(lambda t: 0.5 * slope(t)[1] * slope(t)[0] ** 4, 0, 1)[0]
    assert length == pytest.approx(1.0, rel=1e-8)
    assert 2 * height == pytest.approx(closed["thickness"], rel=1e-8)
    assert volume == pytest.approx(closed["volume"], rel=1e-8)


def test_mylar_balloon_by_tension_field():
    found = mylar.solve()
    errors = found["error_percent"]
    assert abs(errors["radius"]) < 0.1 and abs(errors["thickness"]) < 0.3 and abs(errors["volume"]) < 0.1
    assert found["rim_scatter"] < 2e-3
    assert found["wrinkled"] > 0.9
    far = [s["thickness"] for s in found["steps"]]
    assert np.all(np.diff(np.abs(np.array(far) - found["exact"]["thickness"])) < 0)  # stiffer sheets come closer
    assert len(found["profile"]["r"]) == 17 and found["profile"]["r"][0] == 0.0


def test_mylar_needs_a_small_residual():
    coarse = mylar.solve(2, 6, 4, ladder=((1e-2, 1e-2), (1e-3, 1e-3)))
    assert coarse["error_percent"]["radius"] > 1.5


@pytest.mark.parametrize("order, n, error", [(1, 4, 5.0), (2, 3, 0.2)])
def test_rubber_balloon_over_its_pressure_maximum(order, n, error):
    found = sphere.solve(order, n)
    assert found["largest_error_percent"] < error
    assert found["peak_stretch"] == pytest.approx(7 ** (1 / 6), rel=2e-3)
    assert found["peak_pressure"] == pytest.approx(1.2394629, rel=0.01 * error)
    assert found["pressure"][-1] < found["pressure"].max() > found["pressure"][0]


def test_rubber_balloon_converges_with_the_mesh():
    errors = [sphere.solve(2, n, stretches=(1.1, 1.38, 1.5))["largest_error_percent"] for n in (2, 4)]
    assert np.log2(errors[0] / errors[1]) > 3.0


def test_volume_out_of_reach_is_named():
    with pytest.raises(NotConvergedError, match="volume"):
        sphere.solve(1, 2, stretches=(1.05, 1e80, 1e90))


def test_meshes():
    disc = quarter_disc(0.1, 4, 3, 2)
    np.testing.assert_allclose(np.linalg.norm(disc.nodes[disc.nodes_of("outer")], axis=1), 0.1, rtol=1e-12)
    assert disc.areas.sum() == pytest.approx(0.25 * 12 * 0.5 * 0.01 * np.sin(np.pi / 6), rel=1e-12)
    ball = sphere_octant(0.1, 3, 2)
    np.testing.assert_allclose(np.linalg.norm(ball.nodes, axis=1), 0.1, rtol=1e-12)
    assert len(ball.triangles) == 9
    corner = ball.vertices[ball.triangles]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    assert np.all(np.sum(normal * corner.mean(axis=1), axis=1) > 0)
    with pytest.raises(InputError):
        quarter_disc(0.1, 1, 3, 2)
    with pytest.raises(InputError):
        sphere_octant(0.1, 1, 2)


def test_run_and_pictures(tmp_path):
    for case in ("hencky", "mylar", "sphere"):
        payload = run(case, 2, "draft")
        assert payload["test"] == "inflation" and payload["case"] == case and payload["wall_s"] > 0
        assert Path(save_pictures(tmp_path, payload)[0]).stat().st_size > 5_000
    with pytest.raises(UnknownNameError, match="hencky"):
        run("cube")
    with pytest.raises(UnknownNameError, match="draft"):
        run("mylar", fidelity="best")


def test_targets():
    rows = list(csv.DictReader(line for line in TARGETS.open(encoding="utf-8") if not line.startswith("#")))
    assert all(row["source"] for row in rows)
    values = {(row["quantity"], row["kind"]): float(row["value"]) for row in rows}
    assert values["centre deflection w0/a over (p a/(E h))^(1/3)", "exact"] == pytest.approx(hencky.exact(0.3).centre, abs=1e-7)
    assert values["inflated rim radius over flat radius", "exact"] == pytest.approx(mylar.exact()["radius"], abs=1e-8)
    assert values["total thickness over flat radius", "exact"] == pytest.approx(mylar.exact()["thickness"], abs=1e-6)
    assert values["peak of p R/(mu h)", "exact"] == pytest.approx(sphere.peak()[1], abs=1e-8)


@pytest.mark.skipif(not SHARED.exists(), reason="reference data not present")
def test_reference_file_agrees():
    rows = {row[0]: float(row[1]) for row in csv.reader(SHARED.open(encoding="utf-8")) if len(row) == 3 and row[0] != "quantity"}
    closed = mylar.exact()
    assert rows["Mylar balloon inflated radius r/a"] == pytest.approx(closed["radius"], abs=1e-8)
    assert rows["Mylar balloon total thickness/a"] == pytest.approx(closed["thickness"], rel=1e-5)
    assert rows["Mylar balloon volume/a^3"] == pytest.approx(closed["volume"], rel=1e-8)
    assert rows["Hencky circular membrane w0/a / (p a/(E h))^(1/3), nu=0.3"] == pytest.approx(hencky.exact(0.3).centre, abs=1e-3)
