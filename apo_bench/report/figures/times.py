"""Wall times of trials: a line from the 5th to the 95th percentile with a dot at the median, by scenario and method."""

from collections.abc import Sequence
from typing import Any

from apo_bench.report.figures.outcome_bars import canvas
from apo_bench.report.figures.sheet import WIDTH, Figure, Panel, Tips
from apo_bench.report.figures.styles import INK, SOFT
from apo_bench.statistics.times import Times

_LEFT = 118
_RIGHT = 16
_STEP = 20
"""Where the axis begins and ends, and from one line to the next, px."""


def time_figure(found: Sequence[Times]) -> Figure:
    """A panel per scenario, with one axis for all."""
    most = _round(max((t.high for t in found), default=0.0))
    by_scenario: dict[str, list[Times]] = {}
    for t in found:
        by_scenario.setdefault(t.scenario, []).append(t)
    return Figure("Wall time of a trial", [_panel(scenario, own, most) for scenario, own in by_scenario.items()])


def _panel(scenario: str, own: Sequence[Times], most: float) -> Panel:
    bottom = 14 + _STEP * len(own)
    height = bottom + 28

    def x(seconds: float) -> float:
        return _LEFT + (WIDTH - _LEFT - _RIGHT) * seconds / most

    def draw(axis: Any, tip: Tips) -> None:
        canvas(axis, height)
        at = [14 + _STEP * i for i in range(len(own))]
        for y, t in zip(at, own, strict=True):
            axis.text(0, y + 4, t.method[:18])
        axis.hlines(at, [x(t.low) for t in own], [x(t.high) for t in own], color=SOFT, linewidth=1.4)
        (dots,) = axis.plot([x(t.median) for t in own], at, "o", color=INK, markersize=8)
        said = "{0.method}: median {0.median:.2f} s, 90 % between {0.low:.2f} and {0.high:.2f} s, n {0.trials}"
        tip(dots, [said.format(t) for t in own])
        for share in (0.0, 0.5, 1.0):
            axis.text(x(most * share), bottom + 8, f"{most * share:g}", ha="center", color=SOFT, fontsize=9)
        axis.text(x(most / 2), bottom + 22, "wall time of a trial [s]", ha="center", color=SOFT, fontsize=9)

    low = min(t.trials for t in own)
    high = max(t.trials for t in own)
    return Panel(f"{scenario}; n {low if low == high else f'{low} to {high}'}", draw, height, (0, 0, 0, 0))


def _round(x: float) -> float:
    """The next larger of 0.1, 0.2, 0.4, 1, 2, 4, 10, .."""
    size = next(10.0**k for k in range(-1, 12) if 10.0**k * 10 > x)
    return next(size * step for step in (1, 2, 4, 10) if size * step >= x)
