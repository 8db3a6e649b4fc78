"""Worker processes: what those that are started side by side should inherit."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import Any

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


def side_by_side(work: Callable[..., Any], calls: Mapping[Any, tuple], workers: int) -> Iterator[tuple[Any, Any]]:
    """Call a function many times in worker processes, one thread each, and yield ``(key, result)`` as they are done.

    Parameters
    ----------
    work : callable
        Importable by a new process, like its arguments.
    calls : mapping of key to tuple
        The arguments of every call.
    workers : int
        Processes; with one, or a single call, everything runs in this one.

    Raises
    ------
    Exception
        What a call raised; calls that have not begun are dropped then, and when the caller stops listening.
    """
    if min(workers, len(calls)) <= 1:
        for key, arguments in calls.items():
            yield key, work(*arguments)
        return
    with one_thread(), ProcessPoolExecutor(min(workers, len(calls)), get_context("spawn")) as pool:
        futures = {pool.submit(work, *arguments): key for key, arguments in calls.items()}
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        finally:
            pool.shutdown(cancel_futures=True)
