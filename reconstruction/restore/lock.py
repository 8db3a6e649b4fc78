"""One run at a time in a folder. The system gives the lock back when its process ends, however it ends: no lock goes stale."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mfar_fem.errors import InputError

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]

log = logging.getLogger(__name__)
NAME = ".lock"


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Hold a folder.

    Raises
    ------
    InputError
        Another process holds it, or it cannot be written.
    """
    try:
        stream = (folder / NAME).open("a+", encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot write into '{folder}': {error.strerror or error}; choose another --out") from error
    with stream:
        try:
            if fcntl is None:
                raise OSError("this system has no such locks")
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            stream.seek(0)
            owner = stream.read().strip()
            raise InputError(f"another run{f' (process {owner})' if owner else ''} is at work in '{folder}': wait for its end, or "
                             "choose another --out") from None  # fmt: skip
        except OSError as error:  # a file system without locks
            log.warning("'%s' cannot be locked (%s): do not run twice in it at once", folder, error.strerror or error)
        stream.truncate(0)
        stream.write(f"{os.getpid()}\n")
        stream.flush()
        yield
