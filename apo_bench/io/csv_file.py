"""Tables as CSV that a spreadsheet shows and does not obey: a text that it would take for a formula has ' in front."""

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path

from apo_bench.io.writing import to_write

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
