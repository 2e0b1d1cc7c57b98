"""TOML read strictly: every complaint is one sentence that names the file and the line or the key."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from apo_bench.errors import InputError
from apo_bench.strict_json import Node

LARGEST_BYTES = 1_000_000


def read_toml(path: str | Path, kind: str) -> Node:
    """The document in a file.

    Args:
        kind: What the file should be, for the message: `sweep file`.

    Raises:
        InputError: No such file, too large, not UTF-8, not TOML, or a date or time in it.
    """
    try:
        path = Path(path)
        if path.is_dir():
            raise InputError(f"{path}: a folder was given; give a {kind}, which ends in .toml.")
        if path.exists() and not path.is_file():
            raise InputError(f"{path}: this is no ordinary file; give a {kind}, which ends in .toml.")
        with path.open("rb") as stream:
            raw = stream.read(LARGEST_BYTES + 1)
    except OSError as error:
        raise InputError(f"{path}: the {kind} cannot be read ({error.strerror}); check the path.") from error
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{str(path)!r}: this is not a path ({error}); give the path of a .toml file.") from error
    if len(raw) > LARGEST_BYTES:
        raise InputError(f"{path}: the file is larger than {LARGEST_BYTES // 1_000_000} MB; give a {kind}.")
    return parse_toml(raw, str(path))


def parse_toml(raw: bytes, file: str) -> Node:
    """The document in a text; `file` is its name in messages."""
    try:
        document = tomllib.loads(raw.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise InputError(f"{file}: the file is not UTF-8 text (byte {error.start}); give a TOML file.") from error
    except (ValueError, RecursionError) as error:
        what = str(error) if isinstance(error, tomllib.TOMLDecodeError) else "nested too deep, or a huge number"
        raise InputError(f"{file}: this is not TOML: {what}; mend the file at that place.") from error
    _refuse_dates(document, file)
    return Node(document, file)


def _refuse_dates(value: Any, file: str, key: str = "") -> None:
    """No key of any file takes a date, and no message could spell one."""
    if isinstance(value, dict):
        for name, entry in value.items():
            _refuse_dates(entry, file, f"{key}, {name}" if key else name)
    elif isinstance(value, list):
        for entry in value:
            _refuse_dates(entry, file, key)
    elif not isinstance(value, str | int | float | bool):
        raise InputError(f"{file}, {key}: the date or time {value} was given, which no key takes; put it into quotes.")
