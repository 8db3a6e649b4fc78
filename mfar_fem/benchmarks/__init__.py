"""Shell benchmarks with exact, published or independently computed references: ``mfar benchmark``.

One file a benchmark; each has ``DEFAULT_MESH`` and ``build(order, nx, ny) -> Case``. Figures of the literature are in
``references.csv`` with their sources.
"""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from mfar_fem.errors import UnknownNameError

BENCHMARKS = {
    "cantilever-shear": "Strip clamped at one end, dead shear force at the other: large rotation, exact elastica as reference",
    "cantilever-moment": "Strip rolled up to a full circle by a moment at its end",
    "slit-annulus": "Annular plate, slit and lifted at one face of the slit: very large rotation, hard on membrane locking",
    "hemisphere": "Hemisphere with an 18° hole under alternating radial point forces: nearly isometric, doubly curved",
    "pinched-cylinder": "Cylinder on rigid diaphragms pinched by two opposite forces: snaps on its way",
    "heavy-elastica": "Strip that hangs over an edge under its own weight: chord at 41.5°, the geometry of ASTM D1388",
    "scordelis-lo": "Cylindrical roof under its own weight, small displacements: membrane and bending mixed",
}
"""Name of every benchmark and what it is."""


def benchmark(name: str) -> ModuleType:
    """The module of a benchmark (``DEFAULT_MESH``, ``build``).

    Raises
    ------
    UnknownNameError
        The message lists the names that exist.
    """
    if name not in BENCHMARKS:
        raise UnknownNameError(f"unknown benchmark '{name}'; known benchmarks: {', '.join(BENCHMARKS)}")
    return import_module(f"{__name__}.{name.replace('-', '_')}")


def run(name: str, order: int = 2, mesh: tuple[int, int] | None = None, progress=None, **options) -> dict:
    """Run a benchmark.

    Parameters
    ----------
    name : str
        One of :data:`BENCHMARKS`.
    order : {1, 2}
        Of the shell.
    mesh : (int, int), optional
        Cells; the benchmark's own by default.
    progress : callable, optional
        Called with the load factor of every accepted step.
    **options
        Passed to the benchmark's ``build`` (``pattern``, ``jitter``, ``seed`` of the triangulation).

    Returns
    -------
    dict
        See :func:`mfar_fem.benchmarks.case.run_case`.
    """
    from mfar_fem.benchmarks.case import run_case

    module = benchmark(name)
    mesh = module.DEFAULT_MESH if mesh is None else mesh
    return run_case(name, order, mesh, lambda: module.build(order, *mesh, **options), progress)
