"""What the supports leave free is counted, and named when a run fails."""

import numpy as np
import pytest

from mfar_fem.loads import gravity
from mfar_fem.materials import Fabric
from mfar_fem.solve import NewtonOptions, Problem, solve_static
from mfar_fem.solve.statics import free_rigid_motions
from mfar_fem.supports import Clamp, Hinge
from mfar_fem.surface import Surface, patterns


@pytest.mark.parametrize(
    ("supports", "free"), [([], 6), ([Hinge([0], by_node=True)], 3), ([Hinge("left")], 1), ([Clamp("left")], 0)]
)
def test_free_rigid_motions_are_counted(supports, free):
    surface = Surface.from_pattern(patterns.strip(0.2, 0.05, 4, 2), 2)
    assert free_rigid_motions(Problem(surface, Fabric.load("faille"), supports)) == free


def test_a_sheet_that_is_not_held_fails_by_name():
    surface = Surface.from_pattern(patterns.strip(0.2, 0.05, 4, 2), 2)
    fabric = Fabric.load("faille")
    problem = Problem(surface, fabric, [], [gravity(fabric.areal_density)])
    result = solve_static(problem, 1, NewtonOptions(max_iterations=5), min_step=0.2)
    assert not result.converged
    assert "6 rigid motions" in result.message
    assert np.isfinite(result.state.u).all()
