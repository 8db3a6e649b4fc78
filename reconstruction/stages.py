"""What the stages from images to a template cost: each in a process of its own, timed, with its peak of memory."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from mfar_fem.errors import NotConvergedError

PAPER_S = 48.3
"""Time the silk paper gives for the reconstruction of one garment, s (18-core Xeon and a P100)."""


def stages(folder, out, keypoints: str | None = None) -> list[tuple[str, list[str]]]:
    """Commands of the stages of a folder of sources, by name; `keypoints` is a detector's file, "shipped" without it."""
    detector = ["--weights", keypoints] if keypoints else []
    return [
        ("fuse", ["fuse", str(folder), "--out", f"{out}/fusion"]),
        ("keypoints", ["keypoints", str(folder), "--out", f"{out}/keypoints", *detector]),
        ("template", ["template", f"{out}/keypoints", "--out", f"{out}/template"]),
    ]


def measure(commands: Sequence[tuple[str, Sequence[str]]], progress: Callable[..., None] | None = None) -> dict[str, Any]:
    """Run commands of ``mfar`` one after the other.

    Parameters
    ----------
    commands : sequence of (str, list of str)
        Name and arguments.
    progress : callable, optional
        Called after each.

    Returns
    -------
    dict
        ``rows`` (``stage``, ``seconds``, ``cpu_s``, ``peak_MB``), ``seconds`` of all, ``peak_MB`` of the largest, ``paper_s``,
        ``cores``. Seconds are those of the whole process, imports included.

    Raises
    ------
    NotConvergedError
        A command failed; the message has its error.
    """
    rows: list[dict[str, Any]] = []
    for name, arguments in commands:
        begin = time.perf_counter()
        with subprocess.Popen([sys.executable, "-m", "mfar_fem.cli.main", *arguments], stdout=subprocess.DEVNULL,
                              stderr=subprocess.PIPE, text=True) as process:  # fmt: skip
            assert process.stderr is not None
            said = process.stderr.read()
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            raise NotConvergedError(f"mfar {' '.join(arguments)} ended with code {process.returncode}: {said.strip()[-500:]}")
        peak = usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024)  # bytes there, kilobytes elsewhere
        rows.append({"stage": name, "seconds": time.perf_counter() - begin, "cpu_s": usage.ru_utime + usage.ru_stime,
                     "peak_MB": peak / 1e6})  # fmt: skip
        if progress is not None:
            progress()
    return {"rows": rows, "seconds": sum(r["seconds"] for r in rows), "peak_MB": max(r["peak_MB"] for r in rows),
            "paper_s": PAPER_S, "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()}


def make_and_measure(out, garment: str = "round-collar-robe", keypoints: str | None = None,
                     progress: Callable[..., None] | None = None) -> dict[str, Any]:
    """Cost of the stages on a synthetic garment of ten pictures, which is made first (and kept, in ``out/case``; what the stages
    wrote before is removed, for they would go on with it)."""
    case = Path(out) / "case"
    if not (case / "sources.toml").exists():
        from reconstruction.benchmark.case import make_case

        make_case(case, garment)
    for name, _ in stages(case, out, keypoints):
        shutil.rmtree(Path(out) / ("fusion" if name == "fuse" else name), ignore_errors=True)
    from reconstruction.sources import read

    return {"garment": garment, "images": len(read(case).sources), **measure(stages(case, out, keypoints), progress)}
