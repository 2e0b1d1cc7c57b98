"""HTML out of plain text: whatever comes from outside is escaped here, once."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from html import escape
from typing import NamedTuple

LONG = 24
"""Columns of words with more letters than this break into lines."""


class Html(str):
    """Text that is markup already."""

    __slots__ = ()


def html(x: object) -> Html:
    """Markup as it is, anything else escaped; None is a dash."""
    if isinstance(x, Html):
        return x
    return Html("–" if x is None else escape(str(x)))


def tag(name: str, *inside: object, **attributes: object) -> Html:
    """`<name key="value">inside</name>`; of attributes `class_` is class, `data_x` is data-x, None is left out."""
    given = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{escape(str(value))}"'
        for key, value in attributes.items()
        if value is not None
    )
    end = "" if name in ("img", "meta") else f"</{name}>"
    return Html(f"<{name}{given}>{''.join(map(html, inside))}{end}")


def joined(pieces: Iterable[object], between: str = "") -> Html:
    """Pieces in a row."""
    return Html(between.join(map(html, pieces)))


def prose(text: str, kind: str | None = None) -> Html:
    """Sentences in which `code` and *emphasis* are marked as in Markdown."""
    said = re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(text, quote=False))
    return tag("p", Html(re.sub(r"\*([^*]+)\*", r"<em>\1</em>", said)), class_=kind)


class Table(NamedTuple):
    """A table for people: words in cells, numbers already as they are to be read."""

    head: tuple[str, ...]
    rows: list[tuple[object, ...]]
    words: int = 1
    """So many columns are words, set to the left; the others are numbers."""

    def html(self, empty: str = "Nothing to show.") -> Html:
        """In a box that scrolls by itself; a sentence where there is no row."""
        if not self.rows:
            return tag("p", empty, class_="none")
        long = {i for row in self.rows for i, x in enumerate(row[: self.words]) if len(_plain(x)) > LONG}
        head = joined(_cell("th", x, i < self.words, scope="col") for i, x in enumerate(self.head))
        body = joined(
            tag("tr", joined(_cell("td", x, i < self.words, i in long) for i, x in enumerate(row))) for row in self.rows
        )
        made = tag("table", tag("thead", tag("tr", head)), tag("tbody", body))
        tall = " tall" * (len(self.rows) > 30)
        return tag("div", made, class_=f"scroll{tall}", tabindex=0, role="region", aria_label=f"table: {self.head[0]}")

    def markdown(self, empty: str = "Nothing to show.") -> list[str]:
        """The same as lines of Markdown."""
        if not self.rows:
            return [empty]
        return [_line(self.head), "|" + "---|" * len(self.head), *map(_line, self.rows)]


def _cell(name: str, x: object, word: bool, long: bool = False, **more: object) -> Html:
    return tag(name, x, class_="long" if long else None if word else "number", **more)


def _plain(x: object) -> str:
    """Text that may break into lines; markup looks after itself."""
    return "" if x is None or isinstance(x, Html) else str(x)


def _line(cells: Sequence[object]) -> str:
    return f"| {' | '.join('–' if x is None else str(x) for x in cells)} |"
