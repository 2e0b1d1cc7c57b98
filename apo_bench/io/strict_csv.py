"""Comma-separated values read strictly: every complaint is one sentence that names the line and the column.

Tables as CSV and, where the package pyarrow is installed, as Parquet.
"""

import csv
import io
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import Any, NoReturn, final

from apo_bench.errors import InputError, missing_package, require
from apo_bench.io.ordinary_files import read_text
from apo_bench.io.result_files import replace_file, write_file

Columns = Mapping[str, tuple[str, float]]
"""What a column stands for, and the size of its unit."""


@final
@dataclass(frozen=True)
class CsvRow:
    """One row, its cells by what they stand for."""

    file: str
    line: int
    cells: Mapping[str, tuple[str, str, float]]
    """Meaning -> its column, its text, and its unit."""

    def fail(self, meaning: str, wanted: str) -> NoReturn:
        column, text, _ = self.cells[meaning]
        stands = f"'{text[:40]}' was given" if text else "nothing was given"
        raise InputError(f"{self.file}, line {self.line}, column {column}: {wanted}, {stands}.")

    def require(self, holds: object, meaning: str, wanted: str) -> None:
        if not holds:
            self.fail(meaning, wanted)

    def text(self, meaning: str) -> str:
        return self.cells[meaning][1] if meaning in self.cells else ""

    def number(self, meaning: str, largest: float) -> float:
        """Finite, in the unit that the size of the column's own unit is counted in."""
        _, text, unit = self.cells[meaning]
        try:
            x = float(text) * unit if text.isascii() and "_" not in text else math.nan
        except ValueError:
            x = math.nan
        if not abs(x) <= largest:
            limit = f" of at most {largest / unit:g}" if math.isfinite(largest) else ""
            self.fail(meaning, f"a number{limit} is needed")
        return x


def read_csv(path: str | Path, columns: Columns, required: Sequence[str]) -> Iterator[CsvRow]:
    """Every row that is not empty, behind the first, which names the columns.

    Args:
        columns: All that are allowed.
        required: What some column has to stand for.

    Raises:
        InputError: No such file, too large, not UTF-8, not CSV, unknown, repeated or missing columns, ragged rows.
    """
    reader = csv.reader(io.StringIO(read_text(path, "CSV file"), newline=""), strict=True, skipinitialspace=True)
    names: list[str] = []
    try:
        for cells in reader:
            texts = [cell.strip() for cell in cells]
            if not any(texts):
                continue
            if not names:
                names = _header(f"{path}, line {reader.line_num}", texts, columns, required)
                continue
            require(
                len(texts) == len(names),
                f"{path}, line {reader.line_num}: {len(names)} cells are needed, one for each column, "
                f"{len(texts)} were given.",
            )
            cells_of = {columns[c][0]: (c, text, columns[c][1]) for c, text in zip(names, texts, strict=True)}
            yield CsvRow(str(path), reader.line_num, cells_of)
    except csv.Error as error:
        raise InputError(f"{path}, line {reader.line_num}: this is not a CSV file ({error}).") from error
    require(names, f"{path}: the file is empty; its first line names the columns: {_shown(columns)}.")


def _header(place: str, names: Sequence[str], columns: Columns, required: Sequence[str]) -> list[str]:
    """The columns, each known, none twice and none missing."""
    lowered = [name.lower() for name in names]
    taken = dict[str, str]()
    for column in lowered:
        if column not in columns:
            check_separator(place, names)
            longer = [name for name in columns if column and name.startswith(f"{column}_")]
            near = longer or get_close_matches(column, columns, n=1, cutoff=0.3)
            hint = f"did you mean '{near[0]}'? Allowed are" if near else "allowed are"
            raise InputError(f"{place}: unknown column '{column[:40]}'; {hint} {_shown(columns)}.")
        meaning = columns[column][0]
        if meaning in taken:
            raise InputError(f"{place}: the columns '{taken[meaning]}' and '{column}' say the same; keep one.")
        taken[meaning] = column
    for meaning in required:
        if meaning not in taken:
            column = next(name for name, (m, _) in columns.items() if m == meaning)
            raise InputError(f"{place}: the column '{column}' is missing; needed are {_shown(columns, required)}.")
    return lowered


def check_separator(place: str, names: Sequence[str]) -> None:
    """Refuse what spreadsheets of some countries put in place of commas."""
    for separator, called in ((";", "';'"), ("\t", "tabs"), ("|", "'|'")):
        require(
            len(names) != 1 or separator not in names[0],
            f"{place}: columns are separated by commas; this file uses {called}, so save it with commas.",
        )


def _shown(columns: Columns, meanings: Sequence[str] = ()) -> str:
    """The columns, those in m and rad left out."""
    return ", ".join(
        name
        for name, (m, _) in columns.items()
        if not name.endswith(("_m", "_rad")) and (not meanings or m in meanings)
    )


def write_csv(path: Path, head: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write a table; None is an empty field, and numbers stay numbers.

    Raises:
        InputError: As `replace_file`.
    """
    table = io.StringIO(newline="")
    writer = csv.writer(table)
    writer.writerow(head)
    writer.writerows(rows)
    write_file(path, table.getvalue())


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
