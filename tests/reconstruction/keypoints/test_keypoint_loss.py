"""The knowledge term: known values, invariances of the graph against formula (6) as printed, gradients, controls."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("rdflib")

from reconstruction.keypoints.heatmaps import encode  # noqa: E402
from reconstruction.keypoints.knowledge import Knowledge, Order, Ratio, Symmetry  # noqa: E402
from reconstruction.keypoints.knowledge_file import load  # noqa: E402
from reconstruction.keypoints.loss import ARMS, GraphLoss, LiteralLoss, heatmap_loss, knowledge_loss, soft_argmax  # noqa: E402
from reconstruction.landmarks import INDEX, MIRROR  # noqa: E402

STANDING = np.zeros((12, 2))
_HALF = {"shoulder": (24, 48), "elbow": (36, 90), "wrist": (44, 128), "neckline": (8, 42), "waist": (18, 110), "ankle": (22, 226)}
for name, (x, y) in _HALF.items():
    STANDING[INDEX[f"left_{name}"]] = (95.5 + x, y)
    STANDING[INDEX[f"right_{name}"]] = (95.5 - x, y)
ALL = torch.ones(1, 12, dtype=torch.float64)


def tensor(points):
    return torch.tensor(np.atleast_3d(points).reshape(-1, 12, 2), dtype=torch.float64)


def bad_figures(n=4, seed=0):
    rng = np.random.default_rng(seed)
    return tensor(STANDING + rng.normal(0, 30, (n, 12, 2)))


def turned(points, degrees):
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    return points @ torch.tensor([[c, s], [-s, c]], dtype=torch.float64)


def test_soft_argmax_finds_the_centre_and_ignores_the_background():
    points = np.array([[10.25, 20.5], [40.0, 5.75], [4.0, 60.0]])
    found = soft_argmax(torch.from_numpy(encode(points, sigma=3.0)).double())
    assert found.numpy() == pytest.approx(points, abs=0.35)
    inner = soft_argmax(torch.from_numpy(encode(points[0], sigma=3.0)).double())
    assert inner.numpy() == pytest.approx(points[0], abs=0.02)


def test_heatmap_loss_is_one_for_empty_maps_and_obeys_the_weights():
    target = torch.from_numpy(encode([[20.0, 30.0], [25.0, 25.0]], sigma=3.0))[None]
    assert heatmap_loss(torch.zeros_like(target), target, torch.ones(1, 2), 3.0).item() == pytest.approx(1.0, rel=1e-3)
    assert heatmap_loss(target, target, torch.ones(1, 2), 3.0) == 0
    half = torch.cat([target[:, :1], torch.zeros_like(target[:, 1:])], dim=1)
    assert heatmap_loss(half, target, torch.tensor([[1.0, 0.0]]), 3.0) == 0
    assert heatmap_loss(half, target, torch.tensor([[0.0, 1.0]]), 3.0).item() == pytest.approx(1.0, rel=1e-3)


def test_a_standing_figure_breaks_nothing():
    for arm in ("graph", "literal", "graph-pixels"):
        assert knowledge_loss(arm)(tensor(STANDING), ALL).item() == 0
    assert knowledge_loss("shuffled", seed=1)(tensor(STANDING), ALL).item() > 0.05


def test_values_of_single_constraints():
    levels = {"left_neckline": 0.0, "right_neckline": 0.0, "left_ankle": 1.0, "right_ankle": 1.0}
    figure = tensor(STANDING)
    size = np.sqrt(np.mean(np.sum((STANDING - STANDING.mean(0)) ** 2, axis=1)))
    symmetry = Symmetry("s", "left_waist", "right_waist", 0.05, 10.0, 1.0, "x")
    axis = [Symmetry(f"axis{i}", f"left_{p}", f"right_{p}", 9, 9, 0.0, "x") for i, p in enumerate(("neckline", "ankle"))]
    moved = STANDING.copy()
    moved[[INDEX["left_waist"], INDEX["right_waist"]], 0] += 20
    moved_size = np.sqrt(np.mean(np.sum((moved - moved.mean(0)) ** 2, axis=1)))
    g = GraphLoss(Knowledge((symmetry, *axis), {}, levels))
    assert g(tensor(moved), ALL).item() == pytest.approx((20 / (0.05 * moved_size) - 1) ** 2, rel=1e-9)
    ratio = Ratio("r", "left_shoulder", "right_shoulder", "left_waist", "right_waist", 2.0, 3.0, 1.0, "x")
    value = GraphLoss(Knowledge((ratio, *axis), {}, levels))(figure, ALL).item()
    assert value == pytest.approx(np.log(2 / (48 / 36)) ** 2, rel=1e-2)
    order = Order("o", "left_ankle", "left_waist", 0.1, 1.0, "x")
    expected = (0.1 + (226 - 110) / size) ** 2
    assert GraphLoss(Knowledge((order, *axis), {}, levels))(figure, ALL).item() == pytest.approx(expected, rel=1e-9)


def test_literal_formula_6_has_the_papers_tolerances():
    term = LiteralLoss()
    shifted = tensor(STANDING + np.array([7.4, 0]))  # x_a + x_b - W changes by 14.8 < 15
    assert term(shifted, ALL).item() == 0
    further = tensor(STANDING + np.array([15.0, 0]))  # by 30: one tolerance beyond
    assert term(further, ALL).item() == pytest.approx(1.0)
    tilted = STANDING.copy()
    tilted[0::2, 1] += 40
    assert term(tensor(tilted), ALL).item() == pytest.approx(1.0)


@pytest.mark.parametrize("seed", range(3))
def test_the_graph_does_not_care_where_how_big_or_how_turned_the_figure_is(seed):
    g, p = GraphLoss(load()), bad_figures(seed=seed)
    here = torch.ones(4, 12, dtype=torch.float64)
    value = g(p, here).item()
    assert value > 0.01
    for other in (p + torch.tensor([31.0, -12.0]), 0.37 * p, turned(p, 25.0), turned(p, 180.0)):
        assert g(other, here).item() == pytest.approx(value, rel=1e-9)
    literal = LiteralLoss()
    assert literal(p + 31.0, here).item() != pytest.approx(literal(p, here).item(), rel=1e-2)
    assert literal(turned(p, 25.0), here).item() != pytest.approx(literal(p, here).item(), rel=1e-2)


def test_a_figure_that_stands_aside_or_leans_is_wrong_only_to_the_literal_formula():
    aside, leaning = tensor(STANDING + np.array([30.0, 0])), turned(tensor(STANDING), 12.0)
    for figure in (aside, leaning):
        assert GraphLoss(load())(figure, ALL).item() == 0
        assert LiteralLoss()(figure, ALL).item() > 0.3


def test_the_mirror_image_with_left_and_right_exchanged_has_the_same_loss():
    p = bad_figures()
    here = torch.ones(4, 12, dtype=torch.float64)
    mirrored = torch.stack([191.0 - p[..., 0], p[..., 1]], dim=-1)[:, list(MIRROR)]
    k = load()
    sides = [c for c in k.constraints if c.name != "span_to_length"]  # measured along the left edge only
    for term in (GraphLoss(Knowledge(tuple(sides), k.parts, k.levels)), LiteralLoss()):
        # ratios left over right turn into their inverse, and the shipped range 0.35 to 2.9 is its own inverse to 2 %
        assert term(mirrored, here).item() == pytest.approx(term(p, here).item(), rel=0.02)


def test_trust_and_the_true_frame():
    g, p = GraphLoss(load()), bad_figures()
    here = torch.ones(4, 12, dtype=torch.float64)
    assert g(p, here, trust=0.0 * here).item() == 0
    assert g(p, here, trust=here).item() == g(p, here).item()
    assert g(p, here, trust=0.5 * here).item() < 0.26 * g(p, here).item()
    assert g(p, here, true_points=p).item() == g(p, here).item()
    true = tensor(np.repeat(STANDING[None], 4, axis=0))
    assert torch.autograd.gradcheck(lambda q: g(q, here, here, true), p.clone().requires_grad_())
    # blown up, a figure pleases a graph that measures with the figure itself no less than before; the true frame sees it
    crooked = true.clone()
    crooked[:, [INDEX["left_waist"], INDEX["right_waist"]], 0] += 60
    larger = 5 * crooked
    assert g(larger, here).item() == pytest.approx(g(crooked, here).item())
    assert g(larger, here, true_points=true).item() > 2 * g(crooked, here, true_points=true).item()


def test_absent_points_take_their_constraints_with_them():
    g, p = GraphLoss(load()), tensor(STANDING)
    p[0, INDEX["left_wrist"]] = torch.tensor([-500.0, 900.0])
    assert g(p, ALL).item() > 0.1
    here = ALL.clone()
    here[0, INDEX["left_wrist"]] = 0
    assert g(p, here).item() == 0
    assert g(p, torch.zeros(1, 12)).item() == 0


@pytest.mark.parametrize("arm", [a for a in ARMS if a != "none"])
def test_gradients(arm):
    term = knowledge_loss(arm, seed=2)
    p = bad_figures(2).requires_grad_()
    here = torch.ones(2, 12, dtype=torch.float64)
    here[1, 3] = 0
    assert torch.autograd.gradcheck(lambda q: term(q, here), p)


def test_gradients_through_the_heat_maps():
    term = knowledge_loss("graph")
    rng = np.random.default_rng(0)
    maps = encode(rng.uniform(2, 9, (1, 12, 2)), (12, 12), 2.0) + 0.05 * rng.normal(size=(1, 12, 12, 12))
    maps = torch.tensor(maps, dtype=torch.float64).requires_grad_()
    assert torch.autograd.gradcheck(lambda m: term(4 * soft_argmax(m) + 1.5, ALL), maps, fast_mode=True)


def test_descending_the_graph_term_repairs_a_figure():
    term = knowledge_loss("graph")
    wrong = STANDING.copy()
    wrong[[INDEX["left_waist"], INDEX["left_neckline"]]] = wrong[[INDEX["left_neckline"], INDEX["left_waist"]]]
    p = tensor(wrong).requires_grad_()
    before = term(p, ALL).item()
    optimiser = torch.optim.Adam([p], 1.0)
    for _ in range(200):
        optimiser.zero_grad()
        value = term(p, ALL)
        value.backward()
        optimiser.step()
    assert value.item() < 0.02 * before
    # the two exchanged points had stood 68 px on the wrong sides; how far they come back is the tolerances' affair
    assert p[0, INDEX["left_neckline"], 1] - p[0, INDEX["left_waist"], 1] < 5


def test_degenerate_figures_have_finite_values_and_gradients():
    term = knowledge_loss("graph")
    p = torch.full((1, 12, 2), 50.0, dtype=torch.float64, requires_grad=True)
    value = term(p, ALL)
    value.backward()
    assert torch.isfinite(value) and torch.isfinite(p.grad).all()
