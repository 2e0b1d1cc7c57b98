"""Figures in which one unit is a px: where trials ended (for every method and level a bar of shares, success first,
then the stages that failed), predicted against real failure (squares whose shade is a share), wall times of trials."""

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any

from apo_bench.io import grouped
from apo_bench.records import STAGES, knows_truth
from apo_bench.report.figures.sheet import INK, SOFT, STAGE_COLORS, SUCCESS, WIDTH, Entry, Figure, Panel, Tips
from apo_bench.statistics import ALL, Cell, Confusion, Setting, TrialTimes, level_of, level_words, percent

_LEFT = 138
_RIGHT = 46
_HIGH = 11
_STEP = 14
_APART = 5
"""Where bars begin and end, their height, from one to the next, and between methods, px."""
_LETTER = 6.6
_LETTER_OF_LEVEL = 5.8
_LONGEST = 48
"""How wide letters of names and of levels are, px; letters of a name that is shown whole."""
_SIDE = 74
_SQUARES_TOP = 34
_SQUARES_LEFT = 108
"""Of a square of predictions; where the first begins, px."""
_SQUARES_HEIGHT = _SQUARES_TOP + 2 * _SIDE + 6
_TIMES_LEFT = 118
_TIMES_RIGHT = 16
_TIMES_STEP = 20
"""Where the axis of times begins and ends, and from one line to the next, px."""
_MARGINS = (0, 0, 0, 0)
_SAMPLE = (4.0, 1.0, 18.0, 12.0)
"""The box of a legend."""
_SMALL = {"fontsize": 9, "color": SOFT}
_Box = tuple[float, float, float, float]
_RIGHT_COLOR = "#0072b2"
_WRONG_COLOR = "#d55e00"
_Counts = tuple[tuple[int, int], tuple[int, int]]
"""Predicted to fit, predicted to fail: each fitted, failed."""


def outcome_figure(grouped: Mapping[Setting, Sequence[Cell]]) -> Figure:
    """A panel per setting that has a trial that counts."""
    counted = {setting: [c for c in cells if c.trials] for setting, cells in grouped.items()}
    stages = _in_order({stage for cells in counted.values() for cell in cells for stage in _stages_of(cell)})
    return Figure(
        "Where trials failed",
        [_outcome_panel(s, cells) for s, cells in counted.items() if cells],
        [Entry(name, partial(_boxes, places=[_SAMPLE], colors=[_color_of(name)])) for name in ("success", *stages)],
    )


def prediction_figure(confusions: Sequence[Confusion]) -> Figure:
    """A panel per method of which something was predicted, over all scenarios, and one of all methods."""
    groups = grouped(("all methods" if c.method == ALL else c.method, c) for c in confusions)
    summed = {method: _sum(own) for method, own in groups.items()}
    return Figure(
        "Predicted against real failure",
        [_prediction_panel(method, counts) for method, counts in summed.items() if sum(map(sum, counts))],
    )


def time_figure(times: Sequence[TrialTimes]) -> Figure:
    """A panel per scenario, with one axis for all."""
    most = _round_up(max((t.high for t in times), default=0.0))
    by_scenario = grouped((t.scenario, t) for t in times)
    return Figure("Wall time of a trial", [_time_panel(scenario, own, most) for scenario, own in by_scenario.items()])


def _stages_of(cell: Cell) -> dict[str, int]:
    """Stage -> failures."""
    counts = grouped((why.partition(":")[0], count) for why, count in cell.failures.items())
    return {stage: sum(own) for stage, own in counts.items()}


def _color_of(ending: str) -> str:
    """Of `success` or a stage."""
    return SUCCESS if ending == "success" else STAGE_COLORS.get(ending, STAGE_COLORS["observe"])


def _canvas(axis: Any, height: float) -> None:
    """Axes in which one unit is a px, from the upper left corner."""
    axis.set_axis_off()
    axis.set(xlim=(0, WIDTH), ylim=(height, 0))


def _boxes(axis: Any, places: Sequence[_Box], colors: Sequence[Any]) -> Any:
    """Filled boxes (x, y, width, height)."""
    from matplotlib.collections import PolyCollection

    corners = [[(x, y), (x + w, y), (x + w, y + h), (x, y + h)] for x, y, w, h in places]
    return axis.add_collection(PolyCollection(corners, facecolors=colors, linewidths=0, clip_on=False), autolim=False)


def _outcome_panel(setting: Setting, cells: Sequence[Cell]) -> Panel:
    """A method's name stands at the first of its bars, and above them where it is too long to stand beside."""
    names: list[tuple[float, str]] = []
    bars: list[tuple[float, Cell]] = []
    y = 6.0
    for method in dict.fromkeys(cell.method for cell in cells):
        own = [cell for cell in cells if cell.method == method]
        beside = _LETTER * len(method) + _LETTER_OF_LEVEL * len(_level(own[0], setting)) <= _LEFT - 12
        names.append((y + _APART, method if len(method) <= _LONGEST else f"{method[: _LONGEST - 1]}…"))
        y += _APART if beside else _APART + _STEP
        bars += [(y + _STEP * i, cell) for i, cell in enumerate(own)]
        y += _STEP * len(own)
    height = int(y + 32)

    def draw(axis: Any, tip: Tips) -> None:
        _canvas(axis, height)
        for top, name in names:
            axis.text(0, top + _HIGH - 2, name)
        for top, cell in bars:
            axis.text(_LEFT - 6, top + _HIGH - 2, _level(cell, setting), ha="right", **_SMALL)
            axis.text(WIDTH - _RIGHT + 5, top + _HIGH - 2, f"n {cell.trials}", **_SMALL)
        boxes, colors, words = zip(*[piece for top, cell in bars for piece in _bar(cell, setting, top)], strict=True)
        tip(_boxes(axis, boxes, colors), words)
        for share in (0.0, 0.5, 1.0):
            axis.text(_x(share), y + 12, f"{100 * share:.0f} %", ha="center", **_SMALL)
        axis.text(_x(0.5), y + 26, "share of trials", ha="center", **_SMALL)

    return Panel(setting.title(), draw, height, _MARGINS)


def _bar(cell: Cell, setting: Setting, y: float) -> Iterable[tuple[_Box, str, str]]:
    """Boxes with their colours and what is said of them."""
    failures = _stages_of(cell)
    done = 0
    level = _level(cell, setting)
    at = f"{cell.method}{f', level {level}' if level else ''}"
    for ending, count in (("success", cell.successes), *((stage, failures[stage]) for stage in _in_order(failures))):
        left = _x(done / cell.trials)
        done += count
        if count:
            words = f"{at}: {ending} {count} of {cell.trials} ({percent(count / cell.trials)})"
            yield (left, y, _x(done / cell.trials) - left, _HIGH), _color_of(ending), words


def _in_order(stages: Iterable[str]) -> list[str]:
    """Stages in the order in which a trial goes through them; any other at the end."""
    return sorted(set(stages), key=lambda stage: (STAGES.index(stage) if stage in STAGES else len(STAGES), stage))


def _level(cell: Cell, setting: Setting) -> str:
    return "" if knows_truth(cell.method) else level_words(level_of(cell), setting.noise)


def _x(share: float) -> float:
    return _LEFT + (WIDTH - _LEFT - _RIGHT) * share


def _sum(own: Sequence[Confusion]) -> _Counts:
    return (
        (sum(c.fit_fitted for c in own), sum(c.fit_failed for c in own)),
        (sum(c.fail_fitted for c in own), sum(c.fail_failed for c in own)),
    )


def _prediction_panel(method: str, counts: _Counts) -> Panel:
    n = sum(map(sum, counts))

    def draw(axis: Any, tip: Tips) -> None:
        _canvas(axis, _SQUARES_HEIGHT)
        ends = ("fitted", "failed")
        for i, words in enumerate(("predicted to fit", "predicted to fail")):
            y = _SQUARES_TOP + _SIDE * i
            axis.text(_SQUARES_LEFT - 8, y + _SIDE * 0.5 + 4, words, ha="right")
            for j, (word, count) in enumerate(zip(ends, counts[i], strict=True)):
                x = _SQUARES_LEFT + _SIDE * j
                square = _boxes(axis, [(x, y, _SIDE - 2, _SIDE - 2)], [_RIGHT_COLOR if i == j else _WRONG_COLOR])
                square.set_alpha(0.08 + 0.55 * count / n)
                tip(square, [f"{words}, {word}: {count} of {n}"])
                axis.text(x + _SIDE / 2 - 1, y + _SIDE / 2, f"{count:,}", ha="center")
                axis.text(x + _SIDE / 2 - 1, y + _SIDE / 2 + 14, f"{100 * count / n:.1f} %", ha="center", **_SMALL)
        for j, word in enumerate(ends):
            axis.text(_SQUARES_LEFT + _SIDE * (j + 0.5), _SQUARES_TOP - 8, word, ha="center")
        agreed = f"{100 * (counts[0][0] + counts[1][1]) / n:.1f} % right"
        axis.text(_SQUARES_LEFT + 2 * _SIDE + 8, _SQUARES_TOP + _SIDE, agreed, **_SMALL)

    return Panel(f"{method}; n {n:,}", draw, _SQUARES_HEIGHT, _MARGINS)


def _time_panel(scenario: str, own: Sequence[TrialTimes], most: float) -> Panel:
    bottom = 14 + _TIMES_STEP * len(own)
    height = bottom + 28

    def x(seconds: float) -> float:
        return _TIMES_LEFT + (WIDTH - _TIMES_LEFT - _TIMES_RIGHT) * seconds / most

    def draw(axis: Any, tip: Tips) -> None:
        _canvas(axis, height)
        at = [14 + _TIMES_STEP * i for i in range(len(own))]
        for y, t in zip(at, own, strict=True):
            axis.text(0, y + 4, t.method[:18])
        axis.hlines(at, [x(t.low) for t in own], [x(t.high) for t in own], color=SOFT, linewidth=1.4)
        (dots,) = axis.plot([x(t.median) for t in own], at, "o", color=INK, markersize=8)
        words = "{0.method}: median {0.median:.2f} s, 90 % between {0.low:.2f} and {0.high:.2f} s, n {0.trials}"
        tip(dots, [words.format(t) for t in own])
        for share in (0.0, 0.5, 1.0):
            axis.text(x(most * share), bottom + 8, f"{most * share:g}", ha="center", **_SMALL)
        axis.text(x(most / 2), bottom + 22, "wall time of a trial [s]", ha="center", **_SMALL)

    ends = dict.fromkeys((min(t.trials for t in own), max(t.trials for t in own)))
    return Panel(f"{scenario}; n {' to '.join(map(str, ends))}", draw, height, _MARGINS)


def _round_up(x: float) -> float:
    """The next larger of 0.1, 0.2, 0.4, 1, 2, 4, 10, .."""
    size = next(10.0**k for k in range(-1, 12) if 10.0**k * 10 > x)
    return next(size * step for step in (1, 2, 4, 10) if size * step >= x)
