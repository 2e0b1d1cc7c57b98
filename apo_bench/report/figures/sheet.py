"""A figure: panels with a legend, drawn once by matplotlib, for files as one sheet and for a page in pieces.

One unit of a sheet is one px; a panel is 360 of them wide. In a page every panel is a picture of its own, so that
panels find their places in windows of any width, and their colours follow the page's.

Colours, markers and dashes: told apart without colour too, on a light and on a dark page.
"""

import io
import re
import textwrap
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any, NamedTuple, final

from markupsafe import Markup

from apo_bench.io import default_looks, save_figure, write_file

INK = "#1d2430"
SOFT = "#5b6575"
RULE = "#d9dde4"
"""Of text and lines, of what matters less, and of the grid."""
SUCCESS = "#cfe3dc"
_SOLID: Any = "-"
_DASHED = (0, (4, 1.5))
_DOTTED = (0, (1, 1))


class Style(NamedTuple):
    """How the line of a method looks; told apart without colour too."""

    color: str
    marker: Any
    """As matplotlib takes it: a letter, or a star as (points, 1, turned by degrees)."""
    dashes: Any


STYLES = {
    "none": Style("#d55e00", "o", _SOLID),
    "search": Style("#e7298a", "8", _DASHED),
    "by-heart": Style("#999933", (3, 1, 0), _DASHED),
    "contact": Style("#332288", "p", _SOLID),
    "contact-robust": Style("#aa3377", (4, 1, 0), _DASHED),
    "paper": Style("#0072b2", "s", _SOLID),
    "paper-track": Style("#009e73", "D", _SOLID),
    "snap": Style("#a6761d", "*", _DOTTED),
    "least-squares": Style("#117733", "<", _DOTTED),
    "settle": Style("#882255", ">", _DOTTED),
    "penalty": Style("#88ccee", "d", _DOTTED),
}
OWN_STYLES = (Style("#6b6b6b", "h", _DOTTED), Style("#ddcc77", "H", _DOTTED), Style("#000000", "1", _DOTTED))
RECOGNITION_STYLES = {
    "recognised": Style("#009e73", "o", _SOLID),
    "recognised-jointly": Style("#cc79a7", "D", _SOLID),
}
SEEN = Style(SOFT, "o", _SOLID)
"""What was observed, before any method."""
STAGE_COLORS = {
    "observe": "#999999",
    "correct": "#aa4499",
    "plan": "#ddaa33",
    "pick": "#88ccee",
    "lift": "#44aa99",
    "carry": "#117733",
    "attach": "#d55e00",
    "release": "#999933",
    "depart": "#882255",
    "judge": "#0072b2",
    "worker": "#222222",
}
"""Stage at which a trial failed -> its colour."""
_DARK = {
    INK: "#e6e9ee",
    SOFT: "#a5aebb",
    RULE: "#333b47",
    SUCCESS: "#2f4a42",
    "#d55e00": "#ff9048",
    "#332288": "#a79bff",
    "#0072b2": "#55b7f3",
    "#009e73": "#35cfa0",
    "#a6761d": "#d3a452",
    "#8c6bb1": "#bda2dc",
    "#117733": "#57c47c",
    "#882255": "#e070a6",
    "#6b6b6b": "#ababab",
    "#000000": "#f2f2f2",
    "#222222": "#eeeeee",
    "#aa4499": "#d27cc3",
    "#999933": "#b9b95a",
    "#44aa99": "#5cc4b2",
    "#ffffff": "#14181e",
}
"""Colours that would drown on a dark page, and what stands for them there."""


def styles(methods: Sequence[str]) -> dict[str, Style]:
    """One each; a method of one's own takes the next that is left."""
    own = [method for method in methods if method not in STYLES]
    return {m: STYLES[m] if m in STYLES else OWN_STYLES[own.index(m) % len(OWN_STYLES)] for m in methods}


def themed(svg: str) -> str:
    """Colours of styles as custom properties, which a dark page sets to others."""
    return re.sub(r' style="[^"<>]*"', lambda style: re.sub("#[0-9a-f]{6}", _property, style[0]), svg)


def _property(color: re.Match[str]) -> str:
    return f"var(--c{color[0][1:]},{color[0]})" if color[0] in _DARK else color[0]


def dark_properties() -> str:
    """The custom properties of a dark page."""
    return "".join(f"--c{light[1:]}:{dark};" for light, dark in _DARK.items())


WIDTH = 360
_HEIGHT = 230
"""Of a panel."""
_ACROSS = 3
_LETTERS = 62
"""Panels side by side in a file; letters of a line of their titles."""
_HEAD = 40
_LINE = 20
_GAP = 18
_TITLE = 32
SAMPLE = (26, 14)
"""Heights of the title, of a line of the legend, of the space between panels and of their titles; size of a sample."""
DPI = 72
"""Of a sheet: one px each."""
_PNG_DPI = 120
_LOOKS: Any = {
    "svg.fonttype": "none",
    "font.family": ["sans-serif"],
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 10.0,
    "text.color": INK,
    "text.parse_math": False,
    "text.usetex": False,
    "path.simplify": False,
}
_PIECE = re.compile(r'^  <g id="((?:panel|sample)-\d+)">\n(.*?)^  </g>$', re.MULTILINE | re.DOTALL)
_CLIPS = re.compile(r"<clipPath .*?</clipPath>", re.DOTALL)
_SHAPE = re.compile(r"<(use|path) (?!id=)([^>]*?)/>")
Tips = Callable[[Any, Sequence[str]], None]
"""Says what is shown when a mark is pointed at: takes something drawn, and a sentence for each of its marks."""


class Panel(NamedTuple):
    """One drawing with its title."""

    title: str
    draw: Callable[[Any, Tips], None]
    """Draws into the axes of matplotlib."""
    height: int = _HEIGHT
    margins: tuple[int, int, int, int] = (52, 12, 10, 42)
    """Left, right, above and below the axes."""


class Entry(NamedTuple):
    """One of a legend."""

    name: str
    draw: Callable[[Any], None]
    """Draws a sample into axes of 26 by 14, from the upper left corner."""


class Figure(NamedTuple):
    """Panels that share a legend."""

    title: str
    panels: Sequence[Panel]
    legend: Sequence[Entry] = ()


class PagePiece(NamedTuple):
    """A panel, or the sample of a legend, as it stands in a page."""

    title: str
    svg: Markup


@final
@dataclass(frozen=True)
class DrawnFigure:
    """A figure that was drawn."""

    title: str
    panels: tuple[PagePiece, ...]
    legend: tuple[PagePiece, ...]
    shapes: Markup
    """What pieces refer to; it stands once in the page."""
    sheet: str
    """All of it as an SVG file."""
    canvas: Any
    """Matplotlib's figure."""

    def write(self, path: Path) -> Path:
        """Write the sheet, as SVG or PNG by the ending."""
        if path.suffix == ".png":
            with _looks(self.title):
                save_figure(self.canvas, path, dpi=_PNG_DPI)
        else:
            write_file(path, self.sheet)
        return path


def draw(figure: Figure) -> DrawnFigure:
    """Draw every panel and the legend."""
    across = min(_ACROSS, len(figure.panels))
    width = across * (WIDTH + _GAP) + _GAP
    samples, lines = _legend_places(figure.legend, width)
    top = _HEAD + _LINE * lines
    places = []
    for i in range(0, len(figure.panels), across):
        row = figure.panels[i : i + across]
        places += [(_GAP + k * (WIDTH + _GAP), top + _TITLE) for k in range(len(row))]
        top += _TITLE + max(panel.height for panel in row) + _GAP
    boxes: dict[str, tuple[float, ...]] = {}
    tips: list[Sequence[str]] = []

    def tip(artist: Any, sentences: Sequence[str]) -> None:
        artist.set_gid(f"tips-{len(tips)}")
        tips.append(sentences)

    with _looks(figure.title):
        from matplotlib import figure as mpl

        canvas = mpl.Figure(figsize=(width / DPI, top / DPI), dpi=DPI)
        sheet = _Sheet(canvas, width, top)
        sheet.text(_GAP, 26, figure.title, fontsize=15)
        for i, (entry, (x, y)) in enumerate(zip(figure.legend, samples, strict=True)):
            boxes[f"sample-{i}"] = (x, y, *SAMPLE)
            axes = sheet.axes(f"sample-{i}", x, y, *SAMPLE)
            axes.set_axis_off()
            axes.set(xlim=(0, SAMPLE[0]), ylim=(SAMPLE[1], 0))
            entry.draw(axes)
            sheet.text(x + SAMPLE[0] + 5, y + 11, entry.name)
        for i, (panel, (x, y)) in enumerate(zip(figure.panels, places, strict=True)):
            boxes[f"panel-{i}"] = (x, y, WIDTH, panel.height)
            for k, words in enumerate(textwrap.wrap(panel.title, _LETTERS)[:2]):
                sheet.text(x, y - _TITLE + 12 + 14 * k, words)
            left, right, above, below = panel.margins
            size = (WIDTH - left - right, panel.height - above - below)
            panel.draw(sheet.axes(f"panel-{i}", x + left, y + above, *size), tip)
        file = io.StringIO()
        canvas.savefig(file, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    svg = _with_tips(file.getvalue(), tips)
    pieces = {
        name: Markup(f'viewBox="{" ".join(f"{x:g}" for x in boxes[name])}">{themed(_small(body))}</svg>')
        for name, body in _PIECE.findall(svg)
    }
    return DrawnFigure(
        title=figure.title,
        panels=tuple(PagePiece(p.title, pieces[f"panel-{i}"]) for i, p in enumerate(figure.panels)),
        legend=tuple(PagePiece(e.name, pieces[f"sample-{i}"]) for i, e in enumerate(figure.legend)),
        shapes=Markup("".join(map(_small, _CLIPS.findall(svg)))),
        sheet=svg[svg.index("<svg ") :],
        canvas=canvas,
    )


class _Sheet(NamedTuple):
    """Places things by px from the upper left corner."""

    canvas: Any
    width: float
    height: float

    def text(self, x: float, y: float, words: str, **more: Any) -> None:
        """Below all axes in the file, so that pieces are read without it."""
        self.canvas.text(x / self.width, 1 - y / self.height, words, zorder=-1, **more)

    def axes(self, name: str, x: float, y: float, width: float, height: float) -> Any:
        axes = self.canvas.add_axes(
            (x / self.width, 1 - (y + height) / self.height, width / self.width, height / self.height), gid=name
        )
        axes.patch.set_visible(False)
        return axes


@contextmanager
def _looks(salt: str) -> Iterator[None]:
    """Matplotlib's own settings but for ours; a letter that a font lacks is nothing to warn of."""
    with default_looks(_LOOKS | {"svg.hashsalt": salt}), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def _legend_places(entries: Sequence[Entry], width: int) -> tuple[list[tuple[int, int]], int]:
    """Upper left corners of the samples, set in lines, and how many lines there are."""
    x = _GAP
    line = 0
    places = []
    for entry in entries:
        need = 48 + 7 * len(entry.name)
        if x + need > width and x > _GAP:
            x = _GAP
            line += 1
        places.append((x, _HEAD + _LINE * line - 4))
        x += need
    return places, line + bool(places)


def _with_tips(svg: str, tips: Sequence[Sequence[str]]) -> str:
    """With a `<title>` in every mark of which something is said."""
    head, *rest = re.split(r'<g id="tips-(\d+)">', svg)
    marks = zip(rest[::2], rest[1::2], strict=True)
    return "<g>".join([head, *(_tipped(segment, tips[int(number)]) for number, segment in marks)])


def _tipped(segment: str, tips: Sequence[str]) -> str:
    """One tip for each mark, in their order; marks that are left have none."""
    left = iter(tips)

    def tipped(mark: re.Match[str]) -> str:
        tip = next(left, None)
        return mark[0] if tip is None else f"<{mark[1]} {mark[2]}><title>{escape(tip, quote=False)}</title></{mark[1]}>"

    return _SHAPE.sub(tipped, segment)


def _small(svg: str) -> str:
    """Without names that nothing refers to, without fonts, and without lines."""
    plain = re.sub(r"(?<=<g) id=\"[^\"]*\"(?=>)| transform=\"rotate\(-0 [^)]*\)\"| font-family: [^;]*;", "", svg)
    return re.sub(r"\s*\n\s*", " ", plain)
