"""ALIKED points (Zhao et al. 2023, doi:10.1109/TIM.2023.3271000) through kornia, with the user's copy of the published weights."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import DataFileError, MissingDependencyError
from reconstruction.matching.features import Features
from reconstruction.matching.settings import MatchSettings

MOST_POINTS = 4000
"""Points that are kept of a picture, at most."""
MODELS = ("aliked-t16", "aliked-n16rot", "aliked-n16", "aliked-n32")
_COMPUTED = {"dkd.hw_grid"}  # a buffer that the published files leave out


@lru_cache(maxsize=2)
def network(weights: str) -> Any:
    """The network in evaluation mode, its form told from the file's name.

    Raises
    ------
    MissingDependencyError
        torch or kornia is not installed.
    DataFileError
        The file is missing, of an unknown name, or does not fit the network.
    """
    try:
        import torch
        from kornia.feature import ALIKED
    except ImportError as error:
        raise MissingDependencyError(f"ALIKED needs torch and kornia ({error}): pip install 'mfar-fem[recon,torch]'") from error
    path = Path(weights)
    if path.stem not in MODELS:
        raise DataFileError(f"is not named after an ALIKED model: {', '.join(name + '.pth' for name in MODELS)}", path=path)
    if not path.is_file():
        raise DataFileError("there is no such file; the ALIKED weights are published with github.com/Shiaoming/ALIKED", path=path)
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # torch raises pickle, zip, runtime and key errors
        raise DataFileError(f"is not a file of torch weights ({type(error).__name__}); fetch it again", path=path) from error
    model = ALIKED(model_name=path.stem, max_num_keypoints=MOST_POINTS)
    try:
        missing, unexpected = model.load_state_dict(state, strict=False)
    except (RuntimeError, TypeError, AttributeError) as error:
        raise DataFileError(f"does not hold the weights of {path.stem}: {str(error).splitlines()[0]}", path=path) from error
    if unexpected or set(missing) - _COMPUTED:
        raise DataFileError(f"does not hold the weights of {path.stem}: {len(missing)} missing, {len(unexpected)} unknown",
                            path=path)  # fmt: skip
    return model.eval()


def aliked(rgb: np.ndarray, settings: MatchSettings) -> Features:
    """ALIKED points and unit descriptors of an (h, w, 3) uint8 picture."""
    import torch

    model = network(settings.weights or "")
    size = (rgb.shape[1], rgb.shape[0])
    tensor = torch.from_numpy(np.array(rgb)).permute(2, 0, 1)[None].float() / 255
    with torch.inference_mode():
        found = model(tensor)[0]
    points = found.keypoints.double().numpy()
    order = np.lexsort((points[:, 1], points[:, 0], -found.keypoint_scores.numpy()))[: settings.most_features]
    return Features(points[order], found.descriptors.numpy()[order].astype(np.float32), size)
