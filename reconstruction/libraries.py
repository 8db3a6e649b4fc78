"""Optional libraries, imported when they are needed."""

from __future__ import annotations

import importlib
from typing import Any

from mfar_fem.errors import MissingDependencyError


def optional(module: str, use: str, install: str = "mfar-fem[recon]") -> Any:
    """A module that an extra installs.

    Parameters
    ----------
    module : str
        Its name, e.g. ``cv2``.
    use : str
        What needs it, in the plural or with its verb: "matching needs".
    install : str
        What pip installs it with.

    Raises
    ------
    MissingDependencyError
        It is not installed, or cannot be imported.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MissingDependencyError(f"{use} {module} ({error}): pip install '{install}'") from error


def opencv(use: str = "images need") -> Any:
    """The module cv2."""
    return optional("cv2", use)


def networkx() -> Any:
    """The module networkx."""
    return optional("networkx", "graphs need")
