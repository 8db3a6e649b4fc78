"""What every command shares: one way to print results, errors and progress, and to check an output folder beforehand.

Standard output carries the result (a rendered table, or with ``--json`` exactly one JSON object); everything else
(progress, warnings, errors) goes to standard error.
"""

from __future__ import annotations

import contextlib
import dataclasses
import enum
import json
import math
import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from mfar_fem.errors import InputError

_emitted_json = False  # whether this run has already written its JSON object
_made: list[Path] = []  # folders that this run has made, outermost first


def out():
    """The rich console on standard output."""
    from rich.console import Console

    return Console(file=sys.stdout, soft_wrap=not sys.stdout.isatty())


def err():
    """The rich console on standard error."""
    from rich.console import Console

    return Console(file=sys.stderr, stderr=True)


def jsonable(value: Any, where: str = "payload") -> Any:
    """Turn a result into plain JSON types.

    Parameters
    ----------
    value : any
        Nested mappings, sequences, numpy arrays and scalars, dataclasses, paths, enumerations, or objects that offer
        ``to_dict()``.
    where : str
        Name of the value, used in the error.

    Returns
    -------
    dict, list, str, int, float, bool or None
        ``NaN`` and infinities become ``None`` (JSON has neither).

    Raises
    ------
    TypeError
        A value has no JSON form; the message says which.
    """
    if value is None or isinstance(value, str | bool):
        return value
    if isinstance(value, enum.Enum):
        return jsonable(value.value, where)
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): jsonable(item, f"{where}.{key}") for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [jsonable(item, f"{where}[{i}]") for i, item in enumerate(value)]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if hasattr(value, "tolist"):  # numpy arrays and scalars
        return jsonable(value.tolist(), where)
    if hasattr(value, "to_dict"):
        return jsonable(value.to_dict(), where)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
        return jsonable(fields, where)
    raise TypeError(f"{where} is a {type(value).__name__}, which has no JSON form")


def emit(payload: Mapping[str, Any], as_json: bool, render: Callable[[Mapping[str, Any]], Any] | None = None) -> None:
    """Print the result of a command.

    Parameters
    ----------
    payload : mapping
        The result; with `as_json` it is printed as one JSON object (see :func:`jsonable`).
    as_json : bool
        The command's ``--json`` switch.
    render : callable, optional
        ``render(payload)`` for people: it either returns something rich can print (a string with markup, a table, or a
        list of those) or prints through :func:`out` itself and returns None. Without it the JSON is printed.
    """
    global _emitted_json
    if as_json or render is None:
        sys.stdout.write(json.dumps(jsonable(payload), indent=2, allow_nan=False) + "\n")
        sys.stdout.flush()
        _emitted_json = True
        return
    shown = render(payload)
    for item in shown if isinstance(shown, list | tuple) else [shown]:
        if item is not None:
            out().print(item)


def error_payload(error: BaseException, exit_code: int) -> dict[str, Any]:
    """The JSON form of an error: type, message, exit code, and file, line, column or ids where the error has them."""
    details: dict[str, Any] = {"type": type(error).__name__, "message": str(error), "exit_code": exit_code}
    for name in ("path", "line", "column", "ids"):
        if getattr(error, name, None) not in (None, []):
            value = getattr(error, name)
            details[name] = value if name in ("line", "ids") else str(value)
    return {"error": details}


def report_error(error: BaseException, exit_code: int, as_json: bool, title: str = "error") -> None:
    """Say what went wrong on standard error, and with `as_json` as the one JSON object on standard output.

    A command that has already emitted its (partial) result keeps that as the only JSON object.
    """
    from rich.text import Text

    text = Text(f"{title}: ", style="bold red")
    text.append(str(error) or type(error).__name__, style="default")
    err().print(text, soft_wrap=True)
    if as_json and not _emitted_json:
        emit(error_payload(error, exit_code), True)


def forget_emitted() -> None:
    """Start a new run: no JSON object has been written yet, no folder made."""
    global _emitted_json
    _emitted_json = False
    _made.clear()


def remove_empty() -> None:
    """Remove the folders that :func:`check_writable` made in this run and that are empty (after an error)."""
    for folder in reversed(_made):
        with contextlib.suppress(OSError):
            folder.rmdir()
    _made.clear()


@contextlib.contextmanager
def progress(description: str, total: float | None = None, quiet: bool = False) -> Iterator[Callable[..., None]]:
    """A progress bar on standard error, drawn only if that is a terminal.

    Parameters
    ----------
    description : str
        What is being done.
    total : float, optional
        Number of steps; unknown if None.
    quiet : bool
        Draw nothing.

    Yields
    ------
    callable
        ``advance(steps=1, description=None, completed=None, total=None)``.
    """
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f}%"))
    hidden = quiet or not sys.stderr.isatty()
    with Progress(*columns, TimeElapsedColumn(), console=err(), transient=True, disable=hidden) as bar:
        task = bar.add_task(description, total=total)

        def advance(steps: float = 1, description: str | None = None, completed=None, total=None) -> None:
            bar.update(task, description=description, completed=completed, total=total)
            if completed is None:
                bar.advance(task, steps)

        yield advance


def check_writable(out_dir: str | os.PathLike) -> Path:
    """Make the output folder, or fail before anything is computed.

    Parameters
    ----------
    out_dir : str or path-like
        The folder; it is made, with its parents, if it does not exist.

    Returns
    -------
    pathlib.Path
        The folder.

    Raises
    ------
    InputError
        It cannot be made or nothing can be written into it.
    """
    folder = Path(out_dir)
    for part in (folder, *folder.parents):
        if part.exists() and not part.is_dir():
            raise InputError(f"cannot write into the output folder '{folder}': '{part}' is a file; choose another with --out")
    missing = [part for part in (folder, *folder.parents) if not part.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _made.extend(reversed(missing))
        with tempfile.NamedTemporaryFile(dir=folder, prefix=".mfar-write-test-"):
            pass
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(
            f"cannot write into the output folder '{folder}': {reason}; choose another with --out"
        ) from error
    return folder
