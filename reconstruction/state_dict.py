"""Files of network weights: written whole, read without running what is in them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mfar_fem.errors import DataFileError
from mfar_fem.files import replace_file
from reconstruction.torch_library import torch


def read_state_dict(path) -> dict:
    """Tensors by name in a file of `torch.save` (only tensors and plain containers are unpickled).

    A dictionary below ``state_dict``, ``model`` or ``state`` (a detector) is unpacked, and the prefix ``module.`` of data-parallel
    training dropped.

    Raises
    ------
    DataFileError
        No such file, not a file of weights, or it holds something other than tensors.
    """
    path = Path(path)
    if not path.is_file():
        raise DataFileError("there is no such file of weights", path=path)
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # torch raises pickle, zip, EOF and runtime errors of its own
        reason = ": ".join([type(error).__name__, *str(error).splitlines()[:1]])
        raise DataFileError(f"is not a file of weights that can be read safely ({reason}); "
                            "save it with torch.save(model.state_dict(), file)", path=path) from error
    for key in ("state_dict", "model", "state"):
        if isinstance(state, dict) and isinstance(state.get(key), dict):
            state = state[key]
    if not isinstance(state, dict) or not state or not all(isinstance(v, torch.Tensor) for v in state.values()):
        raise DataFileError("does not hold a dictionary of tensors; save it with torch.save(model.state_dict(), file)", path=path)
    return {str(name).removeprefix("module."): value for name, value in state.items()}


def save_state(value: Any, path: Path) -> None:
    """`torch.save` so that a kill leaves the old file or the new one."""
    replace_file(path, lambda partial: torch.save(value, partial))
