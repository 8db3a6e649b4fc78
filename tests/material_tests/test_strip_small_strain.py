"""A first reading at a tiny strain must not stop a strip test: there the energy of a law is mostly rounding."""

import pytest

from material_tests.strip.fe import StripTest
from mfar_fem.materials import Fabric, get_law


@pytest.mark.parametrize("law", ["neo-hookean", "arruda-boyce", "eight-chain-silk", "st-venant-kirchhoff"])
def test_tiny_first_strain_converges(law):
    fabric = Fabric.load("paper-silk").replace(law=get_law(law))
    result = StripTest(0.08, 0.05).run(fabric, [6.289e-05, 1.1675e-03, 2.2035e-03])
    assert result.converged, result.message
    assert result.iterations <= 12
    assert result.line_force[2] / result.line_force[0] == pytest.approx(2.2035e-03 / 6.289e-05, rel=0.02)
