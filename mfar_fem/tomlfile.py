"""TOML settings files whose errors name file, line and key.

`tomllib` forgets where a key stood; :class:`TomlFile` finds it again in the text, so that a wrong value can be reported
as ``fabric.toml, line 4, key 'thickness': unit missing: write e.g. '0.1 mm'``.
"""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from . import units
from .errors import DataFileError

_HEADER = re.compile(r"^\s*\[\[?\s*([^\]]+?)\s*\]\]?")
_KEY = re.compile(r"""^\s*((?:[\w-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[\w-]+|"[^"]*"|'[^']*'))*)\s*=""")
_PART = re.compile(r"""[\w-]+|"([^"]*)"|'([^']*)'""")
_MISSING = object()


def suggest(name: str, known: Iterable[str]) -> str:
    """End of a message about an unknown name: the known name that is close, or else all of them."""
    known = {key.lower(): key for key in known}
    close = difflib.get_close_matches(str(name).lower(), known, n=1)
    return f"; did you mean '{known[close[0]]}'?" if close else f"; known: {', '.join(known.values()) or 'none'}"


class TomlFile:
    """A parsed TOML file (or a plain dict) with access by key path and errors that say where.

    Parameters
    ----------
    data : dict
        The parsed contents.
    path : str or path-like, optional
        The file, for messages.
    text : str
        Its text, from which line numbers are found.
    """

    def __init__(self, data: dict[str, Any], path=None, text: str = ""):
        self.data, self.path, self.text = data, path, text
        self._lines = _key_lines(text) if text else {}

    @classmethod
    def read(cls, path) -> TomlFile:
        """Read and parse a file.

        Raises
        ------
        DataFileError
            It does not exist, cannot be read, is not UTF-8 or not TOML (with the line).
        """
        try:
            text = Path(path).read_text(encoding="utf-8")
        except FileNotFoundError:
            raise DataFileError("there is no such file", path=path) from None
        except OSError as error:
            raise DataFileError(f"cannot be read: {error.strerror or error}", path=path) from error
        except UnicodeDecodeError as error:
            raise DataFileError("is not a UTF-8 text file", path=path) from error
        try:
            return cls(tomllib.loads(text), path, text)
        except tomllib.TOMLDecodeError as error:
            found = re.search(r"\(at line (\d+)", str(error))
            line = int(found[1]) if found else None
            raise DataFileError(f"is not valid TOML: {error}", path=path, line=line) from error

    def line(self, *keys: str) -> int | None:
        """1-based line of a key given by its path, or of the nearest table that encloses it."""
        for n in range(len(keys), 0, -1):
            if keys[:n] in self._lines:
                return self._lines[keys[:n]]
        return None

    def error(self, message: str, *keys: str) -> DataFileError:
        """The error to raise about a key (returned, not raised)."""
        return DataFileError(message, path=self.path, line=self.line(*keys), column=_shown(keys) or None)

    def get(self, *keys: str, default: Any = _MISSING, kind: type | tuple[type, ...] | None = None) -> Any:
        """Value at a key path.

        Parameters
        ----------
        *keys : str
            Path, e.g. ``"law", "name"``.
        default : any, optional
            Returned if the key is missing; without it a missing key is an error.
        kind : type or tuple of types, optional
            What the value must be.

        Raises
        ------
        DataFileError
            Missing, or of another type.
        """
        value: Any = self.data
        for n, key in enumerate(keys):
            if isinstance(value, list) and key.isdigit() and int(key) < len(value):  # [[table]]: its entries by number
                value = value[int(key)]
                continue
            if not isinstance(value, dict):
                raise self.error("must be a table, written [" + ".".join(keys[:n]) + "]", *keys[:n])
            if key not in value:
                if default is _MISSING:
                    raise self.error(f"the key '{_shown(keys)}' is missing", *keys)
                return default
            value = value[key]
        if kind is not None and (not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool)):
            names = {str: "a string", dict: "a table", bool: "true or false", list: "a list"}
            wanted = names.get(kind, "a number") if isinstance(kind, type) else "a number"
            raise self.error(f"must be {wanted}, not {value!r}", *keys)
        return value

    def check_keys(self, table: tuple[str, ...], allowed: Iterable[str]) -> None:
        """Refuse keys of a table that are not known, with a suggestion."""
        allowed = list(allowed)
        for key in self.get(*table, kind=dict):
            if key not in allowed:
                raise self.error(f"unknown key '{key}'{suggest(key, allowed)}", *table, key)

    def quantity(self, *keys: str, unit: str, default: Any = _MISSING) -> Any:
        """A quantity "number unit" converted to `unit` (see :func:`mfar_fem.units.parse`)."""
        value = self.get(*keys, default=default)
        if value is default and default is not _MISSING:
            return default
        return units.parse(value, unit, name=_shown(keys), path=self.path, line=self.line(*keys))


def _shown(keys: Iterable[str]) -> str:
    """A key path for people: numbers of ``[[table]]`` entries count from 1, ``body[2].radius``."""
    text = ""
    for key in keys:
        text += f"[{int(key) + 1}]" if key.isdigit() else (("." if text else "") + key)
    return text


def _split(dotted: str) -> tuple[str, ...]:
    """Parts of a dotted TOML key, unquoted."""
    return tuple(next((g for g in m.groups() if g is not None), m[0]) for m in _PART.finditer(dotted))


def _key_lines(text: str) -> dict[tuple[str, ...], int]:
    """Line numbers (1-based) of all tables and keys, by path; text inside multi-line strings is skipped."""
    found: dict[tuple[str, ...], int] = {}
    count: dict[tuple[str, ...], int] = {}
    table: tuple[str, ...] = ()
    inside = None
    for number, line in enumerate(text.splitlines(), 1):
        if inside is None:
            if line.lstrip().startswith("#"):
                continue
            if header := _HEADER.match(line):
                table = _split(header[1])
                if line.lstrip().startswith("[["):
                    found.setdefault(table, number)
                    table = (*table, str(count.get(table, 0)))
                    count[table[:-1]] = int(table[-1]) + 1
                else:  # [body.motion] after [[body]] belongs to the last body
                    for n in range(len(table) - 1, 0, -1):
                        if table[:n] in count:
                            table = (*table[:n], str(count[table[:n]] - 1), *table[n:])
                            break
                found.setdefault(table, number)
            elif key := _KEY.match(line):
                path = table + _split(key[1])
                found.setdefault(path, number)
                found.setdefault(tuple(k for k in path if not k.isdigit()), number)  # of [[table]] the first
        for quotes in ('"""', "'''"):
            if inside in (None, quotes) and line.count(quotes) % 2:
                inside = None if inside else quotes
    return found
