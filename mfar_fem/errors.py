"""Errors a user can act on: every one says what was wrong, where, and what would be right."""

from __future__ import annotations


class MfarError(Exception):
    """Base of all errors raised on purpose; the command line turns it into a message and ``exit_code``."""

    exit_code = 1


class InputError(MfarError):
    """The input is wrong (file, parameter, mesh, option): exit code 2."""

    exit_code = 2


class ParameterError(InputError):
    """A parameter is unknown, missing, not finite or outside its bounds."""


class UnknownNameError(InputError):
    """A law, preset, dataset or benchmark of that name does not exist; the message lists those that do."""


class DataFileError(InputError):
    """A data or settings file cannot be used.

    Parameters
    ----------
    message : str
        What is wrong and what would be right.
    path : str or path-like, optional
        The file.
    line : int, optional
        1-based line in it.
    column : str, optional
        Name of the column or key.
    """

    def __init__(self, message: str, path=None, line: int | None = None, column: str | None = None):
        self.path, self.line, self.column = path, line, column
        where = "" if path is None else str(path) + (f", line {line}" if line is not None else "")
        if column is not None:
            where += (", " if where else "") + _named(column, path)
        super().__init__(f"{where}: {message}" if where else message)


def _named(column: str, path) -> str:
    """What a place in a file is called: an option of the command line, a key of TOML or JSON, a column of a table."""
    if column.startswith("--"):
        return column
    return f"{'key' if str(path).lower().endswith(('.toml', '.json')) or path is None else 'column'} '{column}'"


class SurfaceError(InputError):
    """A surface mesh is unusable; ``ids`` lists the elements, edges or vertices concerned."""

    def __init__(self, message: str, ids=()):
        self.ids = list(ids)
        super().__init__(message)


class MissingDependencyError(InputError):
    """An optional library or a system library is not installed; the message says how to install it."""


class NotConvergedError(MfarError):
    """A computation did not converge; ``result`` carries what was reached: exit code 3."""

    exit_code = 3

    def __init__(self, message: str, result=None):
        self.result = result
        super().__init__(message)
