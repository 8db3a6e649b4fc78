"""A user's law reaches worker processes: pickled here, used in a fresh interpreter."""

import pickle
import subprocess
import sys

import numpy as np
import pytest

from mfar_fem.materials import law_from_file

SOURCE = '''
from mfar_fem.materials import NeoHookean, law_from_energy

def energy(C11, C22, C12, k=900.0):
    return 0.5 * k * ((C11 - 1) ** 2 + (C22 - 1) ** 2 + C12 ** 2)

law = law_from_energy(energy, {"k": 700.0}, basis="area", name="mine")

class Own(NeoHookean):
    name = "own"
'''


@pytest.mark.parametrize("name", ["energy", "law", "Own"])
def test_law_of_a_file_works_in_another_process(tmp_path, name):
    file = tmp_path / "my_law.py"
    file.write_text(SOURCE)
    law = law_from_file(f"{file}:{name}")
    law = law.replace(**{next(iter(law.values)): 1234.0})
    stored = tmp_path / "law.pickle"
    stored.write_bytes(pickle.dumps(law))
    code = f"import pickle; law = pickle.load(open({str(stored)!r}, 'rb')); print(*law.stress([[1.2, 1.0, 0.1]])[0])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    np.testing.assert_allclose([float(x) for x in done.stdout.split()], law.stress([[1.2, 1.0, 0.1]])[0], rtol=1e-12)


def test_the_same_file_is_run_once_and_a_changed_one_again(tmp_path):
    file = tmp_path / "my_law.py"
    file.write_text(SOURCE)
    first = law_from_file(f"{file}:energy")
    assert law_from_file(f"{file}:energy") == first
    file.write_text(SOURCE.replace("0.5 * k", "0.25 * k"))
    changed = law_from_file(f"{file}:energy")
    np.testing.assert_allclose(2.0 * changed.energy([[1.2, 1.0, 0.1]]), first.energy([[1.2, 1.0, 0.1]]))
