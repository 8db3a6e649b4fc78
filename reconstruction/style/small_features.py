"""The small feature network: features trained here on drawn scenes, where nobody brings published weights. It is not VGG.

It learns what can be told of a drawn scene (kind of source, garment, seen or not: belt, medallions), so that its activations
answer to both look and content. How well it does is in the report of its training (:mod:`train_features`).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from mfar_fem.errors import DataFileError, ParameterError
from mfar_fem.tomlfile import suggest
from reconstruction.style.published import load_published
from reconstruction.torch_library import functional, nn, torch

SHIPPED = Path(__file__).parent / "weights" / "small_features.pt"


@dataclass(frozen=True)
class Heads:
    """Questions the network is trained on: number of answers of each."""

    kind: int = 3
    garment: int = 4
    belt: int = 2
    medallions: int = 2

    def items(self) -> dict[str, int]:
        """Answers by question."""
        return {"kind": self.kind, "garment": self.garment, "belt": self.belt, "medallions": self.medallions}


class SmallNetwork(nn.Module):
    """Four pairs of 3×3 convolutions with batch norm, each at half the resolution of the last, and a linear head a question."""

    WIDTHS = (16, 32, 64, 96)

    def __init__(self, heads: Heads | None = None):
        super().__init__()
        channels = 3
        for k, width in enumerate(self.WIDTHS):
            block = nn.Sequential(
                nn.Conv2d(channels, width, 3, 1, 1, bias=False), nn.BatchNorm2d(width), nn.ReLU(),
                nn.Conv2d(width, width, 3, 1, 1, bias=False), nn.BatchNorm2d(width), nn.ReLU(),
            )
            setattr(self, f"block{k + 1}", block)
            channels = width
        self.heads = nn.ModuleDict({name: nn.Linear(channels, n) for name, n in (heads or Heads()).items().items()})

    def maps(self, image) -> list:
        """Maps at 1, 1/2, 1/4 and 1/8 of an (n, 3, h, w) batch in [0, 1]."""
        x, found = 2.0 * image - 1.0, []
        for k in range(len(self.WIDTHS)):
            x = getattr(self, f"block{k + 1}")(x if k == 0 else functional.avg_pool2d(x, 2))
            found.append(x)
        return found

    def forward(self, image) -> dict:
        """Logits by question."""
        pooled = self.maps(image)[-1].amax(dim=(2, 3))
        return {name: head(pooled) for name, head in self.heads.items()}


class SmallFeatures(nn.Module):
    """Activations of chosen layers of a trained :class:`SmallNetwork`, frozen.

    Parameters
    ----------
    weights : path-like, optional
        A file of :func:`train_features.train`; the one that is shipped by default.
    layers : sequence of str
        Of ``block1`` to ``block4``.

    Raises
    ------
    ParameterError
        A layer that the network does not have.
    DataFileError
        No file, or another network's.
    """

    DEFAULT = ("block1", "block2", "block3", "block4")
    name = "small features"

    def __init__(self, weights=None, layers=DEFAULT):
        super().__init__()
        for layer in layers:
            if layer not in self.DEFAULT:
                raise ParameterError(f"the small feature network has no layer '{layer}'{suggest(layer, self.DEFAULT)}")
        path = SHIPPED if weights is None else Path(weights)
        if not path.is_file():
            raise DataFileError("there is no such file of weights; train one with `mfar train style --features-only`", path=path)
        self.layers = tuple(layers)
        self.network = SmallNetwork()
        load_published(self.network, path)
        self.requires_grad_(False)
        self.eval()

    def train(self, mode: bool = True):
        """Always in evaluation mode."""
        return super().train(False)

    def forward(self, image) -> dict:
        """Activations by layer of an (n, 3, h, w) batch in [0, 1]."""
        maps = dict(zip(self.DEFAULT, self.network.maps(image), strict=True))
        return {layer: maps[layer] for layer in self.layers}


def save_small_features(network: SmallNetwork, path) -> None:
    """Write the weights in half precision where nothing is lost by it for features (a file of about 0.4 MB)."""
    state = {name: value.half() if value.is_floating_point() else value for name, value in network.state_dict().items()}
    torch.save(state, path)
