"""Colours, markers, dashes and matplotlib settings of all figures."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

from apo_bench.io import use_figure_style

INK = "#1d2430"
"""Colour of text and lines."""
SOFT = "#5b6575"
"""Colour of details."""
RULE = "#d9dde4"
"""Colour of the grid."""
_SOLID: Any = "-"
_DASHED = (0, (4, 1.5))
_DOTTED = (0, (1, 1))


class Style(NamedTuple):
    """The style of the line of a method."""

    color: str
    marker: Any
    """As matplotlib takes it: a letter, or a star as (number of points, 1, rotation in degrees)."""
    dashes: Any


STYLES = {
    "oracle": Style(SOFT, "", _DASHED),
    "uncorrected": Style("#d55e00", "o", _SOLID),
    "spiral-search": Style("#e7298a", "8", _DASHED),
    "nominal": Style("#999933", (3, 1, 0), _DASHED),
    "contact": Style("#332288", "p", _SOLID),
    "contact-robust": Style("#aa3377", (4, 1, 0), _DASHED),
    "paper": Style("#0072b2", "s", _SOLID),
    "paper-track": Style("#009e73", "D", _SOLID),
    "snap": Style("#a6761d", "*", _DOTTED),
    "least-squares": Style("#117733", "<", _DOTTED),
    "physics-settle": Style("#882255", ">", _DOTTED),
    "penalty": Style("#88ccee", "d", _DOTTED),
}
OWN_STYLES = (Style("#6b6b6b", "h", _DOTTED), Style("#ddcc77", "H", _DOTTED), Style("#000000", "1", _DOTTED))
"""Styles of methods that do not come with the package, used in turn."""
COLORS = {
    "success": "#cfe3dc",
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
    "fit: fitted": "#cfe3dc",
    "fit: failed": "#d55e00",
    "fail: fitted": "#ddaa33",
    "fail: failed": "#0072b2",
}
"""Outcome of a trial, or pair of prediction and outcome -> colour of its section of a bar."""
_LOOKS: Any = {  # settings of matplotlib
    "svg.fonttype": "none",
    "font.family": ["sans-serif"],
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9.0,
    "text.color": INK,
    "axes.edgecolor": RULE,
    "axes.labelcolor": INK,
    "axes.titlesize": 9.0,
    "axes.titlelocation": "left",
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.grid": True,
    "axes.grid.axis": "y",
    "grid.color": RULE,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
}


def assign_styles(names: Sequence[str]) -> dict[str, Style]:
    """Return a style for each name; names without a style of their own take those of `OWN_STYLES` in turn."""
    own = [name for name in names if name not in STYLES]
    return {name: STYLES[name] if name in STYLES else OWN_STYLES[own.index(name) % len(OWN_STYLES)] for name in names}


@contextmanager
def list_report_styles(secret_seed: str) -> Iterator[None]:
    """Draw with the settings of reports; `secret_seed` determines the ids of an SVG, so figures are reproducible."""
    with use_figure_style(_LOOKS | {"svg.hashsalt": secret_seed}):
        yield
