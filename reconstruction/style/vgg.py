"""VGG-16 and VGG-19 with the names of torchvision's published weights: φ_l of formula (4).

References
----------
Simonyan, Zisserman: Very deep convolutional networks for large-scale image recognition. ICLR 2015, arXiv:1409.1556.
"""

from __future__ import annotations

from mfar_fem.errors import ParameterError, UnknownNameError
from mfar_fem.tomlfile import suggest
from reconstruction.style.published import LoadReport, load_published, standardised
from reconstruction.torch_library import nn

CONVOLUTIONS = {"vgg16": (2, 2, 3, 3, 3), "vgg19": (2, 2, 4, 4, 4)}
"""Convolutions in each of the five blocks (configurations D and E)."""
WIDTHS = (64, 128, 256, 512, 512)
PARAMETERS = {"vgg16": 138_357_544, "vgg19": 143_667_240}
"""Parameters with the classifier of 1000 classes, as published."""


def layer_index(name: str) -> dict[str, int]:
    """Index within ``features`` of every rectified convolution, ``relu1_1`` to ``relu5_3`` or ``relu5_4``."""
    found, index = {}, 0
    for block, count in enumerate(_convolutions(name), 1):
        for k in range(count):
            found[f"relu{block}_{k + 1}"] = index + 1
            index += 2
        index += 1  # pooling
    return found


class VGG(nn.Module):
    """The network of a name ("vgg16", "vgg19").

    Parameters
    ----------
    name : str
        Configuration.
    classifier : bool
        With the three fully connected layers (90 % of the parameters), which features do not need.

    Raises
    ------
    UnknownNameError
    """

    def __init__(self, name: str, classifier: bool = False):
        super().__init__()
        layers: list[nn.Module] = []
        channels = 3
        for width, count in zip(WIDTHS, _convolutions(name), strict=True):
            for _ in range(count):
                layers += [nn.Conv2d(channels, width, 3, padding=1), nn.ReLU()]
                channels = width
            layers.append(nn.MaxPool2d(2))
        self.features: nn.Sequential = nn.Sequential(*layers)
        if classifier:
            hidden, drop = 4096, 0.5
            self.classifier = nn.Sequential(nn.Linear(512 * 7 * 7, hidden), nn.ReLU(), nn.Dropout(drop),
                                            nn.Linear(hidden, hidden), nn.ReLU(), nn.Dropout(drop), nn.Linear(hidden, 1000))
        self.name = name

    def forward(self, image):
        """Logits (n, 1000) of an (n, 3, 224, 224) batch in [0, 1]; needs the classifier."""
        return self.classifier(self.features(standardised(image)).flatten(1))


class VGGFeatures(nn.Module):
    """Activations of chosen layers, frozen.

    Parameters
    ----------
    name : str
        "vgg16" or "vgg19".
    layers : sequence of str
        Which (see :func:`layer_index`): the set C of formula (4), which the paper does not give. The default is that of Johnson et
        al. (ECCV 2016, doi:10.1007/978-3-319-46475-6_43).

    Raises
    ------
    ParameterError
        A layer that the network does not have.
    """

    DEFAULT = ("relu1_2", "relu2_2", "relu3_3", "relu4_3")

    def __init__(self, name: str = "vgg16", layers=DEFAULT):
        super().__init__()
        index = layer_index(name)
        for layer in layers:
            if layer not in index:
                raise ParameterError(f"{name} has no layer '{layer}'{suggest(layer, index)}")
        self.name, self.layers = name, tuple(layers)
        self.features = nn.Sequential(*list(VGG(name).features)[: max(index[layer] for layer in layers) + 1])
        self._tap = {index[layer]: layer for layer in layers}
        self.requires_grad_(False)
        self.eval()

    def load(self, path) -> LoadReport:
        """Take over torchvision's published weights; deeper layers and the classifier are not needed."""
        deeper = [f"features.{k}." for k in range(len(self.features), sum(_convolutions(self.name)) * 2 + len(WIDTHS))]
        return load_published(self, path, ignore=("classifier.", *deeper))

    def forward(self, image) -> dict:
        """Activations by layer of an (n, 3, h, w) batch in [0, 1]."""
        x, found = standardised(image), {}
        for k, layer in enumerate(self.features):
            x = layer(x)
            if k in self._tap:
                found[self._tap[k]] = x
        return found


def _convolutions(name: str) -> tuple[int, ...]:
    if name not in CONVOLUTIONS:
        raise UnknownNameError(f"no network '{name}'{suggest(name, CONVOLUTIONS)}")
    return CONVOLUTIONS[name]
