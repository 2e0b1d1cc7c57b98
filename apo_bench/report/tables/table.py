"""One table, said once: the page, the terminal, Markdown, CSV and Parquet are made from its columns; and the columns
that several tables share."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple, final

from apo_bench.io import has_parquet, markdown, write_columns, write_csv
from apo_bench.records import knows_truth
from apo_bench.statistics import Interval, Place, Rate, cell_place, level_label, setting_of


class Column(NamedTuple):
    """One of a table: with a name it is in files, with a head people read it."""

    name: str = ""
    head: str = ""
    value: Callable[[Any], object] | None = None
    """From what a line is of to what files hold; usually what is called like the column."""
    text: Callable[[Any], object] | None = None
    """From the same to what people read; usually the value. None is a dash."""
    words: bool = False
    """Set to the left, and broken into lines; else it is a number."""
    group: bool = False
    """A page says it once above all lines that have the same."""

    def of(self, item: Any) -> object:
        """What files hold of an item."""
        return attrgetter(self.name)(item) if self.value is None else self.value(item)

    def said(self, item: Any) -> str:
        """What people read of it."""
        value = self.of(item) if self.text is None else self.text(item)
        if value is None:
            return "–"
        return f"{value:g}" if isinstance(value, float) else str(value)


@final
@dataclass(frozen=True)
class Table:
    """Lines and columns."""

    items: Sequence[Any]
    columns: Sequence[Column]
    empty: str = "Nothing to show."
    """Said to people where there is no line."""
    note: str = ""
    """What its numbers are, in sentences; `code` and *emphasis* are marked as in Markdown."""

    @property
    def shown(self) -> list[Column]:
        """The columns that people read."""
        return [column for column in self.columns if column.head]

    @property
    def kept(self) -> list[Column]:
        """The columns of files."""
        return [column for column in self.columns if column.name]

    @property
    def lines(self) -> list[list[str]]:
        """What people read, line by line."""
        return [[column.said(item) for column in self.shown] for item in self.items]

    @property
    def beside(self) -> list[Column]:
        """The columns of a page: those that people read and no line of which stands above its group."""
        return [column for column in self.shown if not column.group]

    def groups(self) -> list[tuple[str, list[list[str]]]]:
        """What a page says: heading (empty where nothing is grouped), and the lines below it."""
        together = groupby(self.items, lambda item: ", ".join(c.said(item) for c in self.shown if c.group))
        return [(heading, [[c.said(item) for c in self.beside] for item in own]) for heading, own in together]

    def markdown(self) -> list[str]:
        """The table as lines of Markdown, in which no cell has markup, or the sentence where there is none."""
        heads = [column.head for column in self.shown]
        lines = [f"| {' | '.join(map(markdown, cells))} |" for cells in (heads, *self.lines)]
        return [lines[0], "|" + "---|" * len(heads), *lines[1:]] if self.items else [self.empty]

    def write_all(self, path: Path) -> list[Path]:
        """Write a CSV file and, where Parquet can be written, the same as Parquet."""
        return [self.write(path), *([self.write(path.with_suffix(".parquet"))] if has_parquet() else [])]

    def write(self, path: Path) -> Path:
        """Write a file, by its ending as CSV, where None is an empty field, or as Parquet."""
        names = [column.name for column in self.kept]
        columns = [[column.of(item) for item in self.items] for column in self.kept]
        if path.suffix == ".parquet":
            write_columns(list(map(_text, names)), [list(map(_text, column)) for column in columns], path)
        else:
            write_csv(path, names, zip(*columns, strict=True))
        return path


def millimetres(x: float | None) -> str | None:
    """`0.012`: to a thousandth."""
    return None if x is None else f"{x:.3f}"


def place_columns(of: Callable[[Any], Any] = cell_place, levels: bool = True) -> tuple[Column, ...]:
    """Where something was measured: for people scenario, conditions and method, for files every axis by itself.

    Args:
        of: From an item to its place, or to the setting of its curve, which has no level.
    """
    return (
        axis("scenario", of, head="scenario", words=True, group=True),
        Column("", "conditions", text=lambda x: ", ".join(setting_of(of(x)).conditions()), words=True, group=True),
        *(axis(name, of) for name in ("clearance_mm", "noise", "relations", "careless")),
        *((axis("level", of, name="level_mm"), axis("level_deg", of)) if levels else ()),
        axis("method", of, head="method", words=True),
        *(
            axis(name, of)
            for name in ("grasp", "fidelity", "looks", "robot_error", "wrench", "stated_error", "abstain")
        ),
    )


def axis(field: str, of: Callable[[Any], Any] = cell_place, **more: Any) -> Column:
    """A column of one field of a place or setting, called like it; `more` are other fields of the column."""
    return Column(field, value=lambda x: getattr(of(x), field))._replace(**more)


def level_text(x: Any) -> str:
    """`0.5`, or `0.5 mm, 1 deg`, of anything that has a place; `any` of the oracle, which meets none."""
    place = x if isinstance(x, Place) else cell_place(x)
    return "any" if knows_truth(place.method) else level_label(place.level, place.level_deg, place.noise)


def interval_columns(
    of: Callable[[Any], Interval | None], low: str = "low_95", high: str = "high_95"
) -> tuple[Column, ...]:
    """Both ends of an interval, for files."""
    return (
        Column(low, value=lambda x: (of(x) or (None, None))[0]),
        Column(high, value=lambda x: (of(x) or (None, None))[1]),
    )


def rate_columns(of: Callable[[Any], Rate], names: tuple[str, str, str, str, str]) -> tuple[Column, ...]:
    """Trials, successes, rate and its interval, for files; an empty name is left out."""
    trials, successes, rate, low, high = names
    ends = interval_columns(lambda x: of(x).interval, low, high)
    counts = zip((trials, successes, rate), ("trials", "successes", "rate"), strict=True)
    return (*(axis(field, of, name=name) for name, field in counts if name), *ends)


def _text(x: Any) -> Any:
    """A text without what is no letter in UTF-8 (names of folders may have some); anything else as it is."""
    return x.encode("utf-8", "replace").decode() if isinstance(x, str) else x
