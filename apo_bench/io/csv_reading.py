"""Tables of comma-separated values, whose columns are known by their names and carry their unit in it."""

import csv
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, NoReturn, final

from apo_bench.errors import InputError, require, require_known
from apo_bench.io.safe_io import read_text

Columns = Mapping[str, tuple[str, float]]
"""Name of a column -> what it stands for, and the size of its unit."""


class CsvCell(NamedTuple):
    """One cell."""

    column: str
    text: str
    unit: float


@final
@dataclass(frozen=True)
class CsvRow:
    """One row, its cells by what they stand for."""

    file: str
    line: int
    cells: Mapping[str, CsvCell]

    def fail(self, meaning: str, wanted: str) -> NoReturn:
        """Raise the `InputError` that says what is needed in a cell, and what was given."""
        cell = self.cells[meaning]
        stands = f"'{cell.text[:40]}' was given" if cell.text else "nothing was given"
        raise InputError(f"{self.file}, line {self.line}, column {cell.column}: {wanted}, {stands}.")

    def require(self, holds: object, meaning: str, wanted: str) -> None:
        """Raise that error unless something holds."""
        if not holds:
            self.fail(meaning, wanted)

    def text(self, meaning: str) -> str:
        """The text of a cell; empty where the column is missing."""
        return self.cells[meaning].text if meaning in self.cells else ""

    def number(self, meaning: str, largest: float) -> float:
        """A finite number, in the unit that the size of the column's own unit is counted in."""
        _, text, unit = self.cells[meaning]
        try:
            x = float(text) * unit
        except ValueError:
            x = math.nan
        limit = f" of at most {largest / unit:g}" if math.isfinite(largest) else ""
        self.require(abs(x) <= largest, meaning, f"a number{limit} is needed")
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
        require(
            len(texts) == len(names), f"{path}, line {line}: {len(names)} cells are needed, {len(texts)} were given."
        )
        cells = {
            columns[name][0]: CsvCell(name, text, columns[name][1]) for name, text in zip(names, texts, strict=True)
        }
        yield CsvRow(str(path), line, cells)


def _check_header(place: str, names: Sequence[str], columns: Columns, required: Sequence[str]) -> None:
    """Every column is known, none stands for the same as another one, and none is missing."""
    check_separator(place, names)
    for name in names:
        require_known("column", name, columns, place=place)
    meanings = [columns[name][0] for name in names]
    for name, meaning in zip(names, meanings, strict=True):
        require(meanings.count(meaning) == 1, f"{place}: another column says the same as '{name}'; keep one.")
    for meaning in required:
        wanted = next(name for name in columns if columns[name][0] == meaning)
        require(meaning in meanings, f"{place}: the column '{wanted}' is missing.")


def check_separator(place: str, names: Sequence[str]) -> None:
    """Refuse what spreadsheets of some countries put in place of commas."""
    for separator, called in ((";", "';'"), ("\t", "tabs"), ("|", "'|'")):
        require(
            len(names) != 1 or separator not in names[0],
            f"{place}: columns are separated by commas; this file uses {called}, so save it with commas.",
        )
