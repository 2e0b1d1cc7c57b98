"""Draw bar figures: outcomes of trials, and predictions against outcomes."""

from collections.abc import Mapping, Sequence
from typing import Any

from apo_bench.benchmark.report.figures.sheet import Figure, FigurePanel, draw_figure
from apo_bench.benchmark.report.figures.style import COLORS, SOFT

_BAR = 0.2
"""Height of a bar with the space around it [inches]."""
_AROUND = 1.1  # title and axis of a panel [inches]
_LETTER = 0.075
"""Width of a letter of a bar's name [inches]."""
_LONGEST = 40  # letters of a bar's name; longer ones are cut
Shares = Mapping[str, Mapping[str, int]]
"""Name of a bar -> its sections -> their counts."""


def draw_bars(title: str, panels: Mapping[str, Shares]) -> Figure:
    """Draw one panel of stacked bars for each entry.

    Sections have the order of `COLORS`; others are grey and come last.
    """
    from matplotlib.patches import Patch

    met = {part for bars in panels.values() for parts in bars.values() for part in parts}
    ordered = [*(part for part in COLORS if part in met), *sorted(met - set(COLORS))]
    drawn = [_draw_panel(name, bars, ordered) for name, bars in panels.items()]
    return draw_figure(title, drawn, {part: Patch(color=COLORS.get(part, SOFT)) for part in ordered})


def _draw_panel(title: str, bars: Shares, ordered: Sequence[str]) -> FigurePanel:
    """Return a panel of stacked bars; each bar is normalised to 1, with its count at the right."""
    names = [name if len(name) <= _LONGEST else f"{name[: _LONGEST - 1]}…" for name in bars]
    totals = [sum(parts.values()) for parts in bars.values()]

    def draw_bars(axis: Any) -> None:
        left = [0.0] * len(bars)
        for part in ordered:
            shares = [parts.get(part, 0) / total for parts, total in zip(bars.values(), totals, strict=True)]
            axis.barh(range(len(bars)), shares, left=left, height=0.8, color=COLORS.get(part, SOFT))
            left = [a + b for a, b in zip(left, shares, strict=True)]
        for i, total in enumerate(totals):
            axis.text(1.01, i, f"n {total}", va="center", fontsize=8, color=SOFT)
        axis.set_yticks(range(len(bars)), names)
        axis.set_xticks((0.0, 0.5, 1.0), ("0 %", "50 %", "100 %"))
        axis.set(xlim=(0, 1.2), ylim=(len(bars) - 0.5, -0.5), xlabel="share of trials")
        axis.grid(False)

    return FigurePanel(title, draw_bars, _AROUND + _BAR * len(bars), 0.3 + _LETTER * max(map(len, names)))
