"""What has to be installed for the chosen settings, looked for before anything is computed."""

from __future__ import annotations

from importlib.util import find_spec

from mfar_fem.errors import MissingDependencyError
from mfar_fem.fidelity import fidelity as level

ALWAYS = {"cv2": "recon", "networkx": "recon", "PIL": "recon", "igl": "recon", "embreex": "recon", "skimage": "recon",
          "torch": "torch"}  # fmt: skip
"""Modules of every restoration and the extras that install them; torch finds the keypoints."""
POISSON = {"gpytoolbox": "recon"}
DRAPE = {"ipctk": "contact"}
"""Contact with the figure; the position-based drape of the draft level does without."""


def modules(surface: str, drape: bool, fidelity: str) -> dict[str, str]:
    """Optional modules and their extras that a restoration with these settings imports."""
    needed = dict(ALWAYS)
    if surface == "poisson":
        needed |= POISSON
    if drape and level(fidelity).order > 0:
        needed |= DRAPE
    return needed


def check_libraries(surface: str, drape: bool, fidelity: str) -> None:
    """Refuse to begin what cannot be ended.

    Raises
    ------
    MissingDependencyError
        Names every module that is missing and the extras of pip.
    """
    missing = {name: extra for name, extra in modules(surface, drape, fidelity).items() if find_spec(name) is None}
    if missing:
        extras = ",".join(dict.fromkeys(missing.values()))
        without = "; --no-drape does without ipctk" if "ipctk" in missing else ""
        raise MissingDependencyError(f"restoring needs {', '.join(missing)}: pip install 'mfar-fem[{extras}]'{without}")
