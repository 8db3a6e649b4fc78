"""What one tangent costs: µs an element for the whole shell, and the membrane against scikit-fem's ``BilinearForm``."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from types import SimpleNamespace

import numpy as np

from mfar_fem.assembly import Pattern
from mfar_fem.benchmarks.bilinear_form import MembraneForm
from mfar_fem.materials.bending import Bending
from mfar_fem.materials.eight_chain_silk import EightChainSilk
from mfar_fem.materials.fabric import Fabric
from mfar_fem.shell import Shell, State
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import strip

LAW = "eight-chain-silk"


def silk() -> Fabric:
    """A light silk made of the project's law (0.1 mm, bending rigidities of 1e-6 N·m)."""
    return Fabric("silk", EightChainSilk(), 1e-4, 0.06, Bending(2e-6, 1e-6, 1e-6))


def seconds(call: Callable[[], object], repeats: int) -> np.ndarray:
    """Times (repeats,) of a call after one warm-up, s."""
    call()
    times = np.empty(repeats)
    for i in range(repeats):
        clock = time.perf_counter()
        call()
        times[i] = time.perf_counter() - clock
    return times


def affine_state(shell: Shell) -> State:
    """A homogeneous stretch with shear and rotation of the whole sheet."""
    F = np.array([[1.08, 0.03, 0.0], [-0.02, 1.04, 0.0], [0.05, 0.1, 1.0]])
    state = shell.reference_state()
    u = state.u.copy()
    u[: shell.alpha_offset] = (shell.surface.nodes @ F.T).ravel()
    return state.with_u(u)


def wavy_state(shell: Shell) -> State:
    """A stretched and waved sheet, every element curved and rotated."""
    state = affine_state(shell)
    u, X = state.u.copy(), shell.surface.nodes
    u[2: shell.alpha_offset: 3] += 0.01 * np.sin(30.0 * X[:, 0]) * np.cos(20.0 * X[:, 1])
    return state.with_u(u)


def tangent_call(shell: Shell, state: State, exact: bool) -> tuple[Callable[[], tuple[np.ndarray, np.ndarray]], Pattern]:
    """A call that computes law, residual and tangent from nothing but the state, and the pattern of its matrix."""
    pattern = Pattern(shell.n, [shell.element_dofs])

    def call():
        gradient, data = np.zeros(shell.n), np.zeros(pattern.nnz)
        shell.hessian(state, gradient, data, pattern.positions[0], exact)
        return gradient, data

    return call, pattern


def _given(shell: Shell, state: State) -> SimpleNamespace:
    """A fabric whose law is a table of its values at ``state``: nothing is left to evaluate."""
    values = shell.fabric.law.evaluate(shell.right_cauchy_green(state).reshape(-1, 3), 2)
    law = SimpleNamespace(evaluate=lambda C, order: values)
    return SimpleNamespace(law=law, membrane_scale=shell.fabric.membrane_scale, bending=shell.fabric.bending)


def run_assembly(cells: int = 71, repeats: int = 15, progress=None) -> dict:
    """Time the assembly on a square of ``cells × cells × 2`` triangles.

    Returns
    -------
    dict
        ``order1_us_per_element`` and ``order2_us_per_element`` (exact tangent), ``order1_safe_us_per_element``,
        ``order2_safe_us_per_element``: best of the repetitions for law, residual and tangent of the whole shell, scattered into
        the matrix; ``*_median``. ``membrane_us_per_element`` and ``bilinearform_us_per_element`` of the same P2 membrane
        tangent, stress and law tangent given to both (ours computes strain and residual too), and their ratio
        ``membrane_ratio_to_bilinearform``: scikit-fem as it comes, with its own quadrature for P2;
        ``membrane_ratio_same_points`` with the three points that suffice, as ours.
    """
    pattern = strip(0.3, 0.3, cells, cells)
    payload: dict = {"law": LAW, "elements": 2 * cells * cells, "repeats": repeats}
    for order in (1, 2):
        surface = Surface.from_pattern(pattern, order)
        shell = Shell(surface, silk())
        state = wavy_state(shell)
        for exact, key in ((True, f"order{order}"), (False, f"order{order}_safe")):
            call, _ = tangent_call(shell, state, exact)
            us = 1e6 * seconds(call, repeats) / len(surface.elements)
            payload[f"{key}_us_per_element"], payload[f"{key}_us_per_element_median"] = us.min(), np.median(us)
            if progress is not None:
                progress(key)
    membrane = Shell(surface, silk(), bending=False)
    state = affine_state(membrane)
    call, _ = tangent_call(membrane.with_fabric(_given(membrane, state)), state, True)
    ours = seconds(call, repeats).min()
    payload["membrane_us_per_element"] = 1e6 * ours / len(surface.elements)
    for intorder, ending in ((None, "to_bilinearform"), (2, "same_points")):
        oracle = MembraneForm(membrane, intorder)
        fields = oracle.fields(state)
        theirs = seconds(partial(oracle.matrix, fields), 3).min()
        payload[f"membrane_ratio_{ending}"] = theirs / ours
        if intorder is None:
            payload["bilinearform_us_per_element"] = 1e6 * theirs / len(surface.elements)
    return payload
