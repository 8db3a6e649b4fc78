"""The payload of the wrinkle tests."""

from __future__ import annotations

import time

from material_tests.wrinkles import scalings, sheet
from mfar_fem.errors import InputError, UnknownNameError

CASES = ("sheared", "stretched")
DEFAULTS = {"sheared": {"size": 0.032, "thickness": 25e-6, "strain": 2.0 / 128.0, "nu": 0.31, "aspect": 2.5},
            "stretched": {"size": 0.25, "thickness": 1e-4, "strain": 0.1, "nu": 0.5, "aspect": 2.5}}
"""``size``: height of the sheared strip, length of the stretched sheet, m; ``aspect``: length over height, length over width."""

CELLS = {"sheared": {"draft": 4.0, "standard": 7.0, "reference": 10.0},
         "stretched": {"draft": 7.5, "standard": 10.0, "reference": 14.0}}
"""Cells a full wavelength of the scaling law: sheared, along the strip (where a wave is √2 longer); stretched, across the sheet."""

RESOLVED = 3.5
"""Cells a wavelength *found* below which the wrinkles are the mesh's own (elements then fold in zigzag)."""

SEEDS = {"draft": (0.9,), "standard": (0.7, 0.85, 1.0, 1.2), "reference": (0.7, 0.8, 0.9, 1.0, 1.2)}


def run(case: str = "stretched", fidelity: str = "draft", strain: float | None = None, size: float | None = None,
        thickness: float | None = None, seeds: tuple[float, ...] | None = None, options=None) -> dict:
    """Wrinkle one sheet and compare with its scaling law.

    Parameters
    ----------
    case : {'sheared', 'stretched'}
    fidelity : {'draft', 'standard', 'reference'}
        Mesh (`CELLS`) and starts (`SEEDS`).
    strain : float, optional
        Shear delta/H or engineering strain; ``size`` and ``thickness`` in m (see `DEFAULTS`).
    seeds : tuple of float, optional
        Wavelengths to start from, over the scaling law's.
    options : NewtonOptions, optional

    Returns
    -------
    dict
        ``law_wavelength_m`` (sheared: half wavelength), ``law_amplitude_m`` (sheared only), ``branches`` (each start: wavelength,
        amplitude, energy, status, residual …), ``lowest`` (its index), ``wavelength_m``, ``wavelength_ratio`` and
        ``amplitude_ratio`` of it to the law, ``wrinkled`` (amplitude over a tenth of the thickness), ``cells_a_wavelength`` and
        ``resolved`` (see `RESOLVED`), ``converged``; ``surface`` for the picture.

    Raises
    ------
    UnknownNameError, ParameterError, InputError, NotConvergedError
    """
    if case not in CASES:
        raise UnknownNameError(f"unknown wrinkle case '{case}'; known: {', '.join(CASES)}")
    if fidelity not in SEEDS:
        raise UnknownNameError(f"unknown fidelity '{fidelity}'; known: {', '.join(SEEDS)}")
    seeds = SEEDS[fidelity] if seeds is None else tuple(seeds)
    if not seeds or min(seeds) <= 0:
        raise InputError("the wavelengths to start from must be positive")
    given = {"strain": strain, "size": size, "thickness": thickness}
    values = DEFAULTS[case] | {k: v for k, v in given.items() if v is not None}
    size, strain, thickness, nu = (values[k] for k in ("size", "strain", "thickness", "nu"))
    clock, amplitude, other = time.perf_counter(), None, values["aspect"]
    if case == "sheared":
        wavelength, amplitude = scalings.sheared(size, thickness, strain, nu)
        cell = 2.0**0.5 * 2.0 * wavelength / CELLS[case][fidelity]
        cells = round(other * size / cell), round(size / cell)
        branches = [sheet.sheared_strip(size, other * size, thickness, strain, nu, s, cells, options=options) for s in seeds]
    else:
        wavelength = scalings.stretched(size, thickness, strain, nu)
        across = round(size / other * CELLS[case][fidelity] / wavelength)
        cells = max(8, round(0.4 * across)), across + across % 2
        branches = [sheet.stretched_sheet(size, size / other, thickness, strain, s, cells, options=options) for s in seeds]
    lowest = min(range(len(branches)), key=lambda i: branches[i].energy)
    best = branches[lowest]
    x = best.problem.shell.positions(best.state)
    found = best.wavelength / size * (8.0**0.5 * cells[0] / other if case == "sheared" else cells[1] * other)
    return {"test": "wrinkles", "case": case, "fidelity": fidelity, "size_m": size, "strain": strain, "thickness_m": thickness,
            "nu": nu, "cells_a_wavelength": found, "resolved": bool(found >= RESOLVED),
            "wrinkled": bool(best.amplitude > 0.1 * thickness),
            "cells": list(cells), "unknowns": best.problem.n, "law_wavelength_m": wavelength, "law_amplitude_m": amplitude,
            "branches": [b.to_dict() for b in branches], "lowest": lowest, "wavelength_m": best.wavelength,
            "wavelength_uncertainty_m": best.uncertainty, "amplitude_m": best.amplitude,
            "wavelength_ratio": best.wavelength / wavelength,
            "amplitude_ratio": None if amplitude is None else best.amplitude / amplitude,
            "converged": all(b.status == "converged" for b in branches),
            "surface": {"x_m": x[:, 0], "y_m": x[:, 1], "z_m": x[:, 2], "triangles": best.problem.surface.triangles},
            "wall_s": time.perf_counter() - clock}
