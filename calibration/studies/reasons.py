"""Why a fitted law misses measured strips: read off the fit and the law, in words."""

from __future__ import annotations

import math

import numpy as np

from calibration.fit import Fit

OVER_ALL = 2.0
EACH_DIRECTION = 3.0
"""RMSE in % of the force range that a law should reach: over all experiments and in each."""

BY_LAW = {
    "arruda-boyce": "Its chains lock alike in all directions, so where one direction hardens all do.",
    "bischoff": "One set of chains carries yarns and shear alike: the sides of its box set the three stiffnesses, but hardening "
                "along a yarn and a soft trellis cannot be had together.",
    "eight-chain-literal": "The anisotropic part of the paper's formula is a constant (det H): the law is isotropic as written.",
    "eight-chain-silk": "One locking length for both yarn families, and the shear modulus is tied to the modulus of the network: "
                        "stiff yarns with a free trellis are out of its reach.",
    "fung": "One exponential for all directions: shear hardens with the yarns' exponent, and compression along a yarn is as stiff "
            "as tension, which the bias strip feels.",
    "gasser-ogden-holzapfel": "Its yarns are exponential and slack in compression, as a weave's are, but the matrix has one shear "
                              "modulus and does not harden: the trellis locks at large shear.",
    "neo-hookean": "One modulus for all directions and no hardening.",
    "neo-hookean-compressible": "One modulus for all directions and no hardening.",
    "st-venant-kirchhoff": "Linear in the Green strain: no toe, no locking, and compression along a yarn as stiff as tension.",
}
"""What the form of a law cannot do, whatever its parameters."""


def isotropic(law) -> bool:
    """Whether the energy does not feel the direction of the yarns."""
    C = np.array([[1.03, 0.99, 0.02], [1.01, 1.04, -0.03]])
    energies = []
    for angle in (0.0, 0.4, math.pi / 4, math.pi / 2):
        c, s = math.cos(angle), math.sin(angle)
        R = np.array([[c * c, s * s, 2 * c * s], [s * s, c * c, -2 * c * s], [-c * s, c * s, c * c - s * s]])
        energies.append(law.energy(C @ R.T))
    return bool(np.allclose(energies, energies[0], rtol=1e-8))


def hardening(x: np.ndarray, y: np.ndarray) -> float:
    """Slope of the last quarter of the strain over that of the first half."""
    last, half = x >= x[0] + 0.75 * np.ptp(x), x <= x[0] + 0.5 * np.ptp(x)
    if last.sum() < 2 or half.sum() < 2:
        return math.nan
    first = np.polyfit(x[half], y[half], 1)[0]
    return float(np.polyfit(x[last], y[last], 1)[0] / first) if first > 0 else math.inf


def compression_ratio(law, strain: float = 0.03) -> float:
    """Stress of a yarn pushed together over that of the same yarn pulled (warp, the other direction held), at +-strain."""
    E = strain
    S = law.stress(np.array([[1 + 2 * E, 1.0, 0.0], [1 - 2 * E, 1.0, 0.0]]))[:, 0]
    energy = law.energy(np.array([[1 + 2 * E, 1.0, 0.0], [1 - 2 * E, 1.0, 0.0]]))
    return float(-S[1] / S[0]) if np.isfinite(energy).all() and S[0] > 0 else math.nan


def reasons(f: Fit) -> list[str]:
    """Sentences on why a fit misses its target; empty where it does not."""
    errors = f.rmse_by_experiment
    if f.rmse_percent_of_range <= OVER_ALL and max(errors.values()) <= EACH_DIRECTION:
        return []
    out = [_misses(f, errors)]
    law = f.law
    if law.name in BY_LAW:
        out.append(BY_LAW[law.name])
    if isotropic(law):
        out.append(_directions(f))
    else:
        out += _hardening(f)
        ratio = compression_ratio(law)
        if ratio > 0.5 and "compression" not in BY_LAW.get(law.name, ""):
            out.append(f"Pushed together by 3 % its warp carries {ratio:.2g} times what it carries pulled; real yarns buckle.")
    bounds = f.at_bounds()
    if bounds:
        ends = ", ".join(f"{k.removeprefix('law.')} ({v})" for k, v in bounds.items())
        out.append(f"The fit drives parameters to their bounds: {ends}.")
    return out


def _two(value: float) -> str:
    """Two significant digits without an exponent."""
    return f"{float(f'{value:.2g}'):g}"


def _misses(f: Fit, errors: dict[str, float]) -> str:
    worst = max(errors, key=lambda k: errors[k])
    return f"It misses by {f.rmse_percent_of_range:.1f} % of the range over all, most in '{worst}' ({errors[worst]:.1f} %)."


def _directions(f: Fit) -> str:
    """Measured secant stiffnesses at the largest strain that all strips reach."""
    strips = [e for e in f.problem.experiments if e.kind == "strip"]
    top = min(float(e.x.max()) for e in strips)
    forces = {e.direction_name: float(np.interp(top, e.x, e.y)) for e in strips}
    text = ", ".join(f"{k} {v:.3g}" for k, v in forces.items())
    low, high = min(forces.values()), max(forces.values())
    factor = f"a factor {_two(high / low)}" if low > 0 else "more than the resolution of the instrument"
    return f"It is isotropic: one curve for directions that differ by {factor} at {100 * top:.1f} % ({text} N/m)."


def _hardening(f: Fit) -> list[str]:
    out = []
    for e, p in zip(f.problem.experiments, f.predictions, strict=True):
        if e.kind != "strip":
            continue
        measured, law = hardening(e.x, e.y), hardening(e.x, p.y)
        if math.isfinite(measured) and measured > 2 * max(law, 0.1):
            out.append(f"The {e.direction_name} curve steepens {_two(measured)} times, the law's {_two(max(law, 0.0))} times.")
    return out
