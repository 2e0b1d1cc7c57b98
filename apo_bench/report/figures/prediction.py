"""Predicted against real failure, as squares whose shade is a share: one panel for each method."""

from collections.abc import Sequence
from typing import Any

from apo_bench.report.figures.outcome_bars import boxes, canvas
from apo_bench.report.figures.sheet import Figure, Panel, Tips
from apo_bench.report.figures.styles import SOFT
from apo_bench.statistics.confusion import ALL, Confusion

_SIDE = 74
_TOP = 34
_LEFT = 108
"""Of a square; where the first begins, px."""
_HEIGHT = _TOP + 2 * _SIDE + 6
_RIGHT_COLOR = "#0072b2"
_WRONG_COLOR = "#d55e00"
_Counts = tuple[tuple[int, int], tuple[int, int]]
"""Predicted to fit, predicted to fail: each fitted, failed."""


def prediction_figure(found: Sequence[Confusion]) -> Figure:
    """A panel per method of which something was predicted, over all scenarios, and one of all methods."""
    groups: dict[str, list[Confusion]] = {}
    for one in found:
        groups.setdefault("all methods" if one.method == ALL else one.method, []).append(one)
    summed = {method: _sum(own) for method, own in groups.items()}
    panels = [_panel(method, counts) for method, counts in summed.items() if sum(map(sum, counts))]
    return Figure("Predicted against real failure", panels)


def _sum(own: Sequence[Confusion]) -> _Counts:
    fits = sum(c.fit_fitted for c in own), sum(c.fit_failed for c in own)
    fails = sum(c.fail_fitted for c in own), sum(c.fail_failed for c in own)
    return fits, fails


def _panel(method: str, counts: _Counts) -> Panel:
    n = sum(map(sum, counts))

    def draw(axis: Any, tip: Tips) -> None:
        canvas(axis, _HEIGHT)
        small = {"fontsize": 9, "color": SOFT}
        for i, words in enumerate(("predicted to fit", "predicted to fail")):
            axis.text(_LEFT - 8, _TOP + _SIDE * (i + 0.5) + 4, words, ha="right")
            for j, word in enumerate(("fitted", "failed")):
                x = _LEFT + _SIDE * j
                y = _TOP + _SIDE * i
                count = counts[i][j]
                color = _RIGHT_COLOR if i == j else _WRONG_COLOR
                square = boxes(axis, [(x, y, _SIDE - 2, _SIDE - 2)], [color])
                square.set_alpha(0.08 + 0.55 * count / n)
                tip(square, [f"{words}, {word}: {count} of {n}"])
                axis.text(x + _SIDE / 2 - 1, y + _SIDE / 2, f"{count:,}", ha="center")
                axis.text(x + _SIDE / 2 - 1, y + _SIDE / 2 + 14, f"{100 * count / n:.1f} %", ha="center", **small)
        for j, word in enumerate(("fitted", "failed")):
            axis.text(_LEFT + _SIDE * (j + 0.5), _TOP - 8, word, ha="center")
        agreed = (counts[0][0] + counts[1][1]) / n
        axis.text(_LEFT + 2 * _SIDE + 8, _TOP + _SIDE, f"{100 * agreed:.1f} % right", **small)

    return Panel(f"{method}; n {n:,}", draw, _HEIGHT, (0, 0, 0, 0))
