"""The cantilever test without a mesh: readings, directions, cited targets, and 618 real fabrics there and back."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest

import material_tests
from material_tests import elastica, heart_loop
from material_tests.cantilever import exact
from mfar_fem.errors import InputError
from mfar_fem.materials import Bending, Fabric
from mfar_fem.units import STANDARD_GRAVITY

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
FOLDER = Path(material_tests.__file__).parent


@pytest.fixture(scope="module")
def fabric():
    bending = Bending(warp=4e-6, weft=2.5e-6, twist=1.1e-6, coupling=0.9e-6)
    return Fabric.load("faille").replace(bending=bending, areal_density=0.08)


@pytest.mark.parametrize("direction", ["warp", "weft", "bias", 0.4])
def test_option_a_reads_back_what_went_in(fabric, direction):
    result = exact(fabric, direction)
    assert result.exact_rigidity == pytest.approx(result.rigidity, rel=1e-12)
    assert result.error_percent == pytest.approx(0.0525, abs=1e-3)
    assert math.degrees(math.atan2(-result.y[-1], result.x[-1])) == pytest.approx(41.5, abs=1e-7)
    assert result.s[-1] == pytest.approx(result.reading)
    # the standard's own arithmetic: mg/cm2 times cm^3
    by_hand = fabric.areal_density * 1e2 * (50 * result.reading) ** 3
    assert result.standard_rigidity_mg_cm == pytest.approx(by_hand, rel=1e-12)


def test_direction_and_edges(fabric):
    d = fabric.bending
    strip = exact(fabric, "warp").rigidity
    assert strip == pytest.approx(d.warp - d.coupling**2 / d.weft, rel=1e-12)
    assert exact(fabric, "warp", free=False).rigidity == pytest.approx(d.warp)
    for angle in (0.0, 0.3, np.pi / 4, 1.2):
        assert exact(fabric, angle).rigidity <= exact(fabric, angle, free=False).rigidity * (1 + 1e-12)
    isotropic = fabric.replace(bending=Bending.isotropic(1e7, 0.3, 1e-3))
    readings = [exact(isotropic, angle).reading for angle in (0.0, 0.5, np.pi / 4, np.pi / 2)]
    assert np.ptp(readings) < 1e-12 * readings[0]


def test_option_b(fabric):
    result = exact(fabric, "warp", "B", loop_length=0.15)
    assert result.exact_rigidity == pytest.approx(result.rigidity, rel=1e-8)
    error = heart_loop.formula_error([result.bending_length / 0.15])[0]["error_in_B_percent"]
    assert result.error_percent == pytest.approx(error, rel=1e-9)
    assert -result.y[-1] == pytest.approx(result.reading) and abs(result.x[-1]) < 1e-12


def test_bad_input(fabric):
    for bad in ({"option": "C"}, {"direction": "north"}, {"option": "B", "loop_length": 0.0}, {"option": "B", "beta": -1e-9}):
        with pytest.raises(InputError):
            exact(fabric, **bad)


def test_618_fabrics_there_and_back():
    path = DATA / "bending" / "feng2022_618_fabrics_SI.csv"
    if not path.is_file():
        pytest.skip("the measured fabrics are not beside the checkout")
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    data = np.genfromtxt(lines, delimiter=",", names=True)
    weight = data["areal_mass_g_m2"] * 1e-3 * STANDARD_GRAVITY
    assert len(weight) == 618
    reached, limit = 0, -0.18815743
    for name in ("warp", "weft", "bias"):
        alpha, beta = data[f"alpha_{name}_Nm"], data[f"beta_{name}_Nm2"]
        length = np.array([elastica.overhang(B, w) for B, w in zip(alpha, weight, strict=True)])
        back = np.array([elastica.rigidity(L, w) for L, w in zip(length, weight, strict=True)])
        np.testing.assert_allclose(back, alpha, rtol=1e-12)
        c_cm = data[f"c_{name}_cm_from_alpha"]
        np.testing.assert_allclose(50 * length, c_cm, rtol=2e-3)  # c = L / 2, table rounded and g = 9.81
        softness = beta / (alpha * (alpha / weight) ** (1 / 3))
        reached += int((softness <= limit).sum())
    assert reached == 461  # of 1854 rows: the fitted law peaks before a strip droops to 41.5 degrees
    for row in (8, 300):  # one on each side of that limit or well inside it
        w, alpha, beta = weight[row], data["alpha_warp_Nm"][row], data["beta_warp_Nm2"][row]
        b = beta / (alpha * elastica.bending_length(alpha, w))
        if b > limit:
            assert elastica.overhang(alpha, w, beta=beta) < elastica.overhang(alpha, w)
        else:
            with pytest.raises(elastica.MomentLimitError):
                elastica.overhang(alpha, w, beta=beta)


@pytest.mark.parametrize("test", ["cantilever", "strip"])
def test_every_target_has_its_citation(test):
    lines = (FOLDER / test / "targets.csv").read_text(encoding="utf-8").splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    assert len(rows) >= 10
    for row in rows:
        assert len(row["source"]) > 20 and row["unit"] and row["kind"] in {"exact", "measured", "secondary", "derived"}
        value = float(row["value"])
        assert float(row["lower"] or value) <= value <= float(row["upper"] or value)
    assert (FOLDER / test / "method.md").is_file()


def test_the_exact_targets_hold():
    lines = (FOLDER / "cantilever" / "targets.csv").read_text(encoding="utf-8").splitlines()
    rows = [row for row in csv.DictReader(line for line in lines if not line.startswith("#")) if row["kind"] == "exact"]
    gamma = elastica.gamma_at_chord_angle()
    ours = {
        "gamma at": gamma,
        "error of c": 100 * (0.5 * gamma ** (1 / 3) - 1),
        "error of P": 100 * (elastica.peirce_bending_length(gamma ** (1 / 3)) - 1),
        "height of": heart_loop.solve(0.0).height,
        "tip drop": float(elastica.shape(1.0).drop[-1]),
    }
    assert len(rows) == len(ours)
    for row in rows:
        value = next(value for name, value in ours.items() if row["quantity"].startswith(name))
        assert float(row["lower"]) <= value <= float(row["upper"])
