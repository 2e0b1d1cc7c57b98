"""A table of `rich` out of a list of JSON objects."""

from collections.abc import Iterable, Mapping
from typing import Any

from rich.table import Table


def form_table(rows: Iterable[Mapping[str, Any]], columns: Mapping[str, str]) -> Table:
    """One line for each object, with the keys as heads.

    Args:
        columns: Key -> how its value is formatted, or each of a list or an object. What is not there is `-`.
    """
    table = Table(box=None, pad_edge=False)
    for key, how in columns.items():
        table.add_column(key.replace("_", " "), justify="right" if how else "left")
    for row in rows:
        table.add_row(*(_cell(row.get(key), how) for key, how in columns.items()))
    return table


def _cell(value: Any, how: str) -> str:
    if value is None:
        return "-"
    if isinstance(value, dict):
        return ", ".join(f"{name} {each:{how}}" for name, each in value.items())
    values = value if isinstance(value, list) else [value]
    return (" " if how else ", ").join(format(each, how) for each in values)
