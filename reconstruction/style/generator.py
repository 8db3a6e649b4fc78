"""The generator of I_B^syn: what picture B shows, with the statistics of picture A at every resolution.

The maps of B (and B itself) are brought to the channel means and deviations of A's, so that the only way from A to the result is
through statistics: A cannot be copied. Skip connections keep the contours of B; the network puts out a change of the logits of
the adjusted B, so that before any training it is a transfer of mean and deviation in RGB.

References
----------
Huang, Belongie: Arbitrary style transfer in real-time with adaptive instance normalization. ICCV 2017, doi:10.1109/ICCV.2017.167.
Ronneberger, Fischer, Brox: U-Net. MICCAI 2015, doi:10.1007/978-3-319-24574-4_28.
"""

from __future__ import annotations

from typing import Any

from mfar_fem.errors import ParameterError
from reconstruction.torch_library import functional, nn, torch

_EPS = 1e-5
_MARGIN = 0.02
"""Distance from 0 and 1 at which logits are cut."""


def adaptive_instance_norm(content, style, strength: float = 1.0):
    """Channel means and deviations of `style` given to `content`, both (n, c, ., .); `strength` 0 leaves it as it is."""
    mean, std = content.mean((2, 3), keepdim=True), _deviation(content)
    wanted_mean, wanted_std = style.mean((2, 3), keepdim=True), _deviation(style)
    return content + strength * ((content - mean) / std * wanted_std + wanted_mean - content)


class SmallEncoder(nn.Module):
    """Four maps of (16, 32, 64, 128) channels at 1, 1/2, 1/4 and 1/8, without normalisation, which would wipe out the look.

    The small encoder, trained with the decoder from nothing; it is not ResNet-50.
    """

    name = "small encoder"
    channels = (16, 32, 64, 128)
    strides = (1, 2, 4, 8)

    def __init__(self):
        super().__init__()
        self.stages = nn.ModuleList()
        before = 3
        for k, width in enumerate(self.channels):
            first = nn.Conv2d(before, width, 3, 1 if k == 0 else 2, 1, padding_mode="reflect")
            second = nn.Conv2d(width, width, 3, 1, 1, padding_mode="reflect")
            self.stages.append(nn.ModuleList([first, second]))
            before = width

    def forward(self, image) -> list:
        """Maps of an (n, 3, h, w) batch in [0, 1]."""
        x, found = 2.0 * image - 1.0, []
        for first, second in self.stages:
            x = functional.relu(first(x))
            x = x + second(x)
            found.append(x)
            x = functional.relu(x)
        return found


class Generator(nn.Module):
    """Encoder, adaptive instance norms and a decoder.

    Parameters
    ----------
    encoder : str
        "small" or "resnet50" (whose published weights go in with ``generator.encoder.load(path)``; it is then not trained).
    skips : bool
        U-shaped (all maps) or plain (the coarsest map alone).
    width : int
        Most channels in the decoder.

    Raises
    ------
    ParameterError
        Another encoder.
    """

    def __init__(self, encoder: str = "small", skips: bool = True, width: int = 64):
        super().__init__()
        if encoder == "small":
            self.encoder: Any = SmallEncoder()
        elif encoder == "resnet50":
            from reconstruction.style.resnet import ResNet50Encoder

            self.encoder = ResNet50Encoder()
            self.encoder.requires_grad_(False)
        else:
            raise ParameterError(f"encoder '{encoder}' is not known; it is 'small' or 'resnet50'")
        self.skips = skips
        channels, strides = (3, *self.encoder.channels), (1, *self.encoder.strides)
        widths = [min(width, max(16, c // 2)) for c in channels]
        self.decoder = nn.ModuleList()
        before = channels[-1]
        for k in range(len(channels) - 2, -1, -1):
            inputs = before + (channels[k] if skips or k == 0 else 0)
            self.decoder.append(nn.Conv2d(inputs, widths[k], 3, 1, 1, padding_mode="reflect"))
            before = widths[k]
        self.last = nn.Conv2d(before, 3, 3, 1, 1, padding_mode="reflect")
        nn.init.zeros_(self.last.weight)
        nn.init.zeros_(self.last.bias)  # type: ignore[arg-type]
        self.multiple = max(strides)

    def forward(self, like, image, strength: float = 1.0):
        """I_B^syn of a batch of pairs.

        Parameters
        ----------
        like : (n, 3, h', w') tensor
            I_A, RGB in [0, 1]; its size may differ.
        image : (n, 3, h, w) tensor
            I_B; h and w multiples of :attr:`multiple`.
        strength : float
            1 takes A's statistics, 0 keeps B's.

        Returns
        -------
        (n, 3, h, w) tensor
            In (0, 1).
        """
        if image.shape[2] % self.multiple or image.shape[3] % self.multiple:
            size = tuple(image.shape[2:])
            raise ParameterError(f"height and width must be multiples of {self.multiple}, not {size}: pad the picture")
        style_maps = self.encoder(like)
        maps = [adaptive_instance_norm(b, a, strength) for a, b in zip(style_maps, self.encoder(image), strict=True)]
        base = adaptive_instance_norm(image, like, strength)
        skips = [base, *maps]
        x = maps[-1]
        for k, conv in zip(range(len(skips) - 2, -1, -1), self.decoder, strict=True):
            if x.shape[2:] != skips[k].shape[2:]:
                x = functional.interpolate(x, size=skips[k].shape[2:], mode="bilinear", align_corners=False)
            x = functional.relu(conv(torch.cat([x, skips[k]], dim=1) if self.skips or k == 0 else x))
        return torch.sigmoid(torch.logit(base.clamp(_MARGIN, 1.0 - _MARGIN)) + self.last(x))


def _deviation(x):
    return (x.var((2, 3), keepdim=True, unbiased=False) + _EPS).sqrt()
