"""Frozen records that can be copied and pickled."""

import copyreg
from collections.abc import Mapping
from dataclasses import fields
from types import MappingProxyType
from typing import Any, TypeVar

Record = TypeVar("Record")


def copyable(record: type[Record]) -> type[Record]:
    """Have a frozen dataclass copied and pickled through its constructor: what it holds is read-only in the copy too.

    A read-only mapping cannot be pickled by itself, and an array that was pickled can be written to.
    """
    copyreg.pickle(record, _reduced)
    return record


def _reduced(record: Any) -> tuple[Any, ...]:
    return _again, (type(record), {f.name: _plain(getattr(record, f.name)) for f in fields(record)})


def _again(record: type[Any], values: Mapping[str, Any]) -> Any:
    return record(**values)


def _plain(value: Any) -> Any:
    return dict(value) if isinstance(value, MappingProxyType) else value
