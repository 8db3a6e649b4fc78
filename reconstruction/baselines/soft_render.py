"""A smooth renderer of meshes whose pictures can be differentiated.

F. Petersen, A. H. Bermano, O. Deussen, D. Cohen-Or, Pix2Vex: image-to-geometry reconstruction using a smooth differentiable
renderer, arXiv:1903.11149. A triangle covers a pixel by the product of three sigmoids of the distances from its edges, and what is
seen is an average over triangles that falls off behind the nearest one: everything has a gradient, also with respect to triangles
that a pixel does not meet. As the widths go to zero it becomes the sharp picture.
"""

from __future__ import annotations

from dataclasses import dataclass

from reconstruction.torch_library import torch


@dataclass(frozen=True)
class Softness:
    """Widths of edges (px) and of the fall-off behind the nearest triangle (m)."""

    edge: float = 1.0
    depth: float = 0.02


def render(vertices, faces, colours, camera, size: tuple[int, int], softness: Softness, closed: bool = False):
    """Picture and coverage of a mesh.

    Parameters
    ----------
    vertices : (nv, 3) tensor
        m.
    faces : (nf, 3) integer tensor
    colours : (nf, 3) tensor
        0 to 1.
    camera : (3, 4) tensor
        To pixels of the picture; its third row gives depths in metres, positive in front.
    size : (int, int)
        Height and width, px.
    softness : Softness
    closed : bool
        A closed surface: its back is not drawn.

    Returns
    -------
    picture : (h, w, 3) tensor
    coverage : (h, w) tensor
        0 to 1.
    """
    local = vertices @ camera[:, :3].T + camera[:, 3]
    depth = local[:, 2]
    flat = local[:, :2] / depth[:, None]
    corners = flat[faces]
    edges = torch.roll(corners, -1, dims=1) - corners
    double_area = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    if closed:  # counter-clockwise from outside is clockwise in a picture whose y runs down
        front = double_area < 0
        corners, edges, double_area, faces, colours = (a[front] for a in (corners, edges, double_area, faces, colours))
    h, w = size
    y, x = torch.meshgrid(torch.arange(h, dtype=vertices.dtype), torch.arange(w, dtype=vertices.dtype), indexing="ij")
    pixels = torch.stack([x.reshape(-1), y.reshape(-1)], dim=1)
    # signed distance of pixel p from the line of edge e: (e x (p - a)) / |e|, linear in p
    normal = torch.stack([-edges[..., 1], edges[..., 0]], dim=-1) * torch.sign(double_area)[:, None, None]
    normal = normal / (edges.norm(dim=-1, keepdim=True) * softness.edge + 1e-12)
    shift = (normal * corners).sum(dim=-1)
    inside = torch.ones((), dtype=vertices.dtype)
    for k in range(3):
        inside = inside * torch.sigmoid(pixels @ normal[:, k].T - shift[:, k])
    coverage = inside.sum(dim=1).clamp(max=1)  # triangles side by side add up: 1 - prod(1 - inside) would leave their seams bare
    mean_depth = depth[faces].mean(dim=1)
    weight = inside * torch.exp(-(mean_depth - mean_depth.min().detach()) / softness.depth)
    picture = (weight @ colours) / (weight.sum(dim=1, keepdim=True) + 1e-9)
    return picture.reshape(h, w, 3), coverage.reshape(h, w)
