"""A table, described once by columns, as HTML, text, Markdown, CSV and Parquet."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from pathlib import Path
from string import Formatter
from typing import Any, NamedTuple, final

from apo_bench.benchmark.analysis import format_percent, format_percent_interval, format_points, format_signed
from apo_bench.io import escape_markdown, has_parquet, write_columns, write_csv

DASH = "–"
"""Text in place of an unknown value."""


def _format_p_value(p: float) -> str:
    return f"{p:.3f}" if p >= 0.001 else "< 0.001"


def format_endings(failures: Mapping[str, int], most: int | None = 3) -> str:
    """Format failures: `attach: force_stop 12, judge: gap 3`, at most `most` of them, the most frequent first."""
    return ", ".join(f"{why} {count}" for why, count in list(failures.items())[:most])


def _format_percent_number(share: float) -> str:
    return f"{100 * share:.2f}"


_SPELLED: Mapping[str, Callable[[Any], str]] = {
    "percent": format_percent,
    "percent2": partial(format_percent, digits=2),
    "percents": format_percent_interval,
    "hundredths": _format_percent_number,
    "points": format_points,
    "signed": partial(format_signed, digits=3),
    "p": _format_p_value,
    "endings": format_endings,
}
"""Format specification of a template -> function, in addition to the formats of Python."""


class _Unknown(Exception):
    """Raised by a template if a value is None."""


class _Template(Formatter):
    """Formats a template such as `{interval.low:.3f}` with the attributes or keys of one object."""

    def get_field(self, field_name: str, args: Any, kwargs: Any) -> tuple[Any, str]:
        return look_up(args[0], field_name), field_name

    def format_field(self, value: Any, format_spec: str) -> str:
        if value is None:
            raise _Unknown
        return _SPELLED[format_spec](value) if format_spec in _SPELLED else str(format(value, format_spec))


_TEMPLATE = _Template()


def make_template(template: str) -> Callable[[Any], str | None]:
    """Return a function that fills a template from an item, or returns None if any value in it is None."""

    def say(item: Any) -> str | None:
        try:
            return _TEMPLATE.format(template, item)
        except _Unknown:
            return None

    return say


def look_up(item: Any, path: str) -> Any:
    """Return the value at a path of attributes or keys, such as `interval.low`; None if any step is None."""
    for name in path.split("."):
        if item is not None:
            item = item[name] if isinstance(item, Mapping) else getattr(item, name)
    return item


class TableColumn(NamedTuple):
    """A column of a table: with a name it is in files, with a head people see it."""

    name: str = ""
    head: str = ""
    value: str | Callable[[Any], object] = ""
    """Path from an item to the value in files, or a function of the item; default: the name of the column."""
    text: str = ""
    """Template of the text that people see; default: the value. If a value in it is None, the text is a dash."""
    words: bool = False
    """Whether the column is text, aligned left and wrapped; else it is numbers, aligned right."""
    group: bool = False
    """Whether a page states the value once as a heading above all lines that share it."""

    def of(self, item: Any) -> Any:
        """Return the value of an item for files."""
        return look_up(item, self.value or self.name) if isinstance(self.value, str) else self.value(item)

    def said(self, item: Any) -> str:
        """Return the text of an item for people."""
        value = make_template(self.text)(item) if self.text else self.of(item)
        if value is None:
            return DASH
        return f"{value:g}" if isinstance(value, float) else str(value)


@final
@dataclass(frozen=True)
class Table:
    """Items, one per line, and the columns that describe them."""

    items: Sequence[Any]
    columns: Sequence[TableColumn]
    empty: str = "Nothing to show."
    """Sentence that replaces a table without lines."""
    note: str = ""
    """Explanation of the numbers, with `code` and *emphasis* marked as in Markdown."""

    @property
    def shown(self) -> list[TableColumn]:
        """The columns that people see."""
        return [column for column in self.columns if column.head]

    @property
    def lines(self) -> list[list[str]]:
        """The texts that people see, line by line."""
        return [[column.said(item) for column in self.shown] for item in self.items]

    @property
    def ungrouped(self) -> list[TableColumn]:
        """The columns that people see, without those that a page states as headings."""
        return [column for column in self.shown if not column.group]

    def groups(self) -> list[tuple[str, list[list[str]]]]:
        """Return heading and lines of each group on a page; the heading is empty if no column is grouped."""
        together = groupby(self.items, lambda item: ", ".join(c.said(item) for c in self.shown if c.group))
        return [(heading, [[c.said(item) for c in self.ungrouped] for item in own]) for heading, own in together]

    def markdown(self) -> list[str]:
        """Return the table as lines of Markdown, with cells escaped; an empty table is its sentence."""
        heads = [column.head for column in self.shown]
        lines = [f"| {' | '.join(map(escape_markdown, cells))} |" for cells in (heads, *self.lines)]
        return [lines[0], "|" + "---|" * len(heads), *lines[1:]] if self.items else [self.empty]

    def write(self, path: Path) -> list[Path]:
        """Write the table as CSV, with empty fields for None, and also as Parquet if pyarrow is installed.

        Returns:
            The paths of the files.
        """
        columns = {c.name: [c.of(item) for item in self.items] for c in self.columns if c.name}
        return save_columns(columns, path)


def save_columns(columns: Mapping[str, Sequence[Any]], path: Path) -> list[Path]:
    """Write columns as CSV, and as Parquet next to it if the package pyarrow is installed; return the paths."""
    write_csv(path, list(columns), zip(*columns.values(), strict=True))
    if not has_parquet():
        return [path]
    beside = path.with_suffix(".parquet")
    write_columns(
        list(map(_format_cell, columns)), [list(map(_format_cell, column)) for column in columns.values()], beside
    )
    return [path, beside]


def list_condition_columns(levels: bool = True) -> tuple[TableColumn, ...]:
    """Return the columns that identify a condition: few for people, one per setting for files.

    Args:
        levels: Whether the noise level is part of the condition.
    """
    last = (
        "grasp",
        "fidelity",
        "max_reobservations",
        "robot_error",
        "ft_sensor",
        "assumed_robot_error",
        "min_predicted_success",
    )
    return (
        TableColumn("scenario", "scenario", "condition.scenario", words=True, group=True),
        TableColumn("", "conditions", "condition.description", words=True, group=True),
        *(
            TableColumn(name, value=f"condition.{name}")
            for name in ("clearance_mm", "noise", "contact_source", "human_error_scale")
        ),
        *(
            (TableColumn("noise_mm", value="condition.noise_mm"), TableColumn("noise_deg", value="condition.noise_deg"))
            if levels
            else ()
        ),
        TableColumn("method", "method", "condition.method", words=True),
        *(TableColumn(name, value=f"condition.{name}") for name in last),
        *([TableColumn("", "noise level", "condition.noise_words")] * levels),
    )


def list_interval_columns(
    path: str = "interval", low: str = "low_95", high: str = "high_95"
) -> tuple[TableColumn, ...]:
    """Return the columns of both ends of an interval, for files."""
    return TableColumn(low, value=f"{path}.low"), TableColumn(high, value=f"{path}.high")


def _format_cell(x: Any) -> Any:
    """Replace half letters, as names of folders may have, since UTF-8 has none; other values stay."""
    return x.encode("utf-8", "replace").decode() if isinstance(x, str) else x
