"""The payload of the swing test."""

from __future__ import annotations

import math
import time as clock
from itertools import pairwise

import numpy as np

from material_tests.swing.fe import SIZE, Specimen, level_of, swing
from material_tests.swing.fit import Estimate, fit_fe, fit_plate, noisy
from material_tests.swing.model import PAPER_GAMMA, added_mass, drag_coefficient, per_area
from mfar_fem.errors import InputError

RECOVER = ("fe", "plate", "none")


def read_swing(time, angle) -> dict:
    """Period and amplitudes of a motion (n,), s and rad.

    Returns
    -------
    dict
        ``period_s``: twice the mean time between passages of the vertical (None below two passages); ``amplitudes_deg``: the
        release and the largest angle of every completed half swing; ``decay``: ratio of successive amplitudes.
    """
    time, angle = np.asarray(time, dtype=float), np.asarray(angle, dtype=float)
    cross = np.flatnonzero(np.sign(angle[:-1]) * np.sign(angle[1:]) < 0)
    passage = time[cross] - angle[cross] * (time[cross + 1] - time[cross]) / (angle[cross + 1] - angle[cross])
    largest = [abs(angle[0])]
    for a, b in pairwise(cross):
        i = int(a) + 1 + int(np.argmax(np.abs(angle[a + 1 : b + 1])))
        lo, hi = max(i - 1, 0), min(i + 2, len(angle))
        p = np.polyfit(time[lo:hi] - time[i], np.abs(angle[lo:hi]), 2) if hi - lo == 3 else (0.0, 0.0, abs(angle[i]))
        largest.append(float(p[2] - p[1] ** 2 / (4 * p[0])) if p[0] < 0 else float(abs(angle[i])))
    amplitudes = np.array(largest)
    return {"period_s": float(2.0 * np.mean(np.diff(passage))) if len(passage) > 1 else None,
            "amplitudes_deg": np.degrees(amplitudes), "decay": amplitudes[1:] / amplitudes[:-1]}


def paper_gamma(area: float, gamma: float = PAPER_GAMMA) -> dict:
    """What the paper's γ (N·s²/m²) means on a swatch of ``area`` (m²), taken as the total of the swatch.

    Keys ``total_N_s2_per_m2``, ``area_m2``, ``per_area_N_s2_per_m4``, ``drag_coefficient``.
    """
    return {"total_N_s2_per_m2": gamma, "area_m2": area, "per_area_N_s2_per_m4": per_area(gamma, area),
            "drag_coefficient": drag_coefficient(per_area(gamma, area))}


def run(fabric, angle: float = math.radians(60.0), hang: str = "short", size: tuple[float, float] = SIZE, direction: float = 0.0,
        gamma: float = 0.6, tangential: float = 0.02, duration: float | None = None, recover: str = "fe",
        noise: float = math.radians(0.5), rate: float = 100.0, seed: int = 0, fidelity: str = "standard") -> dict:
    """Let a swatch of a fabric swing, and recover its drag coefficient from a synthetic record of it.

    Parameters
    ----------
    fabric : Fabric
    angle : float
        Of the release from the vertical, rad.
    hang : {'short', 'long'}
        Edge it hangs from.
    size : (long, short)
        m.
    direction : float
        Of the warp from the way down, rad.
    gamma, tangential : float
        Drag coefficients, N·s²/m⁴; ``gamma`` is the truth to recover.
    duration : float, optional
        s; default two and a half periods of the rigid plate.
    recover : {'fe', 'plate', 'none'}
        The record comes from a mesh and a time step 1.5 times finer than those it is read with.
    noise, rate, seed
        Of the record: standard deviation (rad), samples a second, seed.
    fidelity : {'draft', 'standard', 'reference'}

    Returns
    -------
    dict
        ``period_s``, ``amplitudes_deg``, ``decay`` (ratio of successive amplitudes), the same of the rigid plate with ``plate_``
        before them, ``curve`` (time_s, angle_deg, plate_deg, bow), ``defect_share`` and ``dissipated_share`` of the energy at the
        release, ``gamma_normal_recovered``, ``interval``, ``truth``, ``bias_percent``, ``estimates`` (``plate``,
        ``plate_free_frequency``, ``fe``), ``record`` (time_s, angle_deg), ``paper``, ``drag_coefficient``, ``added_mass_share``,
        ``wall_s``; without recovery those of it are absent.

    Raises
    ------
    InputError, UnknownNameError, NotConvergedError
    """
    if hang not in ("short", "long"):
        raise InputError(f"a swatch hangs from its 'short' or its 'long' edge, not '{hang}'")
    if recover not in RECOVER:
        raise InputError(f"unknown way to recover the drag '{recover}'; known: {', '.join(RECOVER)}")
    if not (noise >= 0 and rate > 0 and gamma > 0):
        raise InputError(f"noise >= 0, rate > 0 and gamma > 0 are needed, got {noise} rad, {rate} 1/s, {gamma} N·s²/m⁴")
    begin = clock.perf_counter()
    length, width = (max(size), min(size)) if hang == "short" else (min(size), max(size))
    specimen = Specimen(fabric, length, width, angle, direction, tangential)
    duration = duration or 2.5 * specimen.plate(0.0).period()
    motion = swing(specimen, gamma, duration, fidelity)
    plate = specimen.plate(gamma).trajectory(angle, motion.time)
    read, rigid = read_swing(motion.time, motion.angle), read_swing(motion.time, plate)
    payload = {
        "test": "swing", "fabric": fabric.name, "fidelity": fidelity, "hang": hang, "length_m": length, "width_m": width,
        "angle_deg": math.degrees(angle), "direction_deg": math.degrees(direction), "duration_s": duration,
        "gamma_normal": gamma, "gamma_tangential": tangential, "drag_coefficient": drag_coefficient(gamma), **read,
        **{f"plate_{key}": value for key, value in rigid.items()}, "plate_undamped_period_s": specimen.plate(0.0).period(angle),
        "largest_bow": float(motion.bow.max()), "defect_share": motion.defect, "dissipated_share": motion.dissipated,
        "newton_iterations": motion.result.newton_iterations,
        "added_mass_share": added_mass(length, width) / fabric.areal_density, "paper": paper_gamma(length * width),
        "curve": {"time_s": motion.time, "angle_deg": np.degrees(motion.angle), "plate_deg": np.degrees(plate), "bow": motion.bow},
    }
    if recover != "none":
        payload |= _recovery(specimen, gamma, duration, recover, noise, rate, seed, fidelity)
    return payload | {"wall_s": clock.perf_counter() - begin}


def _recovery(specimen, gamma, duration, recover, noise, rate, seed, fidelity) -> dict:
    times = np.arange(1, int(duration * rate) + 1) / rate
    record = noisy(times, swing(specimen, gamma, duration, level_of(fidelity).finer()).at(times), noise, seed)
    estimates = {"plate": fit_plate(specimen, times, record),
                 "plate_free_frequency": fit_plate(specimen, times, record, free_frequency=True)}
    best = estimates["plate_free_frequency"]
    if recover == "fe":
        best, _ = fit_fe(specimen, times, record, fidelity, estimates["plate"].gamma)
        estimates["fe"] = best
    return {"gamma_normal_recovered": best.gamma, "interval": [best.low, best.high], "truth": gamma,
            "truth_in_interval": best.contains(gamma), "bias_percent": 100.0 * (best.gamma / gamma - 1.0),
            "noise_deg": math.degrees(noise), "seed": seed, "rate_per_s": rate,
            "record": {"time_s": times, "angle_deg": np.degrees(record)},
            "estimates": {name: _estimate(e, gamma) for name, e in estimates.items()}}


def _estimate(e: Estimate, truth: float) -> dict:
    return {"gamma": e.gamma, "interval": [e.low, e.high], "error_percent": 100.0 * (e.gamma / truth - 1.0),
            "frequency_ratio": e.frequency, "residual_deg": math.degrees(e.residual), "runs": e.runs}
