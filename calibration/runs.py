"""Independent runs: serial in this process, in local worker processes, or on a Dask cluster.

Profiles, bootstrap replicates, seeds and laws are independent of each other. `run_all` gives their results in order.
With ``workers=1`` and no scheduler it is a plain loop and needs no Dask. Otherwise every run goes to a Dask worker
process with one BLAS thread; a worker that dies costs its runs alone,
which are repeated elsewhere, at most `attempts` times.
Functions and arguments must be picklable; on a foreign cluster this package must be installed on the workers.
"""

from __future__ import annotations

import contextlib
import importlib.util
import logging
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from mfar_fem.errors import InputError, MissingDependencyError
from mfar_fem.threads import VARIABLE

logger = logging.getLogger(__name__)
CONNECT_TIMEOUT = 10.0  # s, to reach a scheduler
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", VARIABLE, "VECLIB_MAXIMUM_THREADS")


@dataclass(frozen=True)
class Failed:
    """Stands in the results for a run that raised (``error``) or whose worker died every time."""

    error: BaseException

    def __bool__(self) -> bool:
        return False


@dataclass(frozen=True)
class Workers:
    """Where runs go.

    Parameters
    ----------
    workers : int
        Local worker processes; 1 runs in this process.
    scheduler : str, optional
        Address of a Dask scheduler; takes precedence over `workers`.
    attempts : int
        How often a run may lose its worker before it is given up.
    """

    workers: int = 1
    scheduler: str | None = None
    attempts: int = 3

    def __post_init__(self) -> None:
        if self.workers < 1:
            raise InputError(f"workers is {self.workers}; at least 1 is needed")

    @classmethod
    def choose(cls, workers: int = 0, scheduler: str | None = None) -> Workers:
        """As asked for; with 0 workers one a core where Dask is installed, else one."""
        if workers == 0:
            found = importlib.util.find_spec("distributed") is not None
            workers = (os.cpu_count() or 1) if found and scheduler is None else 1
        return cls(workers, scheduler)

    @property
    def serial(self) -> bool:
        """Whether the runs stay in this process."""
        return self.workers == 1 and self.scheduler is None


SERIAL = Workers()


def run_all(
    function: Callable[..., Any],
    items: Iterable[Any],
    where: Workers = SERIAL,
    *,
    progress: Callable[[int, int], None] | None = None,
    on_error: str = "raise",
) -> list[Any]:
    """``[function(item) for item in items]``, in order, wherever the runs go.

    Parameters
    ----------
    function : callable
        Of one argument; picklable when runs leave this process.
    items : iterable
    where : Workers
    progress : callable, optional
        Called with (finished, total) after each run.
    on_error : {'raise', 'keep'}
        'keep' puts a `Failed` in place of a run that raised; 'raise' raises the first error after all have finished.

    Returns
    -------
    list
    """
    items = list(items)
    report = progress or (lambda done, total: None)
    results = _serial(function, items, report) if where.serial else _dask(function, items, where, report)
    if on_error == "raise":
        for result in results:
            if isinstance(result, Failed):
                raise result.error
    return results


def _serial(function, items, report) -> list[Any]:
    results = []
    for item in items:
        results.append(_guarded(function, item))
        report(len(results), len(items))
    return results


def _guarded(function, item):
    try:
        return function(item)
    except Exception as error:
        logger.debug("a run failed", exc_info=True)
        return Failed(error)


def _on_worker(function, item):
    with one_thread():
        return _guarded(function, item)


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """One BLAS thread where threadpoolctl is installed; elsewhere the worker's environment has to do it."""
    try:
        from threadpoolctl import threadpool_limits
    except ImportError:
        yield
        return
    with threadpool_limits(1):
        yield


def _dask(function, items, where: Workers, report) -> list[Any]:
    with _client(where) as client, client.as_current():
        from distributed import as_completed
        from distributed.scheduler import KilledWorker

        results: list[Any] = [None] * len(items)
        lost = [0] * len(items)
        futures = {_submit(client, function, item): i for i, item in enumerate(items)}
        done = 0
        completed = as_completed(list(futures))
        for future in completed:
            i = futures[future]
            if future.status == "finished":
                results[i] = future.result()
            else:
                error = future.exception()
                lost[i] += 1
                if isinstance(error, KilledWorker) and lost[i] < where.attempts:
                    logger.warning("the worker of run %d died; the run is repeated", i)
                    again = _submit(client, function, items[i])
                    futures[again] = i
                    completed.add(again)
                    continue
                results[i] = Failed(error)
            done += 1
            report(done, len(items))
    return results


def _submit(client, function, item):
    return client.submit(_on_worker, function, item, pure=False)


@contextlib.contextmanager
def _client(where: Workers):
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise MissingDependencyError(
            "more than one worker needs the extra 'cluster': pip install 'mfar-fem[cluster]', or use --workers 1"
        ) from error
    logging.getLogger("distributed").setLevel(logging.ERROR)
    if where.scheduler is not None:
        try:
            client = Client(where.scheduler, timeout=CONNECT_TIMEOUT, set_as_default=False)
        except (OSError, ValueError) as error:
            raise InputError(f"no Dask scheduler answers at '{where.scheduler}': {error}") from error
        with client:
            yield client
        return
    threads = {name: "1" for name in THREADS}
    settings = {
        "distributed.nanny.pre-spawn-environ": threads,
        "distributed.scheduler.allowed-failures": where.attempts - 1,
        "distributed.worker.daemon": True,
    }
    with dask.config.set(settings):
        cluster = LocalCluster(
            n_workers=min(where.workers, max(1, 2 * (os.cpu_count() or 1))),
            threads_per_worker=1,
            processes=True,
            dashboard_address=":0",
            worker_dashboard_address=None,
            silence_logs=logging.CRITICAL,
        )
        with cluster, Client(cluster, set_as_default=False) as client:
            yield client
