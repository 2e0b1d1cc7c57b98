"""Tables as Parquet."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from apo_bench.io.writing import to_write


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
