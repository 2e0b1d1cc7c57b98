"""Reading the pages that are written for browsers."""

from __future__ import annotations

import base64
import gzip
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any


class Reader(HTMLParser):
    """Every line of every table as its cells, and all the text outside of scripts and styles."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[list[str]] = []
        self.text: list[str] = []
        self._inside: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in ("img", "meta", "rect", "path", "use"):
            self._inside.append(tag)
        if tag == "tr":
            self.lines.append([])
        elif tag in ("td", "th"):
            self.lines[-1].append("")

    def handle_endtag(self, tag: str) -> None:
        if tag in self._inside:
            while self._inside.pop() != tag:
                pass

    def handle_data(self, data: str) -> None:
        if {"script", "style"} & set(self._inside):
            return
        self.text.append(data)
        if {"td", "th"} & set(self._inside):
            self.lines[-1][-1] += f" {data}" if self.lines[-1][-1] else data


def read(page: Path) -> Reader:
    """A page that was written."""
    reader = Reader()
    reader.feed(page.read_text(encoding="utf-8"))
    return reader


def lines(page: Path) -> str:
    """The tables of a page as lines, cells with bars between them."""
    made = ([" ".join(cell.split()) for cell in line] for line in read(page).lines)
    return "\n".join(f"| {' | '.join(line)} |" for line in made)


def words(page: Path) -> str:
    """All that a person reads."""
    return " ".join("".join(read(page).text).split())


def trials(page: Path) -> dict[str, Any]:
    """The trials of every cell, as they are packed for the script."""
    found = re.search(
        r'<script type="text/plain" id="trials">([A-Za-z0-9+/=]+)</script>', page.read_text(encoding="utf-8")
    )
    assert found is not None
    return dict(json.loads(gzip.decompress(base64.b64decode(found[1]))))
