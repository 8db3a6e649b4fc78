"""Laws from a user's energy function or file, and what the checks say about wrong ones."""

from __future__ import annotations

import pickle

import autograd.numpy as anp
import numpy as np
import pytest

from mfar_fem.errors import InputError, ParameterError
from mfar_fem.materials import Parameter, get_law, law_from_energy, law_from_file
from mfar_fem.materials.check import check_law
from mfar_fem.materials.homogeneous import uniaxial


def energy(C11, C22, C12, mu=1e5):
    return 0.5 * mu * (C11 + C22 + 1.0 / (C11 * C22 - C12**2) - 3.0)


def test_own_energy_is_a_full_law():
    law = law_from_energy(energy, basis="volume", mu=2e5)
    known = get_law("neo-hookean", mu=2e5)
    x = [0.9, 1.1, 1.4]
    r, expected = uniaxial(law, "bias", x, ["mu"]), uniaxial(known, "bias", x, ["mu"])
    np.testing.assert_allclose(r.stress, expected.stress, rtol=1e-9)
    np.testing.assert_allclose(r.sensitivity, expected.sensitivity, rtol=1e-9)
    assert all(c.passed for c in check_law(law, points=10))
    again = pickle.loads(pickle.dumps(law))
    assert again.values == law.values and again == law
    assert law.replace(mu=3e5).mu == 3e5 and law.name == "energy"


def test_parameters_have_the_table_they_are_given():
    table = (Parameter("mu", "μ", "N/m", 5.0, 1.0, 10.0, "log", "modulus", "mine"),)
    law = law_from_energy(energy, table, basis="area", name="own")
    assert law.basis == "area" and law.stress_unit == "N/m" and law.mu == 5.0
    with pytest.raises(ParameterError, match="bounds"):
        law.replace(mu=11.0)
    with pytest.raises(ParameterError, match="has no parameter 'nu'"):
        law.stress_sensitivity([[1.0, 1.0, 0.0]], ["nu"])


def test_energy_that_locks_is_infinite_not_nan():
    law = law_from_energy(lambda C11, C22, C12, L: -anp.log(1.0 - (C11 - 1.0) / L) - C11 / L + C22**2, {"L": 0.2})
    e, s, t = law.evaluate([[1.3, 1.0, 0.0], [1.1, 1.0, 0.0]])
    assert e[0] == np.inf and not s[0].any() and not t[0].any() and np.isfinite(e[1]) and s[1].any()


@pytest.mark.parametrize(
    ("func", "options", "words"),
    [
        (lambda C: C, {}, "C11, C22, C12"),
        (energy, {"basis": "length"}, "basis"),
        (lambda C11, C22, C12, k: C11, {}, "no default for k"),
        (energy, {"parameters": {"nu": 1.0}}, "no argument named nu"),
        (lambda C11, C22, C12, k, m: C11, {"parameters": {"k": 1.0}}, "lacks m"),
    ],
)
def test_wrong_signatures(func, options, words):
    with pytest.raises(InputError, match=words):
        law_from_energy(func, **options)


def test_what_autograd_cannot_differentiate_is_said():
    law = law_from_energy(lambda C11, C22, C12, k=1.0: np.array([float(c) for c in C11]) * k)
    with pytest.raises(InputError, match=r"autograd\.numpy"):
        law.stress([[1.0, 1.0, 0.0]])
    with pytest.raises(InputError, match="element-wise"):
        law_from_energy(lambda C11, C22, C12, k=1.0: anp.sum(k * C11)).energy([[1.0, 1.0, 0.0], [1.0, 1.0, 0.1]])


FILE = """
import autograd.numpy as np
from mfar_fem.materials.neo_hookean import NeoHookean

def mine(C11, C22, C12, a=10.0, b=3.0):
    return 0.5 * a * ((C11 - 1) ** 2 + (C22 - 1) ** 2) + b * C12**2
mine.basis = "area"

def prestressed(C11, C22, C12, a=10.0):
    return a * (C11 - 1) + a * (C22 - 1) ** 2 + a * C12**2

class Mine(NeoHookean):
    name = "mine-too"

ready = NeoHookean(mu=5.0)
number = 3
"""


@pytest.fixture
def user_file(tmp_path):
    path = tmp_path / "my_law.py"
    path.write_text(FILE)
    return path


def test_laws_from_a_file(user_file):
    law = law_from_file(f"{user_file}:mine", a=20.0)
    assert law.basis == "area" and law.a == 20.0 and law.stress([[1.1, 1.0, 0.0]])[0, 0] == pytest.approx(2 * 20 * 0.1)
    assert pickle.loads(pickle.dumps(law)).values == law.values
    assert law_from_file(f"{user_file}:Mine", mu=7.0).mu == 7.0
    assert law_from_file(f"{user_file}:ready").mu == 5.0


@pytest.mark.parametrize(
    ("spec", "words"),
    [("nothing", "path.py:name"), ("none.py:x", "does not exist"), ("{}:absent", "defines no 'absent'; it defines.*mine"),
     ("{}:number", "int")],
)
def test_bad_specifications(user_file, spec, words):
    with pytest.raises(InputError, match=words):
        law_from_file(spec.format(user_file))


def test_a_file_that_fails(tmp_path):
    path = tmp_path / "broken.py"
    path.write_text("1/0\n")
    with pytest.raises(InputError, match="ZeroDivisionError"):
        law_from_file(f"{path}:x")


def test_the_checks_find_a_prestress_and_a_wrong_tangent(user_file):
    failed = {c.name for c in check_law(law_from_file(f"{user_file}:prestressed"), points=8) if not c.passed}
    assert "stress-free reference" in failed and "stress" not in failed

    class Wrong(type(get_law("neo-hookean"))):
        def evaluate(self, C, order=2):
            e, s, t = super().evaluate(C, order)
            return e, s, None if t is None else 1.01 * t

    failed = {c.name for c in check_law(Wrong(), points=8) if not c.passed}
    assert failed == {"tangent"}


def test_the_checks_find_an_unstable_law():
    law = law_from_energy(lambda C11, C22, C12, k=1.0: k * ((C11 - 1) ** 2 + (C22 - 1) ** 2 - 0.5 * C12**2))
    failed = {c.name for c in check_law(law, points=8) if not c.passed}
    assert "positive definite at rest" in failed and "strong ellipticity, warp" in failed
