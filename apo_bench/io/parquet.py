"""Tables as Parquet: of a CSV file, and of the rows of a sweep."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from apo_bench.io.csv_file import OBEYED
from apo_bench.io.writing import to_write

_WORDS = (
    *("scenario", "noise", "relations", "method", "reference", "grasp", "fidelity", "eye", "arm", "failures"),
    *("host", "worker", "command"),
)
"""Columns of words, also where they look like numbers."""
_GUARDED = f"^'('*[{re.escape(OBEYED)}])"
# Files are opened here: names that are no UTF-8 are refused by the library.


def parquet_beside(table: Path) -> Path:
    """Write the columns of a CSV file as `.parquet` beside it; an empty field is null, and no text has a ' in front."""
    import pyarrow as pa
    from pyarrow import compute, csv, parquet

    how = csv.ConvertOptions(column_types=dict.fromkeys(_WORDS, pa.string()))
    with table.open("rb") as file:
        made = csv.read_csv(file, convert_options=how, parse_options=csv.ParseOptions(newlines_in_values=True))
    for i, field in enumerate(made.schema):
        if pa.types.is_string(field.type):
            text = compute.replace_substring_regex(made.column(i), pattern=_GUARDED, replacement=r"\1")
            made = made.set_column(i, field.name, text)
        if pa.types.is_null(field.type):
            made = made.set_column(i, field.name, made.column(i).cast(pa.float64()))
    with to_write(table.with_suffix(".parquet")) as out:
        parquet.write_table(made, out)
    return table.with_suffix(".parquet")


def write_columns(names: Sequence[str], columns: Sequence[Sequence[Any]], path: Path) -> None:
    """Write columns as Parquet; lists of a column are lists there."""
    import pyarrow as pa
    from pyarrow import parquet

    arrays = [pa.array(column, from_pandas=False) for column in columns]
    arrays = [a.cast(pa.float64()) if pa.types.is_null(a.type) else a for a in arrays]
    with to_write(path) as out:
        parquet.write_table(pa.table(arrays, names=list(names)), out, compression="zstd")
