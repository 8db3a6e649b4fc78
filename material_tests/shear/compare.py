"""The payload of the shear tests."""

from __future__ import annotations

import time

import numpy as np

from material_tests.shear.bias import BiasResult, bias_extension
from material_tests.shear.kinematics import law_moment
from material_tests.shear.picture_frame import FrameResult, picture_frame
from mfar_fem.errors import InputError

METHODS = ("frame", "bias")


def run(fabric, method: str = "frame", largest: float = np.radians(40.0), points: int = 8, side: float = 0.2,
        length: float = 0.3, width: float = 0.1, misalignment: float = 0.0, fidelity: str = "standard") -> dict:
    """Shear a fabric in the picture frame or by bias extension.

    Parameters
    ----------
    fabric : Fabric
    method : {'frame', 'bias'}
    largest : float
        Largest shear angle, rad; ``points`` equal steps lead to it.
    side : float
        Of the frame, m; ``length`` and ``width`` those of the bias strip.
    misalignment : float
        Of the warp from the frame's arm, rad.
    fidelity : {'draft', 'standard', 'reference'}

    Returns
    -------
    dict
        ``angle_deg``, ``displacement_m``, ``force_N``, ``expected_force_N`` (of the law: frame, homogeneous shear; bias,
        inextensible yarns), ``shear_moment_N_per_m`` (recovered) and ``law_moment_N_per_m``, ``modulus_error_percent``
        (recovered moment over the law's, less one), its ``largest_error_percent`` and the one at the first angle,
        ``initial_error_percent``; of the frame ``fabric_angle_deg``, of the bias strip ``centre_angle_deg``,
        ``zone_angle_deg`` and ``yarn_strain``.

    Raises
    ------
    InputError, NotConvergedError
    """
    if method not in METHODS:
        raise InputError(f"unknown shear test '{method}'; known: {', '.join(METHODS)}")
    if not (0 < largest < 0.5 * np.pi and points >= 2):
        raise InputError("the largest shear angle lies between 0 and a right angle (rad), and at least 2 points are needed")
    clock, angles = time.perf_counter(), np.linspace(0.0, largest, int(points) + 1)[1:]
    law = law_moment(fabric.law, fabric.membrane_scale)(angles)
    r: FrameResult | BiasResult
    if method == "frame":
        r = picture_frame(fabric, angles, side, misalignment, fidelity)
        own = {"side_m": side, "misalignment_deg": float(np.degrees(misalignment)), "expected_force_N": r.expected,
               "fabric_angle_deg": np.degrees(r.fabric_angle), "scatter_C12": r.scatter}
    else:
        r = bias_extension(fabric, angles, length, width, fidelity)
        own = {"length_m": length, "width_m": width, "expected_force_N": r.expected_force,
               "centre_angle_deg": np.degrees(r.centre_angle), "zone_angle_deg": np.degrees(r.zone_angle),
               "yarn_strain": r.yarn_strain, "field": r.strip.field().to_dict()}
    error = 100.0 * (r.moment / law - 1.0)
    return {"test": "shear", "method": method, "fabric": fabric.name, "law": fabric.law.name, "fidelity": fidelity,
            "angle_deg": np.degrees(angles), "displacement_m": r.displacement, "force_N": r.force, **own,
            "shear_moment_N_per_m": r.moment, "law_moment_N_per_m": law, "modulus_error_percent": error,
            "initial_error_percent": float(error[0]), "largest_error_percent": float(np.abs(error).max()),
            "wall_s": time.perf_counter() - clock}
