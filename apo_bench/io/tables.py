"""Tables as CSV and as Parquet.

A spreadsheet shows a CSV file and does not obey it: a text that it would take for a formula has ' in front.
"""

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from apo_bench.io.ordinary_files import to_write

_OBEYED = "=+-@\t\r"
"""What a formula begins with."""


def write_csv(path: Path, head: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write a table; None is an empty field, and numbers stay numbers.

    Raises:
        InputError: A link or anything else that is no regular file stands there.
        OSError: The file cannot be written.
    """
    with to_write(path, "w") as file:
        writer = csv.writer(file)
        writer.writerow(map(_cell, head))
        writer.writerows(map(_cell, row) for row in rows)


def _cell(x: object) -> object:
    """Texts that have ' in front already get another one, so that a reader can take one away."""
    if not isinstance(x, str) or not x.lstrip("'").startswith(tuple(_OBEYED)) or _number(x):
        return x
    return f"'{x}"


def _number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text


def write_columns(names: Sequence[str], columns: Sequence[Sequence[Any]], path: Path) -> None:
    """Write columns; lists of a column are lists there, and a column without any value is one of numbers.

    Raises:
        InputError: A link or anything else that is no regular file stands there.
        OSError: The file cannot be written.
    """
    import pyarrow as pa
    from pyarrow import parquet

    arrays = [pa.array(column, from_pandas=False) for column in columns]
    arrays = [a.cast(pa.float64()) if pa.types.is_null(a.type) else a for a in arrays]
    with to_write(path) as out:
        parquet.write_table(pa.table(arrays, names=list(names)), out, compression="zstd")
