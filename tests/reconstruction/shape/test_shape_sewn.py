"""A template sewn: topology, areas, seams, warp."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mfar_fem.errors import InputError
from reconstruction.shape.sewn import BACK, FRONT, sew
from reconstruction.surface.connectivity import boundary_loops
from reconstruction.template.dimensions import RibbonDimensions, TDimensions, derive


def dimensions(**change):
    values = {
        "length": 1.2, "cross_sleeve_width": 1.5, "body_width": 0.6, "armhole_depth": 0.3, "cuff_width": 0.18, "hem_width": 0.8,
        "neck_width": 0.16, "neck_depth": 0.09, "back_neck_depth": 0.02, "overlap_neck": 0.0, "overlap_hem": 0.0, "slit": 0.0,
        "collar_height": 0.0,
    }  # fmt: skip
    return TDimensions(**(values | change))


def layer_area(d, depth, shape):
    """Half a T, twice, less the neck: polygon by the shoelace formula, neck by quadrature."""
    t = np.linspace(0, 1, 20001)
    control = np.array([(d.neck_width / 2, 0.0), *((a * d.neck_width / 2, b * depth) for a, b in shape), (0.0, depth)])
    basis = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3])
    x, y = control.T @ basis
    neck = abs(np.sum(0.5 * (x[1:] + x[:-1]) * np.diff(y)))
    corners = np.array([(0, 0), (d.cross_sleeve_width / 2, 0), (d.cross_sleeve_width / 2, d.cuff_width),
                        (d.body_width / 2, d.armhole_depth), (d.hem_width / 2, d.length), (0, d.length)])  # fmt: skip
    u, v = corners.T
    return 2 * (0.5 * abs(u @ np.roll(v, -1) - v @ np.roll(u, -1)) - neck)


def areas(flat):
    a, b = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
    return 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


@pytest.mark.parametrize("slit", [0.0, 0.3])
def test_a_tunic_has_four_openings_and_the_area_of_its_panels(slit):
    d = dimensions(slit=slit)
    sewn = sew("half-sleeve", d, 0.02)
    loops = boundary_loops(sewn.faces)
    assert len(loops) == 4
    euler = len(sewn.uv) - len(sewn.mesh(np.zeros((len(sewn.uv), 3))).edges) + len(sewn.faces)
    assert euler == 2 - 4  # a sphere with four holes
    exact = layer_area(d, d.neck_depth, d.neckline) + layer_area(d, d.back_neck_depth, ((0.75, 0.7), (0.4, 1.0)))
    assert areas(sewn.flat).sum() == pytest.approx(exact, rel=2e-3)
    assert areas(sewn.flat).min() > 1e-3 * 0.02**2
    for name, ids in sewn.openings.items():
        rim = {frozenset(edge) for loop in loops for edge in zip(loop, np.roll(loop, -1), strict=True)}
        steps = [frozenset(edge) in rim for edge in itertools.pairwise(ids)]
        assert sum(steps) >= len(steps) - (1 if name == "hem" else 0), name


def test_layers_share_the_fold_and_face_outwards():
    sewn = sew("half-sleeve", dimensions(), 0.03)
    fold = np.flatnonzero((sewn.layer < 0) & (sewn.uv[:, 1] == 0))
    assert len(fold) == 2 * (1 + int(np.ceil((0.75 - 0.08) / 0.03)))
    spread = np.column_stack([sewn.uv[:, 0], np.where(sewn.layer == FRONT, -0.05, np.where(sewn.layer == BACK, 0.05, 0.0)),
                              -sewn.uv[:, 1]])  # fmt: skip
    normal = sewn.mesh(spread).face_normals[:, 1]
    assert (normal[sewn.panel == FRONT] < 0).all() and (normal[sewn.panel == BACK] > 0).all()
    warp = sewn.warp_in_space(spread)
    assert np.abs(warp[:, 0]).max() < 1e-12 and (warp[:, 2] < 0).all()  # v runs down


@settings(max_examples=15, deadline=None)
@given(st.floats(0.02, 0.06), st.floats(0.5, 1.4), st.floats(0.45, 0.8))
def test_left_and_right_are_alike(edge, length, width):
    d = dimensions(length=length, body_width=width, hem_width=width * 1.1, cross_sleeve_width=width + 0.5)
    sewn = sew("half-sleeve", d, edge)
    left, right = sewn.uv[sewn.uv[:, 0] > 1e-9], sewn.uv[sewn.uv[:, 0] < -1e-9]
    assert len(left) == len(right)
    order = lambda p: p[np.lexsort(p.round(9).T)]  # noqa: E731
    np.testing.assert_allclose(order(left), order(right * (-1, 1)), atol=1e-9)


def test_a_ribbon_is_one_strip():
    sewn = sew("flying-ribbon", RibbonDimensions(2.0, 0.4), 0.05)
    assert len(boundary_loops(sewn.faces)) == 1 and areas(sewn.flat).sum() == pytest.approx(0.8, rel=1e-9)
    np.testing.assert_array_equal(sewn.warp, np.tile([1.0, 0.0], (len(sewn.faces), 1)))


def test_mistakes_are_named():
    with pytest.raises(InputError, match="too long for a width of 160 mm"):
        sew("half-sleeve", dimensions(), 0.1)
    with pytest.raises(InputError, match="positive"):
        sew("half-sleeve", dimensions(), 0.0)
    with pytest.raises(InputError, match="too long for a part of"):
        sew("veil-hat", derive("veil-hat", {})[0], 0.2)
