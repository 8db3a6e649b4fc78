"""Many cases in worker processes: a case that does not end in its time is killed, counted as a hang and can be run again alone."""

from __future__ import annotations

import contextlib
import json
import math
import multiprocessing
import multiprocessing.connection
import os
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from mfar_fem.errors import InputError
from mfar_fem.processes import one_thread
from mfar_fem.stress.cases import Case, draw
from mfar_fem.stress.solve import Outcome, run_case

ROWS = "cases.jsonl"
"""File of finished cases, a line each in the order in which they ended: what a killed run leaves."""
READY_LIMIT = 600.0
"""Seconds a worker may take to start (the kernels may have to be compiled)."""


def run_stress_test(count: int = 40, seed: int = 0, workers: int = 2, out: str | Path | None = None,
                    time_limit_per_case: float = 600.0, progress: Callable[[int, dict], None] | None = None,
                    only: int | Sequence[int] | None = None, cases: Sequence[Case] | None = None) -> dict:
    """Run random cases of the space of extremes and verify every one that claims to have converged.

    Parameters
    ----------
    count : int
        Cases 0 … count - 1 of ``seed``.
    workers : int
        Processes.
    out : path, optional
        Folder for ``cases.jsonl`` (as they end), ``stress.json``, ``stress.csv``, the failure map (CSV and PNG) and the last
        state of every case that did not converge (``case-<index>.npz``: u, directors).
    time_limit_per_case : float
        Seconds of processor time, or ten times as many of wall time, after which the worker is killed and the case is a hang (on a
        busy machine wall time says little; where the system does not tell processor time it is wall time).
    progress : callable, optional
        ``progress(done, row)`` after every case.
    only : int or sequence of int, optional
        Run these indices instead.
    cases : sequence of Case, optional
        Run these instead of drawing any.

    Returns
    -------
    dict
        ``cases``, ``converged``, ``named_failures`` (count by name), ``nan``, ``hangs``, ``unverified``, ``crashes``, ``warnings``
        (cases with a RuntimeWarning), ``converged_percent``, ``seed``, ``wall_s``, ``not_converged`` (indices by outcome) and
        ``rows``.
        ``cases`` = converged + sum of the named failures + nan + hangs + unverified + crashes.

    Raises
    ------
    InputError
        Count, workers or time limit not positive; negative seed.
    """
    if count < 1 or workers < 1 or not time_limit_per_case > 0:
        raise InputError(f"the stress test needs at least one case, one worker and a positive time limit, got {count}, {workers}, "
                         f"{time_limit_per_case}")
    if cases is None:
        indices = range(count) if only is None else [only] if isinstance(only, int) else list(only)
        cases = [draw(seed, index) for index in indices]
    folder = None
    if out is not None:
        folder = Path(out)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / ROWS).write_text("", encoding="utf-8")
    clock = time.perf_counter()
    outcomes: list[Outcome] = []
    for outcome in _outcomes(cases, min(workers, len(cases)), time_limit_per_case):
        outcomes.append(outcome)
        if folder is not None:
            with (folder / ROWS).open("a", encoding="utf-8") as file:
                file.write(json.dumps(_plain(outcome.row())) + "\n")
        if folder is not None and outcome.outcome != "converged" and outcome.state is not None:
            np.savez(folder / f"case-{outcome.case.index}.npz", u=outcome.state.u, directors=outcome.state.directors)
        if progress is not None:
            progress(len(outcomes), outcome.row())
    outcomes.sort(key=lambda o: o.case.index)
    payload = summary(outcomes) | {"seed": seed, "wall_s": time.perf_counter() - clock, "rows": [o.row() for o in outcomes]}
    if folder is not None:
        _write(folder, payload)
    return payload


def summary(outcomes: Sequence[Outcome]) -> dict:
    """The counts of :func:`run_stress_test`."""
    count = Counter(o.outcome for o in outcomes)
    indices: dict[str, list[int]] = {}
    for o in outcomes:
        if o.outcome != "converged":
            indices.setdefault(o.status if o.outcome == "failure" else o.outcome, []).append(o.case.index)
    return {"cases": len(outcomes), "converged": count["converged"],
            "named_failures": dict(sorted(Counter(o.status for o in outcomes if o.outcome == "failure").items())),
            "nan": count["nan"], "hangs": count["hang"], "unverified": count["unverified"], "crashes": count["crash"],
            "warnings": sum(bool(o.warnings) for o in outcomes),
            "converged_percent": 100.0 * count["converged"] / max(len(outcomes), 1), "not_converged": indices}


def _write(folder: Path, payload: dict) -> None:
    import csv

    from mfar_fem.stress.failure_map import draw_failure_map, failure_map, write_failure_map

    (folder / "stress.json").write_text(json.dumps(_plain(payload), indent=1), encoding="utf-8")
    with open(folder / "stress.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(payload["rows"][0]))
        writer.writeheader()
        writer.writerows(payload["rows"])
    table = failure_map(payload["rows"])
    write_failure_map(table, folder / "failure_map.csv")
    draw_failure_map(payload["rows"], folder / "failure_map.png")


def _plain(value):
    """JSON has no infinities: None instead."""
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


# -- processes -----------------------------------------------------------------------------------------------------------------
def _work(connection) -> None:
    """Body of a worker: warm up, then case after case."""
    for order in (1, 2):
        run_case(Case(order=order, cells=(2, 1), kind="dynamics", steps=1))
    with contextlib.suppress(EOFError, ConnectionError):  # the run was stopped
        connection.send("ready")
        while True:
            connection.send(run_case(connection.recv()))


def _cpu_time(pid: int | None) -> float | None:
    """Processor time of a process, s (Linux)."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    except OSError:
        return None
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class _Worker:
    def __init__(self, context):
        self.connection, other = context.Pipe()
        self.process = context.Process(target=_work, args=(other,), daemon=True)
        with one_thread():
            self.process.start()
        other.close()
        self.case: Case | None = None
        self.ready = False
        self.since, self.cpu = time.perf_counter(), 0.0

    @property
    def spent(self) -> float:
        """Seconds on the present case: processor time, or a tenth of the wall time if that is more."""
        wall = time.perf_counter() - self.since
        cpu = _cpu_time(self.process.pid)
        return wall if cpu is None else max(cpu - self.cpu, 0.1 * wall)

    def give(self, case: Case) -> None:
        self.connection.send(case)
        self.case, self.since, self.cpu = case, time.perf_counter(), _cpu_time(self.process.pid) or 0.0

    def stop(self) -> None:
        self.process.kill()
        self.process.join()
        self.connection.close()


def _outcomes(cases: Sequence[Case], workers: int, limit: float):
    """Outcomes of the cases as they end."""
    context = multiprocessing.get_context("spawn")
    waiting = list(cases)[::-1]
    pool = [_Worker(context) for _ in range(workers)]
    try:
        while waiting or any(w.case is not None for w in pool):
            multiprocessing.connection.wait([w.connection for w in pool], timeout=0.2)
            for i, worker in enumerate(pool):
                ended = _look(worker, limit)
                if ended is not None:
                    yield ended
                    if ended.outcome == "hang" or not worker.process.is_alive():
                        worker.stop()
                        pool[i] = worker = _Worker(context)
                if worker.ready and worker.case is None and waiting:
                    worker.give(waiting.pop())
    finally:
        for worker in pool:
            worker.stop()


def _look(worker: _Worker, limit: float) -> Outcome | None:
    """What has become of a worker's case: None while it runs."""
    spent = worker.spent
    try:
        if worker.connection.poll():
            answer = worker.connection.recv()
            if isinstance(answer, str):
                worker.ready = True
                return None
            worker.case = None
            return answer
    except (EOFError, ConnectionError):
        if worker.case is None:
            raise RuntimeError("a worker of the stress test died before its first case") from None
        worker.process.join()
        case, worker.case = worker.case, None
        return Outcome(case, "crash", "WorkerDied", f"the process ended with code {worker.process.exitcode}", wall_s=spent)
    if worker.case is not None and spent > limit:
        case, worker.case = worker.case, None
        return Outcome(case, "hang", "hang", f"not done after {limit:g} s; run it alone with only={case.index}", wall_s=spent)
    if not worker.ready and spent > READY_LIMIT:
        raise RuntimeError(f"a worker of the stress test did not start within {READY_LIMIT:g} s")
    return None
