"""Write a table as comma-separated values."""

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path

from apo_bench.io.result_files import write_file


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
