"""Feature networks by name: what a user writes after ``--features``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mfar_fem.errors import UnknownNameError
from mfar_fem.tomlfile import suggest

NAMES = ("small", "efficientnet-lite0", "vgg16", "vgg19")


def load_features(name: str, layers: Sequence[str] | None = None) -> Any:
    """A frozen network that maps an (n, 3, h, w) batch in [0, 1] to activations by layer.

    Parameters
    ----------
    name : str
        ``vgg16=FILE`` or ``vgg19=FILE`` with the user's file of published weights (the paper's choice; which of the two it does
        not say); ``efficientnet-lite0`` (ImageNet weights from a package); ``small`` or ``small=FILE``, trained here.
    layers : sequence of str, optional
        Layers, the set C of formula (4); each network has its own default.

    Raises
    ------
    UnknownNameError
        No such network, or a VGG without its file.
    ParameterError, DataFileError, MissingDependencyError
        See the networks.
    """
    kind, _, path = name.partition("=")
    given = {} if layers is None else {"layers": tuple(layers)}
    if kind == "small":
        from reconstruction.style.small_features import SmallFeatures

        return SmallFeatures(path or None, **given)
    if kind == "efficientnet-lite0" and not path:
        from reconstruction.style.efficientnet_lite import EfficientNetFeatures

        return EfficientNetFeatures(**given)
    if kind in ("vgg16", "vgg19"):
        if not path:
            raise UnknownNameError(f"the weights of {kind} are not shipped: write '{kind}=FILE' with torchvision's published file, "
                                   "or use 'efficientnet-lite0' or 'small'")
        from reconstruction.style.vgg import VGGFeatures

        network = VGGFeatures(kind, **given)
        network.load(path)
        return network
    raise UnknownNameError(f"no feature network '{name}'{suggest(kind, NAMES)}")
