"""Colours, markers and dashes: told apart without colour too, on a light and on a dark page."""

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

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
    "last-only": Style("#e69f00", "v", _DASHED),
    "no-history": Style("#cc79a7", "^", _DASHED),
    "no-disappeared": Style("#56b4e9", "P", _DASHED),
    "minimal": Style("#8c6bb1", "X", _DOTTED),
    "snap": Style("#a6761d", "*", _DOTTED),
    "least-squares": Style("#117733", "<", _DOTTED),
    "settle": Style("#882255", ">", _DOTTED),
    "penalty": Style("#88ccee", "d", _DOTTED),
}
OWN_STYLES = (Style("#6b6b6b", "h", _DOTTED), Style("#ddcc77", "H", _DOTTED), Style("#000000", "1", _DOTTED))
RECOGNITION_STYLES = {
    "recognised": Style("#009e73", "o", _SOLID),
    "recognised-fixed": Style("#d55e00", "s", _DASHED),
    "recognised-twice": Style("#0072b2", "^", _DOTTED),
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
