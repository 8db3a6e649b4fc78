"""Optional libraries, imported when they are needed."""

from __future__ import annotations

from typing import Any

from mfar_fem.errors import MissingDependencyError


def opencv() -> Any:
    """The module cv2.

    Raises
    ------
    MissingDependencyError
        It is not installed.
    """
    try:
        import cv2
    except ImportError as error:
        raise MissingDependencyError(f"matching needs OpenCV ({error}): pip install 'mfar-fem[recon]'") from error
    return cv2


def networkx() -> Any:
    """The module networkx.

    Raises
    ------
    MissingDependencyError
        It is not installed.
    """
    try:
        import networkx
    except ImportError as error:
        raise MissingDependencyError(f"the match graph needs networkx ({error}): pip install 'mfar-fem[recon]'") from error
    return networkx
