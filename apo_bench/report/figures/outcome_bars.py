"""Where trials ended: for every method and level a bar of shares, success first, then the stages that failed."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from apo_bench.records.method import knows_truth
from apo_bench.records.outcomes import STAGES
from apo_bench.report.figures.sheet import SAMPLE, WIDTH, Entry, Figure, Panel, Tips
from apo_bench.report.figures.styles import SOFT, STAGE_COLORS, SUCCESS
from apo_bench.statistics.rate_text import percent
from apo_bench.statistics.rates import Cell
from apo_bench.statistics.settings import Setting, level_of, level_words

_LEFT = 138
_RIGHT = 46
_HIGH = 11
_STEP = 14
_APART = 5
"""Where bars begin and end, their height, from one to the next, and between methods, px."""
_LETTER = 6.6
_SMALL = 5.8
_MOST = 48
"""How wide letters of names and of levels are, px; letters of a name that is shown whole."""
_Box = tuple[float, float, float, float]


def outcome_figure(grouped: Mapping[Setting, Sequence[Cell]]) -> Figure:
    """A panel per setting that has a trial that counts."""
    counted = {setting: [c for c in cells if c.trials] for setting, cells in grouped.items()}
    found = _in_order({stage for cells in counted.values() for cell in cells for stage in stages_of(cell)})
    legend = [Entry(name, _patch(color_of(name))) for name in ("success", *found)]
    return Figure("Where trials failed", [_panel(s, cells) for s, cells in counted.items() if cells], legend)


def stages_of(cell: Cell) -> Counter[str]:
    """Stage -> failures."""
    found: Counter[str] = Counter()
    for why, count in cell.failures.items():
        found[why.partition(":")[0]] += count
    return found


def color_of(ending: str) -> str:
    """Of `success` or a stage."""
    return SUCCESS if ending == "success" else STAGE_COLORS.get(ending, STAGE_COLORS["observe"])


def canvas(axis: Any, height: float) -> None:
    """Axes in which one unit is a px, from the upper left corner."""
    axis.set_axis_off()
    axis.set(xlim=(0, WIDTH), ylim=(height, 0))


def boxes(axis: Any, found: Sequence[_Box], colors: Sequence[Any]) -> Any:
    """Filled boxes (x, y, width, height)."""
    from matplotlib.collections import PolyCollection

    corners = [[(x, y), (x + w, y), (x + w, y + h), (x, y + h)] for x, y, w, h in found]
    return axis.add_collection(PolyCollection(corners, facecolors=colors, linewidths=0, clip_on=False), autolim=False)


def _patch(color: str) -> Callable[[Any], None]:
    def draw(axis: Any) -> None:
        axis.set_axis_off()
        axis.set(xlim=(0, SAMPLE[0]), ylim=(SAMPLE[1], 0))
        boxes(axis, [(4, 1, 18, 12)], [color])

    return draw


def _panel(setting: Setting, cells: Sequence[Cell]) -> Panel:
    """A method's name stands at the first of its bars, and above them where it is too long to stand beside."""
    names: list[tuple[float, str]] = []
    bars: list[tuple[float, Cell]] = []
    y = 6.0
    for method in dict.fromkeys(cell.method for cell in cells):
        own = [cell for cell in cells if cell.method == method]
        beside = _LETTER * len(method) + _SMALL * len(_level(own[0], setting)) <= _LEFT - 12
        names.append((y + _APART, method if len(method) <= _MOST else f"{method[: _MOST - 1]}…"))
        y += _APART if beside else _APART + _STEP
        bars += [(y + _STEP * i, cell) for i, cell in enumerate(own)]
        y += _STEP * len(own)
    height = int(y + 32)

    def draw(axis: Any, tip: Tips) -> None:
        canvas(axis, height)
        small = {"fontsize": 9, "color": SOFT}
        for top, name in names:
            axis.text(0, top + _HIGH - 2, name)
        for top, cell in bars:
            axis.text(_LEFT - 6, top + _HIGH - 2, _level(cell, setting), ha="right", **small)
            axis.text(WIDTH - _RIGHT + 5, top + _HIGH - 2, f"n {cell.trials}", **small)
        pieces = [piece for top, cell in bars for piece in _bar(cell, setting, top)]
        drawn = boxes(axis, [box for box, _, _ in pieces], [color for _, color, _ in pieces])
        tip(drawn, [said for _, _, said in pieces])
        for share in (0.0, 0.5, 1.0):
            axis.text(_x(share), y + 12, f"{100 * share:.0f} %", ha="center", **small)
        axis.text(_x(0.5), y + 26, "share of trials", ha="center", **small)

    return Panel(setting.title(), draw, height, (0, 0, 0, 0))


def _bar(cell: Cell, setting: Setting, y: float) -> Iterable[tuple[_Box, str, str]]:
    """Boxes with their colours and what is said of them."""
    found = stages_of(cell)
    done = 0
    level = _level(cell, setting)
    at = f"{cell.method}{f', level {level}' if level else ''}"
    for ending, count in (("success", cell.successes), *((stage, found[stage]) for stage in _in_order(found))):
        if count:
            left = _x(done / cell.trials)
            right = _x((done + count) / cell.trials)
            said = f"{at}: {ending} {count} of {cell.trials} ({percent(count / cell.trials)})"
            yield (left, y, right - left, _HIGH), color_of(ending), said
            done += count


def _in_order(found: Iterable[str]) -> list[str]:
    """Stages in the order in which a trial goes through them; any other at the end."""
    return sorted(set(found), key=lambda stage: (STAGES.index(stage) if stage in STAGES else len(STAGES), stage))


def _level(cell: Cell, setting: Setting) -> str:
    return "" if knows_truth(cell.method) else level_words(level_of(cell), setting.noise)


def _x(share: float) -> float:
    return _LEFT + (WIDTH - _LEFT - _RIGHT) * share
