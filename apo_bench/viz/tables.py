"""Tables on the terminal from JSON objects."""

from collections.abc import Iterable, Mapping
from typing import Any

from rich.table import Table


def form_table(rows: Iterable[Mapping[str, Any]], columns: Mapping[str, str]) -> Table:
    """A table of `rich` with a line for each object and its keys as heads.

    Args:
        columns: Key -> format of its value, or of each value of a list or an object; a missing value is `-`.
    """
    table = Table(box=None, pad_edge=False)
    for key, how in columns.items():
        table.add_column(key.replace("_", " "), justify="right" if how else "left")
    for row in rows:
        table.add_row(*(_format(row.get(key), how) for key, how in columns.items()))
    return table


def _format(value: Any, how: str) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{name} {each:{how}}" for name, each in value.items())
    values = value if isinstance(value, list) else [value]
    return "-" if value is None else (" " if how else ", ").join(format(each, how) for each in values)
