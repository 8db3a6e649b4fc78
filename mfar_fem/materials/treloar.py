"""Treloar's rubber (1944): the measured curves and the refit of the eight-chain law to all three modes at once."""

from __future__ import annotations

import csv
from importlib import resources
from typing import Any

import numpy as np

from .arruda_boyce import ArrudaBoyce
from .fit import Curve, fit_curves


def treloar_curves() -> tuple[list[Curve], str]:
    """The three curves, stress in Pa, and their citation.

    Returns
    -------
    curves : list of Curve
        Uniaxial, equibiaxial and planar tension.
    source : str
    """
    text = resources.files(__package__).joinpath("data/treloar1944.csv").read_text(encoding="utf-8")
    rows = list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))
    curves = []
    for mode in ("uniaxial", "equibiaxial", "planar"):
        own = [r for r in rows if r["mode"] == mode]
        stretch = np.array([float(r["stretch"]) for r in own])
        stress = 1e6 * np.array([float(r["nominal_stress_MPa"]) for r in own])
        curves.append(Curve(mode, "warp", stretch, stress, name=mode))
    return curves, rows[0]["source"]


def refit() -> dict[str, Any]:
    """Fit Arruda–Boyce to the three curves, every point alike.

    Returns
    -------
    dict
        ``mu_MPa``, ``N``, ``rmse_MPa``, ``rmse_by_mode_MPa``, ``points``, ``source``, ``success``.
    """
    curves, source = treloar_curves()
    fit = fit_curves(ArrudaBoyce(), curves)
    return {
        "mu_MPa": fit.law.mu / 1e6,
        "N": fit.law.N,
        "rmse_MPa": fit.rmse / 1e6,
        "rmse_by_mode_MPa": {mode: value / 1e6 for mode, value in fit.rmse_by_curve.items()},
        "points": sum(len(c.stretch) for c in curves),
        "source": source,
        "success": fit.success,
    }
