"""A table whose columns give HTML, text, Markdown, CSV and Parquet."""

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
"""Stands for what is not known."""


def _p_value(p: float) -> str:
    return f"{p:.3f}" if p >= 0.001 else "< 0.001"


def endings(failures: Mapping[str, int], most: int | None = 3) -> str:
    """`attach: force_stop 12, judge: gap 3`: how trials failed, the most frequent first."""
    return ", ".join(f"{why} {count}" for why, count in list(failures.items())[:most])


def _hundredths(share: float) -> str:
    return f"{100 * share:.2f}"


_SPELLED: Mapping[str, Callable[[Any], str]] = {
    "percent": format_percent,
    "percent2": partial(format_percent, digits=2),
    "percents": format_percent_interval,
    "hundredths": _hundredths,
    "points": format_points,
    "signed": partial(format_signed, digits=3),
    "p": _p_value,
    "endings": endings,
}
"""How a template may write a number or an interval, besides the formats of Python."""


class _Unknown(Exception):
    """Something that a template names is None."""


class _Template(Formatter):
    """`{interval.low:.3f}` of any object or mapping."""

    def get_field(self, field_name: str, args: Any, kwargs: Any) -> tuple[Any, str]:
        return look_up(args[0], field_name), field_name

    def format_field(self, value: Any, format_spec: str) -> str:
        if value is None:
            raise _Unknown
        return _SPELLED[format_spec](value) if format_spec in _SPELLED else str(format(value, format_spec))


_TEMPLATE = _Template()


def fill(template: str) -> Callable[[Any], str | None]:
    """What a template says of an item; None where anything in it is None."""

    def say(item: Any) -> str | None:
        try:
            return _TEMPLATE.format(template, item)
        except _Unknown:
            return None

    return say


def look_up(item: Any, path: str) -> Any:
    """What an object or mapping has at a path, as `interval.low`; None where something on the way is None."""
    for name in path.split("."):
        if item is not None:
            item = item[name] if isinstance(item, Mapping) else getattr(item, name)
    return item


class TableColumn(NamedTuple):
    """One of a table: with a name it is in files, with a head people read it."""

    name: str = ""
    head: str = ""
    value: str | Callable[[Any], object] = ""
    """Path from what a line is of to what files hold, or a function; usually called like the column."""
    text: str = ""
    """Template of what people read; usually the value. Where anything in it is None it is a dash."""
    words: bool = False
    """Set to the left, and broken into lines; else it is a number."""
    group: bool = False
    """A page says it once above all lines that have the same."""

    def of(self, item: Any) -> Any:
        """What files hold of an item."""
        return look_up(item, self.value or self.name) if isinstance(self.value, str) else self.value(item)

    def said(self, item: Any) -> str:
        """What people read of it."""
        value = fill(self.text)(item) if self.text else self.of(item)
        if value is None:
            return DASH
        return f"{value:g}" if isinstance(value, float) else str(value)


@final
@dataclass(frozen=True)
class Table:
    """Lines and columns."""

    items: Sequence[Any]
    columns: Sequence[TableColumn]
    empty: str = "Nothing to show."
    """Said to people where there is no line."""
    note: str = ""
    """What its numbers are, in sentences; `code` and *emphasis* are marked as in Markdown."""

    @property
    def shown(self) -> list[TableColumn]:
        """The columns that people read."""
        return [column for column in self.columns if column.head]

    @property
    def lines(self) -> list[list[str]]:
        """What people read, line by line."""
        return [[column.said(item) for column in self.shown] for item in self.items]

    @property
    def ungrouped(self) -> list[TableColumn]:
        """The columns of a page: those that people read and no line of which stands above its group."""
        return [column for column in self.shown if not column.group]

    def groups(self) -> list[tuple[str, list[list[str]]]]:
        """What a page says: heading (empty where nothing is grouped), and the lines below it."""
        together = groupby(self.items, lambda item: ", ".join(c.said(item) for c in self.shown if c.group))
        return [(heading, [[c.said(item) for c in self.ungrouped] for item in own]) for heading, own in together]

    def markdown(self) -> list[str]:
        """The table as lines of Markdown, in which no cell has markup, or the sentence where there is none."""
        heads = [column.head for column in self.shown]
        lines = [f"| {' | '.join(map(escape_markdown, cells))} |" for cells in (heads, *self.lines)]
        return [lines[0], "|" + "---|" * len(heads), *lines[1:]] if self.items else [self.empty]

    def write(self, path: Path) -> list[Path]:
        """Write a CSV file, where None is an empty field, and the same as Parquet where pyarrow is installed."""
        columns = {c.name: [c.of(item) for item in self.items] for c in self.columns if c.name}
        return save_columns(columns, path)


def save_columns(columns: Mapping[str, Sequence[Any]], path: Path) -> list[Path]:
    """Write columns as CSV and, where the package pyarrow is installed, as Parquet beside it; which files."""
    write_csv(path, list(columns), zip(*columns.values(), strict=True))
    if not has_parquet():
        return [path]
    beside = path.with_suffix(".parquet")
    write_columns(list(map(_text, columns)), [list(map(_text, column)) for column in columns.values()], beside)
    return [path, beside]


def condition_columns(path: str = "condition", levels: bool = True) -> tuple[TableColumn, ...]:
    """Where something was measured: for people scenario, conditions and method, for files every axis by itself.

    Args:
        path: From an item to its condition.
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
        TableColumn("scenario", "scenario", f"{path}.scenario", words=True, group=True),
        TableColumn("", "conditions", f"{path}.description", words=True, group=True),
        *(
            TableColumn(name, value=f"{path}.{name}")
            for name in ("clearance_mm", "noise", "contact_source", "human_error_scale")
        ),
        *(
            (TableColumn("noise_mm", value=f"{path}.noise_mm"), TableColumn("noise_deg", value=f"{path}.noise_deg"))
            if levels
            else ()
        ),
        TableColumn("method", "method", f"{path}.method", words=True),
        *(TableColumn(name, value=f"{path}.{name}") for name in last),
        *([TableColumn("", "noise level", f"{path}.noise_words")] * levels),
    )


def interval_columns(path: str = "interval", low: str = "low_95", high: str = "high_95") -> tuple[TableColumn, ...]:
    """Both ends of an interval, for files."""
    return TableColumn(low, value=f"{path}.low"), TableColumn(high, value=f"{path}.high")


def _text(x: Any) -> Any:
    """A text without what is no letter in UTF-8 (names of folders may have some); anything else as it is."""
    return x.encode("utf-8", "replace").decode() if isinstance(x, str) else x
