"""Element loops on several threads: kernels that release the interpreter's lock, each on its share of the elements."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise
from typing import Any

VARIABLE = "MFAR_THREADS"
"""Environment variable with the number of threads."""
SHARE = 500
"""Elements that are worth a thread."""
MOST = 8
"""Threads at most."""


def count() -> int:
    """Threads to use: ``MFAR_THREADS`` or ``NUMBA_NUM_THREADS`` if set, else the processors of this process; at most ``MOST``."""
    for name in (VARIABLE, "NUMBA_NUM_THREADS"):
        given = os.environ.get(name, "")
        if given.isdigit() and int(given) > 0:
            return min(int(given), MOST)
    allowed = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(allowed, MOST)


def shares(n: int) -> list[slice]:
    """``n`` elements in as many runs of equal length as there are threads, none much shorter than ``SHARE``."""
    parts = max(1, min(count(), n // SHARE))
    ends = [round(i * n / parts) for i in range(parts + 1)]
    return [slice(a, b) for a, b in pairwise(ends)]


def run(work: Callable[[slice], Any], parts: list[slice]) -> list[Any]:
    """``work`` of every part, in order; the first on this thread, the others beside it."""
    if len(parts) == 1:
        return [work(parts[0])]
    others = [_pool().submit(work, part) for part in parts[1:]]
    return [work(parts[0]), *(other.result() for other in others)]


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(MOST, "mfar-elements")


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)  # a forked process has none of the threads
