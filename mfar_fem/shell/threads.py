"""Element loops in two halves, one a thread (the kernels release the interpreter lock).

The halves are the same whatever the number of cores, and are added in order, so results do not depend on the machine's size.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise

PARTS, LEAST = 2, 400
"""Parts of a loop, and the number of elements from which on it is divided: below, starting threads costs more than it gives."""


@cache
def _pool(process: int) -> ThreadPoolExecutor:
    """The pool of a process (a forked child cannot use its parent's threads)."""
    return ThreadPoolExecutor(min(PARTS, os.cpu_count() or 1), thread_name_prefix="elements")


def halves(count: int) -> list[slice]:
    """Ranges of elements."""
    if count < LEAST:
        return [slice(0, count)]
    bounds = [count * i // PARTS for i in range(PARTS + 1)]
    return [slice(a, b) for a, b in pairwise(bounds)]


def each(work: Callable[[slice], object], parts: list[slice]) -> list:
    """``work`` of every range, in their order."""
    if len(parts) == 1:
        return [work(parts[0])]
    return list(_pool(os.getpid()).map(work, parts))
