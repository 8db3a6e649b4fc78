"""The strip test for the command line: finite elements beside the two homogeneous shortcuts, and what these cost."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from material_tests.strip import homogeneous
from material_tests.strip.fe import StripResult, StripTest
from material_tests.strip.homogeneous import LATERAL, force_curve


def shortcut_error(result: StripResult, fabric, lateral: str = "free") -> dict[str, float]:
    """Error of a homogeneous shortcut against finite elements, over the strains both reach.

    Returns
    -------
    dict
        ``rmse_percent_of_range``; ``at_end_percent``: relative error at the largest common strain; ``strain`` there;
        ``force_ratio`` there (shortcut over finite elements). NaN where nothing is common.
    """
    assert result.test is not None
    good = np.flatnonzero(result.reached & (result.strain > 0))
    curve = force_curve(fabric, result.test.angle, result.strain[good], lateral) if len(good) else None
    common = good if curve is None else good[curve.converged]
    if curve is None or len(common) == 0:
        return dict.fromkeys(("rmse_percent_of_range", "at_end_percent", "strain", "force_ratio"), math.nan)
    fe, simple = result.line_force[common], curve.line_force[curve.converged]
    error = simple - fe
    return {
        "rmse_percent_of_range": float(100.0 * np.sqrt(np.mean(error**2)) / np.abs(fe).max()),
        "at_end_percent": float(100.0 * error[-1] / fe[-1]),
        "strain": float(result.strain[common[-1]]),
        "force_ratio": float(simple[-1] / fe[-1]),
    }


def run(fabric, gauge: float, width: float, angle: float, strains, fidelity: str = "standard") -> dict[str, Any]:
    """The payload of ``mfar test strip --level fe``: the keys of the homogeneous level and a curve ``fe``.

    Parameters
    ----------
    fabric : Fabric
    gauge, width : float
        m.
    angle : float
        Of the strip's axis from the warp, rad.
    strains : (m,) array_like
        Engineering strains, increasing.
    """
    test = StripTest(gauge, width, angle, fidelity)
    result = test.run(fabric, strains)
    n = int(result.reached.sum())
    curves = {
        "fe": {
            "strain": result.strain[:n],
            "line_force_N_per_m": result.line_force[:n],
            "force_N": result.force[:n],
            "lateral_strain": result.lateral_strain(),
            "converged": result.converged,
        },
        **homogeneous.curves(fabric, angle, result.strain, width),
    }
    assert result.problem is not None
    return {
        "test": "strip",
        "standard": "ASTM D5035",
        "level": "fe",
        "fabric": fabric.name,
        "law": fabric.law.name,
        "angle_deg": math.degrees(angle),
        "gauge_m": gauge,
        "width_m": width,
        "fidelity": fidelity,
        "elements": len(result.problem.surface.triangles),
        "quarter": test.quarter(fabric.law),
        "converged": result.converged,
        "status": result.status,
        "message": result.message,
        "mesh_note": test.mesh_note(),
        "newton_iterations": result.iterations,
        "wall_s": result.wall_s,
        "curves": curves,
        "shortcut_error": {lateral: shortcut_error(result, fabric, lateral) for lateral in LATERAL},
        "field": result.field().to_dict() if n else None,
    }
