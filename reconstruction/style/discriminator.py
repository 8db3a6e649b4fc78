"""PatchGAN: says of every patch of a picture how real it looks as a picture of a given kind.

References
----------
Isola, Zhu, Zhou, Efros: Image-to-image translation with conditional adversarial networks. CVPR 2017, doi:10.1109/CVPR.2017.632.
"""

from __future__ import annotations

from reconstruction.torch_library import nn, torch


class PatchDiscriminator(nn.Module):
    """Stride-2 4×4 convolutions with instance norm, then one map of logits a kind.

    Parameters
    ----------
    kinds : int
        Number of kinds; the picture is judged by the map of its own.
    width : int
        Channels of the first layer; they double with each.
    layers : int
        Layers of stride 2: 3 give the 70 px patches of the paper by Isola et al., 2 give 34 px, 1 gives 16 px.
    """

    def __init__(self, kinds: int = 3, width: int = 32, layers: int = 2):
        super().__init__()
        body: list[nn.Module] = [nn.Conv2d(3, width, 4, 2, 1), nn.LeakyReLU(0.2)]
        for k in range(1, layers + 1):
            out = width * min(2**k, 8)
            before = width * min(2 ** (k - 1), 8)
            body += [nn.Conv2d(before, out, 4, 2 if k < layers else 1, 1), nn.InstanceNorm2d(out, affine=True), nn.LeakyReLU(0.2)]
        self.body = nn.Sequential(*body)
        self.head = nn.Conv2d(out if layers else width, kinds, 4, 1, 1)
        self.layers = layers

    @property
    def field(self) -> int:
        """Side of the patch that one logit sees, px."""
        field, jump = 1, 1
        for stride in [2] * self.layers + [1, 1]:
            field += 3 * jump
            jump *= stride
        return field

    def forward(self, image, kind):
        """Logits (n, 1, ., .) that the (n, 3, h, w) pictures in [0, 1] are real ones of the kinds ``kind`` (n,), integers."""
        maps = self.head(self.body(2.0 * image - 1.0))
        return torch.take_along_dim(maps, kind.view(-1, 1, 1, 1), dim=1)
