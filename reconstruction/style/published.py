"""Published weights that the user brings: read safely, compared name by name, refused with a list if they are another network's."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from mfar_fem.errors import DataFileError
from reconstruction.state_dict import read_state_dict
from reconstruction.torch_library import nn

IMAGENET_MEAN = (0.485, 0.456, 0.406)
IMAGENET_STD = (0.229, 0.224, 0.225)
"""Mean and standard deviation of RGB in [0, 1] with which torchvision's ImageNet weights were trained."""
_SHOWN = 5


@dataclass(frozen=True)
class LoadReport:
    """What a file of weights had for a network.

    Attributes
    ----------
    loaded : int
        Tensors taken over.
    missing, unexpected, ignored : tuple of str
        Names the network has and the file lacks; the reverse; and those that the caller said it does not need.
    misshapen : tuple of str
        ``name: shape in the file instead of shape in the network``.
    """

    loaded: int
    missing: tuple[str, ...] = ()
    unexpected: tuple[str, ...] = ()
    ignored: tuple[str, ...] = ()
    misshapen: tuple[str, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether every tensor of the network was filled and nothing was left over."""
        return not (self.missing or self.unexpected or self.misshapen)

    def __str__(self) -> str:
        parts = [f"{self.loaded} tensors loaded"]
        for name in ("missing", "unexpected", "misshapen", "ignored"):
            if found := getattr(self, name):
                more = f" and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
                parts.append(f"{len(found)} {name} ({', '.join(found[:_SHOWN])}{more})")
        return "; ".join(parts)


def load_published(model: nn.Module, path, ignore: Iterable[str] = ()) -> LoadReport:
    """Fill a network from a file of published weights, all or nothing.

    Parameters
    ----------
    model : torch.nn.Module
        Filled in place if everything fits.
    path : str or path-like
        See :func:`reconstruction.state_dict.read_state_dict`.
    ignore : iterable of str
        Prefixes of names in the file that this network does not have on purpose (``fc.`` of an encoder).

    Raises
    ------
    DataFileError
        Names or shapes differ; the message is the report, and nothing was changed.
    """
    state = read_state_dict(path)
    report, wanted = compare(model, state, tuple(ignore))
    if not report.complete:
        raise DataFileError(f"are not the weights of {type(model).__name__}: {report}", path=path)
    model.load_state_dict(wanted, strict=False)
    return report


def compare(model: nn.Module, state: dict, ignore: tuple[str, ...] = ()) -> tuple[LoadReport, dict]:
    """Report on a state dict for a network, and the part of it that fits."""
    own = model.state_dict()
    ignored = tuple(name for name in state if name not in own and name.startswith(ignore)) if ignore else ()
    unexpected = tuple(name for name in state if name not in own and name not in ignored)
    # batch norms count the batches they saw only since torch 0.4.1, and inference does not use the count
    missing = tuple(name for name in own if name not in state and not name.endswith("num_batches_tracked"))
    misshapen = tuple(
        f"{name}: {tuple(value.shape)} instead of {tuple(own[name].shape)}"
        for name, value in state.items() if name in own and value.shape != own[name].shape
    )
    fits = {name: value for name, value in state.items() if name in own and value.shape == own[name].shape}
    return LoadReport(len(fits), missing, unexpected, ignored, misshapen), fits


def count_parameters(model: nn.Module) -> int:
    """Number of trainable and frozen parameters (buffers not counted), as the tables of published networks give it."""
    return sum(parameter.numel() for parameter in model.parameters())


def standardised(image, mean=IMAGENET_MEAN, std=IMAGENET_STD):
    """Subtract the mean and divide by the standard deviation of each channel of an (n, 3, h, w) batch in [0, 1]."""
    shape = (1, len(mean), 1, 1)
    return (image - image.new_tensor(mean).view(shape)) / image.new_tensor(std).view(shape)
