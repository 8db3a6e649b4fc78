"""Toy forward models with known answers, so that fit and statistics are tested apart from the mechanics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calibration.experiments import Experiment
from calibration.forward import Prediction
from calibration.problem import Problem, Unknown
from mfar_fem.materials import get_law
from mfar_fem.materials.bending import Bending
from mfar_fem.materials.fabric import Fabric

FABRIC = Fabric("toy", get_law("eight-chain-silk"), 1e-4, 0.06, Bending.from_rigidities(2e-6, 1e-6))
LINE = (
    Unknown("law.mu", "mu", "Pa", 50.0, 1.0, 1e4, "linear"),
    Unknown("law.nu", "nu", "", 2.0, 0.4, 1e3, "linear"),
)


class Line:
    """y = mu x + nu, linear in both parameters."""

    def predict(self, fabric, x, names=()):
        mu, nu = fabric.law.values["mu"], fabric.law.values["nu"]
        columns = {"law.mu": x, "law.nu": np.ones_like(x)}
        J = np.stack([columns[n] for n in names], axis=-1) if names else None
        return Prediction(mu * x + nu, J, np.ones(x.size, bool))


class Saturating:
    """y = mu x / (1 - x / (3 nu)): locks at x = 3 nu, and hardly depends on nu for small x."""

    def predict(self, fabric, x, names=()):
        mu, nu = fabric.law.values["mu"], fabric.law.values["nu"]
        reached = x < 3 * nu
        d = np.where(reached, 1 - x / (3 * nu), 1.0)
        columns = {"law.mu": x / d, "law.nu": -mu * x * x / (3 * nu * nu * d * d)}
        J = np.stack([columns[n] for n in names], axis=-1) if names else None
        return Prediction(np.where(reached, mu * x / d, 0.0), J, reached, "ok" if reached.all() else "locking")


def line(experiment):
    return Line()


def saturating(experiment):
    return Saturating()


def experiment(x, y, name="curve", **settings):
    return Experiment(name, x, y, gauge=0.1, width=0.05, **settings)


def line_problem(n=21, noise=0.5, seed=0, unknowns=LINE, mu=100.0, nu=5.0):
    x = np.linspace(0, 1, n)
    y = mu * x + nu + noise * np.random.default_rng(seed).standard_normal(n)
    return Problem(FABRIC, unknowns, (experiment(x, y),), line)


def saturating_problem(x, noise=0.0, seed=0, mu=100.0, nu=2.0, start=3.0):
    y = Saturating().predict(FABRIC.replace(law=FABRIC.law.replace(mu=mu, nu=nu)), x).y
    y = y + noise * np.random.default_rng(seed).standard_normal(x.size)
    unknowns = (replace(LINE[0], scale="log"), replace(LINE[1], scale="log", initial=start))
    return Problem(FABRIC, unknowns, (experiment(x, y),), saturating)
