"""Read and write tables of comma-separated values."""

import csv
import io
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, final

from apo_bench.errors import InputError, require, require_known
from apo_bench.io.result_files import write_file
from apo_bench.io.safe_io import read_text

Columns = Mapping[str, tuple[str, float]]
"""Name of a column -> its meaning, and the factor that converts its unit."""
_SEPARATORS = {";": "';'", "\t": "tabs", "|": "'|'"}
"""Separators that spreadsheets of some countries write instead of commas -> their name in messages."""


class CsvCell(NamedTuple):
    """A cell of a table, with its column and the unit of the column."""

    column: str
    text: str
    unit: float


@final
@dataclass(frozen=True)
class CsvRow:
    """A row of a table: meaning of a column -> cell."""

    file: str
    line: int
    cells: Mapping[str, CsvCell]

    def require(self, holds: object, meaning: str, wanted: str) -> None:
        """Raise an `InputError` that states what a cell needs and what it has, unless a condition holds."""
        if not holds:
            cell = self.cells[meaning]
            given = f"'{cell.text[:40]}' was given" if cell.text else "nothing was given"
            raise InputError(f"{self.file}, line {self.line}, column {cell.column}: {wanted}, {given}.")

    def text(self, meaning: str) -> str:
        """Return the text of a cell; empty where the column is missing."""
        return self.cells[meaning].text if meaning in self.cells else ""

    def number(self, meaning: str, largest: float) -> float:
        """Return a finite number of at most this size, converted by the unit of its column."""
        _, text, unit = self.cells[meaning]
        try:
            x = float(text) * unit
        except ValueError:
            x = math.nan
        limit = f" of at most {largest / unit:g}" if math.isfinite(largest) else ""
        self.require(abs(x) <= largest, meaning, f"a number{limit} is needed")
        return x


def read_csv(path: str | Path, columns: Columns, required: Sequence[str]) -> Iterator[CsvRow]:
    """Yield every row that is not empty; the first one names the columns.

    Args:
        columns: All allowed columns.
        required: Meanings that some column must have.

    Raises:
        InputError: There is no such file, it is too large, not UTF-8 or not CSV, columns are unknown, repeated or
        missing,
            or a row has another number of cells.
    """
    reader = csv.reader(io.StringIO(read_text(path, "CSV file"), newline=""), strict=True, skipinitialspace=True)
    try:
        stripped = [(reader.line_num, [cell.strip() for cell in cells]) for cells in reader]
    except csv.Error as error:
        raise InputError(f"{path}, line {reader.line_num}: this is not a CSV file ({error}).") from error
    rows = [(line, texts) for line, texts in stripped if any(texts)]
    require(rows, f"{path}: the file is empty; its first line names the columns: {', '.join(columns)}.")
    line, head = rows[0]
    names = [name.lower() for name in head]
    _check_header(f"{path}, line {line}", names, columns, required)
    for line, texts in rows[1:]:
        count = len(texts)
        require(count == len(names), f"{path}, line {line}: {len(names)} cells are needed, {count} were given.")
        cells = [CsvCell(name, text, columns[name][1]) for name, text in zip(names, texts, strict=True)]
        yield CsvRow(str(path), line, {columns[cell.column][0]: cell for cell in cells})


def _check_header(place: str, names: Sequence[str], columns: Columns, required: Sequence[str]) -> None:
    """Check that every column is known, that no two have the same meaning, and that none is missing."""
    check_separator(place, names)
    for name in names:
        require_known("column", name, columns, place=place)
    meanings = [columns[name][0] for name in names]
    for name, meaning in zip(names, meanings, strict=True):
        require(meanings.count(meaning) == 1, f"{place}: another column says the same as '{name}'; keep one.")
    for wanted, (meaning, _) in columns.items():
        present = meaning in meanings or meaning not in required
        require(present, f"{place}: the column '{wanted}' is missing.")


def check_separator(place: str, names: Sequence[str]) -> None:
    """Raise an `InputError` if the columns of a header are not separated by commas."""
    for separator, called in _SEPARATORS.items():
        require(
            len(names) != 1 or separator not in names[0],
            f"{place}: columns are separated by commas; this file uses {called}, so save it with commas.",
        )


def write_csv(path: Path, head: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write a table; None becomes an empty field.

    Raises:
        InputError: As `replace_file`.
    """
    table = io.StringIO(newline="")
    writer = csv.writer(table)
    writer.writerow(head)
    writer.writerows(rows)
    write_file(path, table.getvalue())
