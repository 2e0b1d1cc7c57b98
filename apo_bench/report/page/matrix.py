"""The headline: for every setting a matrix of methods over levels, with a button for each cell."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from apo_bench.records.method import knows_truth
from apo_bench.statistics.rate_text import interval, percent
from apo_bench.statistics.rates import Cell, Place
from apo_bench.statistics.settings import Setting, cell_place, level_of, level_unit, level_words, levels_of

_MANY = 12
"""With more settings than this, those of a scenario are folded."""


class Button(NamedTuple):
    """A cell that opens its trials."""

    number: int
    anchor: bool
    """A cell that stands in several matrices is met in the first."""
    rate: str
    lines: Sequence[str]
    title: str
    tip: str
    share: float
    span: int
    """Levels that it holds for: the oracle meets none, so it stands for all."""


class Matrix(NamedTuple):
    """Of one setting."""

    title: str
    corner: str
    head: Sequence[str]
    """The levels."""
    lines: Sequence[tuple[str, Sequence[Button | None]]]
    """Method, and its cells; None where a level was not run."""


def matrices(
    grouped: Mapping[Setting, Sequence[Cell]], numbers: Mapping[Place, int]
) -> list[tuple[str | None, list[Matrix]]]:
    """One per setting; where there are many, by scenario.

    Args:
        grouped: From `members`.
        numbers: Cell's place -> its number among all cells.
    """
    met: set[int] = set()
    folded: dict[str | None, list[Matrix]] = {}
    for setting, cells in grouped.items():
        scenario = setting.scenario if len(grouped) > _MANY else None
        folded.setdefault(scenario, []).append(_matrix(setting, cells, numbers, met))
    return list(folded.items())


def _matrix(setting: Setting, cells: Sequence[Cell], numbers: Mapping[Place, int], met: set[int]) -> Matrix:
    levels = levels_of(cells)
    lines: list[tuple[str, list[Button | None]]] = []
    for method in dict.fromkeys(c.method for c in cells):
        own = {level_of(c): c for c in cells if c.method == method}
        if knows_truth(method):
            (best,) = own.values()
            lines.append((method, [_button(best, setting, numbers[cell_place(best)], met, max(1, len(levels)))]))
        else:
            found = [own.get(level) for level in levels]
            lines.append((method, [c and _button(c, setting, numbers[cell_place(c)], met) for c in found]))
    corner = f"method, {level_unit(setting.noise)}" if levels else "method"
    return Matrix(setting.title(), corner, [level_words(x, setting.noise) for x in levels] or ["any"], lines)


def _button(cell: Cell, setting: Setting, number: int, met: set[int], span: int = 1) -> Button:
    level = "" if knows_truth(cell.method) else f", level {level_words(level_of(cell), cell.noise)}"
    said = f"{setting.title()}: {cell.method}{level}: {percent(cell.rate)}, {cell.successes} of {cell.trials}"
    anchor = number not in met
    met.add(number)
    lines = [interval(cell), f"n {cell.trials}"]
    if cell.demonstrated != cell.successes:
        lines.append(f"as demonstrated: {percent(cell.demonstrated_rate)}")
    if cell.not_executed:
        done = cell.executed
        lines.append(f"executed: {percent(done.rate)}, n {done.trials}" if done.trials else "none executed")
    tip = f"{said}; 95 %: {interval(cell)}; excluded {cell.excluded}"
    return Button(number, anchor, percent(cell.rate), lines, said, tip, cell.rate or 0.0, span)
