"""The payload of the inflation tests."""

from __future__ import annotations

import time

from material_tests.inflation import hencky, mylar, sphere
from mfar_fem.errors import UnknownNameError

CASES = ("hencky", "mylar", "sphere")
MESHES = {"draft": (4, 4, 2), "standard": (8, 6, 4), "reference": (16, 8, 8)}
"""Rings and sectors of the quarter disc, divisions of a side of the sphere's octant."""


def run(case: str = "mylar", order: int = 2, fidelity: str = "standard", nu: float = 0.3) -> dict:
    """Inflate one membrane and compare with its exact solution.

    Parameters
    ----------
    case : {'hencky', 'mylar', 'sphere'}
    order : {1, 2}
        Of the elements.
    fidelity : {'draft', 'standard', 'reference'}
        Mesh, see `MESHES`.
    nu : float
        Poisson's ratio (hencky, mylar).

    Returns
    -------
    dict
        ``test``, ``case``, ``fidelity``, ``wall_s`` and what the case's ``solve`` returns.

    Raises
    ------
    UnknownNameError, NotConvergedError
    """
    if fidelity not in MESHES:
        raise UnknownNameError(f"unknown fidelity '{fidelity}'; known: {', '.join(MESHES)}")
    if case not in CASES:
        raise UnknownNameError(f"unknown inflation case '{case}'; known: {', '.join(CASES)}")
    rings, sectors, divisions = MESHES[fidelity]
    clock = time.perf_counter()
    if case == "sphere":
        found = sphere.solve(order, divisions)
    else:
        found = (hencky if case == "hencky" else mylar).solve(order, rings, sectors, nu)
    return {"test": "inflation", "case": case, "fidelity": fidelity, **found, "wall_s": time.perf_counter() - clock}
