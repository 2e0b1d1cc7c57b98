"""Format JSON objects as text: lines of name and value, and tables on the terminal."""

from collections.abc import Iterable, Mapping
from typing import Any

from rich.table import Table


def list_facts(form: Mapping[str, Any], without: Iterable[str] = ()) -> list[tuple[str, str]]:
    """Return name and text of every value that is neither null nor an empty list, except the keys `without`."""
    known = {key: value for key, value in form.items() if key not in without and value is not None and value != []}
    return [(key.replace("_", " "), format_value(value)) for key, value in known.items()]


def format_value(value: Any) -> str:
    """Format a value: floats with four significant digits, lists with commas, objects with their keys."""
    if isinstance(value, Mapping):
        return ", ".join(map(" ".join, list_facts(value)))
    if isinstance(value, list | tuple):
        return ("; " if value and isinstance(value[0], Mapping) else ", ").join(map(format_value, value)) or "none"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def make_table(rows: Iterable[Mapping[str, Any]], columns: Mapping[str, str]) -> Table:
    """Return a `rich` table with one line per object; the columns are titled by keys.

    Args:
        columns: Key -> format specification of its value, or of each item of a list or object; a missing value is `-`.
    """
    table = Table(box=None, pad_edge=False)  # columns with a format hold numbers and are aligned right
    for key, how in columns.items():
        table.add_column(key.replace("_", " "), justify="right" if how else "left")
    for row in rows:
        table.add_row(*(_format_cell(row.get(key), how) for key, how in columns.items()))
    return table


def _format_cell(value: Any, how: str) -> str:
    """Format a value, every item of a list, or every item of an object with its key."""
    if isinstance(value, dict):
        return ", ".join(f"{name} {each:{how}}" for name, each in value.items())
    values = value if isinstance(value, list) else [value]
    return "-" if value is None else (" " if how else ", ").join(format(each, how) for each in values)
