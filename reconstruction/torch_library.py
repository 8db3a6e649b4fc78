"""The one place where the networks of the reconstruction ask for torch."""

from __future__ import annotations

from mfar_fem.errors import MissingDependencyError

try:
    import torch
    from torch import nn
    from torch.nn import functional
except ImportError as error:  # pragma: no cover - depends on the installation
    raise MissingDependencyError("the networks need torch, which is not installed: pip install 'mfar-fem[recon,torch]'") from error

__all__ = ["functional", "nn", "torch"]
