"""Loading the weights that the authors of HRNet published, from a file the user has.

The files are those of HRNet-Human-Pose-Estimation (``pose_hrnet_w32_256x192.pth``; names ``conv1``, ``layer1``,
``transition1``, ``stage2.0.branches…``, ``fuse_layers…``, ``final_layer``), of HRNet-Image-Classification
(``hrnetv2_w18_imagenet_pretrained.pth``) and of HRNet-Facial-Landmark-Detection (``head.0``, ``head.1``, ``head.3``, often
prefixed ``module.``). None of them is shipped here.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

from mfar_fem.errors import DataFileError
from reconstruction.keypoints.hrnet import HRNet
from reconstruction.state_dict import read_state_dict

logger = logging.getLogger(__name__)

LAST_LAYERS = ("final_layer.weight", "final_layer.bias", "head.3.weight", "head.3.bias")


@dataclass(frozen=True)
class LoadReport:
    """What of a file went into the network.

    Attributes
    ----------
    loaded : tuple of str
        Weights taken from the file.
    missing : tuple of str
        Weights of the network that the file does not have: they keep their random values.
    unexpected : tuple of str
        Weights of the file that the network has no place for.
    swapped : tuple of str
        Weights of the last layer that were left random because the number of points differs.
    """

    loaded: tuple[str, ...]
    missing: tuple[str, ...]
    unexpected: tuple[str, ...]
    swapped: tuple[str, ...]

    def __str__(self) -> str:
        text = f"{len(self.loaded)} weights loaded"
        for name in ("missing", "unexpected", "swapped"):
            keys = getattr(self, name)
            if keys:
                text += f"; {len(keys)} {name} ({', '.join(keys[:3])}{', …' if len(keys) > 3 else ''})"
        return text


def load_published(path: str | Path, model: HRNet) -> LoadReport:
    """Put the weights of a published file into a network, in place.

    Parameters
    ----------
    path : str or path-like
        The checkpoint: a state dict, or a dict that holds one under "state_dict" or "model".
    model : HRNet
        The network; its last layer may have another number of points (it then keeps its random weights).

    Returns
    -------
    LoadReport
        What was loaded, missing, unexpected and swapped; also logged, as a warning if anything but the last layer is missing.

    Raises
    ------
    DataFileError
        There is no such file, it is no state dict, or a weight has another shape (another width: the message says which).
    """
    state = read_state_dict(path)
    own = model.state_dict()
    loaded, swapped, wrong = {}, [], []
    for name, value in state.items():
        if name not in own:
            continue
        if value.shape == own[name].shape:
            loaded[name] = value
        elif name in LAST_LAYERS and value.shape[1:] == own[name].shape[1:]:
            swapped.append(name)
        else:
            wrong.append(f"{name} is {tuple(value.shape)} in the file and {tuple(own[name].shape)} in the network")
    if wrong:
        raise DataFileError(
            f"does not fit a network of width {model.arch.width}: {wrong[0]}"
            + (f" (and {len(wrong) - 1} more)" if len(wrong) > 1 else "") + "; build the network of the file's width",
            path=path,
        )
    if not loaded:
        raise DataFileError(f"holds none of the network's weights; it begins with '{next(iter(state))}', "
                            f"the network with '{next(iter(own))}'", path=path)
    model.load_state_dict(loaded, strict=False)
    counters = {name for name in own if name.endswith("num_batches_tracked")}  # old files do not have them; nothing depends on them
    report = LoadReport(
        tuple(loaded),
        tuple(name for name in own if name not in loaded and name not in swapped and name not in counters),
        tuple(name for name in state if name not in own),
        tuple(swapped),
    )
    backbone = [name for name in report.missing if not name.startswith(("head.", "final_layer."))]
    logger.log(logging.WARNING if backbone else logging.INFO, "%s: %s", path, report)
    return report
