"""Panels as a file of its own: one SVG that any viewer opens, on white."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path

from apo_bench.io.writing import to_write
from apo_bench.report.figures.chart import WIDTH, Entry, Panel
from apo_bench.report.figures.paint import palette
from apo_bench.report.page.files import page_file
from apo_bench.report.page.markup import Html, joined, tag

ACROSS = 3
LETTERS = 62
"""Of a line of a title."""
HEAD, LINE, GAP, TITLE = 40, 20, 18, 32
"""Heights of the title, of a line of the legend, of the space between panels and for their titles, px."""


def write_sheet(title: str, panels: Sequence[Panel], methods: Sequence[str], key: Sequence[Entry], path: Path) -> None:
    """Write panels side by side.

    Args:
        key: The legend.
    """
    across = min(ACROSS, len(panels))
    width = across * (WIDTH + GAP) + GAP
    entries, lines = _key(key, width)
    y, body = HEAD + LINE * lines, [tag("text", title, x=GAP, y=26, class_="title"), entries]
    for i in range(0, len(panels), across):
        line = panels[i : i + across]
        for j, one in enumerate(line):
            x = GAP + j * (WIDTH + GAP)
            for k, words in enumerate(textwrap.wrap(one.title, LETTERS)[:2]):
                body.append(tag("text", words, x=x, y=y + 12 + 14 * k))
            size = {"x": x, "y": y + TITLE, "width": WIDTH, "height": one.height}
            body.append(tag("svg", one.drawing, viewBox=f"0 0 {WIDTH} {one.height}", **size))
        y += max(one.height for one in line) + GAP + TITLE
    style = f":root{{{palette(methods)[0]}}}{page_file('chart.css')}"
    ground = tag("rect", width=width, height=y, fill="#ffffff")
    inside = (tag("style", Html(style)), ground, *body)
    made = tag("svg", *inside, xmlns="http://www.w3.org/2000/svg", viewBox=f"0 0 {width} {y}", width=width, height=y)
    with to_write(path, "w") as file:
        file.write(made + "\n")


def _key(key: Sequence[Entry], width: int) -> tuple[Html, int]:
    """Its entries set in lines, and how many lines there are."""
    x, line, made = GAP, 0, []
    for entry in key:
        need = 42 + 7 * len(entry.name)
        if x + need > width and x > GAP:
            x, line = GAP, line + 1
        y = HEAD + LINE * line - 4
        made.append(tag("svg", entry.drawing, x=x, y=y, width=26, height=14, viewBox="0 0 26 14"))
        made.append(tag("text", entry.name, x=x + 31, y=y + 11))
        x += need
    return joined(made), line + bool(made)
