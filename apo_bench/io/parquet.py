"""Write tables as Parquet files with pyarrow."""

from collections.abc import Iterable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import Any

from apo_bench.errors import missing_package
from apo_bench.io.result_files import replace_file


def has_parquet() -> bool:
    """Return whether pyarrow is installed, so that tables can be written as Parquet."""
    return find_spec("pyarrow") is not None


def write_columns(
    names: Sequence[str], columns: Sequence[Sequence[Any]], path: Path, kinds: Mapping[str, str] = MappingProxyType({})
) -> None:
    """Write columns as Parquet; a column without any value becomes a column of numbers.

    Args:
        kinds: Column that may have no value -> its type: `text`, `whole`, or lists, `numbers` or `wholes`.

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
    arrays = [a.cast(pa.float64()) if pa.types.is_null(a.type) else a for a in arrays]  # without any value
    with replace_file(path) as out:
        parquet.write_table(pa.table(arrays, names=list(names)), out, compression="zstd")


def write_parts(
    kinds: Mapping[str, type | None],
    distinct: Mapping[str, Sequence[Any]],
    parts: Iterable[Mapping[str, Any]],
    path: Path,
) -> None:
    """Write a table as Parquet part by part, so that a large one need not be in memory.

    Args:
        kinds: Column -> type of its numbers; None for other values.
        distinct: Column of other values -> its distinct values, or None.
        parts: Column -> its numbers in a part, a masked array, or the indices of its other values in `distinct`.
    """
    import pyarrow as pa
    from pyarrow import parquet

    of_kind = {float: pa.float64(), int: pa.int64(), bool: pa.bool_()}
    values = {name: pa.array(each) for name, each in distinct.items()}
    # without any value
    values = {name: each.cast(pa.float64()) if pa.types.is_null(each.type) else each for name, each in values.items()}
    schema = pa.schema([(name, values[name].type if kind is None else of_kind[kind]) for name, kind in kinds.items()])
    with replace_file(path) as out, parquet.ParquetWriter(out, schema, compression="zstd") as file:
        for part in parts:
            arrays = [
                values[field.name].take(pa.array(part[field.name]))
                if field.name in values
                else pa.array(part[field.name], field.type)
                for field in schema
            ]
            file.write_table(pa.table(arrays, schema=schema))
