"""Write a table as Parquet with pyarrow."""

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import Any

from apo_bench.errors import missing_package
from apo_bench.io.result_files import replace_file


def has_parquet() -> bool:
    """Whether tables can be written as Parquet: pyarrow is installed."""
    return find_spec("pyarrow") is not None


def write_columns(
    names: Sequence[str], columns: Sequence[Sequence[Any]], path: Path, kinds: Mapping[str, str] = MappingProxyType({})
) -> None:
    """Write columns as Parquet; lists of a column are lists there, and a column without any value is one of numbers.

    Args:
        kinds: What columns are that may have no value: text, whole, numbers or wholes, the last two of lists.

    Raises:
        InputError: The package pyarrow is not installed, or as `replace_file`.
    """
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ImportError as error:
        raise missing_package("a Parquet table", "pyarrow") from error

    of_kind = {
        "text": pa.string(),
        "whole": pa.int64(),
        "numbers": pa.list_(pa.float64()),
        "wholes": pa.list_(pa.int64()),
    }
    types = [of_kind[kinds[name]] if name in kinds else None for name in names]
    arrays = [pa.array(column, kind, from_pandas=False) for column, kind in zip(columns, types, strict=True)]
    arrays = [a.cast(pa.float64()) if pa.types.is_null(a.type) else a for a in arrays]
    with replace_file(path) as out:
        parquet.write_table(pa.table(arrays, names=list(names)), out, compression="zstd")
