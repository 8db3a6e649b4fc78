"""ResNet-50 with the names of torchvision's published weights, as a classifier and as an encoder of four resolutions.

References
----------
He, Zhang, Ren, Sun: Deep residual learning for image recognition. CVPR 2016, doi:10.1109/CVPR.2016.90. As in torchvision the stride
of a stage sits in the 3×3 convolution of its first block ("version 1.5"), not in the 1×1 convolution of the paper.
"""

from __future__ import annotations

from reconstruction.style.published import LoadReport, load_published, standardised
from reconstruction.torch_library import functional, nn, torch

PARAMETERS = 25_557_032
"""Parameters of the classifier of 1000 classes, as published."""
BLOCKS = (3, 4, 6, 3)
EXPANSION = 4


class Bottleneck(nn.Module):
    """1×1, 3×3 and 1×1 convolutions around a shortcut; puts out ``EXPANSION * width`` channels."""

    def __init__(self, channels: int, width: int, stride: int = 1):
        super().__init__()
        out = EXPANSION * width
        self.conv1 = nn.Conv2d(channels, width, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(width)
        self.conv2 = nn.Conv2d(width, width, 3, stride, 1, bias=False)
        self.bn2 = nn.BatchNorm2d(width)
        self.conv3 = nn.Conv2d(width, out, 1, bias=False)
        self.bn3 = nn.BatchNorm2d(out)
        self.downsample = None
        if stride != 1 or channels != out:
            self.downsample = nn.Sequential(nn.Conv2d(channels, out, 1, stride, bias=False), nn.BatchNorm2d(out))

    def forward(self, x):
        shortcut = x if self.downsample is None else self.downsample(x)
        x = functional.relu(self.bn1(self.conv1(x)))
        x = functional.relu(self.bn2(self.conv2(x)))
        return functional.relu(self.bn3(self.conv3(x)) + shortcut)


class ResNet50(nn.Module):
    """The network with 50 layers.

    Parameters
    ----------
    classes : int
        Length of the output; 0 leaves the classifier ``fc`` away.
    """

    def __init__(self, classes: int = 1000):
        super().__init__()
        self.conv1 = nn.Conv2d(3, 64, 7, 2, 3, bias=False)
        self.bn1 = nn.BatchNorm2d(64)
        channels = 64
        for k, count in enumerate(BLOCKS):
            width = 64 * 2**k
            blocks = [Bottleneck(channels, width, 1 if k == 0 else 2)]
            channels = EXPANSION * width
            blocks += [Bottleneck(channels, width) for _ in range(count - 1)]
            setattr(self, f"layer{k + 1}", nn.Sequential(*blocks))
        if classes:
            self.fc = nn.Linear(channels, classes)
        self.classes = classes

    def maps(self, image, depth: int = 4) -> list:
        """Activations of the stem and of the first `depth` stages.

        Parameters
        ----------
        image : (n, 3, h, w) tensor
            RGB in [0, 1]; standardised here.

        Returns
        -------
        list of tensors
            64 channels at 1/2, then 256 at 1/4, 512 at 1/8, 1024 at 1/16 and 2048 at 1/32 of the size.
        """
        x = functional.relu(self.bn1(self.conv1(standardised(image))))
        found = [x]
        x = functional.max_pool2d(x, 3, 2, 1)
        for k in range(depth):
            x = getattr(self, f"layer{k + 1}")(x)
            found.append(x)
        return found

    def forward(self, image):
        """Logits (n, classes), or with ``classes = 0`` the mean of the last map, (n, 2048)."""
        pooled = self.maps(image)[-1].mean(dim=(2, 3))
        return self.fc(pooled) if self.classes else pooled


class ResNet50Encoder(nn.Module):
    """Frozen batch norms and four maps, for the generator.

    Attributes
    ----------
    channels : tuple of int
        Channels of the maps.
    strides : tuple of int
        Pixels of the image per pixel of a map.
    """

    name = "resnet50"
    channels = (64, 256, 512, 1024)
    strides = (2, 4, 8, 16)

    def __init__(self):
        super().__init__()
        self.body = ResNet50(classes=0)
        del self.body.layer4

    def load(self, path) -> LoadReport:
        """Take over torchvision's published weights; ``layer4`` and ``fc`` are not needed (see :func:`load_published`)."""
        return load_published(self.body, path, ignore=("layer4.", "fc."))

    def train(self, mode: bool = True):
        """Batch norms keep the statistics they were published with: they stay in evaluation mode."""
        super().train(mode)
        for module in self.body.modules():
            if isinstance(module, nn.BatchNorm2d):
                module.eval()
        return self

    def forward(self, image) -> list:
        """Maps at the :attr:`strides` of an (n, 3, h, w) batch in [0, 1]."""
        return self.body.maps(image, depth=3)


def load_resnet50(path) -> tuple[ResNet50, LoadReport]:
    """The classifier with the user's published file, in evaluation mode (see :func:`load_published` for errors)."""
    with torch.device("cpu"):
        model = ResNet50()
    report = load_published(model, path)
    return model.eval(), report
