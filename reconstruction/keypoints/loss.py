r"""Formula (7) of the silk paper: heat-map error plus what the knowledge graph holds against the predicted points.

.. math:: L_\text{total} = L_\text{mse} + \lambda L_\text{kg}, \qquad \lambda = 0.8

The paper gives no scale to either term. Here both are free of units: :math:`L_\text{mse}` is the squared error of a heat map
over the energy :math:`\pi \sigma^2` of its Gaussian (1 for an empty map), and every constraint is a squared hinge in units of
its own tolerance or of the figure's size. A mean over the 64 × 48 pixels instead would make the same λ hundreds of times heavier.

The points come from the heat maps by a soft argmax, so that the constraints have gradients.
"""

from __future__ import annotations

from dataclasses import dataclass

from mfar_fem.errors import ParameterError
from reconstruction.keypoints.knowledge import Knowledge, Order, Ratio, Symmetry
from reconstruction.landmarks import INDEX, LANDMARKS, PAIRS
from reconstruction.torch_library import nn, torch

LAMBDA = 0.8
DELTA = (15.0, 20.0)
"""Tolerances of formula (6) across and along, pixels; taken in the 256 × 192 input, where 15 is 8 % of the width (on the heat
map it would be 31 %, and in the original image it would depend on the scan)."""


def soft_argmax(heatmaps, sharpness: float = 20.0):
    """Expected position of the heat maps' exponentials.

    Parameters
    ----------
    heatmaps : torch.Tensor, shape (..., h, w)
        With peaks near 1.
    sharpness : float
        Factor in the exponent; 20 leaves a background of zeros less than 1e-4 of the weight of a Gaussian of σ = 3.

    Returns
    -------
    torch.Tensor, shape (..., 2)
        x, y in heat-map pixels.
    """
    h, w = heatmaps.shape[-2:]
    weight = torch.softmax(sharpness * heatmaps.flatten(-2), dim=-1).reshape(heatmaps.shape)
    x = (weight.sum(-2) * torch.arange(w, dtype=heatmaps.dtype)).sum(-1)
    y = (weight.sum(-1) * torch.arange(h, dtype=heatmaps.dtype)).sum(-1)
    return torch.stack([x, y], dim=-1)


def heatmap_loss(predicted, target, weight, sigma: float):
    """Squared error of every map over π σ², averaged with the weights (b, k) of the points; a scalar."""
    error = (predicted - target).square().sum(dim=(-1, -2)) / (torch.pi * sigma**2)
    return (weight * error).sum() / weight.sum().clamp_min(1.0)


def _length(v):
    """Length of vectors (..., 2), differentiable at zero."""
    return (v.square().sum(-1) + 1e-12).sqrt()


@dataclass(frozen=True)
class Figure:
    """The figure's frame for a batch: centre (b, 2), unit vector down the axis (b, 2), and size (b,) in the unit of the points."""

    centre: torch.Tensor
    down: torch.Tensor
    size: torch.Tensor

    def across(self, v):
        """Component of v (b, n, 2) to the right of the axis."""
        return v[..., 0] * self.down[:, None, 1] - v[..., 1] * self.down[:, None, 0]

    def along(self, v):
        """Component of v (b, n, 2) down the axis."""
        return (v * self.down[:, None]).sum(-1)


class GraphLoss(nn.Module):
    """:math:`L_\\text{kg}` of a knowledge graph.

    Parameters
    ----------
    knowledge : Knowledge
        Any graph, also a shuffled one.
    delta : (float, float), optional
        Tolerances across and along of *all* symmetries in the unit of the points, instead of the graph's own in units of the
        figure's size: the paper's (15, 20) pixels about the figure's axis instead of the image's.
    """

    symmetry: torch.Tensor
    tolerance: torch.Tensor
    ratio: torch.Tensor
    bounds: torch.Tensor
    order: torch.Tensor
    gap: torch.Tensor
    weight: torch.Tensor
    levels: torch.Tensor

    def __init__(self, knowledge: Knowledge, delta: tuple[float, float] | None = None):
        super().__init__()
        self.delta = delta
        self.names = [c.name for kind in (Symmetry, Ratio, Order) for c in knowledge.of(kind)]

        def indices(kind, keys):
            rows = [[INDEX[getattr(c, k)] for k in keys] for c in knowledge.of(kind)]
            return torch.tensor(rows, dtype=torch.long).reshape(-1, len(keys))

        def numbers(kind, *keys):
            rows = [[getattr(c, k) for k in keys] for c in knowledge.of(kind)]
            return torch.tensor(rows, dtype=torch.float64).reshape(-1, len(keys))

        levels = [[knowledge.levels.get(name, float("nan"))] for name in LANDMARKS]
        for name, value in {
            "symmetry": indices(Symmetry, "ab"), "tolerance": numbers(Symmetry, "across", "along"),
            "ratio": indices(Ratio, "abcd"), "bounds": numbers(Ratio, "minimum", "maximum"),
            "order": indices(Order, "ab"), "gap": numbers(Order, "gap"),
            "weight": torch.cat([numbers(kind, "weight") for kind in (Symmetry, Ratio, Order)])[:, 0],
            "levels": torch.tensor(levels, dtype=torch.float64)[:, 0],
        }.items():
            self.register_buffer(name, value)

    def figure(self, points, present) -> tuple[Figure, torch.Tensor]:
        """Frame of the figures (points (b, 12, 2), present (b, 12) of 0 and 1) and which of them (b,) have one.

        The axis is the slope of the midpoints of level-defining pairs over their levels; a pair counts if both its points are
        present.
        """
        dtype = points.dtype
        total = present.sum(1, keepdim=True).clamp_min(1.0)
        middle = (present[..., None] * points).sum(1) / total
        spread = (present[..., None] * (points - middle[:, None])).square().sum((1, 2)) / total[:, 0]
        size = (spread + 1e-12).sqrt()
        known = torch.isfinite(self.levels)
        both = torch.ones_like(present)
        for a, b in self._level_pairs():
            both[:, a] = both[:, b] = present[:, a] * present[:, b]
        use = both * known.to(dtype)
        level = torch.nan_to_num(self.levels).to(dtype)[None]
        count = use.sum(1, keepdim=True).clamp_min(1.0)
        centre = (use[..., None] * points).sum(1) / count
        mean_level = (use * level).sum(1, keepdim=True) / count
        slope = ((use * (level - mean_level))[..., None] * points).sum(1)
        usable = ((use * (level - mean_level).square()).sum(1) > 1e-3) & (present.sum(1) >= 4)
        return Figure(centre, slope / _length(slope)[:, None].clamp_min(1e-9), size), usable.to(dtype)

    def _level_pairs(self):
        pairs = {(int(a), int(b)) for a, b in self.symmetry}
        return [(a, b) for a, b in pairs if bool(torch.isfinite(self.levels[[a, b]]).all())]

    def residuals(self, points, present, true_points=None):
        """Squared hinges of every constraint, and whether each applies (all its points present, the figure has an axis).

        Parameters
        ----------
        points : torch.Tensor, shape (b, 12, 2)
        present : torch.Tensor, shape (b, 12)
            0 or 1.
        true_points : torch.Tensor, shape (b, 12, 2), optional
            The figure's frame (centre, axis, size) is taken from these, as in training, where the truth is known. From its own
            points a figure can lower the hinges by blowing itself up, which is what networks then learn first.

        Returns
        -------
        hinge, active : torch.Tensor, shape (b, constraints)
            In the order of ``self.names``.
        """
        dtype = points.dtype
        present = present.to(dtype)
        frame, usable = self.figure(points if true_points is None else true_points.to(dtype), present)
        a, b = points[:, self.symmetry[:, 0]], points[:, self.symmetry[:, 1]]
        across = frame.across(0.5 * (a + b) - frame.centre[:, None]).abs()
        along = frame.along(a - b).abs()
        if self.delta is None:
            limit = self.tolerance.to(dtype)[None] * frame.size[:, None, None]
        else:  # the sum x_a + x_b of formula (6) is twice the midpoint
            limit = torch.tensor([0.5 * self.delta[0], self.delta[1]], dtype=dtype).expand(1, len(self.symmetry), 2)
        symmetry = (across / limit[..., 0] - 1).clamp_min(0).square() + (along / limit[..., 1] - 1).clamp_min(0).square()
        p = [points[:, self.ratio[:, i]] for i in range(4)]
        least = 1e-3 * frame.size[:, None]
        r = torch.log(_length(p[0] - p[1]) + least) - torch.log(_length(p[2] - p[3]) + least)
        low, high = torch.log(self.bounds.to(dtype).clamp_min(1e-6)).T
        ratio = (low - r).clamp_min(0).square() + (r - high).clamp_min(0).square()
        drop = frame.along(points[:, self.order[:, 1]] - points[:, self.order[:, 0]]) / frame.size[:, None]
        order = (self.gap[:, 0].to(dtype) - drop).clamp_min(0).square()
        active = torch.cat([present[:, index].prod(-1) for index in (self.symmetry, self.ratio, self.order)], dim=1)
        return torch.cat([symmetry, ratio, order], dim=1), active * usable[:, None]

    def forward(self, points, present, trust=None, true_points=None):
        """Weighted mean of the active hinges over a batch; a scalar.

        With `trust` (b, 12), in [0, 1], a constraint weighs as much as the product of the trust in its points, and the mean is
        still over all active ones: points that are not found yet are told nothing.
        """
        hinge, active = self.residuals(points, present, true_points)
        weight = active * self.weight.to(points.dtype)
        indices = (self.symmetry, self.ratio, self.order)
        said = hinge if trust is None else hinge * torch.cat([trust[:, i].prod(-1) for i in indices], dim=1)
        return (weight * said).sum() / weight.sum().clamp_min(1.0)


class LiteralLoss(nn.Module):
    """Formula (6) as printed: every pair symmetric about the middle of the *image*, x_a + x_b = W, and level with the image's rows.

    Parameters
    ----------
    width : float
        W, of the image in the unit of the points.
    delta : (float, float)
        δx and δy in the same unit.
    """

    def __init__(self, width: float = 192.0, delta: tuple[float, float] = DELTA):
        super().__init__()
        self.width, self.delta = width, delta
        self.names = [LANDMARKS[a].removeprefix("left_") for a, _ in PAIRS]

    def residuals(self, points, present, true_points=None):
        """As :meth:`GraphLoss.residuals`, one constraint a pair; the frame is the image's, so that the truth has no part in it."""
        a, b = points[:, 0::2], points[:, 1::2]
        # pixel centres count from 0, so the image's middle is (W - 1) / 2
        dx = ((a + b)[..., 0] - (self.width - 1.0)).abs() / self.delta[0]
        dy = (a - b)[..., 1].abs() / self.delta[1]
        active = (present[:, 0::2] * present[:, 1::2]).to(points.dtype)
        return (dx - 1).clamp_min(0).square() + (dy - 1).clamp_min(0).square(), active

    def forward(self, points, present, trust=None, true_points=None):
        """Mean of the active hinges over a batch; a scalar (`trust`: see :meth:`GraphLoss.forward`)."""
        hinge, active = self.residuals(points, present)
        said = hinge if trust is None else hinge * trust[:, 0::2] * trust[:, 1::2]
        return (active * said).sum() / active.sum().clamp_min(1.0)


ARMS = ("graph", "none", "shuffled", "literal", "graph-pixels")
"""What the knowledge term can be: the graph, nothing, the graph with its points exchanged, formula (6) as printed, and the
graph with the paper's pixel tolerances about the figure's axis."""


def knowledge_loss(arm: str, knowledge: Knowledge | None = None, seed: int = 0) -> nn.Module | None:
    """The knowledge term by name (see :data:`ARMS`), for points in pixels of the 256 × 192 input."""
    if arm not in ARMS:
        raise ParameterError(f"no knowledge term is called '{arm}'; there are {', '.join(ARMS)}")
    if arm == "none":
        return None
    if arm == "literal":
        return LiteralLoss()
    if knowledge is None:
        from reconstruction.keypoints.knowledge_file import load

        knowledge = load()
    if arm == "shuffled":
        knowledge = knowledge.shuffled(seed)
    return GraphLoss(knowledge, DELTA if arm == "graph-pixels" else None)
