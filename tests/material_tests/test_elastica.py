"""The exact heavy elastica against an independent collocation solution, tables, closed forms and measured fabrics."""

from pathlib import Path

import numpy as np
import pytest

from material_tests import elastica
from material_tests.heart_loop import chebyshev
from mfar_fem.errors import ParameterError

VERIFICATION = Path(__file__).resolve().parents[3] / "shared" / "data" / "verification"
G = 9.80665


def table(path):
    if not path.is_file():
        pytest.skip(f"{path.name} is not beside the checkout")
    rows = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    return np.genfromtxt(rows, delimiter=",", names=True)


def by_collocation(gamma, b=0.0, n=60):
    """Slope on Chebyshev points: (k + b' k^2)' = -gamma (1 - s) cos(theta), k = theta', b' = beta / (alpha L)."""
    s, derivative, integral = chebyshev(n)
    b = b * gamma ** (-1 / 3)
    theta = gamma / 6 / (1 + 0.1 * gamma) * (1 - (1 - s) ** 3)
    for _ in range(60):
        k = derivative @ theta
        residual = derivative @ (k + b * k * k) + gamma * (1 - s) * np.cos(theta)
        matrix = derivative @ ((1 + 2 * b * k)[:, None] * derivative) - np.diag(gamma * (1 - s) * np.sin(theta))
        residual[0], residual[-1] = theta[0], k[-1]
        matrix[0], matrix[-1] = 0.0, derivative[-1]
        matrix[0, 0] = 1.0
        step = np.linalg.solve(matrix, -residual)
        theta = theta + step * min(1.0, 0.5 / np.abs(step).max())
        if np.abs(step).max() < 1e-12:
            break
    x, drop = integral[-1] @ np.cos(theta), integral[-1] @ np.sin(theta)
    return theta[-1], x, drop, np.arctan2(drop, x)


@pytest.mark.parametrize(("gamma", "b"), [(0.05, 0), (1, 0), (8.0041970326, 0), (40, 0), (5, -0.1), (8, 0.2)])
def test_two_independent_solutions_agree(gamma, b):
    shape = elastica.shape(gamma, b)
    tip, x, drop, chord = by_collocation(gamma, b)
    assert elastica.chord_angle(gamma, b) == pytest.approx(chord, rel=1e-10)
    assert shape.x[-1] == pytest.approx(x, rel=1e-10)
    assert shape.drop[-1] == pytest.approx(drop, rel=1e-10)
    assert shape.angle[-1] == pytest.approx(tip, rel=1e-10)


def test_small_load_is_the_linear_beam():
    gamma = 1e-4
    shape = elastica.shape(gamma)
    s = shape.s
    np.testing.assert_allclose(shape.drop, gamma / 24 * s**2 * (6 - 4 * s + s**2), rtol=1e-6, atol=1e-15)
    assert shape.curvature[0] == pytest.approx(gamma / 2, rel=1e-7)
    assert elastica.chord_angle(gamma) == pytest.approx(gamma / 8, rel=1e-7)


def test_shape_is_consistent():
    shape = elastica.shape(20.0, n=401)
    assert shape.x[0] == shape.drop[0] == 0 and abs(shape.angle[0]) < 1e-7
    speed = np.hypot(np.diff(shape.x), np.diff(shape.drop)) * 400
    assert np.all(np.abs(speed - 1) < 1e-4)
    assert shape.chord_angle == pytest.approx(elastica.chord_angle(20.0), rel=1e-12)


def test_the_standard_angle():
    gamma = elastica.gamma_at_chord_angle()
    assert gamma == pytest.approx(8.004197033, rel=1e-10)
    assert elastica.chord_angle(gamma) == pytest.approx(elastica.STANDARD_ANGLE, rel=1e-13)
    exact = gamma ** (-1 / 3)
    assert 100 * (elastica.standard_bending_length(1.0) / exact - 1) == pytest.approx(0.0175, abs=5e-4)
    assert 100 * (elastica.peirce_bending_length(1.0) / exact - 1) == pytest.approx(1.8821, abs=1e-4)


def test_against_the_tables():
    rows = table(VERIFICATION / "heavy_elastica_horizontal_clamp_computed.csv")
    for row in rows[rows["Gamma"] > 0.1][::6]:
        _, arc = elastica._arc_of_gamma(float(row["Gamma"]), 0.0)
        assert arc.reach / arc.length == pytest.approx(row["X_over_L"], rel=1e-9)
        assert arc.drop / arc.length == pytest.approx(row["drop_over_L"], rel=4e-9)
        assert arc.root_curvature * arc.length == pytest.approx(row["clamp_curvature_times_L"], rel=4e-9)
        assert np.degrees(arc.chord_angle) == pytest.approx(row["chord_angle_deg"], rel=4e-9)
    for row in table(VERIFICATION / "peirce_vs_exact_elastica_by_angle_computed.csv")[::2]:
        angle = np.radians(row["chord_angle_deg"])
        assert elastica.gamma_at_chord_angle(angle) == pytest.approx(row["Gamma_exact"], rel=4e-10)
        assert elastica.peirce_bending_length(1.0, angle) == pytest.approx(row["c_over_L_peirce_formula"], rel=1e-9)


@pytest.mark.parametrize("gamma", [1e-6, 1e-2, 1.0, 1e3, 1e5])
def test_whole_range(gamma):
    _, arc = elastica._arc_of_gamma(gamma, 0.0)
    assert arc.length**3 == pytest.approx(gamma, rel=1e-9)


def test_round_trip_and_sensitivities():
    B, w = 1.86e-6, 0.104 * G
    L = elastica.overhang(B, w)
    assert elastica.rigidity(L, w) == pytest.approx(B, rel=1e-12)
    for beta in (0.0, -1.2e-9, 2e-9):
        exact = elastica.overhang_sensitivity(B, w, beta=beta)
        for name, h in (("rigidity", 1e-3 * B), ("weight", 1e-3 * w), ("angle", 1e-3), ("beta", 1e-12)):
            args = {"rigidity": B, "weight": w, "angle": elastica.STANDARD_ANGLE, "beta": beta}
            ends = [elastica.overhang(**{**args, name: args[name] + k * h}) for k in (-2, -1, 1, 2)]
            difference = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * h)
            assert exact[name] == pytest.approx(difference, rel=1e-6)


def test_a_softening_law_droops_more_and_ends():
    B, w = 3.1e-6, 0.07 * G
    c = elastica.bending_length(B, w)
    lengths = [elastica.overhang(B, w, beta=b * B * c) for b in (0.05, 0.0, -0.05, -0.15)]
    assert np.all(np.diff(lengths) < 0)
    with pytest.raises(elastica.MomentLimitError, match="maximum at kappa"):
        elastica.overhang(B, w, beta=-0.25 * B * c)
    with pytest.raises(elastica.MomentLimitError):
        elastica.chord_angle(500.0, -0.1)
    elastica.gamma_at_chord_angle(elastica.STANDARD_ANGLE, -0.188)
    with pytest.raises(elastica.MomentLimitError):
        elastica.gamma_at_chord_angle(elastica.STANDARD_ANGLE, -0.1885)


@pytest.mark.parametrize(
    "build",
    [
        lambda: elastica.overhang(-1.0, 1.0),
        lambda: elastica.overhang(1.0, 0.0),
        lambda: elastica.rigidity(float("nan"), 1.0),
        lambda: elastica.gamma_at_chord_angle(np.radians(90)),
        lambda: elastica.gamma_at_chord_angle(0.0),
        lambda: elastica.shape(1e9),
    ],
)
def test_bad_input(build):
    with pytest.raises(ParameterError):
        build()
