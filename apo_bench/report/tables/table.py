"""One table, said once: the page, the terminal, Markdown, CSV and Parquet are made from its columns."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple, final

from apo_bench.io.tables import write_columns, write_csv


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
        said = self.of(item) if self.text is None else self.text(item)
        if said is None:
            return "–"
        return f"{said:g}" if isinstance(said, float) else str(said)


@final
@dataclass(frozen=True)
class Table:
    """Lines and columns."""

    items: Sequence[Any]
    columns: Sequence[Column]
    empty: str = "Nothing to show."
    """Said to people where there is no line."""

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
        made: list[tuple[str, list[list[str]]]] = []
        for item in self.items:
            heading = ", ".join(column.said(item) for column in self.shown if column.group)
            if not made or made[-1][0] != heading:
                made.append((heading, []))
            made[-1][1].append([column.said(item) for column in self.beside])
        return made

    def markdown(self) -> list[str]:
        """The table as lines of Markdown, or the sentence where there is none."""
        if not self.items:
            return [self.empty]
        heads = [column.head for column in self.shown]
        return [_line(heads), "|" + "---|" * len(heads), *map(_line, self.lines)]

    def write(self, path: Path) -> Path:
        """Write a file, by its ending as CSV, where None is an empty field, or as Parquet."""
        columns = [[column.of(item) for item in self.items] for column in self.kept]
        names = [column.name for column in self.kept]
        if path.suffix == ".parquet":
            write_columns(list(map(_text, names)), [list(map(_text, column)) for column in columns], path)
        else:
            write_csv(path, names, zip(*columns, strict=True))
        return path


def _text(x: Any) -> Any:
    """A text without what is no letter in UTF-8 (names of folders may have some); anything else as it is."""
    return x.encode("utf-8", "replace").decode() if isinstance(x, str) else x


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"
