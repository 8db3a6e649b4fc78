"""Worker processes: what those that are started side by side should inherit."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator

from mfar_fem import threads

THREADS = ("MKL_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", threads.VARIABLE)
"""Numba's own variable must not change once its threads run."""


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Processes started within use one thread each: several on small matrices only wait for each other."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
